//! The check that the cameras see a prior, and the likely error in its axes, unit or position if they do not.

use std::fmt;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{CameraBounds, SparseVoxelTree, VoxelBoxes};
use strivec_format::OptionName;
use strivec_format::geometry::{Aabb, Camera, Ray};
use strivec_format::model::UpAxis;

/// Rays along each side of a picture, and largest number of cameras, for the share that is reported.
const RAYS: (u32, usize) = (32, 100);
/// Rays along each side of a picture, and largest number of cameras, for each tried change.
const TRIED_RAYS: (u32, usize) = (16, 32);
/// A smaller share is low. Scenes rarely fill less of their photographs, and almost no ray meets a misplaced prior.
const LOW: f64 = 0.05;
/// Smallest factor of the share for a change to be reported.
const GAIN: f64 = 3.0;
/// Scales that convert a prior of another unit, with a description of that unit.
const UNITS: [(f64, &str); 5] = [
    (0.001, "a thousandth of the dataset's, as millimeters are of meters"),
    (0.01, "a hundredth of the dataset's, as centimeters are of meters"),
    (0.3048, "0.3048 of the dataset's, as feet are of meters"),
    (100.0, "a hundred times the dataset's"),
    (1000.0, "a thousand times the dataset's"),
];
/// All directions that can point up.
const UPS: [UpAxis; 6] = [UpAxis::Z, UpAxis::Y, UpAxis::X, UpAxis::MinusY, UpAxis::MinusX, UpAxis::MinusZ];

/// The share of a prior that the cameras see.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorVisibility {
    /// Share of rays that meet an occupied cell in front of their camera, in \[0, 1\]. A camera inside a cell sees
    /// nothing.
    pub share: f64,
    /// If the share is less than 0.05: the change that raises it, if any does.
    pub advice: Option<AlignmentHint>,
}

/// A change of a prior after which the cameras see it. It is displayed as the likely error and its remedy, with option
/// fields in backticks.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignmentHint {
    /// The prior's axis that should point up.
    pub up: UpAxis,
    /// Quarter turns about z after that, counterclockwise as seen from above.
    pub quarter_turns: u32,
    /// Two axes that are exchanged, which mirrors the prior; then there is no rotation.
    pub exchanged: Option<[usize; 2]>,
    /// Factor of the coordinates after that.
    pub scale: f64,
    /// Translation after that, in dataset units.
    pub shift: DVec3,
    /// Share of rays that would meet the changed prior.
    pub share: f64,
}

/// Casts 32×32 rays from each of at most 100 cameras at `boxes`, which are in the dataset's space.
///
/// If few rays meet them, this tries the 24 rotations by quarter turns, exchanges of two axes, usual units,
/// combinations of these, and a shift of the prior's center to the point that the cameras look at. It returns the
/// change that raises the share most, if the share becomes at least 0.05 and three times as large. Weights prefer
/// simpler changes if the shares are similar. Units are tried only if they bring the prior's size closer to the extent
/// of the cameras: a small prior scaled by a thousand would always be seen.
pub fn check_alignment(boxes: &VoxelBoxes, cameras: &[Camera]) -> PriorVisibility {
    let tree = SparseVoxelTree::new(boxes);
    let share = AlignmentHint::NOTHING.share(&tree, &rays(cameras, RAYS));
    let advice = if share < LOW { advice(&tree, &boxes.bounds(), cameras) } else { None };
    PriorVisibility { share, advice }
}

/// A grid of rays through the pictures of evenly selected cameras.
fn rays(cameras: &[Camera], (side, most): (u32, usize)) -> Vec<Ray> {
    let count = cameras.len().min(most);
    let chosen = (0..count).map(|i| &cameras[i * cameras.len() / count]);
    let at = |i: u32, extent: u32| (f64::from(i) + 0.5) / f64::from(side) * f64::from(extent);
    let of = |camera: &Camera| {
        let camera = *camera;
        (0..side * side)
            .filter_map(move |i| camera.ray_through(at(i % side, camera.width), at(i / side, camera.height)))
            .collect::<Vec<_>>()
    };
    chosen.flat_map(of).collect()
}

