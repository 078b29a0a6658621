// The structs and bindings that the host and the stages share. Twin: src/field/render/gpu/layout.rs. Lengths are in model
// units, positions relative to the field's origin.

// One scale of the scene.
struct Scale {
    // The grid of candidate lists: its lower corner, cells per model unit, number of cells.
    min: vec3<f32>,
    top_k: u32,
    cells_per_unit: vec3<f32>,
    // The word of the first cell's list index.
    lists: u32,
    cells: vec3<u32>,
    // The word of the first list's first candidate. A list ends where the next one begins.
    starts: u32,
    // Half edges of a tensor.
    half_edge: vec3<f32>,
    // The quad of the first candidate: its center, and its tensor's index in the scale.
    candidates: u32,
    // By axis: a tensor's cells per model unit, the index of its last cell, and the first row of its vector.
    factor_cells_per_unit: vec3<f32>,
    // The quad of the first tensor's factors, BLOCKS quads a tensor: for density, then for appearance, the first factor
    // quad, and the quads of a row, the last one padded with zeros.
    tensors: u32,
    last_cell: vec3<u32>,
    // 1 if block b has components of a vector along axis b and a matrix; 0 if block 0 has components of three vectors.
    has_matrices: u32,
    first_row: vec3<u32>,
    padding1: u32,
    // By block: its first appearance component over all scales, in quads.
    first_quads: vec3<u32>,
    padding2: u32,
}

// A fully connected layer: the first quads of its weights, [input][output], and of its bias; outputs are padded to
// quads.
struct Layer {
    inputs: u32,
    output_quads: u32,
    weights: u32,
    bias: u32,
}

// The scene: rules, grid of occupied cells, layers, scales and sky.
struct Scene {
    bounds_min: vec3<f32>,
    near: f32,
    bounds_max: vec3<f32>,
    far: f32,
    background: vec3<f32>,
    // Bound of the rounding error of positions.
    position_error: f32,
    step: f32,
    // The optical depth of a step is softplus(feature + density_shift)·depth_scale.
    density_shift: f32,
    depth_scale: f32,
    min_weight: f32,
    min_transmittance: f32,
    // The first quad of the appearance matrices, [component][feature]; features are padded to quads.
    appearance: u32,
    // The grid of cells in which samples can count: the first words of its bricks' bits and of their distances.
    grid_masks: u32,
    grid_distances: u32,
    grid_min: vec3<f32>,
    // The width of the shell around the inner cube of a contracted scene.
    shell: f32,
    grid_cells_per_unit: vec3<f32>,
    padding1: u32,
    grid_cells: vec3<i32>,
    // The scene's own thresholds, where an approximation raises them (src/field/render/approximation.rs).
    own_min_weight: f32,
    grid_bricks: vec3<i32>,
    own_min_transmittance: f32,
    layers: array<Layer, LAYERS>,
    scales: array<Scale, SCALES>,
    // The coefficients of red, green and blue of each polynomial in sky.wgsl. Without a sky, one of zeros.
    sky: array<vec4<f32>, SKY_TERMS>,
}

// The uniforms of a batch of rays.
struct Frame {
    // The camera's position and axes, its focal lengths and principal point in pixels, and the picture's size in
    // pixels.
    position: vec3<f32>,
    width: u32,
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    // The batch: its first ray and the number of rays. Rays of a camera are ordered by tiles of TILE² pixels.
    first_ray: u32,
    back: vec3<f32>,
    ray_count: u32,
    focal: vec2<f32>,
    principal: vec2<f32>,
    // 1 if rays are given, in the order of pixels, instead of a camera.
    rays_are_given: u32,
    // The number of blocks in the pool of slots.
    blocks: u32,
    // The most strides of a ray in a pass: some drivers end long loops.
    strides: u32,
    // Always 0, but opaque to the compiler: keeps it from reassociating sums.
    opaque_zero: u32,
}

// A ray: its span, and the results and the state of its march.
struct Ray {
    // The position of the first sample, its distance `entry` from the ray's origin, and the length of the samples'
    // span. In a contracted scene `start` and `entry` are those of the ray's foot (src/format/geometry/contraction.rs).
    start: vec3<f32>,
    entry: f32,
    direction: vec3<f32>,
    length: f32,
    // The transmittance behind the samples so far, their Σ w and Σ w·t.
    transmittance: f32,
    weights: f32,
    distances: f32,
    // Number of samples evaluated.
    evaluated: u32,
    // The decoder's outputs, if rays are decoded; Σ w of the shaded samples.
    outputs: vec3<f32>,
    shaded_weights: f32,
    // The shaded samples: their first block, their first row, and their number.
    first_block: u32,
    first_row: u32,
    shaded: u32,
    // No property of this ray: entry i of the compacted list, the index of the i-th ray with shaded samples.
    compacted_ray: u32,
    // The state from which the next pass resumes: the compensations of transmittance, Σ w and Σ w·t, the index of the
    // next sample, the last block and the number of its used slots.
    lost: vec3<f32>,
    next: u32,
    block: u32,
    used: u32,
    // In a contracted scene: the unit of the spacing, and the spacing parameter of the first sample. A pixel without a
    // ray has an empty one whose unit is negative.
    scale: f32,
    first: f32,
    // Σ w of the samples that are not shaded but would be with the scene's own thresholds.
    skipped_weights: f32,
    padding1: u32,
    padding2: u32,
    padding3: u32,
}

// Lengths of the batch's lists.
struct Counters {
    // Blocks requested from the pool, including those beyond its end.
    blocks: atomic<u32>,
    rows: atomic<u32>,
    // Rays with shaded samples.
    shaded_rays: atomic<u32>,
    // Rays that need another pass of marching.
    unfinished: atomic<u32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
// Blocks of SLOTS slots: (number of the next block, 0), then (advance, weight) of each shaded sample.
@group(0) @binding(3) var<storage, read_write> slots: array<vec2<u32>>;
// Shaded samples: (ray, advance from the ray's first sample, 0, weight). After the decoder: (color, weight). In mode
// *residual* the color is the sample's term before the sigmoid.
@group(0) @binding(4) var<storage, read_write> rows: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> counters: Counters;
// The decoder's indirect dispatch.
@group(0) @binding(6) var<storage, read_write> workgroups: array<u32>;
// Two per pixel: (color, opacity), (depth, samples evaluated, samples shaded, 0 or a coded normal).
@group(0) @binding(7) var<storage, read_write> pixels: array<vec4<f32>>;

// The column and row of the camera's ray `index`, tile by tile.
fn pixel_of(index: u32) -> vec2<u32> {
    let tiles_across = (frame.width + TILE - 1u) / TILE;
    let tile = index / (TILE * TILE);
    let within = index % (TILE * TILE);
    return vec2(tile % tiles_across * TILE + within % TILE, tile / tiles_across * TILE + within / TILE);
}

const NOWHERE: u32 = 0xffffffffu;

// The index of the pixel of the batch's ray `index`; NOWHERE outside the picture.
fn pixel_index(index: u32) -> u32 {
    if index >= frame.ray_count {
        return NOWHERE;
    }
    if frame.rays_are_given == 1u {
        return frame.first_ray + index;
    }
    let pixel = pixel_of(frame.first_ray + index);
    return select(NOWHERE, pixel.y * frame.width + pixel.x, pixel.x < frame.width && pixel.y < frame.height);
}
