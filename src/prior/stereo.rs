//! Points on the surfaces that photographs with known poses show, matched from one photograph to others.
//!
//! Patches around the pixels of a coarse grid are swept along their rays, on planes that face the camera, and compared
//! with other photographs by zero-mean normalized cross-correlation (a plane sweep; Gallup et al., "Real-Time
//! Plane-Sweeping Stereo with Multiple Sweeping Directions", CVPR 2007). A depth counts if one place on the ray is much
//! more similar than all others, and if the depths found in other photographs agree.

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::CameraBounds;
use crate::dataset::View;
use crate::geometry::Camera;

/// The longer edge of the pictures that are compared, in pixels, at most.
const LONG_EDGE: u32 = 320;
/// Pixels between two patches, in both directions.
const STRIDE: usize = 3;
/// Pixels from the middle of a patch to its border.
const RADIUS: i32 = 3;
/// Pixels of a patch.
const PATCH: usize = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as usize;
/// The least standard deviation of the luminance of a patch that is searched for.
const MIN_CONTRAST: f32 = 0.012;

/// Photographs that a photograph is compared with, at most.
const NEIGHBORS: usize = 6;
/// The number of compared photographs whose similarities count at a depth: the highest ones.
const BEST: usize = 3;
/// The parallax between two photographs that are compared: its least, best and largest angle in radians.
const PARALLAX: [f64; 3] = [0.03, 0.15, 0.7];
/// The range of depths, in distances of the cameras from what they look at.
const RANGE: [f64; 2] = [0.15, 8.0];
/// The largest depth in a scene without an edge, in the same unit.
const FAR: f64 = 100.0;
/// The most depths along a ray.
const MAX_DEPTHS: usize = 320;
/// By how much a patch may be larger or smaller in another photograph.
const MAX_ZOOM: f64 = 2.0;

/// The least similarity of a match.
const MIN_SIMILARITY: f32 = 0.75;
/// By how much the best place on a ray is more similar than the other peaks.
const UNIQUE: f32 = 0.08;
/// The widest peak, in depths from its top to either side.
const WIDEST: usize = 8;
/// The share of the depth by which two photographs' depths of a point may differ, and the difference in pixels that is
/// less than what a photograph tells.
const AGREEMENT: f64 = 0.02;
const AGREEMENT_PIXELS: f64 = 0.5;
/// The photographs that must agree with a depth.
const MIN_AGREEING: usize = 2;

/// The surfaces that photographs show, where they could be matched.
#[derive(Debug)]
pub(super) struct Matches {
    /// Points on the surfaces.
    pub(super) points: Vec<DVec3>,
    /// \[view\]\[height\]\[width\] the distance along each pixel's ray, 0 if unknown; empty for a view without points.
    pub(super) distances: Vec<Vec<f32>>,
}

/// The surfaces that `views` show; there may be none. Only every so manyth of more than `most` views is searched. In a scene
/// that `is_unbounded`, they may be far away; there, distances are known only where photographs tell them well.
pub(super) fn matches(views: &[View], most: usize, is_unbounded: bool) -> Matches {
    let shots: Vec<Shot> = views.par_iter().map(Shot::new).collect();
    let cameras: Vec<Camera> = shots.iter().map(|shot| shot.camera).collect();
    let bounds = CameraBounds::from_cameras(cameras.iter());
    let distance = 2.0 * bounds.near;
    let range = [RANGE[0], if is_unbounded { FAR } else { RANGE[1] }].map(|share| share * distance);
    let chosen: Vec<usize> = (0..shots.len()).step_by(shots.len().div_ceil(most).max(1)).collect();
    // By chosen view.
    let mut maps: Vec<DepthMap> =
        chosen.par_iter().map(|&n| depths(&shots, n, &neighbors(&cameras, n, distance), distance, range)).collect();
    if !is_unbounded {
        // Nothing is so far that the photographs cannot tell.
        maps.iter_mut().for_each(|map| map.tolerance = 0.0);
    }
    let agreed: Vec<Vec<f64>> =
        chosen.par_iter().zip(&maps).map(|(&n, map)| agreed(&shots, &chosen, &maps, n, map)).collect();
    let mut distances = vec![Vec::new(); views.len()];
    let found = chosen.iter().zip(&agreed).filter(|(_, map)| map.iter().any(|&depth| depth > 0.0));
    let found: Vec<(usize, Vec<f32>)> = found
        .zip(&maps)
        .par_bridge()
        .map(|((&n, agreed), map)| {
            let well = |&depth: &f64| if map.tolerance * depth <= AGREEMENT { depth } else { 0.0 };
            let agreed: Vec<f64> = agreed.iter().map(well).collect();
            (n, shots[n].distances(&views[n].camera, &agreed))
        })
        .collect();
    found.into_iter().for_each(|(n, of_view)| distances[n] = of_view);
    let points = chosen.iter().zip(&agreed).flat_map(|(&n, map)| shots[n].points(map)).collect();
    Matches { points, distances }
}

