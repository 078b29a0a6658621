// The appearance components of a tile's rows, one lane per row (spec 4.6): for devices that emulate many lanes on few
// threads, where workgroup memory is slow. Twin: src/field/decoder.rs.

// Four components at a time: those of a sample, or Σ w·f over a ray's shaded samples.
var<private> sums: array<vec4<f32>, COMPONENT_QUADS>;

// Adds `weight` times the components of the sample at `position` to `sums`. Returns the first three features of the
// sample, its own color, in mode *residual*.
fn add_components(position: vec3<f32>, weight: f32) -> vec3<f32> {
    var share = 1.0;
    if APPEARANCE_IS_MEAN {
        var covering = 0.0;
        for (var s = 0u; s < SCALES; s += 1u) {
            covering += select(0.0, 1.0, find_nearest(s, position).count > 0u);
        }
        share /= max(covering, 1.0);
    }
    var color = vec3(0.0);
    for (var s = 0u; s < SCALES; s += 1u) {
        let nearest = find_nearest(s, position);
        for (var b = 0u; b < BLOCKS; b += 1u) {
            var sites: array<InterpolationSite, TOP_K>;
            var quads = 0u;
            for (var k = 0u; k < TOP_K; k += 1u) {
                if k < nearest.count {
                    sites[k] = locate(s, b, nearest.candidates[k], nearest.weights[k], position, APPEARANCE);
                    quads = max(quads, sites[k].quads);
                }
            }
            for (var q = 0u; q < quads; q += 1u) {
                var sum = vec4(0.0);
                for (var k = 0u; k < TOP_K; k += 1u) {
                    if q < sites[k].quads {
                        sum += product(s, q, sites[k]);
                    }
                }
                if APPEARANCE_IS_MEAN {
                    sum *= share;
                }
                let component = scene.scales[s].first_quads[b] + q;
                sums[component] += weight * sum;
                if SAMPLES_HAVE_COLORS {
                    for (var c = 0u; c < 4u; c += 1u) {
                        color += sum[c] * floats(scene.appearance + (4u * component + c) * FEATURE_QUADS).xyz;
                    }
                }
            }
        }
    }
    return color;
}

// Adds the components of all shaded samples of ray `r` to `sums`, and writes the samples' own colors to their rows.
// Returns Σ w.
fn add_samples(r: u32) -> f32 {
    let path = path_of(rays[r]);
    let first = rays[r].first_row;
    let end = first + rays[r].shaded;
    for (var i = first; i < end; i += 1u) {
        let row = rows[i];
        let color = add_components(position_of(path, bitcast<f32>(row.y)), bitcast<f32>(row.w));
        if SAMPLES_HAVE_COLORS {
            rows[i] = vec4(bitcast<vec3<u32>>(color), row.w);
        }
    }
    return rays[r].shaded_weights;
}

// Writes the components of the tile's samples, or the composited components of its rays, Σ w·f / Σ w, to the tile.
fn write_components(lane: u32) {
    var weights = 1.0;
    if lane < ROWS && tile_rays[lane] != NONE {
        if DECODES_SAMPLES {
            let row = rows[tile_rows[lane]];
            _ = add_components(position_of(path_of(rays[row.x]), bitcast<f32>(row.y)), 1.0);
        } else {
            weights = add_samples(tile_rays[lane]);
        }
    }
    // Writing one number of a quad may write all four, so the rows of a quad take turns.
    for (var turn = 0u; turn < 4u; turn += 1u) {
        if lane < ROWS && lane % 4u == turn {
            for (var component = 0u; component < COMPONENT_QUADS; component += 1u) {
                let values = kept(sums[component] / weights);
                for (var c = 0u; c < 4u; c += 1u) {
                    tile[(4u * component + c) * ROW_QUADS + lane / 4u][turn] = values[c];
                }
            }
        }
        workgroupBarrier();
    }
}
