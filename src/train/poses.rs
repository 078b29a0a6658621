//! Refinement of camera poses, and of focal lengths, while a scene trains.
//!
//! Every so many steps, each photograph's camera takes a damped Gauss-Newton step toward the pose at which the scene looks
//! most like the photograph, on random pixels. Steps of second order are few, and the field needs no derivative by
//! position, which jumps between cells. The derivatives of colors by the pose are central differences of rendered
//! colors, half a pixel to either side: they are exact where factors are linear, smooth out what is finer than a pixel,
//! and need nothing of the field but its colors. Focal lengths grow by one factor for all photographs, which is found
//! with the poses eliminated: a camera that zooms out and moves closer sees nearly the same.

use glam::{DMat3, DVec3};

use super::RaySampler;
use super::chunk::Target;
use super::rays::colors;
use strivec_field::Field;
use strivec_format::color_map::ColorMap;
use strivec_format::geometry::{Camera, Ray};
use strivec_format::random::Random;

/// Rounds of refinement, spread over the steps; training ends with some shares of its steps without any.
const ROUNDS: u64 = 16;
const LAST_SHARES: u64 = 4;
/// Pixels of a photograph in a round.
const PIXELS: u64 = 256;
/// Errors of colors above this count linearly (Huber).
const ROBUST: f64 = 0.1;
/// The damping: the share of the diagonal that is added to it.
const DAMPING: f64 = 0.05;
/// The longest move of a round, in pixels.
const MAX_MOVE: f64 = 4.0;

/// A move of a camera in its own axes, in lengths of half a pixel: a rotation vector, a translation, and the growth of its
/// focal lengths, which is that of all cameras.
type Move = [f64; 7];
const GROWTH: usize = 6;
/// The normal equations of a move: \[row\]\[column, then right side\].
type System = [[f64; 8]; 7];

/// True if a round follows step number `step` of `steps`.
pub(super) fn is_due(step: u64, steps: u64) -> bool {
    let every = (steps / (ROUNDS + LAST_SHARES)).max(1);
    step.is_multiple_of(every) && step / every <= ROUNDS
}

/// One round: the moved cameras of `sampler`'s photographs, in the model's space, whose colors `maps` map. `distance` is
/// that of the scene from a camera, about. If `growing`, focal lengths change too, all by one factor.
pub(super) fn refined(
    field: &Field<f32>,
    sampler: &RaySampler<'_>,
    maps: &[ColorMap],
    distance: f64,
    growing: bool,
    random: &Random,
) -> Vec<Camera> {
    let first = sampler.camera(0);
    let growth_unit = 1.0 / f64::from(first.width).hypot(f64::from(first.height));
    let refinements: Vec<Refinement<'_>> = (0..sampler.view_count())
        .map(|view| {
            let camera = *sampler.camera(view);
            let pixels = sampler.sample(view, &random.substream(view as u64), PIXELS);
            Refinement { field, pixels, map: maps.get(view), camera, distance, growth_unit }
        })
        .collect();
    let steps: Vec<PoseEquations> = refinements.iter().map(|refinement| refinement.step(growing)).collect();
    if let Some(growth) = common_growth(&steps) {
        let grown = refinements.iter().zip(&steps).map(|(refinement, step)| refinement.best(step, growth));
        let (cameras, costs): (Vec<_>, Vec<_>) = grown.unzip();
        let keeps_rays = || refinements.iter().zip(&cameras).all(|(r, camera)| sees_as_much(camera, &r.camera));
        // One factor for all photographs, as a capture mostly has one zoom; it is kept only if all together fit
        // better.
        if costs.iter().sum::<f64>() < steps.iter().map(|step| step.cost).sum() && keeps_rays() {
            return cameras;
        }
    }
    refinements.iter().zip(&steps).map(|(refinement, step)| refinement.best(step, 0.0).0).collect()
}