/// The depths that are found in a photograph.
struct DepthMap {
    /// \[patch\] 0 if unknown.
    depths: Vec<f64>,
    /// The largest difference of 1/depth that may be more than the photographs tell.
    tolerance: f64,
}

/// A photograph without the distortion of its lens, small and gray.
struct Shot {
    camera: Camera,
    /// \[row\]\[column\] luminance; NaN where nothing is known.
    luminance: Vec<f32>,
}

impl Shot {
    fn new(view: &View) -> Self {
        let factor = view.camera.width.max(view.camera.height).div_ceil(LONG_EDGE).max(1);
        let camera = view.camera.downscaled(factor).undistorted();
        let lens = view.camera.downscaled(factor);
        let small: Vec<f32> = pixels_of(&lens)
            .map(|(x, y)| {
                let rows = (y * factor)..((y + 1) * factor);
                let cells = rows.flat_map(|row| ((x * factor)..((x + 1) * factor)).map(move |column| (row, column)));
                let mut sum = 0.0;
                for (row, column) in cells {
                    let pixel = (row * view.camera.width + column) as usize;
                    let [r, g, b] = view.pixels.color(pixel, [0.0; 3]);
                    sum += if view.counts(pixel) { 0.299 * r + 0.587 * g + 0.114 * b } else { f32::NAN };
                }
                sum / (factor * factor) as f32
            })
            .collect();
        let shot = Self { camera, luminance: small };
        if lens.lens.is_pinhole() {
            return shot;
        }
        let luminance = pixels_of(&camera)
            .map(|(x, y)| {
                let ray = camera.ray(x, y).and_then(|ray| lens.project(ray.at(1.0)));
                ray.map_or(f32::NAN, |at| shot.at(at))
            })
            .collect();
        Self { camera, luminance }
    }

