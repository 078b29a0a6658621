//! Checkpoints of DVGO: Sun et al., "Direct Voxel Grid Optimization", 2022, its coarse stage.
//!
//! Densities and colors are at the vertices of a grid over a box, interpolated before their activations. The color has no
//! direction. A density d has the opacity 1 − exp(−softplus(d + `act_shift`)) over the edge of a voxel.

use glam::{DVec3, UVec3};

use super::layers::{BLOCK, for_each_layer, vertices_of_block};
use super::marching::NOTHING;
use super::sampling::Sampler;
use super::shading::{Shader, ray_against};
use super::{Error, Space};
use strivec_checkpoints::Value;
use strivec_format::geometry::{Aabb, Similarity};
use strivec_format::model::{Scene, softplus};

/// The most voxels; while they are computed, each takes 21 bytes.
const MAX_VOXELS: u64 = 1 << 26;
/// The opacity over a voxel's edge of a density of 0, DVGO's `alpha_init`: that of empty voxels.
const EMPTY_ALPHA: f64 = 1e-6;
/// Voxels beside one of this opacity have colors; the mask excludes all others.
const MIN_ALPHA: f64 = 1e-4;
/// Colors stay this far from 0 and 1, where their logit is infinite.
const COLOR_MARGIN: f32 = 1e-3;

/// Settings of [`dvgo_checkpoint`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DvgoOptions {
    /// Voxels along the longest edge, 2 to 1024.
    pub resolution: u32,
    /// The space of the grid, whose axes are those of the space.
    pub space: Space,
}

impl Default for DvgoOptions {
    fn default() -> Self {
        Self { resolution: 160, space: Space::Dataset }
    }
}

/// The voxels of a DVGO model.
struct DvgoGrid {
    bounds: Aabb,
    voxels: UVec3,
    /// DVGO's voxel edge, which it derives from `bounds` and [`DvgoGrid::num_voxels`].
    edge: f64,
}

impl DvgoGrid {
    /// A grid over `within`. DVGO takes as many voxels as their edge fits into the box, rounded down. With half an edge
    /// more on each axis, rounding does not change their number.
    fn new(within: &Aabb, resolution: u32) -> Self {
        let edge = within.size().max_element() / f64::from(resolution - 1);
        let voxels = (within.size() / edge - 1e-9).ceil().max(DVec3::ONE) + 1.0;
        let bounds = Aabb::around(within.center(), 0.5 * (voxels + 0.5) * edge);
        Self { bounds, voxels: voxels.as_uvec3(), edge }
    }

    fn num_voxels(&self) -> i64 {
        (self.voxels.as_dvec3() + 0.5).element_product().round() as i64
    }

    fn position(&self, voxel: UVec3) -> DVec3 {
        self.bounds.min + voxel.as_dvec3() / (self.voxels - 1).as_dvec3() * self.bounds.size()
    }

    fn count(&self) -> usize {
        self.voxels.as_u64vec3().element_product() as usize
    }

    /// The place of `voxel` in an array \[x\]\[y\]\[z\].
    fn index(&self, voxel: UVec3) -> usize {
        let [x, y, z] = voxel.to_array().map(|n| n as usize);
        (x * self.voxels.y as usize + y) * self.voxels.z as usize + z
    }

    /// The voxel of the place `index`.
    fn voxel(&self, index: usize) -> UVec3 {
        let [rows, columns] = [self.voxels.y, self.voxels.z].map(|n| n as usize);
        UVec3::new((index / columns / rows) as u32, (index / columns % rows) as u32, (index % columns) as u32)
    }

    /// The voxels of `step` before and after `voxel` on an axis, those at the border instead of one beyond.
    fn beside(&self, voxel: UVec3, axis: UVec3) -> [UVec3; 2] {
        [voxel.saturating_sub(axis), (voxel + axis).min(self.voxels - 1)]
    }
}