/// The best change, if it is good enough.
fn advice(tree: &SparseVoxelTree, bounds: &Aabb, cameras: &[Camera]) -> Option<AlignmentHint> {
    if cameras.is_empty() || !bounds.is_solid() {
        return None;
    }
    let rays = rays(cameras, TRIED_RAYS);
    let before = AlignmentHint::NOTHING.share(tree, &rays);
    let focus = CameraBounds::from_cameras(cameras.iter()).focus;
    let distance = cameras.iter().map(|c| c.position.distance(focus)).sum::<f64>() / cameras.len() as f64;
    let apart = Aabb::from_points(cameras.iter().map(|c| c.position)).size().length();
    // The prior's size as a multiple of the cameras' surroundings, ideally about 1.
    let ratio = bounds.size().length() / distance.max(apart);
    let better = |scale: f64| (ratio * scale).ln().abs() + 2_f64.ln() < ratio.ln().abs();
    let fits = |scale: f64| (0.05..20.0).contains(&(ratio * scale));
    let scales = UNITS.iter().map(|unit| unit.0).filter(|&scale| better(scale));
    // Some part of a prior that is far too large is visible under any rotation, so such scales are left out.
    let scales = [1.0].into_iter().chain(scales).filter(|&scale| fits(scale));

    // Each change with the weight of its share in the comparison.
    let mut turns: Vec<(f64, AlignmentHint)> = Vec::new();
    for (up, quarter_turns) in UPS.iter().flat_map(|&up| (0..4).map(move |turns| (up, turns))) {
        turns.push((
            if quarter_turns == 0 { 1.0 } else { 0.9 },
            AlignmentHint { up, quarter_turns, ..AlignmentHint::NOTHING },
        ));
    }
    for exchanged in [[1, 2], [0, 1], [0, 2]] {
        turns.push((0.85, AlignmentHint { exchanged: Some(exchanged), ..AlignmentHint::NOTHING }));
    }
    let mut tried: Vec<(f64, AlignmentHint)> = Vec::new();
    for scale in scales {
        for (weight, turn) in &turns {
            let both = if scale != 1.0 && *turn != AlignmentHint::NOTHING { 0.8 } else { 1.0 };
            tried.push((weight * both, AlignmentHint { scale, ..turn.clone() }));
        }
        let weight = if scale == 1.0 { 0.7 } else { 0.6 };
        tried.push((weight, AlignmentHint { scale, shift: focus - scale * bounds.center(), ..AlignmentHint::NOTHING }));
    }
    let mut best: Option<(f64, AlignmentHint)> = None;
    for (weight, mut change) in tried {
        change.share = change.share(tree, &rays);
        let worth = weight * change.share;
        let good = change.share >= LOW.max(GAIN * before);
        // Among equal changes the first one wins, which is the simplest.
        if good && best.as_ref().is_none_or(|(most, _)| worth > *most) {
            best = Some((worth, change));
        }
    }
    best.map(|(_, change)| change)
}

impl AlignmentHint {
    /// The identity.
    const NOTHING: Self =
        Self { up: UpAxis::Z, quarter_turns: 0, exchanged: None, scale: 1.0, shift: DVec3::ZERO, share: 0.0 };

    /// Rotation or exchange of the prior's axes: `up` to z by the shortest way (x to −x for −z), then turns about z.
    fn turn(&self) -> DMat3 {
        if let Some([a, b]) = self.exchanged {
            let mut axes = DVec3::AXES;
            axes.swap(a, b);
            return DMat3::from_cols(axes[0], axes[1], axes[2]);
        }
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let quarter = DMat3::from_cols(y, -x, z);
        (0..self.quarter_turns).fold(self.up.z_up_from(), |turned, _| quarter * turned)
    }

    /// The changed position of a point of the prior.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.scale * (self.turn() * point) + self.shift
    }

    /// Share of `rays` that meet the changed prior. The rays are mapped to the space of the unchanged one.
    fn share(&self, tree: &SparseVoxelTree, rays: &[Ray]) -> f64 {
        let back = self.turn().transpose();
        let meets = |ray: &Ray| {
            let origin = back * ((ray.origin - self.shift) / self.scale);
            tree.cast_ray(&Ray { origin, direction: back * ray.direction }).is_some_and(|hit| hit.t > 0.0)
        };
        rays.par_iter().filter(|ray| meets(ray)).count() as f64 / rays.len().max(1) as f64
    }
}