    /// The luminance at the picture point `at`, between pixels; NaN outside.
    #[inline(always)]
    fn at(&self, at: DVec2) -> f32 {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let (x, y) = (at.x as f32 - 0.5, at.y as f32 - 0.5);
        if !(x >= 0.0 && y >= 0.0 && x < (width - 1) as f32 && y < (height - 1) as f32) {
            return f32::NAN;
        }
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f32, y - row as f32);
        let first = row * width + column;
        let (above, below) = (&self.luminance[first..first + 2], &self.luminance[first + width..first + width + 2]);
        let above = above[0] + u * (above[1] - above[0]);
        let below = below[0] + u * (below[1] - below[0]);
        above + v * (below - above)
    }

    /// Patches along columns and rows.
    fn patches(&self) -> [usize; 2] {
        [self.camera.width, self.camera.height].map(|extent| extent as usize / STRIDE)
    }

    /// The middle of patch number `n`: a picture point.
    fn middle(&self, n: usize) -> DVec2 {
        let columns = self.patches()[0];
        let at = [n % columns, n / columns].map(|place| (place * STRIDE + STRIDE / 2) as f64 + 0.5);
        DVec2::from(at)
    }

    /// The place at `depth` in the middle of patch number `n`.
    fn place(&self, n: usize, depth: f64) -> DVec3 {
        let seen = depth * direction(&self.camera, self.middle(n));
        self.camera.position + self.camera.world_from_camera * (DVec3::new(1.0, -1.0, -1.0) * seen)
    }

    /// The places of the patches with a depth in `map`.
    fn points<'a>(&'a self, map: &'a [f64]) -> impl Iterator<Item = DVec3> + 'a {
        map.iter().enumerate().filter(|(_, depth)| **depth > 0.0).map(|(n, &depth)| self.place(n, depth))
    }

    /// \[row\]\[column\] the distances along the rays of `camera`, whose picture this was made of, at the depths of the
    /// patches in `map`; 0 if unknown.
    fn distances(&self, camera: &Camera, map: &[f64]) -> Vec<f32> {
        let columns = self.patches()[0];
        let distance = |(x, y): (u32, u32)| {
            let at = camera.ray(x, y).and_then(|ray| self.camera.project(ray.at(1.0)))?;
            let [column, row] = self.patch_at(at)?;
            Some(map[row * columns + column] * direction(&self.camera, at).length())
        };
        pixels_of(camera).map(|pixel| distance(pixel).unwrap_or(0.0) as f32).collect()
    }

    /// The patch whose middle is nearest to the picture point `at`; `None` outside the picture.
    fn patch_at(&self, at: DVec2) -> Option<[usize; 2]> {
        let place = (at / STRIDE as f64).floor();
        let [columns, rows] = self.patches();
        let inside = place.min_element() >= 0.0 && place.x < columns as f64 && place.y < rows as f64;
        inside.then_some([place.x as usize, place.y as usize])
    }
}

fn pixels_of(camera: &Camera) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (camera.width, camera.height);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

/// The cameras that see most of what camera `n` sees at `distance`, from directions that differ well; at most
/// [`NEIGHBORS`].
fn neighbors(cameras: &[Camera], n: usize, distance: f64) -> Vec<usize> {
    const SIDE: u32 = 6;
    let camera = &cameras[n];
    let places: Vec<DVec3> = (0..SIDE * SIDE)
        .filter_map(|i| {
            let share = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
            camera.ray_through(share(i % SIDE) * f64::from(camera.width), share(i / SIDE) * f64::from(camera.height))
        })
        .flat_map(|ray| [0.6, 1.0, 2.0].map(|times| ray.at(times * distance)))
        .collect();
    let worth = |other: &Camera| -> f64 {
        let of_place = |&place: &DVec3| {
            let seen = other.project(place).is_some_and(|at| other.is_inside(at));
            let angle = (camera.position - place).angle_between(other.position - place);
            let far = (angle / PARALLAX[1]).ln();
            if seen && (PARALLAX[0]..PARALLAX[2]).contains(&angle) { (-far * far).exp() } else { 0.0 }
        };
        places.iter().map(of_place).sum()
    };
    let mut ranked: Vec<(f64, usize)> =
        (0..cameras.len()).filter(|&m| m != n).map(|m| (worth(&cameras[m]), m)).filter(|(w, _)| *w > 0.0).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    ranked.truncate(NEIGHBORS);
    ranked.into_iter().map(|(_, m)| m).collect()
}

/// The map from the space of one camera, in which a point of depth z is z·(x, y, 1), to the picture of another.
struct Pair<'a> {
    other: &'a Shot,
    rotation: DMat3,
    translation: DVec3,
}

impl<'a> Pair<'a> {
    fn new(camera: &Camera, other: &'a Shot) -> Self {
        // Axes of the pictures: y down, z ahead.
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let to_other = flip * other.camera.world_from_camera.transpose();
        Self {
            other,
            rotation: to_other * camera.world_from_camera * flip,
            translation: to_other * (camera.position - other.camera.position),
        }
    }