/// The content of a DVGO checkpoint of `scene`, which must have passed [`Scene::check`], for [`strivec_checkpoints::write_checkpoint`]: a
/// `DirectVoxGO` model with a dense density grid and a dense grid of three colors, without a network. Of an unbounded scene
/// it holds the inner cube. `progress` receives the number of layers that are sampled, and of all.
///
/// # Errors
///
/// If the resolution is out of range, the grid is too large, or the scene is empty.
pub fn dvgo_checkpoint(
    scene: &Scene,
    options: &DvgoOptions,
    progress: &dyn Fn(u64, u64),
) -> Result<Value<'static>, Error> {
    Error::unless_setting("resolution", 2..=1024, options.resolution)?;
    let sampler = Sampler::new(scene, false)?;
    let from_model = options.space.map_from_model(&scene.frame);
    let to_model = from_model.inverse();
    let corners = sampler.region.corners().map(|corner| from_model.point(corner));
    let grid = DvgoGrid::new(&Aabb::from_points(corners), options.resolution);
    Error::unless_within("voxels", MAX_VOXELS, grid.count() as u64)?;
    let depths = optical_depths(&sampler, &grid, &to_model, progress);
    let shift = (EMPTY_ALPHA / (1.0 - EMPTY_ALPHA)).ln();
    let mask = mask(&grid, &depths);
    let colors = colors(sampler, &grid, &to_model, &depths, &mask);
    let density = depths.into_iter().map(|depth| density_of(depth, shift)).collect();
    Ok(checkpoint(&grid, shift, density, colors, mask))
}

/// \[x\]\[y\]\[z\] the optical depth over a voxel's edge.
fn optical_depths(sampler: &Sampler, grid: &DvgoGrid, to_model: &Similarity, progress: &dyn Fn(u64, u64)) -> Vec<f32> {
    let rules = &sampler.field.rules;
    let edge = grid.edge * to_model.scale * rules.distance_scale;
    let in_model = |voxel: UVec3| to_model.point(grid.position(voxel));
    let fill = |first: UVec3, depths: &mut [f32]| {
        let (from, to) = (grid.position(first), grid.position(first + (BLOCK as u32 - 1)));
        let corners = Aabb { min: from, max: to }.corners().map(|corner| to_model.point(corner));
        sampler.features(&Aabb::from_points(corners), vertices_of_block(first).map(in_model), depths);
        for depth in depths {
            let density = if *depth == NOTHING { 0.0 } else { softplus(f64::from(*depth) + rules.density_shift) };
            *depth = (density * edge) as f32;
        }
    };
    let mut depths = vec![0.0; grid.count()];
    let taken = for_each_layer::<std::convert::Infallible>(grid.voxels, fill, progress, |z, layer| {
        for (n, depth) in layer.iter().enumerate() {
            let (x, y) = (n as u32 % grid.voxels.x, n as u32 / grid.voxels.x);
            depths[grid.index(UVec3::new(x, y, z))] = *depth;
        }
        Ok(())
    });
    let Ok(()) = taken;
    depths
}

/// \[x\]\[y\]\[z\] true beside a voxel that is not empty, and there.
fn mask(grid: &DvgoGrid, depths: &[f32]) -> Vec<bool> {
    let mut mask: Vec<bool> = depths.iter().map(|depth| f64::from(*depth) >= -(-MIN_ALPHA).ln_1p()).collect();
    for axis in UVec3::AXES {
        let before = mask.clone();
        for (n, is_set) in mask.iter_mut().enumerate() {
            let beside = || grid.beside(grid.voxel(n), axis).into_iter().any(|voxel| before[grid.index(voxel)]);
            *is_set = *is_set || beside();
        }
    }
    mask
}

