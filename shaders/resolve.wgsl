// Compositing: from colors of samples or rays to pixels (spec 4.8, 4.11). Twins: src/field/decoder.rs
// (`Activations::pixel`), src/field/render/cpu.rs.

@compute @workgroup_size(RAY_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_index(id.x);
    if pixel == NOWHERE {
        return;
    }
    let ray = rays[id.x];
    // The sky belongs to the picture, so its pixels are opaque. A pixel without a ray does not see it.
    let sees_sky = HAS_SKY && ray.scale >= 0.0;
    var behind = scene.background;
    if sees_sky {
        behind = sky_color(ray.direction);
    }
    // Samples skipped by thresholds above the scene's own give their weight to the shaded ones.
    var left = ray.transmittance;
    var weight_scale = 1.0;
    if ray.shaded > 0u {
        if left < scene.min_transmittance {
            left = min(left, scene.own_min_transmittance);
        }
        weight_scale += (ray.transmittance - left + ray.skipped_weights) / ray.shaded_weights;
    }
    var color = left * behind;
    if DECODES_SAMPLES || SAMPLES_HAVE_COLORS {
        for (var i = 0u; i < ray.shaded; i += 1u) {
            let row = bitcast<vec4<f32>>(rows[ray.first_row + i]);
            if DECODES_SAMPLES {
                color += weight_scale * row.w * row.xyz;
            } else {
                color += weight_scale * row.w * sigmoid(ray.outputs + row.xyz);
            }
        }
    } else if ray.shaded > 0u {
        color += weight_scale * ray.shaded_weights * sigmoid(ray.outputs);
    }
    let depth = select(0.0, ray.distances / ray.weights, ray.weights > 0.0);
    pixels[2u * pixel] = vec4(color, select(1.0 - left, 1.0, sees_sky));
    pixels[2u * pixel + 1u] = vec4(depth, f32(ray.evaluated), f32(ray.shaded), 0.0);
}
