// The appearance components of a tile's rows, gathered by all lanes of a workgroup (spec 4.6). Twin:
// src/field/decoder.rs.

// [row][scale][neighbor][block], nearest first; a weight of 0 ends a list.
var<workgroup> sites: array<InterpolationSite, SITES>;
// [row][scale] 1 if the scale covers the row's sample, else 0.
var<workgroup> covering: array<f32, ROWS * SCALES>;
// [row] the number of samples of the rays before it; then of all.
var<workgroup> starts: array<u32, ROWS + 1u>;
// [row] the weight of its sample.
var<workgroup> sample_weights: array<f32, ROWS>;
// [channel][row quad] the samples' own colors before the sigmoid.
var<workgroup> own_colors: array<vec4<f32>, OWN_COLOR_QUADS>;

// Finds the neighbors of the tile's samples, one lane per scale of a sample.
fn find_sites(lane: u32) {
    // Neighbors are found once for a tile and read by all lanes.
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
    // A uniform load, as the barriers in the loop below need uniform control flow.
    let samples = workgroupUniformLoad(&starts[ROWS]);
    // Samples ray after ray, ROWS at a time: with a sample of each ray at a time, most rows were empty after the
    // shortest rays (docs/experiments/2026-11-26-default-in-full.md).
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

// Writes the components of the tile's samples, or the composited components of its rays, to the tile.
fn write_components(lane: u32) {
    if DECODES_SAMPLES {
        find_sites(lane);
        workgroupBarrier();
        gather_samples(lane);
    } else {
        compose_rays(lane);
    }
}
