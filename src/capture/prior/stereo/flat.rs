//! Flat surfaces without texture: walls, floors, tables, sheets of paper.
//!
//! Nothing on them can be matched but their borders and what is drawn on them. Planes in space are found through matched patches
//! that have unmatched ones beside them, in all photographs together (RANSAC; Fischler and Bolles, 1981). From matched patches on
//! such a plane, it spreads over unmatched ones up to the edges in the picture, as one of several possibilities (as in the
//! piecewise planar stereo of Gallup, Frahm and Pollefeys, CVPR 2010). Others decide between them.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::MIN_AGREEING;
use super::plane::{Plane, direction};
use super::search::DepthSearch;
use super::seen::Seen;
use super::shot::{PlaneMap, StereoShot};
use strivec_format::random::Random;

/// The distance of a point from a plane on which it is, as a share of its distance from the camera.
const ON_PLANE: f64 = 0.01;
/// The cosine of the angle between a patch and a plane along which it lies.
const ALONG: f64 = 0.85;
/// Points at borders through which planes are sought, at most.
const POINTS: usize = 3000;
/// Planes that are tried, at most, before the best one is taken.
const TRIALS: usize = 6000;
/// The least share of all points at borders that a plane holds, and the least number of them. Planes of less cut through things that are
/// not flat.
const LEAST_SHARE: f64 = 0.12;
const LEAST_POINTS: usize = 24;
/// Planes that are taken, at most: the bits of a [`Possible`].
const MOST: usize = Possible::BITS as usize;
/// The least area of the triangle of three patches that define a plane, as a share of the picture's.
const LEAST_AREA: f64 = 0.005;

/// The difference in luminance of two adjacent patches that is an edge.
const EDGE: f32 = 0.03;
/// The cost of a step across an edge, beside 1 of a step where the picture is even, and the cost up to which a plane spreads from a
/// matched patch: no edge is crossed.
const EDGE_COST: f32 = 100.0;
const REACH: f32 = 80.0;

/// The least patches of a flat surface in a photograph.
const LEAST_PATCHES: usize = 24;
/// The difference, in stops of encoded luminance, within which two photographs of one exposure show the same surface.
const AS_BRIGHT: f32 = 0.25;
/// The difference between the leads of two planes that decides nothing.
const NEARLY_AS_MUCH: i32 = 3;
/// How many times nearer or farther than all that a photograph matches a flat surface may be in it.
const BEYOND: f64 = 1.5;

/// The planes on which a patch may be: a bit for each.
type Possible = u16;

/// A plane in space: the points of which `normal` · point is `offset`.
#[derive(Clone, Copy, Debug)]
struct Flat {
    normal: DVec3,
    offset: f64,
}

impl Flat {
    fn through([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { normal, offset: normal.dot(a) })
    }

    /// The plane of least squares through `points`.
    fn fitted(points: &[DVec3]) -> Option<Self> {
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        let covariance = points.iter().map(|&at| outer(at - middle)).sum::<DMat3>();
        let scale = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
        // Inverse iteration: the direction in which the points extend the least.
        let inverse = (covariance + DMat3::IDENTITY * (1e-9 * scale)).inverse();
        let start = inverse.x_axis + 0.7 * inverse.y_axis + 0.4 * inverse.z_axis;
        let normal = (0..8).try_fold(start.try_normalize()?, |normal, _| (inverse * normal).try_normalize())?;
        Some(Self { normal, offset: normal.dot(middle) })
    }

    /// True if `point` is on this plane, and its patch lies along it.
    fn holds(&self, point: &Point) -> bool {
        (self.normal.dot(point.place) - self.offset).abs() < ON_PLANE * point.distance
            && self.normal.dot(point.normal).abs() > ALONG
    }

