//! The search for the planes that one photograph shows.

use std::collections::BinaryHeap;
use std::mem::swap;

use glam::DVec2;

use super::pair::Pair;
use super::plane::{Plane, direction};
use super::shot::{Patch, PlaneMap, RADIUS, StereoShot};

/// The distance between two patches that are swept, in patches along columns and along rows.
const SWEPT_STRIDE: usize = 3;
/// The number of compared photographs whose similarities count at a depth, in a sweep and after it: the highest ones.
const SWEPT_BEST: usize = 3;
const GROWN_BEST: usize = 2;
/// The most depths along a ray.
const MAX_DEPTHS: usize = 320;

/// The least similarity of a match, in a sweep and after it. With 0.75 for the latter, too, held-out photographs of real captures
/// lose 1.5 dB; 0.45 is no better (docs/experiments/2026-11-30-captures.md).
const SWEPT_SIMILARITY: f32 = 0.75;
const GROWN_SIMILARITY: f32 = 0.6;
/// The least lead in similarity of the best place on a ray over the other peaks.
const UNIQUE: f32 = 0.08;
/// The widest peak, in depths from its top to either side.
const WIDEST: usize = 8;
/// Pixels of another photograph from where a grown plane is seen to where it looks different on one side at least, unless it may be
/// anywhere, and the least difference in similarity. The even change of a sky's brightness looks the same everywhere: 15 % of a
/// synthetic one are matched but for such planes, 33 % with them (docs/experiments/2026-11-30-captures.md).
const ELSEWHERE: f64 = 32.0;
const SAME: f32 = 0.02;
/// The difference in pixels of another photograph that is below the resolution of the photographs.
const TOLERANCE: f64 = 0.5;

/// The least similarity on a continued plane before it is refined.
const PROMISING: f32 = 0.4;
/// The least gain in similarity of a plane over the one it replaces.
const IMPROVEMENT: f32 = 0.01;
/// The first step of a refinement, in pixels of another photograph, and the number of steps, each half of the one before.
const FIRST_STEP: f64 = 0.5;
const HALVINGS: usize = 3;
/// The largest change of 1/depth from the middle of a patch to its border, as a share of it.
const STEEPEST: f64 = 0.8;

/// One photograph, and those that it is compared with.
pub(super) struct DepthSearch<'a> {
    pub(super) shot: &'a StereoShot,
    pairs: Vec<Pair<'a>>,
    /// The largest and the least 1/depth that is searched.
    range: [f64; 2],
    /// The number of depths whose pictures are a pixel apart in the photograph in which they are farthest apart.
    pixels: f64,
    /// The instructions of this machine.
    arch: pulp::Arch,
}

impl<'a> DepthSearch<'a> {
    /// Compares `shot` with `others`, at depths `nearest` to `farthest`; the scene is at `distance`.
    pub(super) fn new(
        shot: &'a StereoShot,
        others: impl Iterator<Item = &'a StereoShot>,
        distance: f64,
        [nearest, farthest]: [f64; 2],
    ) -> Self {
        let pairs: Vec<Pair> = others.map(|other| Pair::new(&shot.camera, other)).collect();
        let range = [nearest, farthest].map(f64::recip);
        let middle = direction(&shot.camera, DVec2::from(shot.camera.principal));
        let reach = pairs.iter().map(|pair| {
            let step = || Some(pair.point(middle, 1.01 / distance)?.distance(pair.point(middle, 0.99 / distance)?));
            // The speed in pixels per unit of 1/depth, at the distance of the scene.
            step().map_or(0.0, |pixels| pixels / (0.02 / distance) * (range[0] - range[1]))
        });
        let pixels = reach.fold(0.0, f64::max).max(1.0);
        Self { shot, pairs, range, pixels, arch: pulp::Arch::new() }
    }

    /// The difference of 1/depth of a pixel in another photograph.
    fn pixel(&self) -> f64 {
        (self.range[0] - self.range[1]) / self.pixels
    }

    /// The difference of 1/depth that is below the resolution of the photographs.
    pub(super) fn tolerance(&self) -> f64 {
        TOLERANCE * self.pixel()
    }

    /// The mean similarity of the `patch` around `middle` in the `count` photographs that show `plane` best.
    fn similarity(&self, count: usize, middle: DVec2, patch: &Patch, plane: Plane) -> f32 {
        let mut best = [-1.0_f32; SWEPT_BEST];
        self.arch.dispatch(
            #[inline(always)]
            || {
                for pair in &self.pairs {
                    let mut similarity = pair.similarity(&self.shot.camera, middle, patch, plane).unwrap_or(-1.0);
                    for best in &mut best[..count] {
                        if similarity > *best {
                            swap(best, &mut similarity);
                        }
                    }
                }
            },
        );
        best[..count].iter().sum::<f32>() / count as f32
    }

    /// Sweeps one patch in [`SWEPT_STRIDE`], along columns and rows. A patch gets a plane that faces the camera if the
    /// similarity has only one high peak along its ray.
    pub(super) fn sweep(&self) -> PlaneMap {
        let [columns, rows] = self.shot.patches();
        let count = (self.pixels as usize).clamp(16, MAX_DEPTHS);
        let plane = |place: f64| {
            let share = place / (count - 1) as f64;
            let inverse = self.range[0] + share * (self.range[1] - self.range[0]);
            Plane { inverse, slope: DVec2::ZERO, may_be_anywhere: false }
        };
        let best = SWEPT_BEST.min(self.pairs.len());
        let mut profile = vec![0.0; count];
        let found = (0..columns * rows).map(|n| {
            let is_swept = [n % columns, n / columns].map(|place| place % SWEPT_STRIDE) == [SWEPT_STRIDE / 2; 2];
            if !is_swept || best < GROWN_BEST {
                return None;
            }
            let middle = self.shot.middle(n);
            let patch = self.shot.patch(middle)?;
            for (place, similarity) in profile.iter_mut().enumerate() {
                *similarity = self.similarity(best, middle, &patch, plane(place as f64));
            }
            peak(&profile).map(|place| plane(place).rounded())
        });
        found.collect()
    }

