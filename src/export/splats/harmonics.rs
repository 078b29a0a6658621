//! Colors by direction as spherical harmonics.
//!
//! The harmonics are those of the reference implementation of Kerbl et al.: real, with the phase of Condon and Shortley, at
//! the direction from the camera to the splat; a color is 0.5 plus their sum.

use std::f64::consts::PI;

use glam::DVec3;

use super::super::shading::Shader;
use super::super::{Error, Mesh, Space};
use strivec_field::Field;
use strivec_format::geometry::Ray;
use strivec_format::model::{Scene, Sky};

/// Directions that colors are fitted to.
const DIRECTIONS: usize = 64;
/// Splats that are fitted at once.
const AT_ONCE: usize = 1 << 12;

/// Terms of the harmonics up to `degree`.
pub(super) fn terms(degree: u32) -> usize {
    Sky::terms(degree)
}

/// Degree l and order m of each term, in the order of l² + l + m.
pub(super) fn degrees_and_orders(degree: u32) -> impl Iterator<Item = (i32, i32)> {
    (0..=degree as i32).flat_map(|l| (-l..=l).map(move |m| (l, m)))
}

/// The harmonics up to `degree` at the unit vector `direction`.
fn basis(direction: DVec3, degree: u32) -> Vec<f64> {
    let without_phase = Sky::basis(direction);
    degrees_and_orders(degree).zip(without_phase).map(|((_, m), y)| if m % 2 == 0 { y } else { -y }).collect()
}

/// Well-spread unit vectors: the spherical Fibonacci lattice (Keinert et al., "Spherical Fibonacci Mapping", 2015).
fn directions() -> Vec<DVec3> {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let direction = |n: usize| {
        let z = 1.0 - (2 * n + 1) as f64 / DIRECTIONS as f64;
        let (sine, cosine) = (2.0 * PI * (n as f64 / golden).fract()).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cosine, radius * sine, z)
    };
    (0..DIRECTIONS).map(direction).collect()
}

/// \[term\]\[direction\] the map from values at `directions` to the coefficients of least squares.
fn least_squares(directions: &[DVec3], degree: u32) -> Vec<Vec<f64>> {
    let rows: Vec<Vec<f64>> = directions.iter().map(|&direction| basis(direction, degree)).collect();
    let terms = terms(degree);
    // Normal equations, with all right sides beside them, solved by Gauss and Jordan's elimination. The matrix is nearly a
    // multiple of the identity, as the directions are well spread, so no pivot is small.
    let mut equations: Vec<Vec<f64>> = (0..terms)
        .map(|i| {
            let products = (0..terms).map(|j| rows.iter().map(|row| row[i] * row[j]).sum());
            products.chain(rows.iter().map(|row| row[i])).collect()
        })
        .collect();
    for pivot in 0..terms {
        let scale = 1.0 / equations[pivot][pivot];
        equations[pivot].iter_mut().for_each(|value| *value *= scale);
        let row = equations[pivot].clone();
        for (_, other) in equations.iter_mut().enumerate().filter(|(n, _)| *n != pivot) {
            let factor = other[pivot];
            other.iter_mut().zip(&row).for_each(|(value, of_row)| *value -= factor * of_row);
        }
    }
    equations.into_iter().map(|row| row[terms..].to_vec()).collect()
}

/// \[splat\]\[term\] the harmonics of the vertices of `mesh`, which is a surface of `scene` in `space`.
///
/// A splat is seen from outside alone, so a direction from inside has the color of its mirror image at the surface. Then the
/// normal equations are those of the whole sphere, the same for all splats, and the fit is as good as any in terms that are
/// even about the surface, which are complete on the half of the sphere.
///
/// # Errors
///
/// If the scene takes more memory than it may.
pub(super) fn fitted(
    mesh: &Mesh,
    scene: &Scene,
    space: Space,
    degree: u32,
    progress: &dyn Fn(u64, u64),
) -> Result<Vec<[f32; 3]>, Error> {
    let from_model = space.map_from_model(&scene.frame);
    let to_model = from_model.inverse();
    let directions = directions();
    let fit = least_squares(&directions, degree);
    let in_model: Vec<DVec3> = directions.iter().map(|&d| (to_model.rotation * d).normalize()).collect();
    let shader = Shader::new(Field::new(scene)?);
    let toward = |ray: &Ray, n: usize| {
        let along = in_model[n].dot(ray.direction);
        in_model[n] - 2.0 * along.min(0.0) * ray.direction
    };
    let mut coefficients = Vec::with_capacity(mesh.positions.len() * fit.len());
    for first in (0..mesh.positions.len()).step_by(AT_ONCE) {
        let end = mesh.positions.len().min(first + AT_ONCE);
        let rays: Vec<Ray> = (first..end)
            .map(|n| {
                let normal = (to_model.rotation * mesh.normals[n]).normalize();
                shader.ray_against(normal, to_model.point(mesh.positions[n]))
            })
            .collect();
        for colors in shader.colors_toward(&rays, DIRECTIONS, &toward).chunks_exact(DIRECTIONS) {
            coefficients.extend(fit.iter().map(|weights| {
                [0, 1, 2].map(|c| {
                    weights.iter().zip(colors).map(|(w, color)| w * (f64::from(color[c]) - 0.5)).sum::<f64>() as f32
                })
            }));
        }
        progress(end as u64, mesh.positions.len() as u64);
    }
    Ok(coefficients)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_of_each_degree_are_found_exactly() {
        let directions = directions();
        assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        for degree in 0..=3 {
            let fit = least_squares(&directions, degree);
            for (term, weights) in fit.iter().enumerate() {
                for other in 0..terms(degree) {
                    let found: f64 = weights.iter().zip(&directions).map(|(w, &d)| w * basis(d, degree)[other]).sum();
                    assert!(
                        (found - f64::from(u8::from(term == other))).abs() < 1e-12,
                        "{degree}: {term} {other} {found}"
                    );
                }
            }
        }
    }
}