    /// The other picture's point of the point of `depth` on the ray along `direction`; `None` behind the camera.
    #[inline(always)]
    fn point(&self, direction: DVec3, depth: f64) -> Option<DVec2> {
        let seen = depth * (self.rotation * direction) + self.translation;
        let camera = &self.other.camera;
        let at = DVec2::new(seen.x, seen.y) / seen.z;
        (seen.z > 1e-6 * depth).then(|| at * DVec2::from(camera.focal) + DVec2::from(camera.principal))
    }

    /// The similarity, from −1 to 1, of the `patch` around the picture point `middle` at `depth`; `None` where the other
    /// photograph does not show it.
    fn similarity(&self, camera: &Camera, middle: DVec2, patch: &[f32; PATCH], depth: f64) -> Option<f32> {
        let at = |offset: DVec2| self.point(direction(camera, middle + offset), depth);
        let origin = at(DVec2::ZERO)?;
        let (right, down) = (at(DVec2::X)? - origin, at(DVec2::Y)? - origin);
        let zoom = right.perp_dot(down);
        if !(MAX_ZOOM.powi(-2)..MAX_ZOOM.powi(2)).contains(&zoom) {
            return None;
        }
        let (mut sum, mut squares, mut product) = (0.0, 0.0, 0.0);
        let mut n = 0;
        for y in -RADIUS..=RADIUS {
            for x in -RADIUS..=RADIUS {
                let value = self.other.at(origin + f64::from(x) * right + f64::from(y) * down);
                sum += value;
                squares += value * value;
                product += value * patch[n];
                n += 1;
            }
        }
        let variance = squares - sum * sum / PATCH as f32;
        (variance > 0.0).then(|| product / variance.max(MIN_CONTRAST * MIN_CONTRAST * PATCH as f32).sqrt())
    }
}

/// The direction of the picture point `at` of a pinhole camera, of depth 1, in the axes of the picture.
#[inline(always)]
fn direction(camera: &Camera, at: DVec2) -> DVec3 {
    ((at - DVec2::from(camera.principal)) / DVec2::from(camera.focal)).extend(1.0)
}

/// The pixels around `middle`, of mean 0 and length 1; `None` without contrast.
fn patch(shot: &Shot, middle: DVec2) -> Option<[f32; PATCH]> {
    let mut n = 0;
    let mut patch = [0.0; PATCH];
    for y in -RADIUS..=RADIUS {
        for x in -RADIUS..=RADIUS {
            patch[n] = shot.at(middle + DVec2::new(f64::from(x), f64::from(y)));
            n += 1;
        }
    }
    let mean = patch.iter().sum::<f32>() / PATCH as f32;
    patch.iter_mut().for_each(|v| *v -= mean);
    let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
    patch.iter_mut().for_each(|v| *v /= length);
    (length > MIN_CONTRAST * (PATCH as f32).sqrt()).then_some(patch)
}

