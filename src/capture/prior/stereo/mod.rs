//! Points on the surfaces that photographs with known poses show, matched from one photograph to others.
//!
//! Patches around the pixels of a coarse grid are swept along their rays, on planes that face the camera, and compared
//! with other photographs by zero-mean normalized cross-correlation (a plane sweep; Gallup et al., "Real-Time
//! Plane-Sweeping Stereo with Multiple Sweeping Directions", CVPR 2007). A depth counts if one place on the ray is much
//! more similar than all others, and if the depths found in other photographs agree. From these seeds, planes grow to the
//! patches beside them, where they may slant (Furukawa and Ponce, "Accurate, Dense, and Robust Multi-View Stereopsis",
//! CVPR 2007), and must agree again. Planes are then continued over what has no texture, where others agree with that.

mod flat;
mod kept;
mod pair;
mod plane;
mod search;
mod seen;
mod shot;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use self::flat::completed;
use self::kept::{Kept, Stage};
use self::plane::Plane;
use self::search::DepthSearch;
use self::seen::{AGREEMENT, Seen};
use self::shot::{PlaneMap, StereoShot};
use super::CameraBounds;
use crate::dataset::Photograph;
use strivec_format::geometry::Camera;

/// Photographs that a photograph is compared with, at most.
const NEIGHBORS: usize = 10;
/// The sum of how well they see a place from which on another is worth nothing to it.
const ENOUGH: f64 = 3.0;
/// The parallax between two photographs that are compared: its least, best and largest angle in radians.
const PARALLAX: [f64; 3] = [0.03, 0.15, 0.7];
/// The range of depths, in distances of the cameras from what they look at.
const RANGE: [f64; 2] = [0.15, 100.0];
/// The photographs that must agree with a depth.
const MIN_AGREEING: usize = 2;

/// Photographs that are searched between two reports of progress.
const BLOCK: usize = 16;
/// The time after which what was found is kept.
const KEEP_EVERY: Duration = Duration::from_secs(20);

/// A caller's part in a matching: it may keep the planes that are found, and stop the search. `()` does neither.
pub trait MatchWatch {
    /// The bytes that were last kept under `name`, which tells the photographs and cameras. Others than these do no harm.
    fn kept(&mut self, name: &str) -> Option<Vec<u8>> {
        let _ = name;
        None
    }

    /// Keeps `bytes` under `name`.
    fn keep(&mut self, name: &str, bytes: &[u8]) {
        let _ = (name, bytes);
    }

    /// Called when `done` of `total` searches are done. Returning [`ControlFlow::Break`] stops the matching; with the planes
    /// that were kept, the next one continues.
    fn progress(&mut self, done: usize, total: usize) -> ControlFlow<()> {
        let _ = (done, total);
        ControlFlow::Continue(())
    }
}

impl MatchWatch for () {}

/// The surfaces that photographs show, where they could be matched.
#[derive(Debug, Default)]
pub(super) struct Matches {
    /// Points on the surfaces.
    pub(super) points: Vec<DVec3>,
    /// \[view\]\[height\]\[width\] the distance along each pixel's ray, 0 if unknown; empty for a view that was not searched, and for
    /// all if no view has points.
    pub(super) distances: Vec<Vec<f32>>,
}