    /// This plane before the camera of `shot`, around the picture point `middle`.
    fn seen(&self, shot: &StereoShot, middle: DVec2) -> Plane {
        // Along the axes of the picture: y down, z ahead.
        let axes = shot.camera.world_from_camera * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let normal = axes.transpose() * self.normal / (self.offset - self.normal.dot(shot.camera.position));
        let [fx, fy] = shot.camera.focal;
        let (inverse, slope) = (normal.dot(direction(&shot.camera, middle)), DVec2::new(normal.x / fx, normal.y / fy));
        Plane { inverse, slope, may_be_anywhere: false }
    }
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.x * v, v.y * v, v.z * v)
}

/// A matched patch beside an unmatched one.
#[derive(Clone, Copy)]
struct Point {
    place: DVec3,
    /// The normal of the patch.
    normal: DVec3,
    /// The picture point.
    at: DVec2,
    /// The distance from the camera.
    distance: f64,
    shot: usize,
}

impl Point {
    /// Patch number `patch` of `shot`, which is number `number`, on its `plane`.
    fn of(shot: &StereoShot, patch: usize, plane: Plane, number: usize) -> Self {
        let at = shot.middle(patch);
        let place = shot.place(patch, plane.depth());
        // 1/depth is normal · (x, y, 1) along the axes of the picture, which are those of `Flat::seen`.
        let [fx, fy] = shot.camera.focal;
        let (x, y) = (plane.slope.x * fx, plane.slope.y * fy);
        let across = direction(&shot.camera, at).truncate();
        let normal = DVec3::new(x, y, plane.inverse - across.dot(DVec2::new(x, y)));
        let normal = (shot.camera.world_from_camera * (DVec3::new(1.0, -1.0, -1.0) * normal)).normalize_or_zero();
        Self { place, normal, at, distance: place.distance(shot.camera.position), shot: number }
    }
}

