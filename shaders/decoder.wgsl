// Appearance and decoder (spec 4.6, 4.7) for a tile of ROWS samples or ROWS rays, as matrix products of a tile in
// workgroup memory with matrices from the scene. Twin: src/field/decoder.rs.
//
// `tile` is [column][row quad]: a quad holds four rows, in the prelude's type `Kept`. Products are in place: all input
// is read before any output is written. `write_components` is in components_by_tile.wgsl or components_by_lane.wgsl.

const ROW_QUADS: u32 = ROWS / 4u;

var<workgroup> tile: array<Kept, TILE_QUADS>;
// [row] its ray, and its sample.
var<workgroup> tile_rays: array<u32, ROWS>;
var<workgroup> tile_rows: array<u32, ROWS>;

const NONE: u32 = 0xffffffffu;

// Four outputs of four rows, as four columns: the tile's first `inputs` columns times the matrix at quad `first`.
fn product_of(item: u32, inputs: u32, output_quads: u32, first: u32) -> mat4x4<f32> {
    let o = item % output_quads;
    let q = item / output_quads;
    // Four outputs of four rows for each pair of loads: four times as fast on lavapipe as one output at a time
    // (docs/experiments/2026-11-22-software-vulkan.md).
    var sums = mat4x4<f32>();
    for (var i = 0u; i < inputs; i += 1u) {
        let weights = floats(first + i * output_quads + o);
        let values = vec4<f32>(tile[i * ROW_QUADS + q]);
        sums[0] += weights.x * values;
        sums[1] += weights.y * values;
        sums[2] += weights.z * values;
        sums[3] += weights.w * values;
    }
    return sums;
}

// Items of four outputs and four rows.
const PRODUCT_ITEMS_PER_LANE: u32 = (OUTPUT_QUADS * ROW_QUADS + LANES - 1u) / LANES;
const NO_BIAS: u32 = 0xffffffffu;

// Replaces the tile's columns by their product with the matrix at quad `first`, plus a bias, rectified if
// `is_rectified`.
fn multiply(lane: u32, inputs: u32, output_quads: u32, first: u32, bias: u32, is_rectified: bool) {
    var sums: array<mat4x4<f32>, PRODUCT_ITEMS_PER_LANE>;
    let items = output_quads * ROW_QUADS;
    for (var i = 0u; i < PRODUCT_ITEMS_PER_LANE; i += 1u) {
        let item = i * LANES + lane;
        if item < items {
            sums[i] = product_of(item, inputs, output_quads, first);
        }
    }
    // Products are in place, so all lanes read before any writes.
    workgroupBarrier();
    for (var i = 0u; i < PRODUCT_ITEMS_PER_LANE; i += 1u) {
        let item = i * LANES + lane;
        if item < items {
            let o = item % output_quads;
            var added = vec4(0.0);
            if bias != NO_BIAS {
                added = floats(bias + o);
            }
            for (var c = 0u; c < 4u; c += 1u) {
                let sum = sums[i][c] + added[c];
                tile[(4u * o + c) * ROW_QUADS + item / output_quads] = kept(select(sum, max(sum, vec4(0.0)), is_rectified));
            }
        }
    }
    workgroupBarrier();
}

// Writes directions, PE(features) and PE(directions) to the columns after the features.
fn encode_inputs(lane: u32) {
    for (var item = lane; item < 3u * ROW_QUADS; item += LANES) {
        let axis = item / ROW_QUADS;
        let q = item % ROW_QUADS;
        var values = vec4(0.0);
        for (var r = 0u; r < 4u; r += 1u) {
            let ray = tile_rays[4u * q + r];
            if ray != NONE {
                values[r] = rays[ray].direction[axis];
            }
        }
        tile[(FEATURES + axis) * ROW_QUADS + q] = kept(values);
    }
    workgroupBarrier();
    const ENCODED: u32 = FEATURES + 3u;
    encode(lane, 0u, FEATURES, ENCODED, FEATURE_FREQUENCIES);
    encode(lane, FEATURES, 3u, ENCODED + 2u * FEATURES * FEATURE_FREQUENCIES, DIRECTION_FREQUENCIES);
    workgroupBarrier();
}

// Writes PE of the `count` columns from `first` on to the columns from `to` on: all sines, then all cosines,
// frequencies fastest. Each frequency is computed by doubling the angle of the one before.
fn encode(lane: u32, first: u32, count: u32, to: u32, frequencies: u32) {
    if frequencies == 0u {
        return;
    }
    for (var item = lane; item < count * ROW_QUADS; item += LANES) {
        let e = item / ROW_QUADS;
        let q = item % ROW_QUADS;
        let angle = sine_cosine(vec4<f32>(tile[(first + e) * ROW_QUADS + q]));
        var s = angle.sine;
        var c = angle.cosine;
        for (var f = 0u; f < frequencies; f += 1u) {
            tile[(to + e * frequencies + f) * ROW_QUADS + q] = kept(s);
            tile[(to + (count + e) * frequencies + f) * ROW_QUADS + q] = kept(c);
            // One sine for all frequencies; the error doubles with each (docs/numerics.md).
            let doubled = 2.0 * s * c;
            c = 1.0 - 2.0 * s * s;
            s = doubled;
        }
    }
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // A dimension has at most 65 535 workgroups, so tiles continue in a second one.
    let first = (group.y * MAX_ACROSS + group.x) * ROWS;
    let count = select(atomicLoad(&counters.shaded_rays), atomicLoad(&counters.rows), DECODES_SAMPLES);
    if lane < ROWS {
        tile_rays[lane] = NONE;
        tile_rows[lane] = NONE;
        if first + lane < count {
            if DECODES_SAMPLES {
                tile_rows[lane] = first + lane;
                tile_rays[lane] = rows[first + lane].x;
            } else {
                tile_rays[lane] = rays[first + lane].compacted_ray;
            }
        }
    }
    workgroupBarrier();
    write_components(lane);
    workgroupBarrier();
    multiply(lane, COMPONENTS, FEATURE_QUADS, scene.appearance, NO_BIAS, false);
    encode_inputs(lane);
    for (var l = 0u; l < LAYERS; l += 1u) {
        let layer = scene.layers[l];
        multiply(lane, layer.inputs, layer.output_quads, layer.weights, layer.bias, l + 1u < LAYERS);
    }
    if lane < ROWS && tile_rays[lane] != NONE {
        let q = lane / 4u;
        let r = lane % 4u;
        let outputs = vec3<f32>(vec3(tile[q][r], tile[ROW_QUADS + q][r], tile[2u * ROW_QUADS + q][r]));
        if DECODES_SAMPLES {
            rows[tile_rows[lane]] = vec4(bitcast<vec3<u32>>(sigmoid(outputs)), rows[tile_rows[lane]].w);
        } else {
            rays[tile_rays[lane]].outputs = outputs;
        }
    }
}
