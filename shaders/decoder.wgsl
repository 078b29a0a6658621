// Appearance and decoder (spec 4.6, 4.7) for a tile of ROWS samples or ROWS rays, as matrix products of a tile in
// workgroup memory with matrices from the scene. Twin: src/field/decoder.rs.
//
// `tile` is [column][row quad]: a quad holds four rows, in the prelude's type `Kept`. Products are in place: all input
// is read before any output is written.

const ROW_QUADS: u32 = ROWS / 4u;

var<workgroup> tile: array<Kept, TILE_QUADS>;
// [row][scale][neighbor][block], nearest first; a weight of 0 ends a list.
var<workgroup> sites: array<InterpolationSite, SITES>;
// [row][scale] 1 if the scale covers the row's sample, else 0.
var<workgroup> covering: array<f32, ROWS * SCALES>;
// [row] its ray, and its sample.
var<workgroup> tile_rays: array<u32, ROWS>;
var<workgroup> tile_rows: array<u32, ROWS>;
// [row] the number of samples of the rays before it; then of all.
var<workgroup> starts: array<u32, ROWS + 1u>;
// [row] the weight of its sample.
var<workgroup> sample_weights: array<f32, ROWS>;
// [channel][row quad] the samples' own colors before the sigmoid.
var<workgroup> own_colors: array<vec4<f32>, OWN_COLOR_QUADS>;

const NONE: u32 = 0xffffffffu;

// Finds the neighbors of the tile's samples, one lane per scale of a sample.
fn find_sites(lane: u32) {
    for (var item = lane; item < ROWS * SCALES; item += LANES) {
        let r = item / SCALES;
        let s = item % SCALES;
        var nearest: Nearest;
        var position = vec3(0.0);
        if tile_rows[r] != NONE {
            let row = rows[tile_rows[r]];
            position = position_of(path_of(rays[row.x]), bitcast<f32>(row.y));
            nearest = find_nearest(s, position);
        }
        covering[item] = select(0.0, 1.0, nearest.count > 0u);
        for (var k = 0u; k < TOP_K; k += 1u) {
            let first = (item * TOP_K + k) * BLOCKS;
            if k >= nearest.count {
                for (var b = 0u; b < BLOCKS; b += 1u) {
                    sites[first + b].weight = 0.0;
                }
                break;
            }
            for (var b = 0u; b < BLOCKS; b += 1u) {
                sites[first + b] = locate(s, b, nearest.candidates[k], nearest.weights[k], position, APPEARANCE);
            }
        }
    }
}

// Four aggregated appearance components of the tile's row `r`.
fn components_of(r: u32, component: u32) -> vec4<f32> {
    var s = SCALES - 1u;
    while component < scene.scales[s].first_quads.x {
        s -= 1u;
    }
    var b = 0u;
    var q = component - scene.scales[s].first_quads.x;
    if BLOCKS > 1u {
        while b + 1u < BLOCKS && component >= scene.scales[s].first_quads[b + 1u] {
            b += 1u;
        }
        q = component - scene.scales[s].first_quads[b];
    }
    var sum = vec4(0.0);
    for (var k = 0u; k < TOP_K; k += 1u) {
        let site = sites[((r * SCALES + s) * TOP_K + k) * BLOCKS + b];
        if site.weight == 0.0 {
            break;
        }
        if q < site.quads {
            sum += product(s, q, site);
        }
    }
    if APPEARANCE_IS_MEAN {
        var scales = 0.0;
        for (var i = 0u; i < SCALES; i += 1u) {
            scales += covering[r * SCALES + i];
        }
        sum /= max(scales, 1.0);
    }
    return sum;
}

// Four aggregated appearance components of four rows, as four columns of the tile.
fn columns_of(item: u32) -> mat4x4<f32> {
    let first = item % ROW_QUADS * 4u;
    let component = item / ROW_QUADS;
    return transpose(mat4x4(
        components_of(first, component),
        components_of(first + 1u, component),
        components_of(first + 2u, component),
        components_of(first + 3u, component),
    ));
}

// Items of four columns and four rows.
const COMPONENT_ITEMS: u32 = COMPONENT_QUADS * ROW_QUADS;
const COMPONENT_ITEMS_PER_LANE: u32 = (COMPONENT_ITEMS + LANES - 1u) / LANES;

// Writes four columns of four rows to the tile.
fn put_columns(item: u32, columns: mat4x4<f32>) {
    let component = item / ROW_QUADS;
    let q = item % ROW_QUADS;
    for (var c = 0u; c < 4u; c += 1u) {
        tile[(4u * component + c) * ROW_QUADS + q] = kept(columns[c]);
    }
}