/// The surfaces that `views` show; there may be none. Of more than `most` views, so many are searched. They may be far
/// away; distances are known only where photographs resolve them well. If `sees_sky` says so of the \[view\] distances without them,
/// planes that may be anywhere are left out. `None` if `watch` stops it.
pub(super) fn matches(
    views: &[Photograph],
    most: usize,
    sees_sky: impl Fn(&[Vec<f32>]) -> bool,
    watch: &mut dyn MatchWatch,
) -> Option<Matches> {
    let cameras: Vec<Camera> = views.par_iter().map(|view| StereoShot::camera_of(&view.camera)).collect();
    let bounds = CameraBounds::from_cameras(cameras.iter());
    let distance = 2.0 * bounds.near;
    let range = RANGE.map(|share| share * distance);
    let count = views.len().min(most);
    let chosen: Vec<usize> = (0..count).map(|n| n * views.len() / count).collect();
    // By chosen view.
    let compared: Vec<Vec<usize>> = chosen.par_iter().map(|&n| neighbors(&cameras, n, distance)).collect();
    // Photographs that are neither searched nor compared take no memory.
    let taking_part: BTreeSet<usize> = chosen.iter().chain(compared.iter().flatten()).copied().collect();
    let shots: BTreeMap<usize, StereoShot> =
        taking_part.into_par_iter().map(|n| (n, StereoShot::new(&views[n]))).collect();
    let search = |(n, others): (&usize, &Vec<usize>)| {
        DepthSearch::new(&shots[n], others.iter().map(|m| &shots[m]), distance, range)
    };
    let searches: Vec<DepthSearch> = chosen.par_iter().zip(&compared).map(search).collect();
    let maps = planes(&searches, &Kept::name(shots.values()), watch)?;
    let compared: Vec<Vec<usize>> =
        compared.iter().map(|others| others.iter().filter_map(|m| chosen.binary_search(m).ok()).collect()).collect();
    let completed = |maps: Vec<PlaneMap>| {
        let maps = completed(&searches, maps, &compared);
        let distances = distances(views, &chosen, &searches, &maps);
        let points = searches.iter().zip(&maps).flat_map(|(search, map)| search.shot.points(map)).collect();
        Matches { points, distances }
    };
    let certain: Vec<PlaneMap> = maps.iter().map(certain).collect();
    if certain == maps {
        return Some(completed(maps));
    }
    let found = completed((0..searches.len()).into_par_iter().map(|n| agreed(&searches, &certain, n)).collect());
    Some(if sees_sky(&found.distances) { found } else { completed(maps) })
}

/// \[view\] the distances along the rays of the pixels, by the planes of those that are \[search\] `chosen`.
fn distances(views: &[Photograph], chosen: &[usize], searches: &[DepthSearch<'_>], maps: &[PlaneMap]) -> Vec<Vec<f32>> {
    let mut distances = vec![Vec::new(); views.len()];
    if maps.iter().flatten().all(Option::is_none) {
        return distances;
    }
    // The distortion of a lens costs more than all else here: it is computed once for all photographs of a camera.
    let mut groups: Vec<(Camera, Vec<usize>)> = Vec::new();
    for at in 0..chosen.len() {
        let lens = Camera { world_from_camera: DMat3::IDENTITY, position: DVec3::ZERO, ..views[chosen[at]].camera };
        match groups.iter_mut().find(|(other, _)| *other == lens) {
            Some((_, members)) => members.push(at),
            None => groups.push((lens, vec![at])),
        }
    }
    for (_, members) in groups {
        let first = members[0];
        let pixels = searches[first].shot.pixels(&views[chosen[first]].camera);
        let of_member = |&at: &usize| {
            let search = &searches[at];
            (chosen[at], search.shot.distances(&pixels, &maps[at], search.tolerance() / AGREEMENT))
        };
        let found: Vec<(usize, Vec<f32>)> = members.par_iter().map(of_member).collect();
        found.into_iter().for_each(|(n, of_view)| distances[n] = of_view);
    }
    distances
}

/// \[search\] the planes that are found and that others agree with. The search called `name` goes on from what is kept of it.
fn planes(searches: &[DepthSearch<'_>], name: &str, watch: &mut dyn MatchWatch) -> Option<Vec<PlaneMap>> {
    let patches: Vec<usize> = searches.iter().map(|search| search.shot.patches().iter().product()).collect();
    let kept = watch.kept(name).and_then(|bytes| Kept::from_bytes(&bytes, &patches));
    let mut kept = kept.unwrap_or_else(|| Kept::new(searches.len()));
    while kept.stage != Stage::Done {
        let missing: Vec<usize> = (0..searches.len()).filter(|&n| kept.found[n].is_none()).collect();
        let before = kept.stage as usize * searches.len() + searches.len() - missing.len();
        let mut since = Instant::now();
        for (block, numbers) in missing.chunks(BLOCK).enumerate() {
            let search = |&n: &usize| match &kept.before[n] {
                Some(seeds) => searches[n].grow(seeds),
                None => searches[n].sweep(),
            };
            let maps: Vec<PlaneMap> = numbers.par_iter().map(search).collect();
            numbers.iter().zip(maps).for_each(|(&n, map)| kept.found[n] = Some(map));
            let stops = watch.progress(before + block * BLOCK + numbers.len(), 2 * searches.len()).is_break();
            if stops || since.elapsed() > KEEP_EVERY {
                watch.keep(name, &kept.to_bytes());
                since = Instant::now();
            }
            if stops {
                return None;
            }
        }
        let found: Vec<PlaneMap> = kept.found.into_iter().map(Option::unwrap_or_default).collect();
        let agreed = (0..searches.len()).into_par_iter().map(|n| Some(agreed(searches, &found, n))).collect();
        let stage = if kept.stage == Stage::Sweep { Stage::Grow } else { Stage::Done };
        kept = Kept { stage, before: agreed, found: vec![None; searches.len()] };
        watch.keep(name, &kept.to_bytes());
    }
    Some(kept.before.into_iter().map(Option::unwrap_or_default).collect())
}

/// The cameras that see most of what camera `n` sees at `distance`, from directions that differ well; at most
/// [`NEIGHBORS`]. Each is worth the most to places that those before it do not see well enough.
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
    // How well `other` sees each place, 0 to 1.
    let worths = |other: &Camera| -> Vec<f64> {
        let of_place = |&place: &DVec3| {
            let seen = other.project(place).is_some_and(|at| other.is_inside(at));
            let angle = (camera.position - place).angle_between(other.position - place);
            let far = (angle / PARALLAX[1]).ln();
            if seen && (PARALLAX[0]..PARALLAX[2]).contains(&angle) { (-far * far).exp() } else { 0.0 }
        };
        places.iter().map(of_place).collect()
    };
    let mut others: Vec<(usize, Vec<f64>)> =
        (0..cameras.len()).filter(|&m| m != n).map(|m| (m, worths(&cameras[m]))).collect();
    let mut seen = vec![0.0; places.len()];
    let mut found = Vec::new();
    while found.len() < NEIGHBORS {
        let more = |seen: f64, worth: f64| (seen + worth).min(ENOUGH) - seen.min(ENOUGH);
        let gain = |worths: &[f64]| -> f64 { seen.iter().zip(worths).map(|(&seen, &worth)| more(seen, worth)).sum() };
        let gains = others.iter().enumerate().map(|(n, (_, worths))| (gain(worths), n));
        // The first camera of those with equal gains.
        let best = gains.filter(|(gain, _)| *gain > 0.0).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, best)) = best else { break };
        let (m, worths) = others.remove(best);
        seen.iter_mut().zip(&worths).for_each(|(seen, worth)| *seen += worth);
        found.push(m);
    }
    found
}