    /// The planes that grow from `seeds`: those of patches, continued to the patches beside them and refined, the most
    /// similar ones first.
    pub(super) fn grow(&self, seeds: &PlaneMap) -> PlaneMap {
        let [columns, rows] = self.shot.patches();
        let mut grown = Grown { found: vec![None; seeds.len()], queue: BinaryHeap::new() };
        for (n, plane) in seeds.iter().enumerate().filter_map(|(n, plane)| Some((n, (*plane)?))) {
            self.offer(&mut grown, n, plane);
        }
        while let Some((bits, n)) = grown.queue.pop() {
            // One that was replaced is in the queue twice.
            let Some((plane, _)) = grown.found[n].filter(|(_, similarity)| similarity.to_bits() == bits) else {
                continue;
            };
            let (column, row) = (n % columns, n / columns);
            let left = (column > 0).then(|| n - 1);
            let right = (column + 1 < columns).then(|| n + 1);
            let above = (row > 0).then(|| n - columns);
            let below = (row + 1 < rows).then(|| n + columns);
            for beside in [left, right, above, below].into_iter().flatten() {
                self.offer(&mut grown, beside, plane.moved(self.shot.middle(beside) - self.shot.middle(n)));
            }
        }
        grown.found.into_iter().map(|found| found.map(|(plane, _)| plane.rounded())).collect()
    }

    /// Refines `plane` for patch number `n`, and keeps it there if it is similar, and more so than the one before.
    fn offer(&self, grown: &mut Grown, n: usize, plane: Plane) {
        let middle = self.shot.middle(n);
        let Some(patch) = self.shot.patch(middle) else { return };
        let [promising, least] =
            grown.found[n].map_or([PROMISING, GROWN_SIMILARITY], |(_, before)| [before, before + IMPROVEMENT]);
        let similarity = |plane: Plane| {
            let change = plane.slope.abs().element_sum() * f64::from(RADIUS);
            let is_in_range = (self.range[1]..=self.range[0]).contains(&plane.inverse);
            let is_seen = is_in_range && change < STEEPEST * plane.inverse;
            if is_seen { self.similarity(GROWN_BEST, middle, &patch, plane) } else { -1.0 }
        };
        let mut best = (plane, similarity(plane));
        if best.1 < promising {
            return;
        }
        for halving in 0..HALVINGS {
            let step = FIRST_STEP * self.pixel() / f64::from(1 << halving);
            let slope = step / f64::from(RADIUS);
            let steps = [(step, DVec2::ZERO), (0.0, slope * DVec2::X), (0.0, slope * DVec2::Y)];
            for (inverse, slope) in
                steps.into_iter().flat_map(|(inverse, slope)| [(inverse, slope), (-inverse, -slope)])
            {
                let plane = Plane { inverse: best.0.inverse + inverse, slope: best.0.slope + slope, ..best.0 };
                let found = similarity(plane);
                if found > best.1 {
                    best = (plane, found);
                }
            }
        }
        if best.1 < least {
            return;
        }
        let elsewhere = [1.0, -1.0].map(|sign| {
            let inverse = best.0.inverse + sign * ELSEWHERE * self.pixel();
            similarity(Plane { inverse, ..best.0 })
        });
        best.0.may_be_anywhere = elsewhere[0].min(elsewhere[1]) > best.1 - SAME;
        grown.found[n] = Some(best);
        grown.queue.push((best.1.to_bits(), n));
    }
}

/// The planes of a photograph while they grow.
struct Grown {
    /// \[patch\] a plane and its similarity.
    found: Vec<Option<(Plane, f32)>>,
    /// The bits of similarities, which are above 0 and thus in the same order, and the patches whose neighbors they may
    /// reach.
    queue: BinaryHeap<(u32, usize)>,
}

/// The place of the only high peak of `profile`, between its entries.
fn peak(profile: &[f32]) -> Option<f64> {
    let at = (0..profile.len()).max_by(|&a, &b| profile[a].total_cmp(&profile[b]))?;
    if profile[at] < SWEPT_SIMILARITY || at == 0 || at + 1 == profile.len() {
        return None;
    }
    // The slopes of the peak end where the profile rises again.
    let left = (0..at).rev().take_while(|&n| profile[n] <= profile[n + 1]).last().unwrap_or(at);
    let right = (at + 1..profile.len()).take_while(|&n| profile[n] <= profile[n - 1]).last().unwrap_or(at);
    let others = profile[..left].iter().chain(&profile[right + 1..]).copied().fold(-1.0, f32::max);
    // An edge along the line of the search is similar everywhere on it.
    let beside = |n: usize| profile[n.clamp(left, right)];
    let flat = beside(at.saturating_sub(WIDEST)).min(beside(at + WIDEST)) > profile[at] - UNIQUE;
    if others > profile[at] - UNIQUE || flat {
        return None;
    }
    let [before, here, after] = [profile[at - 1], profile[at], profile[at + 1]].map(f64::from);
    let curvature = before - 2.0 * here + after;
    Some(at as f64 + if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 })
}
