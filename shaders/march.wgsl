// Marching rays front to back, density only: what samples weigh. Those that add colour go to blocks of slots. Twin:
// src/field/march.rs.

@compute @workgroup_size(RAY_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.ray_count {
        return;
    }
    var ray = rays[id.x];
    var walk = walk_of(ray);
    ray.transmittance = 1.0;
    // What rounding has taken too much from the transmittance: many faint samples must not be lost.
    var lost = 0.0;
    // The same of Σ w and Σ w·t.
    var sums_lost = vec2(0.0);
    // Blocks count from 1, so that 0 is none.
    var block = 0u;
    var used = SLOTS;
    loop {
        let distance = advance(&walk);
        if distance < 0.0 {
            break;
        }
        let density = density_feature(ray.start + distance * ray.direction);
        if !density.covered {
            continue;
        }
        ray.evaluated += 1u;
        let alpha = opacity_of(softplus(density.feature + scene.density_shift) * scene.depth_scale);
        let weight = ray.transmittance * alpha;
        let change = -weight - lost;
        let after = ray.transmittance + change;
        lost = (after - ray.transmittance) - change;
        ray.transmittance = max(after, 0.0);
        let sums = vec2(ray.weights, ray.distances);
        let added = weight * vec2(1.0, ray.entry + distance) - sums_lost;
        let sums_after = sums + added;
        sums_lost = (sums_after - sums) - added;
        ray.weights = sums_after.x;
        ray.distances = sums_after.y;
        if weight > scene.min_weight {
            if used == SLOTS {
                let taken = atomicAdd(&counters.blocks, 1u) + 1u;
                if taken > frame.blocks {
                    // The host sees from the counter that the batch has to be done again in parts.
                    break;
                }
                if block == 0u {
                    ray.first_block = taken;
                } else {
                    slots[(block - 1u) * SLOTS].x = taken;
                }
                block = taken;
                used = 1u;
            }
            slots[(block - 1u) * SLOTS + used] = vec2(bitcast<u32>(distance), bitcast<u32>(weight));
            used += 1u;
            ray.colored += 1u;
            ray.colored_weights += weight;
        }
        if ray.transmittance < scene.min_transmittance {
            break;
        }
    }
    rays[id.x] = ray;
}