/// The planes but for those that may be anywhere.
fn certain(map: &PlaneMap) -> PlaneMap {
    map.iter().map(|plane| plane.filter(|plane| !plane.may_be_anywhere)).collect()
}

/// The planes of photograph `n` that the planes of others agree with.
fn agreed(searches: &[DepthSearch<'_>], maps: &[PlaneMap], n: usize) -> PlaneMap {
    let (shot, tolerance) = (searches[n].shot, searches[n].tolerance());
    let is_agreed = |patch: usize, plane: &Plane| {
        let place = shot.place(patch, plane.depth());
        let others = searches.iter().zip(maps).enumerate().filter(|(m, _)| *m != n);
        let agreeing = others
            .filter(|(_, (other, map))| Seen::of(place, other.shot).is_some_and(|seen| seen.is_on(map, tolerance)));
        agreeing.take(MIN_AGREEING).count() == MIN_AGREEING
    };
    let planes = maps[n].iter().enumerate();
    planes.map(|(patch, plane)| plane.filter(|plane| is_agreed(patch, plane))).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::dataset::Pixels;
    use strivec_format::geometry::{Distortion, Lens, Projection};
    use strivec_format::random::Random;

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

    /// The distance along a ray to the floor z = −1, and the color there, which repeats itself where y is above 0. There is
    /// nothing else.
    fn floor(random: &Random, origin: DVec3, direction: DVec3) -> (f64, f32) {
        if direction.z > -0.05 {
            return (1e3, 0.5);
        }
        let reach = (-1.0 - origin.z) / direction.z;
        let at = 2.0 * (origin + reach * direction);
        let tile = |v: f64| if at.y > 0.0 { v.rem_euclid(2.0) } else { v };
        (reach, texture(random, tile(at.x), tile(at.y)))
    }

    /// The number of pixels of the floor up to 5 away, of those with a distance and of those with a right one, by sides of
    /// the floor, whose luminance is multiplied by `contrast`.
    fn floor_counts(contrast: f32) -> [[i32; 3]; 2] {
        let random = Random::new(7, "texture");
        let views: Vec<Photograph> = (0..9)
            .map(|n| {
                let position = DVec3::new(0.05 * f64::from(n % 3), 0.25 * f64::from(n - 4), 0.0);
                let camera = Camera::looking_at([120, 96], 110.0, position, DVec3::new(4.0, 0.0, -1.0), DVec3::Z);
                let gray = camera.rays(0..96).map(|ray| ray.unwrap());
                let gray = gray.map(|ray| [contrast * floor(&random, ray.origin, ray.direction).1; 3]);
                Photograph::new(n.to_string(), camera, Pixels::opaque(gray))
            })
            .collect();
        let Matches { distances, .. } = matches(&views, 100, |_| true, &mut ()).unwrap();
        let mut counts = [[0; 3]; 2];
        for (view, distances) in views.iter().zip(&distances) {
            for (ray, &distance) in view.camera.rays(0..96).map(|ray| ray.unwrap()).zip(distances) {
                let (exact, _) = floor(&random, ray.origin, ray.direction);
                if exact < 5.0 {
                    let [all, known, right] = &mut counts[usize::from(ray.at(exact).y > 0.0)];
                    *all += 1;
                    *known += i32::from(distance > 0.0);
                    *right += i32::from((f64::from(distance) - exact).abs() < 0.02 * exact);
                }
            }
        }
        println!("{counts:?}");
        counts
    }

    #[test]
    fn planes_grow_along_slanted_surfaces_and_over_patterns() {
        let counts = floor_counts(1.0);
        for [all, known, right] in counts {
            assert!(3 * known > 2 * all && 10 * right > 8 * known, "{counts:?}");
        }
    }

    #[test]
    fn planes_of_an_even_change_of_brightness_may_be_anywhere() {
        let random = Random::new(7, "texture");
        // A wall 3 ahead, with texture on one side.
        let color = |at: DVec3| match at.y < 0.0 {
            true => texture(&random, 12.0 * at.y, 12.0 * at.z),
            false => 0.1 + 0.2 * at.y as f32,
        };
        let view = |n: i32| {
            let position = DVec3::new(0.0, 0.6 * f64::from(n - 2), 0.1 * f64::from(n % 2));
            let camera = Camera::looking_at([320, 96], 110.0, position, position + DVec3::X, DVec3::Z);
            let rays = camera.rays(0..96).map(|ray| ray.unwrap());
            let gray = rays.map(|ray| [color(ray.at((3.0 - ray.origin.x) / ray.direction.x)); 3]);
            StereoShot::new(&Photograph::new(n.to_string(), camera, Pixels::opaque(gray)))
        };
        let shots: Vec<StereoShot> = (0..5).map(view).collect();
        let search = DepthSearch::new(&shots[2], [0, 1, 3, 4].into_iter().map(|n| &shots[n]), 3.0, [1.0, 30.0]);
        let [mut textured, mut even] = [[0, 0]; 2];
        for (patch, plane) in search.grow(&search.sweep()).iter().enumerate() {
            let Some(plane) = plane else { continue };
            let y = shots[2].place(patch, plane.depth()).y;
            let counts = if y < 0.0 { &mut textured } else { &mut even };
            counts[usize::from(plane.may_be_anywhere)] += i32::from(y.abs() > 0.3);
        }
        assert!(textured[0] > 100 && 20 * textured[1] < textured[0], "{textured:?}");
        // Steps of 8 bits differ elsewhere.
        assert!(even[1] > 300, "{even:?}");
    }

    #[test]
    fn a_floor_of_little_contrast_is_found_and_one_without_is_not() {
        // A standard deviation of 0.004, of one step of 8 bits.
        let counts = floor_counts(0.02);
        for [all, known, right] in counts {
            assert!(2 * known > all && 10 * right > 8 * known, "{counts:?}");
        }
        assert_eq!(floor_counts(0.001).map(|[_, known, _]| known), [0, 0], "without contrast");
    }

    #[test]
    fn tiles_without_texture_lie_between_their_joints_and_a_hole_is_none_of_them() {
        let random = Random::new(7, "texture");
        // Even gray but for textured joints. Within a circle, photographs show each another gray: nothing that stays.
        let color = |at: DVec3, n: u32| {
            let is_near = |v: f64, joints: &[f64]| joints.iter().any(|joint| (v - joint).abs() < 0.1);
            let joint = is_near(at.x, &[1.2, 1.9, 3.4, 4.5]) || is_near(at.y, &[-2.1, -0.9, 0.2, 1.6]);
            let hole = (at.truncate() - DVec2::new(2.6, 0.9)).length() < 0.5;
            match (hole, joint) {
                (true, _) => [0.1, 0.3, 0.9][n as usize % 3],
                (false, true) => 0.4 * texture(&random, 9.0 * at.x, 9.0 * at.y),
                (false, false) => 0.6,
            }
        };
        let views: Vec<Photograph> = (0..9)
            .map(|n| {
                let position = DVec3::new(0.05 * f64::from(n % 3), 0.25 * (f64::from(n) - 4.0), 1.0);
                let camera = Camera::looking_at([120, 96], 110.0, position, DVec3::new(3.0, 0.0, 0.0), DVec3::Z);
                let gray = camera.rays(0..96).map(|ray| {
                    let ray = ray.unwrap();
                    let reach = -ray.origin.z / ray.direction.z.min(-0.05);
                    [color(ray.at(reach), n); 3]
                });
                Photograph::new(n.to_string(), camera, Pixels::opaque(gray))
            })
            .collect();
        let Matches { distances, .. } = matches(&views, 100, |_| true, &mut ()).unwrap();
        let [mut even, mut known, mut right, mut hole, mut wrong] = [0; 5];
        for ((n, view), distances) in (0..).zip(&views).zip(&distances) {
            for (ray, &distance) in view.camera.rays(0..96).map(|ray| ray.unwrap()).zip(distances) {
                let reach = -ray.origin.z / ray.direction.z;
                if !(0.0..4.5).contains(&reach) {
                    continue;
                }
                let is_right = (f64::from(distance) - reach).abs() < 0.05 * reach;
                if color(ray.at(reach), n) == 0.6 {
                    even += 1;
                    known += i32::from(distance > 0.0);
                    right += i32::from(is_right);
                } else if (ray.at(reach).truncate() - DVec2::new(2.6, 0.9)).length() < 0.4 {
                    hole += 1;
                    wrong += i32::from(distance > 0.0);
                }
            }
        }
        println!("{even} even pixels, {known} known, {right} right; {wrong} of {hole} in the hole");
        assert!(10 * known > 6 * even && 10 * right > 9 * known, "{known} of {even} known, {right} right");
        assert!(hole > 100 && 2 * wrong < hole, "{wrong} of {hole}");
    }

    fn views(lens: Lens) -> Vec<Photograph> {
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
                Photograph::new(n.to_string(), camera, Pixels::opaque(gray))
            })
            .collect()
    }

    fn assert_found(lens: Lens) {
        let views = views(lens);
        let Matches { points, distances } = matches(&views, 100, |_| true, &mut ()).unwrap();
        let off = |point: &DVec3| (point.length() - 1.0).abs().min((point.x + 2.0).abs());
        let wrong = points.iter().filter(|point| off(point) > 0.12).count();
        let on_wall = points.iter().filter(|point| point.x < -1.9).count();
        println!("{} points, {on_wall} on the wall, {wrong} wrong", points.len());
        assert!(points.len() > 1500 && on_wall > 300, "{} points, {on_wall} on the wall", points.len());
        assert!(50 * wrong < points.len(), "{wrong} of {} points are on no surface", points.len());
        let blank = points.iter().filter(|point| point.x < -1.9 && point.y.abs() < 0.5).count();
        assert!(blank > 100, "{blank} points where the wall has no texture");

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
        assert_eq!(matches(&views, 100, |_| true, &mut ()).unwrap().points, []);
        assert_eq!(matches(&views[..1], 100, |_| true, &mut ()).unwrap().points, []);
        assert_eq!(matches(&[], 100, |_| true, &mut ()).unwrap().points, []);
    }
}
