//! A synthetic scene for measurements: a soft ball with the tensors of a preset, made without training.
//!
//! The density feature is a Gaussian around the origin, which is a product of a function of x, y and z each: the first
//! component of scale 0 holds it exactly at every tensor, for any weights of its neighbors. Rays therefore end a few
//! dozen samples inside a surface, as in a trained scene. All other factors are the random ones that training starts
//! from. Tensors lie on a shell around the surface, as sparse as on a solid object.

use glam::{DVec3, UVec3};

use strivec_capture::dataset::{Photograph, Pixels};
use strivec_capture::prior;
use strivec_capture::prior::{ScaleShape, VoxelBoxes};
use strivec_format::geometry::{Aabb, Camera, Lattice, Similarity};
use strivec_format::model::{ColorSpace, Form, Frame, Occupancy, Scale, Scene, UpAxis};
use strivec_train::{PrepareError, TrainConfig, initial_scene};

/// The ball's radius in model units, at which the feature equals the density's shift.
const RADIUS: f64 = 0.9;
/// The feature at the center, in shifts; it sets the sharpness of the surface.
const PEAK_IN_SHIFTS: f64 = 3000.0;
/// The radii between which tensors are placed.
const SHELL: [f64; 2] = [0.75, 1.0];
/// Radius of the occupied space. The density is almost 0 before it, so that more samples are evaluated than colored, as
/// in a trained scene.
const OCCUPIED_RADIUS: f64 = 1.0;
/// Edge of the voxels on which tensors are placed.
const VOXEL: f64 = 0.025;
/// The cameras' distance in model units, and their focal length in picture widths.
const DISTANCE: f64 = 4.0;
const FOCAL: f64 = 1.39;

/// A ball of `config`'s tensors, at the resolution after `upsampled` upsamplings.
///
/// # Errors
///
/// If `config` has no tensors, or they cannot cover the ball.
pub fn ball(config: &TrainConfig, upsampled: usize) -> Result<Scene, PrepareError> {
    let boxes = shell(VOXEL);
    let mut config = config.clone();
    for scale in &mut config.scales {
        // The resolution stays the same after the last upsampling.
        let resolution = scale.resolutions.get(upsampled).or(scale.resolutions.last()).copied();
        scale.resolutions = vec![resolution.unwrap_or([1; 3])];
    }
    let clouds = (config.scales.iter())
        .map(|s| {
            prior::place_on_boxes(&boxes, &ScaleShape { pitch: s.pitch, edge: s.edge, resolution: s.resolutions[0] })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let frame = Frame {
        model_from_dataset: Similarity::IDENTITY,
        up: UpAxis::Z,
        meters_per_unit: None,
        near: DISTANCE - 2.0,
        far: DISTANCE + 2.0,
        background: config.photographs.background,
        color_space: ColorSpace::Srgb,
    };
    let mut scene = initial_scene(&config, clouds, frame, "ball")?;
    let peak = -PEAK_IN_SHIFTS * scene.rules.density_shift;
    if let Some(coarsest) = scene.scales.first_mut() {
        write_gaussian(coarsest, peak);
    }
    scene.bounds = Aabb::around(DVec3::ZERO, DVec3::splat(OCCUPIED_RADIUS)).intersection(&scene.bounds);
    scene.occupancy = Some(occupancy(scene.bounds, scene.scales[0].cloud.cell_size()));
    scene.check()?;
    Ok(scene)
}

/// `count` gray photographs of `size`×`size` pixels around the ball. The time of a step does not depend on their colors.
pub fn ball_views(count: u32, size: u32) -> Vec<Photograph> {
    (0..count)
        .map(|n| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(n) / f64::from(count)).sin_cos();
            let position = DISTANCE * DVec3::new(0.8 * cos, 0.8 * sin, 0.6);
            let camera = Camera::looking_at([size; 2], FOCAL * f64::from(size), position, DVec3::ZERO, DVec3::Z);
            Photograph::new(n.to_string(), camera, Pixels::opaque(vec![[0.5; 3]; size as usize * size as usize]))
        })
        .collect()
}

