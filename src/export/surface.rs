//! The surface of a scene's density as a mesh with colors.

use glam::{DVec3, UVec3};

use super::layers::{BLOCK, vertices_of_block};
use super::marching::{MAX_RESOLUTION, NOTHING, march};
use super::mesh::{normals, remove_small_parts};
use super::sampling::{Sampler, farthest};
use super::shading::Shader;
use super::{Error, Mesh, Space};
use strivec_format::geometry::{Aabb, Contraction};
use strivec_format::model::{Rules, Scene};
use strivec_format::{Invalid, Place};

/// Settings of [`surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// Cells along the longest edge of the box around the scene, 2 to 2048.
    pub resolution: u32,
    /// The surface is where a march step has this opacity, more than 0 and less than 1.
    pub alpha: f64,
    /// The space of the mesh.
    pub space: Space,
    /// Connected parts of fewer triangles are removed.
    pub min_triangles: u32,
    /// Unbounded scenes: also export what is outside the inner cube, up to 64 of its half edges away.
    pub surroundings: bool,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self { resolution: 256, alpha: 0.2, space: Space::Dataset, min_triangles: 0, surroundings: false }
    }
}

impl SurfaceOptions {
    fn check(&self) -> Result<(), Error> {
        Error::unless_setting("resolution", 2..=MAX_RESOLUTION, self.resolution)?;
        if self.alpha > 0.0 && self.alpha < 1.0 {
            return Ok(());
        }
        Err(Error::Setting(Invalid::new(Place::option("alpha"), "a number between 0 and 1", self.alpha)))
    }
}

/// The density feature at which a march step has the opacity `alpha` (spec 4.5 and 4.8).
fn feature_of(alpha: f64, rules: &Rules) -> f64 {
    let density = -(-alpha).ln_1p() / (rules.step * rules.distance_scale);
    // The inverse of the softplus.
    let x = if density > 30.0 { density } else { density.exp_m1().ln() };
    x - rules.density_shift
}

/// The surface of `scene`, which must have passed [`Scene::check`], by marching cubes: closed, of shared vertices, with the
/// normals of its triangles and with the colors that it has seen against them. Of an unbounded scene, the cells are cubes
/// of contracted space, and the vertices are mapped back. `progress` receives the number of layers that are sampled, and
/// of all.
///
/// ```
/// use strivec_export::{SurfaceOptions, surface};
///
/// let scene = strivec_format::container::decode(include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/explicit.strivec")))?;
/// let options = SurfaceOptions { resolution: 16, alpha: 0.01, ..SurfaceOptions::default() };
/// let mesh = surface(&scene, &options, &|_, _| {})?;
/// assert_eq!(mesh.positions.len(), mesh.colors.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// If a setting is out of range, no density reaches the threshold, or the surface has too many vertices.
pub fn surface(scene: &Scene, options: &SurfaceOptions, progress: &dyn Fn(u64, u64)) -> Result<Mesh, Error> {
    options.check()?;
    let sampler = Sampler::new(scene, options.surroundings)?;
    let region = sampler.region;
    let pitch = region.size().max_element() / f64::from(options.resolution);
    let cells = (region.size() / pitch).ceil().max(DVec3::ONE);
    // One vertex more on each side, which is outside.
    let origin = region.center() - (0.5 * cells + 1.0) * pitch;
    let position = |vertex: DVec3| origin + vertex * pitch;
    let threshold = feature_of(options.alpha, &scene.rules) as f32;
    let fill = |first: UVec3, levels: &mut [f32]| {
        let around = Aabb::from_points([first, first + (BLOCK as u32 - 1)].map(|vertex| position(vertex.as_dvec3())));
        let positions = vertices_of_block(first).map(|vertex| position(vertex.as_dvec3()));
        sampler.features(&around, positions, levels);
        levels.iter_mut().filter(|level| **level != NOTHING).for_each(|level| *level -= threshold);
    };
    let found = march(cells.as_uvec3() + 3, fill, progress)?;
    let (mut positions, mut triangles) = (found.positions, found.triangles);
    positions.iter_mut().for_each(|p| *p = position(*p));
    remove_small_parts(&mut positions, &mut triangles, options.min_triangles);
    if triangles.is_empty() {
        return Err(Error::NoSurface { alpha: options.alpha });
    }
    if let Some(contraction) = &scene.rules.contraction {
        positions.iter_mut().for_each(|p| *p = expand(contraction, *p));
    }
    let mut normals = normals(&positions, &triangles);
    let colors = colors(sampler, &positions, &normals);
    let map = options.space.map_from_model(&scene.frame);
    positions.iter_mut().for_each(|p| *p = map.point(*p));
    normals.iter_mut().for_each(|n| *n = map.rotation * *n);
    Ok(Mesh { positions, normals, colors, triangles })
}

/// The point of model space whose image is `contracted`, which may be half a cell beyond the exported region.
fn expand(contraction: &Contraction, contracted: DVec3) -> DVec3 {
    let beyond = contracted.abs().max_element() / farthest(contraction);
    contraction.expand(contracted / beyond.max(1.0))
}

/// The colors of vertices in model space, seen against their normals.
fn colors(sampler: Sampler, positions: &[DVec3], normals: &[DVec3]) -> Vec<[f32; 3]> {
    let shader = Shader::new(sampler.field);
    shader.colors(positions.iter().zip(normals).map(|(&point, &normal)| shader.ray_against(normal, point)))
}
