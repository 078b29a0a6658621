// What the host and the stages share: structs, whose twins are in src/render/gpu/layout.rs, and bindings. Lengths are in model
// units, positions relative to the field's origin.

// One scale of the scene.
struct Scale {
    // The grid of candidate lists: its lower corner, cells per unit, cells.
    min: vec3<f32>,
    top_k: u32,
    cells_per_unit: vec3<f32>,
    // Word of the first cell's list.
    lists: u32,
    cells: vec3<u32>,
    // Word of the first list's first candidate; each list ends where the next one begins.
    starts: u32,
    // Half edges of a tensor.
    half: vec3<f32>,
    // Quad of the first candidate: its center, and its tensor's number in the scale.
    candidates: u32,
    // Cells of a factor per unit, the last cell's number, and a tensor's first row, by axis.
    factor_cells_per_unit: vec3<f32>,
    // Rows of a tensor.
    rows: u32,
    last_cell: vec3<u32>,
    // Factor quad of the first tensor's first density component.
    density: u32,
    first_row: vec3<u32>,
    // The same of appearance.
    appearance: u32,
    // Components of a row in quads, the last of which may be padded with zeros.
    density_quads: u32,
    appearance_quads: u32,
    // The scale's first appearance component among those of all scales, in quads.
    first_quad: u32,
    padding: u32,
}

// A fully connected layer: quads of its weights, [input][output], and of its bias, outputs padded to quads.
struct Layer {
    inputs: u32,
    output_quads: u32,
    weights: u32,
    bias: u32,
}

struct Scene {
    bounds_min: vec3<f32>,
    near: f32,
    bounds_max: vec3<f32>,
    far: f32,
    background: vec3<f32>,
    // How far rounding may move a position.
    position_error: f32,
    step: f32,
    // Of the density feature to the optical depth of a step.
    density_shift: f32,
    depth_scale: f32,
    min_weight: f32,
    min_transmittance: f32,
    // Quads of the appearance matrices, [component][feature], features padded to quads.
    appearance: u32,
    // The grid of where samples count: words of its bits, and of those of its blocks.
    grid_words: u32,
    grid_blocks: u32,
    grid_min: vec3<f32>,
    padding0: u32,
    grid_cells_per_unit: vec3<f32>,
    padding1: u32,
    grid_cells: vec3<i32>,
    padding2: u32,
    grid_block_counts: vec3<i32>,
    padding3: u32,
    layers: array<Layer, LAYERS>,
    scales: array<Scale, SCALES>,
}

// What changes from one batch of rays to the next.
struct Frame {
    // The camera's place and axes, its focal lengths and principal point in pixels, and the picture's size.
    position: vec3<f32>,
    width: u32,
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    // The batch: its first ray, and their number. Rays of a camera are in tiles of TILE² pixels.
    first_ray: u32,
    back: vec3<f32>,
    ray_count: u32,
    focal: vec2<f32>,
    principal: vec2<f32>,
    // 1 where rays are given, in the order of pixels, and no camera.
    rays_are_given: u32,
    // How much fits: blocks of the pool of slots.
    blocks: u32,
    // Strides that a ray takes in a pass at most: some devices end loops that run for too long.
    strides: u32,
    // 0, which compilers do not know.
    zero: u32,
}

// A ray and what became of it.
struct Ray {
    // Where its first sample is, at this distance; samples are up to `length` behind it.
    start: vec3<f32>,
    entry: f32,
    direction: vec3<f32>,
    length: f32,
    // Of all samples: transmittance behind them, Σ w, Σ w·t.
    transmittance: f32,
    weights: f32,
    distances: f32,
    // How many were evaluated.
    evaluated: u32,
    // The network's outputs, where it is called once a ray; Σ w of the samples that add color.
    outputs: vec3<f32>,
    colored_weights: f32,
    // The samples that add color: their first block, their first row, and their number.
    first_block: u32,
    first_row: u32,
    colored: u32,
    // No property of this ray: entry n of the list of rays that have color.
    listed: u32,
    // Where the next pass goes on: what rounding has taken from transmittance, Σ w and Σ w·t, the next sample, the last block
    // and how much of it is used.
    lost: vec3<f32>,
    next: u32,
    block: u32,
    used: u32,
    padding0: u32,
    padding1: u32,
}

struct Counters {
    // Blocks that were taken from the pool, also past its end.
    blocks: atomic<u32>,
    rows: atomic<u32>,
    listed: atomic<u32>,
    // Rays that wait for another pass of marching.
    unfinished: atomic<u32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
// Blocks of SLOTS: (number of the next block, 0), then samples' (distance, weight).
@group(0) @binding(3) var<storage, read_write> slots: array<vec2<u32>>;
// Samples that add color: (their ray, their distance behind its first sample, 0, weight); once they are decoded, (color,
// weight), where the color may be what they add to their ray's before the sigmoid.
@group(0) @binding(4) var<storage, read_write> rows: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> counters: Counters;
// Workgroups of the decoder.
@group(0) @binding(6) var<storage, read_write> workgroups: array<u32>;
// Two a pixel: (color, opacity), (depth, samples evaluated, samples with color, 0 or a coded normal).
@group(0) @binding(7) var<storage, read_write> pixels: array<vec4<f32>>;

// The picture's column and row of a camera's ray number `n`, tile by tile.
fn pixel_of(n: u32) -> vec2<u32> {
    let tiles_across = (frame.width + TILE - 1u) / TILE;
    let tile = n / (TILE * TILE);
    let within = n % (TILE * TILE);
    return vec2(tile % tiles_across * TILE + within % TILE, tile / tiles_across * TILE + within / TILE);
}

const NOWHERE: u32 = 0xffffffffu;

// The number of the pixel of the batch's ray `n`; NOWHERE outside the picture.
fn pixel_number(n: u32) -> u32 {
    if n >= frame.ray_count {
        return NOWHERE;
    }
    if frame.rays_are_given == 1u {
        return frame.first_ray + n;
    }
    let pixel = pixel_of(frame.first_ray + n);
    return select(NOWHERE, pixel.y * frame.width + pixel.x, pixel.x < frame.width && pixel.y < frame.height);
}