/// The voxels of edge `voxel` whose centers are in the shell around the ball's surface.
fn shell(voxel: f64) -> VoxelBoxes {
    let cells = (2.0 * SHELL[1] / voxel).ceil() as u32;
    let lattice = Lattice { origin: DVec3::splat(-0.5 * f64::from(cells) * voxel), pitch: DVec3::splat(voxel) };
    let inside = |cell: &UVec3| {
        let radius = (lattice.origin + (cell.as_dvec3() + 0.5) * voxel).length();
        (SHELL[0]..=SHELL[1]).contains(&radius)
    };
    let all = (0..cells).flat_map(|z| (0..cells).flat_map(move |y| (0..cells).map(move |x| UVec3::new(x, y, z))));
    VoxelBoxes { lattice, cells: all.filter(inside).collect() }
}

/// Makes the first density component of `scale` a Gaussian of height `peak` that is `peak / PEAK_IN_SHIFTS` at the ball's surface.
fn write_gaussian(scale: &mut Scale, peak: f64) {
    let exponent = PEAK_IN_SHIFTS.ln() / (RADIUS * RADIUS);
    let cloud = &scale.cloud;
    let (half_edge, cell, resolution) = (cloud.half_edge, cloud.cell_size(), cloud.resolution);
    let block = &mut scale.factors.density[0];
    let (rank, tensor_len) = (block.rank as usize, block.tensor_len(resolution));
    for (values, center) in block.values.chunks_exact_mut(tensor_len).zip(scale.cloud.centers()) {
        let gaussian = |axis: usize, vertex: u32| {
            let x = center[axis] - half_edge[axis] + f64::from(vertex) * cell[axis];
            peak.cbrt() * (-exponent * x * x).exp()
        };
        let along = |axis: usize| (0..=resolution[axis]).map(move |vertex| gaussian(axis, vertex));
        let rows: Vec<f64> = match block.form {
            Form::Cp => (0..3).flat_map(along).collect(),
            Form::Vm(axis) => {
                let [first, second] = Form::matrix_axes(axis);
                let matrix = along(second).flat_map(|of_second| along(first).map(move |of_first| of_first * of_second));
                along(axis).chain(matrix).collect()
            }
        };
        values.iter_mut().step_by(rank).zip(rows).for_each(|(value, row)| *value = row as f32);
    }
}

/// The occupancy of the ball, on cells of about `cell`.
fn occupancy(bounds: Aabb, cell: DVec3) -> Occupancy {
    let vertices = (bounds.size() / cell).ceil().max(DVec3::splat(2.0)).as_uvec3();
    let mut occupancy = Occupancy::empty(bounds, vertices);
    for z in 0..vertices.z {
        for y in 0..vertices.y {
            for x in 0..vertices.x {
                let vertex = UVec3::new(x, y, z);
                if occupancy.position(vertex).length_squared() <= OCCUPIED_RADIUS * OCCUPIED_RADIUS {
                    occupancy.set(vertex);
                }
            }
        }
    }
    occupancy
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_field::render::{CpuRenderer, Renderer};
    use strivec_format::model::FactorKind;

    fn config() -> TrainConfig {
        let mut config = TrainConfig::preset("12").unwrap();
        // Two scales and few components keep this quick.
        config.scales.truncate(2);
        config.scales.iter_mut().for_each(|s| (s.density_rank, s.appearance_rank) = (4, 2));
        config
    }

    #[test]
    fn the_ball_is_solid_within_its_radius_and_nothing_is_far_outside() {
        for kind in [FactorKind::Cp, FactorKind::Vm] {
            let mut config = config();
            config.scales.iter_mut().for_each(|scale| scale.factors = kind);
            let scene = ball(&config, 0).unwrap();
            let renderer = CpuRenderer::unlimited(&scene);
            let view = &ball_views(4, 33)[1];
            let picture = renderer.render(&view.camera);
            let opacity = |column: usize, row: usize| picture.pixels[row * 33 + column].opacity;
            assert!(opacity(16, 16) > 0.999, "{kind:?}: {}", opacity(16, 16));
            assert_eq!(opacity(0, 0), 0.0);
            let depth = picture.pixels[16 * 33 + 16].depth;
            assert!((f64::from(depth) - (DISTANCE - RADIUS)).abs() < 0.1, "{kind:?}: {depth}");
        }
    }

    #[test]
    fn each_upsampling_makes_it_finer_and_the_last_stays() {
        let steps = [0, 1, 5, 9].map(|n| ball(&config(), n).unwrap().rules.step);
        assert!(steps[0] > steps[1] && steps[1] > steps[2], "{steps:?}");
        assert_eq!(steps[2], steps[3]);
    }
}