/// The depths in the range `nearest` to `farthest` of the patches of photograph `n`, found in `neighbors`.
fn depths(shots: &[Shot], n: usize, neighbors: &[usize], distance: f64, [nearest, farthest]: [f64; 2]) -> DepthMap {
    let shot = &shots[n];
    let [columns, rows] = shot.patches();
    let pairs: Vec<Pair> = neighbors.iter().map(|&m| Pair::new(&shot.camera, &shots[m])).collect();
    if pairs.len() < 2 {
        return DepthMap { depths: vec![0.0; columns * rows], tolerance: 0.0 };
    }
    // Even in the reciprocal, a pixel apart in the photograph in which they are farthest apart.
    let middle = direction(&shot.camera, DVec2::from(shot.camera.principal));
    let reach = pairs.iter().map(|pair| {
        let step = |depth: f64| Some(pair.point(middle, 0.99 * depth)?.distance(pair.point(middle, 1.01 * depth)?));
        // The speed in pixels per unit of 1/depth, at the distance of the scene.
        step(distance).map_or(0.0, |pixels| pixels / (0.02 / distance) * (1.0 / nearest - 1.0 / farthest))
    });
    let pixels = reach.fold(0.0, f64::max);
    let count = (pixels as usize).clamp(16, MAX_DEPTHS);
    let tolerance = AGREEMENT_PIXELS * (1.0 / nearest - 1.0 / farthest) / pixels.max(1.0);
    let depth_of = |place: f64| {
        let share = place / (count - 1) as f64;
        1.0 / (1.0 / nearest + share * (1.0 / farthest - 1.0 / nearest))
    };
    let mut profile = vec![0.0; count];
    let depths = (0..columns * rows)
        .map(|n| {
            let middle = shot.middle(n);
            let Some(patch) = patch(shot, middle) else { return 0.0 };
            for (place, similarity) in profile.iter_mut().enumerate() {
                let depth = depth_of(place as f64);
                let mut found = [-1.0_f32; NEIGHBORS];
                for (found, pair) in found.iter_mut().zip(&pairs) {
                    *found = pair.similarity(&shot.camera, middle, &patch, depth).unwrap_or(-1.0).max(-1.0);
                }
                found.sort_by(|a, b| b.total_cmp(a));
                let best = BEST.min(pairs.len());
                *similarity = found[..best].iter().sum::<f32>() / best as f32;
            }
            peak(&profile).map_or(0.0, depth_of)
        })
        .collect();
    DepthMap { depths, tolerance }
}

