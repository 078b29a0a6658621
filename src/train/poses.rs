//! Refinement of camera poses while a scene trains.
//!
//! Every so many steps, each photograph's camera takes a damped Gauss-Newton step toward the pose at which the scene looks
//! most like the photograph, on random pixels. The derivatives of colors by the pose are central differences of rendered
//! colors, half a pixel to either side: they are exact where factors are linear, smooth out what is finer than a pixel,
//! and need nothing of the field but its colors.

use glam::{DMat3, DVec3};

use super::RaySampler;
use super::chunk::Target;
use super::rays::colors;
use crate::color_map::ColorMap;
use crate::field::Field;
use crate::geometry::{Camera, Ray};
use crate::random::Random;

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

/// A move of a camera in its own axes: a rotation vector, then a translation, both in lengths of half a pixel.
type Move = [f64; 6];

/// True if a round follows step number `step` of `steps`.
pub(super) fn is_due(step: u64, steps: u64) -> bool {
    let every = (steps / (ROUNDS + LAST_SHARES)).max(1);
    step.is_multiple_of(every) && step / every <= ROUNDS
}

/// One round: the moved cameras of `sampler`'s photographs, in the model's space, whose colors `maps` map. `distance` is
/// that of the scene from a camera, about.
pub(super) fn refined(
    field: &Field<f32>,
    sampler: &RaySampler<'_>,
    maps: &[ColorMap],
    distance: f64,
    random: &Random,
) -> Vec<Camera> {
    (0..sampler.view_count())
        .map(|view| {
            let camera = *sampler.camera(view);
            let pixels = sampler.sample(view, &random.substream(view as u64), PIXELS);
            let refinement = Refinement { field, pixels, map: maps.get(view), camera, distance };
            refinement.step().unwrap_or(camera)
        })
        .collect()
}

/// A photograph, the camera that it is compared at, and the pixels.
struct Refinement<'a> {
    field: &'a Field<f32>,
    /// (column, row, target)
    pixels: Vec<(u32, u32, Target)>,
    map: Option<&'a ColorMap>,
    camera: Camera,
    distance: f64,
}

impl Refinement<'_> {
    /// The camera after one step; `None` if no step makes the photograph more alike.
    fn step(&self) -> Option<Camera> {
        if self.pixels.is_empty() {
            return None;
        }
        let sides: Vec<[Vec<[f64; 3]>; 2]> = (0..6)
            .map(|axis| {
                [1.0, -1.0].map(|side| {
                    let mut by = [0.0; 6];
                    by[axis] = side;
                    self.differences(&self.moved(&by))
                })
            })
            .collect();
        let here = self.differences(&self.camera);
        let mut system = [[0.0; 7]; 6];
        for (n, difference) in here.iter().enumerate() {
            for channel in 0..3 {
                let weight = (ROBUST / difference[channel].abs()).min(1.0);
                let slopes: Move =
                    std::array::from_fn(|axis| 0.5 * (sides[axis][0][n][channel] - sides[axis][1][n][channel]));
                for (row, slope) in system.iter_mut().zip(slopes) {
                    row[..6].iter_mut().zip(slopes).for_each(|(sum, other)| *sum += weight * slope * other);
                    row[6] -= weight * slope * difference[channel];
                }
            }
        }
        let floor = 1e-6 * (0..6).map(|i| system[i][i]).fold(0.0, f64::max);
        for (i, row) in system.iter_mut().enumerate() {
            row[i] += DAMPING * row[i] + floor;
        }
        let mut by = solved(system)?;
        let length = by.iter().map(|v| v * v).sum::<f64>().sqrt();
        by.iter_mut().for_each(|v| *v *= (2.0 * MAX_MOVE / length).min(1.0));
        let moved = self.moved(&by);
        (cost(&self.differences(&moved)) < cost(&here)).then_some(moved)
    }

    fn moved(&self, by: &Move) -> Camera {
        let half_pixel = 1.0 / (self.camera.focal[0] + self.camera.focal[1]);
        let turn = half_pixel * DVec3::new(by[0], by[1], by[2]);
        let shift = half_pixel * self.distance * DVec3::new(by[3], by[4], by[5]);
        let axes = self.camera.world_from_camera;
        let turned = DMat3::from_quat(glam::DQuat::from_scaled_axis(turn));
        Camera { world_from_camera: axes * turned, position: self.camera.position + axes * shift, ..self.camera }
    }

    /// \[pixel\] by how much the scene's color, as `camera` sees it, differs from the photograph's.
    fn differences(&self, camera: &Camera) -> Vec<[f64; 3]> {
        let rays: Vec<Ray> = (self.pixels.iter())
            .map(|&(column, row, _)| camera.ray(column, row).expect("active pixels have a ray"))
            .collect();
        let found = colors(self.field, &rays, |ray| self.pixels[ray].2.background);
        let difference = |(color, (.., target)): (&[f32; 3], &(u32, u32, Target))| {
            let color = color.map(f64::from);
            let seen = self.map.map_or(color, |map| map.apply(color));
            [0, 1, 2].map(|c| seen[c] - f64::from(target.color[c]))
        };
        found.iter().zip(&self.pixels).map(difference).collect()
    }
}

/// Σ of Huber's function of the differences.
fn cost(differences: &[[f64; 3]]) -> f64 {
    let huber = |d: &f64| if d.abs() < ROBUST { 0.5 * d * d } else { ROBUST * (d.abs() - 0.5 * ROBUST) };
    differences.iter().flatten().map(huber).sum()
}

/// The solution of the positive definite system \[row\]\[column, then right side\]; `None` if it is singular.
fn solved(mut system: [[f64; 7]; 6]) -> Option<Move> {
    for pivot in 0..6 {
        if system[pivot][pivot].is_nan() || system[pivot][pivot] <= 0.0 {
            return None;
        }
        let row = system[pivot].map(|v| v / system[pivot][pivot]);
        system[pivot] = row;
        for other in (0..6).filter(|&other| other != pivot) {
            let factor = system[other][pivot];
            system[other].iter_mut().zip(row).for_each(|(v, p)| *v -= factor * p);
        }
    }
    let solution = system.map(|row| row[6]);
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positive_definite_systems_are_solved_and_singular_ones_are_not() {
        let random = Random::new(1, "system");
        let rows: [Move; 8] = std::array::from_fn(|r| std::array::from_fn(|c| random.normal((6 * r + c) as u64)));
        let expected: Move = std::array::from_fn(|c| c as f64 - 2.5);
        let product = |a: usize, b: usize| rows.iter().map(|row| row[a] * row[b]).sum::<f64>();
        let system: [[f64; 7]; 6] = std::array::from_fn(|r| {
            let right = (0..6).map(|c| product(r, c) * expected[c]).sum();
            std::array::from_fn(|c| if c < 6 { product(r, c) } else { right })
        });
        let found = solved(system).unwrap();
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        assert_eq!(solved([[0.0; 7]; 6]), None);
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