/// \[search\] its planes in `maps`, and flat surfaces that continue them. A patch is on the one of which \[search\] those that it is
/// `compared` with tell most: that they may have it there, too, and show it as bright. None may see through it.
pub(super) fn completed(searches: &[DepthSearch<'_>], maps: Vec<PlaneMap>, compared: &[Vec<usize>]) -> Vec<PlaneMap> {
    let shots: Vec<&StereoShot> = searches.iter().map(|search| search.shot).collect();
    let flats = planes(&shots, &maps);
    if flats.is_empty() {
        return maps;
    }
    let of_shot = |shot: &&StereoShot| (0..shot.patches().iter().product()).map(|n| shot.mean_luminance(n)).collect();
    let luminance: Vec<Vec<f32>> = shots.par_iter().map(of_shot).collect();
    let possible: Vec<Vec<Possible>> =
        (0..shots.len()).into_par_iter().map(|n| possible(shots[n], &maps[n], &luminance[n], &flats)).collect();
    let of_search = |n: usize| -> PlaneMap {
        let (shot, tolerance) = (shots[n], searches[n].tolerance());
        let matched: Vec<f64> = maps[n].iter().flatten().map(|plane| plane.inverse).collect();
        let [farthest, nearest] = [f64::min, f64::max].map(|of| matched.iter().copied().reduce(of).unwrap_or(0.0));
        let range = farthest / BEYOND..nearest * BEYOND;
        // In the order of those compared, how much brighter they are, by what is matched.
        let brighter = |&m: &usize| {
            let of_patch = |(patch, plane): (usize, &Option<Plane>)| {
                let seen = Seen::of(shot.place(patch, (*plane)?.depth()), shots[m])?;
                seen.is_on(&maps[m], tolerance).then(|| luminance[m][seen.number()] / luminance[n][patch])
            };
            median(maps[n].iter().enumerate().filter_map(of_patch).filter(|ratio| ratio.is_finite()).collect())
        };
        let brighter: Vec<f32> = compared[n].iter().map(|m| brighter(m).unwrap_or(f32::NAN)).collect();
        // How many more agree that a patch is on a plane than do not; `None` if it is not there.
        let lead = |patch: usize, flat: usize| -> Option<i32> {
            let plane =
                Some(flats[flat].seen(shot, shot.middle(patch))).filter(|plane| range.contains(&plane.inverse))?;
            let place = shot.place(patch, plane.depth());
            let [mut agreeing, mut others] = [0; 2];
            for (&m, brighter) in compared[n].iter().zip(&brighter) {
                let Some(seen) = Seen::of(place, shots[m]) else { continue };
                match seen.depth_order(&maps[m], tolerance) {
                    Ordering::Greater => return None,
                    Ordering::Less => continue,
                    Ordering::Equal => {}
                }
                let ratio = luminance[m][seen.number()] / (luminance[n][patch] * brighter);
                let is_as_bright = ratio.log2().abs() < AS_BRIGHT;
                let may_be = seen.is_on(&maps[m], tolerance) || possible[m][seen.number()] >> flat & 1 == 1;
                match (is_as_bright, may_be) {
                    (true, true) => agreeing += 1,
                    (true, false) if maps[m][seen.number()].is_none() => {}
                    _ => others += 1,
                }
            }
            (agreeing >= MIN_AGREEING as i32 && agreeing > others).then_some(agreeing - others)
        };
        // Of the planes with nearly the largest lead, the first one holds the most points.
        let flat = |patch: usize| {
            let leads: Vec<Option<i32>> = (0..flats.len()).map(|flat| lead(patch, flat)).collect();
            let most = leads.iter().flatten().max()?;
            leads.iter().position(|lead| lead.is_some_and(|lead| lead + NEARLY_AS_MUCH >= *most))
        };
        let mut found: Vec<Option<usize>> =
            (0..maps[n].len()).map(|patch| if maps[n][patch].is_none() { flat(patch) } else { None }).collect();
        drop_small(&mut found, shot.patches()[0]);
        let plane = |patch: usize| maps[n][patch].or_else(|| Some(flats[found[patch]?].seen(shot, shot.middle(patch))));
        (0..found.len()).map(plane).collect()
    };
    (0..searches.len()).into_par_iter().map(of_search).collect()
}

/// The middle one of `values`.
fn median(mut values: Vec<f32>) -> Option<f32> {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}

/// \[patch\] those of `planes` on which an unmatched patch of `shot` may be: those that reach it from matched ones in `map`.
fn possible(shot: &StereoShot, map: &PlaneMap, luminance: &[f32], planes: &[Flat]) -> Vec<Possible> {
    let mut possible = vec![0; map.len()];
    for (bit, plane) in planes.iter().enumerate() {
        spread(shot, map, luminance, plane, |patch| possible[patch] |= 1 << bit);
    }
    possible
}

/// The planes that hold many points at the borders of what is matched.
fn planes(shots: &[&StereoShot], maps: &[PlaneMap]) -> Vec<Flat> {
    let of_shot = |n: usize| -> Vec<Point> {
        let (shot, map) = (shots[n], &maps[n]);
        let [columns, _] = shot.patches();
        let is_border = |patch: usize| around(patch, columns, map.len()).any(|beside| map[beside].is_none());
        let point = |patch: usize| Some(Point::of(shot, patch, map[patch]?, n)).filter(|_| is_border(patch));
        (0..map.len()).filter_map(point).collect()
    };
    let all: Vec<Point> = (0..shots.len()).into_par_iter().flat_map_iter(of_shot).collect();
    let mut points: Vec<Point> = all.iter().step_by(all.len().div_ceil(POINTS).max(1)).copied().collect();
    let least = ((LEAST_SHARE * points.len() as f64) as usize).max(LEAST_POINTS);
    let mut found = Vec::new();
    while found.len() < MOST && points.len() >= least {
        let Some(best) = best_plane(shots, &points, found.len() as u64) else { break };
        let inliers = |plane: &Flat| -> Vec<DVec3> {
            points.iter().filter(|point| plane.holds(point)).map(|point| point.place).collect()
        };
        let best = (0..3).try_fold(best, |plane, _| Flat::fitted(&inliers(&plane))).unwrap_or(best);
        if inliers(&best).len() < least {
            break;
        }
        points.retain(|point| !best.holds(point));
        found.push(best);
    }
    found
}

/// The plane through three of `points` of one photograph that holds the most points.
fn best_plane(shots: &[&StereoShot], points: &[Point], round: u64) -> Option<Flat> {
    // Points are in the order of their photographs.
    let mut firsts = vec![0; shots.len() + 1];
    points.iter().for_each(|point| firsts[point.shot + 1] += 1);
    (0..shots.len()).for_each(|n| firsts[n + 1] += firsts[n]);
    let random = Random::new(round, "planes");
    let trial = |n: usize| {
        let draw = |k: u64, count: usize| (random.uniform(4 * n as u64 + k) * count as f64) as usize;
        let shot = points[draw(0, points.len())].shot;
        let of_shot = &points[firsts[shot]..firsts[shot + 1]];
        let [a, b, c] = [1, 2, 3].map(|k| of_shot[draw(k, of_shot.len())]);
        let area = 0.5 * (b.at - a.at).perp_dot(c.at - a.at).abs();
        let camera = &shots[shot].camera;
        if area < LEAST_AREA * f64::from(camera.width) * f64::from(camera.height) {
            return None;
        }
        let plane = Flat::through([a.place, b.place, c.place])?;
        let held = points.iter().filter(|point| plane.holds(point)).count();
        Some((held, Reverse(n), plane))
    };
    let trials = (0..TRIALS).into_par_iter().filter_map(trial);
    trials.max_by_key(|&(held, n, _)| (held, n)).map(|(.., plane)| plane)
}

/// Calls `reaches` for each unmatched patch in `map` that `plane` reaches from matched ones on it.
fn spread(shot: &StereoShot, map: &PlaneMap, luminance: &[f32], plane: &Flat, mut reaches: impl FnMut(usize)) {
    let [columns, _] = shot.patches();
    let mut costs = vec![f32::INFINITY; map.len()];
    let mut queue = BinaryHeap::new();
    for (n, matched) in map.iter().enumerate().filter_map(|(n, plane)| Some((n, (*plane)?))) {
        if plane.holds(&Point::of(shot, n, matched, 0)) {
            costs[n] = 0.0;
            queue.push(Reverse((0.0_f32.to_bits(), n)));
        }
    }
    while let Some(Reverse((bits, n))) = queue.pop() {
        if costs[n].to_bits() != bits {
            continue;
        }
        if map[n].is_none() && plane.seen(shot, shot.middle(n)).inverse > 0.0 {
            reaches(n);
        }
        for beside in around(n, columns, map.len()).filter(|&beside| map[beside].is_none()) {
            let change = (luminance[n] - luminance[beside]) / EDGE;
            // Unknown luminances make it NaN, and no comparison true.
            let next = costs[n] + 1.0 + EDGE_COST * change * change;
            if next < costs[beside].min(REACH) {
                costs[beside] = next;
                queue.push(Reverse((next.to_bits(), beside)));
            }
        }
    }
}

/// Drops what is found, in rows of `columns`, where fewer than [`LEAST_PATCHES`] patches of one kind lie side by side.
fn drop_small(found: &mut [Option<usize>], columns: usize) {
    let mut is_done = vec![false; found.len()];
    for first in 0..found.len() {
        if is_done[first] || found[first].is_none() {
            continue;
        }
        let mut those = vec![first];
        is_done[first] = true;
        let mut next = 0;
        while let Some(&n) = those.get(next) {
            next += 1;
            for beside in around(n, columns, found.len()) {
                if !is_done[beside] && found[beside] == found[first] {
                    is_done[beside] = true;
                    those.push(beside);
                }
            }
        }
        if those.len() < LEAST_PATCHES {
            those.iter().for_each(|&n| found[n] = None);
        }
    }
}

/// The patches beside patch number `n` of so many, in rows of `columns`.
fn around(n: usize, columns: usize, count: usize) -> impl Iterator<Item = usize> {
    let left = (!n.is_multiple_of(columns)).then(|| n - 1);
    let right = (!(n + 1).is_multiple_of(columns)).then(|| n + 1).filter(|&n| n < count);
    let above = n.checked_sub(columns);
    let below = Some(n + columns).filter(|&n| n < count);
    [left, right, above, below].into_iter().flatten()
}