/// The place of the only high peak of `profile`, between its entries.
fn peak(profile: &[f32]) -> Option<f64> {
    let at = (0..profile.len()).max_by(|&a, &b| profile[a].total_cmp(&profile[b]))?;
    if profile[at] < MIN_SIMILARITY || at == 0 || at + 1 == profile.len() {
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

/// The depths `map` of photograph `n` that the depths of others agree with; 0 for all others.
fn agreed(shots: &[Shot], chosen: &[usize], maps: &[DepthMap], n: usize, map: &DepthMap) -> Vec<f64> {
    let shot = &shots[n];
    let depth = |(patch, &depth): (usize, &f64)| {
        let place = shot.place(patch, depth);
        let agrees = |(&m, map): (&usize, &DepthMap)| {
            let other = &shots[m];
            let Some(at) = other.camera.project(place) else { return false };
            let Some([column, row]) = other.patch_at(at) else { return false };
            let depth = (other.camera.position - place).dot(other.camera.world_from_camera.z_axis);
            let [columns, rows] = other.patches();
            let around = (row.saturating_sub(1)..=(row + 1).min(rows - 1)).flat_map(|row| {
                (column.saturating_sub(1)..=(column + 1).min(columns - 1)).map(move |column| row * columns + column)
            });
            let tolerance = depth * AGREEMENT.max(map.tolerance * depth);
            around.map(|patch| map.depths[patch]).any(|found| found > 0.0 && (found - depth).abs() < tolerance)
        };
        let count = chosen.iter().zip(maps).filter(|(m, _)| **m != n).filter(|&pair| agrees(pair)).take(MIN_AGREEING);
        if depth > 0.0 && count.count() == MIN_AGREEING { depth } else { 0.0 }
    };
    map.depths.iter().enumerate().map(depth).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Pixels;
    use crate::geometry::{Distortion, Lens, Projection};
    use crate::random::Random;

    /// Smooth noise on the plane, of some pixels' period in the pictures below.
    fn texture(random: &Random, u: f64, v: f64) -> f32 {
        let corner = |x: f64, y: f64| random.uniform((x.rem_euclid(512.0) * 512.0 + y.rem_euclid(512.0)) as u64);
        let [x, y] = [u, v].map(f64::floor);
        let mix = |a: f64, b: f64, t: f64| a + t * t * (3.0 - 2.0 * t) * (b - a);
        let row = |y: f64| mix(corner(x, y), corner(x + 1.0, y), u - x);
        mix(row(y), row(y + 1.0), v - y) as f32
    }

    /// The distance along a ray to a ball of radius 1 or to the wall x = −2, and the color there.
    fn scene(random: &Random, origin: DVec3, direction: DVec3) -> (f64, f32) {
        let (half, rest) = (origin.dot(direction), origin.length_squared() - 1.0);
        let square = half * half - rest;
        if square > 0.0 {
            let at = origin + (-half - square.sqrt()) * direction;
            return (-half - square.sqrt(), texture(random, 12.0 * at.y.atan2(at.x), 12.0 * at.z));
        }
        let reach = (-2.0 - origin.x) / direction.x;
        let at = origin + reach * direction;
        (reach, if at.y.abs() < 0.8 { 0.5 } else { texture(random, 6.0 * at.y, 6.0 * at.z) })
    }

    fn views(lens: Lens) -> Vec<View> {
        let random = Random::new(7, "texture");
        (0..9)
            .map(|n| {
                let angle = 0.12 * (f64::from(n) - 4.0);
                let position = 4.0 * DVec3::new(angle.cos(), angle.sin(), 0.1 * f64::from(n % 3));
                let camera = Camera::looking_at([120, 96], 110.0, position, DVec3::ZERO, DVec3::Z);
                let camera = Camera { lens, ..camera };
                let gray = camera.rays(0..96).map(|ray| {
                    let ray = ray.unwrap();
                    [scene(&random, ray.origin, ray.direction).1; 3]
                });
                View::new(n.to_string(), camera, Pixels::opaque(gray))
            })
            .collect()
    }

    fn assert_found(lens: Lens) {
        let views = views(lens);
        let Matches { points, distances } = matches(&views, 100, false);
        let off = |point: &DVec3| (point.length() - 1.0).abs().min((point.x + 2.0).abs());
        let wrong = points.iter().filter(|point| off(point) > 0.12).count();
        let on_wall = points.iter().filter(|point| point.x < -1.9).count();
        println!("{} points, {on_wall} on the wall, {wrong} wrong", points.len());
        assert!(points.len() > 1500 && on_wall > 300, "{} points, {on_wall} on the wall", points.len());
        assert!(50 * wrong < points.len(), "{wrong} of {} points are on no surface", points.len());
        let blank = points.iter().filter(|point| point.x < -1.9 && point.y.abs() < 0.5).count();
        assert!(blank < 5, "{blank} points where the wall has no texture");

        let random = Random::new(7, "texture");
        let [mut known, mut off, mut off_next] = [0; 3];
        for (view, distances) in views.iter().zip(&distances) {
            for (n, &distance) in distances.iter().enumerate().filter(|(_, distance)| **distance > 0.0) {
                let [x, y] = [n % 120, n / 120].map(|v| v as u32);
                let misses = |x: u32| {
                    let ray = view.camera.ray(x, y).unwrap();
                    let exact = scene(&random, ray.origin, ray.direction).0;
                    i32::from((f64::from(distance) - exact).abs() > 0.03 * exact)
                };
                known += 1;
                off += misses(x);
                off_next += misses((x + 12) % 120);
            }
        }
        println!("{known} distances, {off} wrong, {off_next} of another pixel");
        assert!(known > 9 * 1500 && 10 * off < known, "{off} of {known} distances are wrong");
        assert!(off_next > 2 * off, "distances of other pixels show: {off_next}, {off}");
    }

    #[test]
    fn points_lie_on_textured_surfaces() {
        assert_found(Lens::PINHOLE);
    }

    #[test]
    fn a_lens_changes_nothing() {
        let distortion = Distortion::new([0.08, -0.02, 0.0, 0.0], [0.0; 3], [0.0; 2], [0.0; 2]).unwrap();
        assert_found(Lens { projection: Projection::Perspective, distortion });
    }

    #[test]
    fn photographs_from_one_place_have_no_points() {
        let mut views = views(Lens::PINHOLE);
        let position = views[0].camera.position;
        views.iter_mut().for_each(|view| view.camera.position = position);
        assert_eq!(matches(&views, 100, false).points, []);
        assert_eq!(matches(&views[..1], 100, false).points, []);
        assert_eq!(matches(&[], 100, false).points, []);
    }
}