// Four outputs of four rows, as four columns: the tile's first `inputs` columns times the matrix at quad `first`.
fn product_of(item: u32, inputs: u32, output_quads: u32, first: u32) -> mat4x4<f32> {
    let o = item % output_quads;
    let q = item / output_quads;
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

// Writes the samples' components to the tile.
fn gather_samples(lane: u32) {
    for (var item = lane; item < COMPONENT_ITEMS; item += LANES) {
        put_columns(item, columns_of(item));
    }
}

// Writes the rays' composited components, Σ w·f / Σ w, to the tile and, in mode *residual*, the samples' own colors to
// their rows. The tile holds the samples of all rays, ray after ray, ROWS at a time.
fn compose_rays(lane: u32) {
    if lane == 0u {
        var samples = 0u;
        for (var r = 0u; r < ROWS; r += 1u) {
            starts[r] = samples;
            if tile_rays[r] != NONE {
                samples += rays[tile_rays[r]].shaded;
            }
        }
        starts[ROWS] = samples;
    }
    // The sums of four components of each item, a column for each of its four rays.
    var sums: array<mat4x4<f32>, COMPONENT_ITEMS_PER_LANE>;
    let samples = workgroupUniformLoad(&starts[ROWS]);
    for (var first = 0u; first < samples; first += ROWS) {
        if lane < ROWS {
            tile_rows[lane] = NONE;
            if first + lane < samples {
                let row = row_of(first + lane);
                tile_rows[lane] = row;
                sample_weights[lane] = bitcast<f32>(rows[row].w);
            }
        }
        workgroupBarrier();
        find_sites(lane);
        workgroupBarrier();
        gather_samples(lane);
        workgroupBarrier();
        for (var i = 0u; i < COMPONENT_ITEMS_PER_LANE; i += 1u) {
            let item = i * LANES + lane;
            if item < COMPONENT_ITEMS {
                let ray = item % ROW_QUADS * 4u;
                for (var r = 0u; r < 4u; r += 1u) {
                    sums[i][r] = composite(ray + r, item / ROW_QUADS, first, sums[i][r]);
                }
            }
        }
        if SAMPLES_HAVE_COLORS {
            if lane < ROW_QUADS {
                // The first three features are in the first quad.
                let sums = product_of(lane * FEATURE_QUADS, COMPONENTS, FEATURE_QUADS, scene.appearance);
                for (var c = 0u; c < 3u; c += 1u) {
                    own_colors[c * ROW_QUADS + lane] = sums[c];
                }
            }
            workgroupBarrier();
            if lane < ROWS && tile_rows[lane] != NONE {
                let q = lane / 4u;
                let r = lane % 4u;
                let color = vec3(own_colors[q][r], own_colors[ROW_QUADS + q][r], own_colors[2u * ROW_QUADS + q][r]);
                rows[tile_rows[lane]] = vec4(bitcast<vec3<u32>>(color), rows[tile_rows[lane]].w);
            }
        }
        workgroupBarrier();
    }
    for (var i = 0u; i < COMPONENT_ITEMS_PER_LANE; i += 1u) {
        let item = i * LANES + lane;
        if item < COMPONENT_ITEMS {
            let weights = weights_of(item % ROW_QUADS);
            for (var r = 0u; r < 4u; r += 1u) {
                sums[i][r] /= weights[r];
            }
            put_columns(item, transpose(sums[i]));
        }
    }
}

// The row of the tile's sample number `sample`.
fn row_of(sample: u32) -> u32 {
    var r = 0u;
    while starts[r + 1u] <= sample {
        r += 1u;
    }
    return rays[tile_rays[r]].first_row + sample - starts[r];
}

// `sum` plus Σ w·f of four components over those samples of the tile's ray `r` that the tile holds, one after the other: sums
// do not depend on where the tile's first sample, number `first`, is.
fn composite(r: u32, component: u32, first: u32, sum: vec4<f32>) -> vec4<f32> {
    var total = sum;
    let end = min(starts[r + 1u], first + ROWS);
    for (var sample = max(starts[r], first); sample < end; sample += 1u) {
        let row = sample - first;
        let at = 4u * component * ROW_QUADS + row / 4u;
        let column = row % 4u;
        total += sample_weights[row] * vec4<f32>(vec4(
            tile[at][column],
            tile[at + ROW_QUADS][column],
            tile[at + 2u * ROW_QUADS][column],
            tile[at + 3u * ROW_QUADS][column],
        ));
    }
    return total;
}

// Σ w over the shaded samples of each ray of row quad `q`; 1 without a ray.
fn weights_of(q: u32) -> vec4<f32> {
    var weights = vec4(1.0);
    for (var r = 0u; r < 4u; r += 1u) {
        let ray = tile_rays[4u * q + r];
        if ray != NONE {
            weights[r] = rays[ray].shaded_weights;
        }
    }
    return weights;
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
            let doubled = 2.0 * s * c;
            c = 1.0 - 2.0 * s * s;
            s = doubled;
        }
    }
}

@compute @workgroup_size(LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
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
    if DECODES_SAMPLES {
        find_sites(lane);
        workgroupBarrier();
        gather_samples(lane);
    } else {
        compose_rays(lane);
    }
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