/// The growth of all focal lengths, if the poses follow it; `None` if it is zero.
fn common_growth(steps: &[PoseEquations]) -> Option<f64> {
    let rows = steps.iter().filter_map(|step| step.reduced.map(|reduced| reduced[GROWTH]));
    let (curvature, slope) = rows.fold((0.0, 0.0), |(c, s), row| (c + row[GROWTH], s + row[7]));
    (curvature > 0.0 && slope != 0.0).then(|| (slope / curvature).clamp(-2.0 * MAX_MOVE, 2.0 * MAX_MOVE))
}

/// True if every pixel of which `old` has a ray has one of `new`.
fn sees_as_much(new: &Camera, old: &Camera) -> bool {
    let Some(seen) = new.seen_pixels() else { return true };
    old.seen_pixels().is_some_and(|was| was.iter().zip(seen).all(|(was, is)| is || !was))
}

/// A photograph, the camera that it is compared at, and the pixels.
struct Refinement<'a> {
    field: &'a Field<f32>,
    /// (column, row, target)
    pixels: Vec<(u32, u32, Target)>,
    map: Option<&'a ColorMap>,
    camera: Camera,
    distance: f64,
    /// The share by which focal lengths grow with a move of half a pixel, at the corner of a picture.
    growth_unit: f64,
}

/// A photograph's cost and normal equations at its camera.
struct PoseEquations {
    /// The cost where the camera is.
    cost: f64,
    /// The equations solved for the pose in terms of the growth; `None` if no move makes the photograph more alike.
    reduced: Option<System>,
}

impl Refinement<'_> {
    fn step(&self, growing: bool) -> PoseEquations {
        let here = self.differences(&self.camera);
        let parameters = if growing { 7 } else { GROWTH };
        let sides: Vec<[Vec<[f64; 3]>; 2]> = (0..parameters)
            .map(|axis| {
                [1.0, -1.0].map(|side| {
                    let mut by = [0.0; 7];
                    by[axis] = side;
                    self.differences(&self.moved(&by))
                })
            })
            .collect();
        let mut system: System = [[0.0; 8]; 7];
        for (n, difference) in here.iter().enumerate() {
            for channel in 0..3 {
                let weight = (ROBUST / difference[channel].abs()).min(1.0);
                let mut slopes: Move = [0.0; 7];
                for (slope, [above, below]) in slopes.iter_mut().zip(&sides) {
                    *slope = 0.5 * (above[n][channel] - below[n][channel]);
                }
                for (row, slope) in system.iter_mut().zip(slopes) {
                    row[..7].iter_mut().zip(slopes).for_each(|(sum, other)| *sum += weight * slope * other);
                    row[7] -= weight * slope * difference[channel];
                }
            }
        }
        // A direction without any slope would make the system singular.
        let floor = 1e-6 * (0..GROWTH).map(|i| system[i][i]).fold(0.0, f64::max);
        for (i, row) in system.iter_mut().enumerate().take(parameters) {
            row[i] += DAMPING * row[i] + floor;
        }
        PoseEquations { cost: cost(&here), reduced: reduced(system) }
    }

    /// The best camera after a growth of its focal lengths, moved by `step` or not, and its cost.
    fn best(&self, step: &PoseEquations, growth: f64) -> (Camera, f64) {
        let mut by = [0.0; 7];
        by[GROWTH] = growth;
        let still = self.moved(&by);
        let still_cost = if growth == 0.0 { step.cost } else { cost(&self.differences(&still)) };
        let Some(reduced) = step.reduced else { return (still, still_cost) };
        let pose = &mut by[..GROWTH];
        pose.iter_mut().zip(&reduced).for_each(|(v, row)| *v = row[7] - row[GROWTH] * growth);
        // At most some pixels, as far as the linear model holds.
        let length = pose.iter().map(|v| v * v).sum::<f64>().sqrt();
        pose.iter_mut().for_each(|v| *v *= (2.0 * MAX_MOVE / length).min(1.0));
        let moved = self.moved(&by);
        let moved_cost = cost(&self.differences(&moved));
        // A linear step may overshoot, so it is taken only if it fits better.
        if moved_cost < still_cost { (moved, moved_cost) } else { (still, still_cost) }
    }

    fn moved(&self, by: &Move) -> Camera {
        let half_pixel = 1.0 / (self.camera.focal[0] + self.camera.focal[1]);
        let turn = half_pixel * DVec3::new(by[0], by[1], by[2]);
        let shift = half_pixel * self.distance * DVec3::new(by[3], by[4], by[5]);
        let axes = self.camera.world_from_camera;
        let turned = DMat3::from_quat(glam::DQuat::from_scaled_axis(turn));
        Camera {
            world_from_camera: axes * turned,
            position: self.camera.position + axes * shift,
            focal: self.camera.focal.map(|focal| focal * (1.0 + self.growth_unit * by[GROWTH])),
            ..self.camera
        }
    }

    /// \[pixel\] by how much the scene's color, as `camera` sees it, differs from the photograph's; zero where it sees none.
    fn differences(&self, camera: &Camera) -> Vec<[f64; 3]> {
        let seen: Vec<(Ray, &Target)> = (self.pixels.iter())
            .filter_map(|(column, row, target)| Some((camera.ray(*column, *row)?, target)))
            .collect();
        let rays: Vec<Ray> = seen.iter().map(|(ray, _)| *ray).collect();
        let found = colors(self.field, &rays, |ray| seen[ray].1.background);
        let difference = |(color, (_, target)): (&[f32; 3], &(Ray, &Target))| {
            let color = color.map(f64::from);
            let seen = self.map.map_or(color, |map| map.apply(color));
            [0, 1, 2].map(|c| seen[c] - f64::from(target.color[c]))
        };
        found.iter().zip(&seen).map(difference).collect()
    }
}

