//! 3D Gaussian splats on a surface (Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering", 2023), as
//! PLY, SPZ and SOG.
//!
//! In: a mesh, and the scene that its splats have colors by direction of. Trainers can start from the files, and viewers of
//! splats show them.

mod codebook;
mod harmonics;
mod palette;
mod ply;
mod sog;
mod spz;

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

pub use ply::write_splats;
pub use sog::write_sog;
pub use spz::write_spz;

use super::{Error, Mesh, Space};
use harmonics::terms;
use strivec_format::model::Scene;

/// Standard deviations along the surface, in edges of a square of a vertex's area.
const SPREAD: f64 = 0.5;
/// Standard deviation across the surface, as a share of that along it.
const FLATNESS: f64 = 0.1;
/// The opacity in the middle of a splat.
const OPACITY: f64 = 0.9;
/// Splats of an SPZ or SOG file, as in the reference reader of SPZ.
const MAX_SPLATS: u64 = 10_000_000;
/// The largest degree of the harmonics.
const MAX_DEGREE: u32 = 3;

/// Flat splats on a surface, one for each vertex of a mesh: along the surface, as large as the vertex's part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Splats {
    splats: Vec<Splat>,
    /// Degree of the spherical harmonics, 0 to 3.
    degree: u32,
    /// \[splat\]\[(degree + 1)²\] coefficients of red, green and blue, in the order of l² + l + m.
    coefficients: Vec<[f32; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Splat {
    center: DVec3,
    /// Turns z to the normal of the surface.
    rotation: DQuat,
    /// Standard deviations along the turned axes.
    deviations: [f64; 3],
}

impl Splats {
    /// The splats of `mesh`, which must have triangles, of the vertices' colors in all directions.
    pub fn new(mesh: &Mesh) -> Self {
        // The spherical harmonic of degree 0.
        let harmonic = 0.5 / PI.sqrt();
        let coefficient = |channel: f32| ((f64::from(channel) - 0.5) / harmonic) as f32;
        let splat = |(n, area): (usize, f64)| {
            let along = (SPREAD * area.sqrt()).max(f64::from(f32::MIN_POSITIVE));
            Splat {
                center: mesh.positions[n],
                rotation: DQuat::from_rotation_arc(DVec3::Z, mesh.normals[n]),
                deviations: [along, along, FLATNESS * along],
            }
        };
        Self {
            splats: mesh.areas_of_vertices().into_iter().enumerate().map(splat).collect(),
            degree: 0,
            coefficients: mesh.colors.iter().map(|color| color.map(coefficient)).collect(),
        }
    }

    /// The splats of `mesh`, which is [`surface`](super::surface) of `scene` in `space`, with colors by direction: spherical
    /// harmonics of `degree`, fitted to the colors that the scene's decoder has for directions against the surface. Degree 0
    /// is [`Splats::new`]. `progress` receives the number of splats that are fitted, and of all.
    ///
    /// # Errors
    ///
    /// If `degree` is larger than 3, or the scene takes more memory than it may.
    pub fn with_harmonics(
        mesh: &Mesh,
        scene: &Scene,
        space: Space,
        degree: u32,
        progress: &dyn Fn(u64, u64),
    ) -> Result<Self, Error> {
        Error::unless_setting("harmonics", 0..=MAX_DEGREE, degree)?;
        let flat = Self::new(mesh);
        if degree == 0 {
            return Ok(flat);
        }
        Ok(Self { degree, coefficients: harmonics::fitted(mesh, scene, space, degree, progress)?, ..flat })
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.splats.len()
    }

    /// True if there are no splats.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    /// The coefficients of splat `n` in the order of l² + l + m.
    fn coefficients_of(&self, n: usize) -> &[[f32; 3]] {
        let terms = terms(self.degree);
        &self.coefficients[n * terms..][..terms]
    }
}

/// The number of the component of the largest magnitude, the first of equal ones.
fn largest_component(quaternion: [f64; 4]) -> usize {
    (1..4).fold(0, |best, n| if quaternion[n].abs() > quaternion[best].abs() { n } else { best })
}
