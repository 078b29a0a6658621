//! WGSL of the renderers on GPUs: one constant per file of this folder. `strivec_field::render::gpu` joins them into modules;
//! each names its twin in Rust in its head.
#![forbid(unsafe_code)]

/// `boxes.wgsl`.
pub const BOXES: &str = include_str!("boxes.wgsl");
/// `cells.wgsl`.
pub const CELLS: &str = include_str!("cells.wgsl");
/// `compact.wgsl`.
pub const COMPACT: &str = include_str!("compact.wgsl");
/// `compact_alloc.wgsl`.
pub const COMPACT_ALLOC: &str = include_str!("compact_alloc.wgsl");
/// `compact_alloc_subgroup.wgsl`.
pub const COMPACT_ALLOC_SUBGROUP: &str = include_str!("compact_alloc_subgroup.wgsl");
/// `components_by_lane.wgsl`.
pub const COMPONENTS_BY_LANE: &str = include_str!("components_by_lane.wgsl");
/// `components_by_tile.wgsl`.
pub const COMPONENTS_BY_TILE: &str = include_str!("components_by_tile.wgsl");
/// `decoder.wgsl`.
pub const DECODER: &str = include_str!("decoder.wgsl");
/// `density.wgsl`.
pub const DENSITY: &str = include_str!("density.wgsl");
/// `display.wgsl`.
pub const DISPLAY: &str = include_str!("display.wgsl");
/// `gather.wgsl`.
pub const GATHER: &str = include_str!("gather.wgsl");
/// `layout.wgsl`.
pub const LAYOUT: &str = include_str!("layout.wgsl");
/// `march.wgsl`.
pub const MARCH: &str = include_str!("march.wgsl");
/// `neighbors.wgsl`.
pub const NEIGHBORS: &str = include_str!("neighbors.wgsl");
/// `normals.wgsl`.
pub const NORMALS: &str = include_str!("normals.wgsl");
/// `path.wgsl`.
pub const PATH: &str = include_str!("path.wgsl");
/// `ray_marcher.wgsl`.
pub const RAY_MARCHER: &str = include_str!("ray_marcher.wgsl");
/// `rays.wgsl`.
pub const RAYS: &str = include_str!("rays.wgsl");
/// `real.wgsl`.
pub const REAL: &str = include_str!("real.wgsl");
/// `resolve.wgsl`.
pub const RESOLVE: &str = include_str!("resolve.wgsl");
/// `scene_buffer.wgsl`.
pub const SCENE_BUFFER: &str = include_str!("scene_buffer.wgsl");
/// `sky.wgsl`.
pub const SKY: &str = include_str!("sky.wgsl");
/// `workgroups.wgsl`.
pub const WORKGROUPS: &str = include_str!("workgroups.wgsl");