/// Σ of Huber's function of the differences.
fn cost(differences: &[[f64; 3]]) -> f64 {
    let huber = |d: &f64| if d.abs() < ROBUST { 0.5 * d * d } else { ROBUST * (d.abs() - 0.5 * ROBUST) };
    differences.iter().flatten().map(huber).sum()
}

/// The `system`, solved for the six numbers of a pose: its rows are those numbers, with a column for the growth, and its last
/// row is what remains for the growth. `None` if it is singular.
fn reduced(mut system: System) -> Option<System> {
    for pivot in 0..GROWTH {
        if system[pivot][pivot].is_nan() || system[pivot][pivot] <= 0.0 {
            return None;
        }
        let row = system[pivot].map(|v| v / system[pivot][pivot]);
        system[pivot] = row;
        for other in (0..system.len()).filter(|&other| other != pivot) {
            let factor = system[other][pivot];
            system[other].iter_mut().zip(row).for_each(|(v, p)| *v -= factor * p);
        }
    }
    system.as_flattened().iter().all(|v| v.is_finite()).then_some(system)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positive_definite_systems_are_solved_and_singular_ones_are_not() {
        let random = Random::new(1, "system");
        let rows: [Move; 9] = std::array::from_fn(|r| std::array::from_fn(|c| random.normal((7 * r + c) as u64)));
        let expected: Move = std::array::from_fn(|c| c as f64 - 2.5);
        let product = |a: usize, b: usize| rows.iter().map(|row| row[a] * row[b]).sum::<f64>();
        let system: System = std::array::from_fn(|r| {
            let right = (0..7).map(|c| product(r, c) * expected[c]).sum();
            std::array::from_fn(|c| if c < 7 { product(r, c) } else { right })
        });
        let found = reduced(system).unwrap();
        let growth = found[GROWTH][7] / found[GROWTH][GROWTH];
        let pose = found.iter().take(GROWTH).map(|row| row[7] - row[GROWTH] * growth);
        assert!(pose.chain([growth]).zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        assert_eq!(reduced([[0.0; 8]; 7]), None);
    }

    #[test]
    fn rounds_are_spread_over_the_first_steps() {
        for steps in [30_u64, 600, 30_000] {
            let due: Vec<u64> = (1..=steps).filter(|&step| is_due(step, steps)).collect();
            assert_eq!(due.len() as u64, ROUNDS, "{steps}");
            assert!(due[due.len() - 1] <= steps * 8 / 10 && due[0] <= steps / 20);
        }
    }
}