impl fmt::Display for AlignmentHint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut causes: Vec<String> = Vec::new();
        let mut cures: Vec<String> = Vec::new();
        if self.up != UpAxis::Z {
            let up = self.up.name();
            causes.push(format!("the prior's {up} axis seems to be up where the dataset's is z"));
            cures.push(format!("{} {up}", OptionName("up")));
        }
        if self.quarter_turns > 0 {
            causes.push(format!("it seems to need a turn of {} degrees about z", 90 * self.quarter_turns));
        }
        if let Some(exchanged) = self.exchanged {
            let [a, b] = exchanged.map(|axis| ["x", "y", "z"][axis]);
            causes.push(format!("its {a} and {b} axes seem to be exchanged, which mirrors it"));
        }
        if let Some((scale, unit)) = UNITS.iter().find(|(scale, _)| *scale == self.scale) {
            causes.push(format!("its unit seems to be {unit}"));
            cures.push(format!("{} {scale}", OptionName("scale")));
        }
        if self.shift != DVec3::ZERO {
            let DVec3 { x, y, z } = self.shift;
            causes.push(format!(
                "it lies beside the point that the cameras look at, which is ({x:.3}, {y:.3}, {z:.3}) away"
            ));
        }
        write!(f, "{}", causes.join(", and "))?;
        if !cures.is_empty() {
            write!(f, ": try {}", cures.join(" "))?;
        }
        write!(f, " ({:.0} % of the cameras' rays would meet it)", 100.0 * self.share)
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use strivec_format::geometry::Lattice;

    /// A scene like an L, off the middle in every direction: a flat slab and a tower, cells of 0.05.
    fn scene() -> VoxelBoxes {
        let slab = (0..60).flat_map(|y| (0..60).map(move |x| UVec3::new(x, y, 0)));
        let tower = (0..30).flat_map(|z| (50..60).map(move |x| UVec3::new(x, 50, z)));
        let mut cells: Vec<UVec3> = slab.chain(tower).collect();
        cells.sort_by_key(|c| [c.z, c.y, c.x]);
        cells.dedup();
        VoxelBoxes { lattice: Lattice { origin: DVec3::new(4.0, 2.0, 12.0), pitch: DVec3::splat(0.05) }, cells }
    }

    fn cameras() -> Vec<Camera> {
        let target = DVec3::new(5.5, 3.5, 12.5);
        (0..24)
            .map(|i| {
                let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
                let offset = DVec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 2.0 + 0.1 * f64::from(i % 5));
                Camera::looking_at([60, 40], 100.0, target + offset, target, DVec3::Z)
            })
            .collect()
    }

    /// The boxes, each corner of them changed by `change`, which turns by quarter turns.
    fn changed(boxes: &VoxelBoxes, change: impl Fn(DVec3) -> DVec3) -> VoxelBoxes {
        let centers: Vec<DVec3> = boxes.boxes().map(|b| change(b.center())).collect();
        let unit = (change(DVec3::X) - change(DVec3::ZERO)).length();
        let pitch = DVec3::splat(0.05 * unit);
        let origin = centers.iter().copied().reduce(DVec3::min).unwrap() - 0.5 * pitch;
        let mut cells: Vec<_> = centers.iter().map(|&c| ((c - origin) / pitch).floor().as_uvec3()).collect();
        cells.sort_by_key(|c| [c.z, c.y, c.x]);
        VoxelBoxes { lattice: Lattice { origin, pitch }, cells }
    }

    #[test]
    fn a_prior_that_is_right_is_seen_and_needs_no_advice() {
        let PriorVisibility { share, advice } = check_alignment(&scene(), &cameras());
        assert!(share > 0.3 && advice.is_none(), "{share} {advice:?}");
        // By hand: one ray straight down on the slab, one past it.
        let above =
            |x: f64| Camera::looking_at([2, 2], 1e6, DVec3::new(x, 3.0, 15.0), DVec3::new(x, 3.0, 0.0), DVec3::X);
        assert_eq!(check_alignment(&scene(), &[above(4.5), above(4.7), above(9.0), above(10.0)]).share, 0.5);
        assert_eq!(check_alignment(&scene(), &[]), PriorVisibility { share: 0.0, advice: None });
    }

    #[test]
    fn a_wrong_axis_is_named() {
        let advice = |prior: &VoxelBoxes| {
            let PriorVisibility { share, advice } = check_alignment(prior, &cameras());
            assert!(share < LOW, "{share}");
            advice.unwrap()
        };
        let y_up = changed(&scene(), |p| DVec3::new(p.x, p.z, -p.y));
        let found = advice(&y_up);
        assert_eq!((found.up, found.quarter_turns, found.scale), (UpAxis::Y, 0, 1.0), "{found}");
        assert!(
            found.to_string().starts_with("the prior's y axis seems to be up where the dataset's is z: try `up` y (")
        );
        assert!(found.point(DVec3::new(1.0, 3.0, -2.0)).abs_diff_eq(DVec3::new(1.0, 2.0, 3.0), 1e-12));
        let down = changed(&scene(), |p| DVec3::new(p.x, -p.z, p.y));
        assert_eq!(advice(&down).up, UpAxis::MinusY);
        let mirrored = changed(&scene(), |p| DVec3::new(p.x, p.z, p.y));
        let found = advice(&mirrored);
        assert_eq!(found.exchanged, Some([1, 2]), "{found}");
        let turned = changed(&scene(), |p| DVec3::new(p.y, -p.x, p.z));
        let found = advice(&turned);
        assert_eq!((found.up, found.quarter_turns), (UpAxis::Z, 1), "{found}");
    }

    #[test]
    fn every_turn_is_one_and_its_up_goes_up() {
        for (up, axis) in UPS.iter().zip([DVec3::Z, DVec3::Y, DVec3::X, -DVec3::Y, -DVec3::X, -DVec3::Z]) {
            for quarter_turns in 0..4 {
                let turn = AlignmentHint { up: *up, quarter_turns, ..AlignmentHint::NOTHING }.turn();
                assert_eq!(turn * axis, DVec3::Z);
                assert_eq!(turn.determinant(), 1.0);
            }
        }
    }

    #[test]
    fn a_wrong_unit_is_named_alone_and_with_an_axis() {
        for (factor, scale) in [(1000.0, 0.001), (100.0, 0.01), (0.01, 100.0), (0.001, 1000.0)] {
            let AlignmentHint { up, scale: found, .. } =
                check_alignment(&changed(&scene(), |p| factor * p), &cameras()).advice.unwrap();
            assert_eq!((up, found), (UpAxis::Z, scale));
        }
        let both = changed(&scene(), |p| 1000.0 * DVec3::new(p.x, p.z, -p.y));
        let found = check_alignment(&both, &cameras()).advice.unwrap();
        assert_eq!((found.up, found.scale), (UpAxis::Y, 0.001));
        let text = found.to_string();
        assert!(text.contains("as millimeters are of meters: try `up` y `scale` 0.001"), "{text}");
    }

    #[test]
    fn a_prior_beside_what_the_cameras_look_at_is_told_where_that_is() {
        let aside = changed(&scene(), |p| p + DVec3::new(20.0, -11.0, 3.0));
        let found = check_alignment(&aside, &cameras()).advice.unwrap();
        assert!((found.shift + DVec3::new(20.0, -11.0, 3.0)).length() < 0.6, "{found}");
        assert!(found.to_string().contains("beside the point that the cameras look at, which is (-20."), "{found}");
    }

    #[test]
    fn a_small_thing_gets_no_advice_to_grow() {
        let small = VoxelBoxes {
            lattice: Lattice { origin: DVec3::new(5.35, 3.35, 12.35), pitch: DVec3::splat(0.3) },
            cells: vec![UVec3::ZERO],
        };
        let PriorVisibility { share, advice } = check_alignment(&small, &cameras());
        assert!(share > 0.0 && share < LOW && advice.is_none(), "{share} {advice:?}");
    }
}