/// \[channel\]\[x\]\[y\]\[z\] the logits of the colors of the voxels in `mask`, seen against the gradient of opacity; 0
/// elsewhere.
fn colors(sampler: Sampler, grid: &DvgoGrid, to_model: &Similarity, depths: &[f32], mask: &[bool]) -> Vec<f32> {
    let shader = Shader::new(sampler.field);
    let opacity = |voxel: UVec3| -(-f64::from(depths[grid.index(voxel)])).exp_m1();
    let colored = || (0..mask.len()).filter(|&n| mask[n]);
    let rays = colored().map(|n| {
        let voxel = grid.voxel(n);
        let fall = DVec3::from(UVec3::AXES.map(|axis| {
            let [before, after] = grid.beside(voxel, axis);
            opacity(before) - opacity(after)
        }));
        let normal = fall.normalize_or(DVec3::Z);
        ray_against(to_model.rotation * normal, to_model.point(grid.position(voxel)), 0.0)
    });
    let mut logits = vec![0.0; 3 * mask.len()];
    for (n, color) in colored().zip(shader.colors(rays)) {
        for (channel, value) in color.into_iter().enumerate() {
            let value = value.clamp(COLOR_MARGIN, 1.0 - COLOR_MARGIN);
            logits[channel * mask.len() + n] = (value / (1.0 - value)).ln();
        }
    }
    logits
}

/// DVGO's density of the optical depth `depth` over a voxel's edge.
fn density_of(depth: f32, shift: f64) -> f32 {
    let depth = f64::from(depth).max(-(-EMPTY_ALPHA).ln_1p());
    // The inverse of the softplus.
    let x = if depth > 30.0 { depth } else { depth.exp_m1().ln() };
    (x - shift) as f32
}

fn checkpoint(grid: &DvgoGrid, shift: f64, density: Vec<f32>, colors: Vec<f32>, mask: Vec<bool>) -> Value<'static> {
    let [x, y, z] = grid.voxels.to_array().map(|n| n as usize);
    let vector = |v: DVec3| Value::tensor([3], v.as_vec3().to_array().to_vec());
    let list = |v: DVec3| Value::List(v.to_array().map(Value::Float).to_vec());
    let (min, max, size) = (grid.bounds.min, grid.bounds.max, grid.bounds.size());
    let per_unit = (grid.voxels - 1).as_dvec3() / size;
    let state = vec![
        ("xyz_min".into(), vector(min)),
        ("xyz_max".into(), vector(max)),
        ("act_shift".into(), Value::tensor([1], vec![shift as f32])),
        ("density.grid".into(), Value::tensor([1, 1, x, y, z], density)),
        ("density.xyz_min".into(), vector(min)),
        ("density.xyz_max".into(), vector(max)),
        ("k0.grid".into(), Value::tensor([1, 3, x, y, z], colors)),
        ("k0.xyz_min".into(), vector(min)),
        ("k0.xyz_max".into(), vector(max)),
        ("mask_cache.mask".into(), Value::tensor([x, y, z], mask)),
        ("mask_cache.xyz2ijk_scale".into(), vector(per_unit)),
        ("mask_cache.xyz2ijk_shift".into(), vector(-min * per_unit)),
    ];
    let empty = || Value::Dict(Vec::new());
    let kwargs = vec![
        ("xyz_min".into(), list(min)),
        ("xyz_max".into(), list(max)),
        ("num_voxels".into(), Value::Int(grid.num_voxels())),
        ("num_voxels_base".into(), Value::Int(grid.num_voxels())),
        ("alpha_init".into(), Value::Float(EMPTY_ALPHA)),
        ("voxel_size_ratio".into(), Value::Float(1.0)),
        ("mask_cache_path".into(), Value::None),
        ("mask_cache_thres".into(), Value::Float(MIN_ALPHA)),
        ("mask_cache_world_size".into(), Value::List([x, y, z].map(|n| Value::Int(n as i64)).to_vec())),
        ("fast_color_thres".into(), Value::Float(0.0)),
        ("density_type".into(), Value::text("DenseGrid")),
        ("k0_type".into(), Value::text("DenseGrid")),
        ("density_config".into(), empty()),
        ("k0_config".into(), empty()),
        ("rgbnet_dim".into(), Value::Int(0)),
    ];
    Value::Dict(vec![
        ("global_step".into(), Value::Int(0)),
        ("model_kwargs".into(), Value::Dict(kwargs)),
        ("model_state_dict".into(), Value::OrderedDict(state)),
    ])
}
