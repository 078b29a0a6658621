// Marching rays front to back, density only: what samples weigh. Those that add color go to blocks of slots. Twin:
// src/field/march.rs. A ray that has not come to its end in this pass goes on in the next one.

// The next sample of a ray that has come to its end.
const FINISHED = 0xffffffffu;

// The same numbers, out of the compiler's sight: it may take (a + b) - a for b, and what rounding took would be lost.
fn as_is(values: vec2<f32>) -> vec2<f32> {
    return bitcast<vec2<f32>>(bitcast<vec2<u32>>(values) ^ vec2(frame.zero));
}

@compute @workgroup_size(RAY_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.ray_count {
        return;
    }
    var ray = rays[id.x];
    if ray.next == FINISHED {
        return;
    }
    var walk = walk_of(ray);
    let waited = ray.next > 0u;
    if !waited {
        ray.transmittance = 1.0;
        ray.used = SLOTS;
    }
    // What rounding has taken too much from the transmittance: many faint samples must not be lost.
    var lost = ray.lost.x;
    // The same of Σ w and Σ w·t.
    var sums_lost = ray.lost.yz;
    // Blocks count from 1, so that 0 is none.
    var block = ray.block;
    var used = ray.used;
    var is_finished = false;
    loop {
        let distance = advance(&walk);
        if distance < 0.0 {
            is_finished = distance == NO_SAMPLE;
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
        let after = as_is(vec2(ray.transmittance + change)).x;
        lost = (after - ray.transmittance) - change;
        ray.transmittance = max(after, 0.0);
        let sums = vec2(ray.weights, ray.distances);
        let added = weight * vec2(1.0, ray.entry + distance) - sums_lost;
        let sums_after = as_is(sums + added);
        sums_lost = (sums_after - sums) - added;
        ray.weights = sums_after.x;
        ray.distances = sums_after.y;
        if weight > scene.min_weight {
            if used == SLOTS {
                let taken = atomicAdd(&counters.blocks, 1u) + 1u;
                if taken > frame.blocks {
                    // The host sees from the counter that the batch has to be done again in parts.
                    is_finished = true;
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
            is_finished = true;
            break;
        }
    }
    if is_finished {
        if waited {
            atomicSub(&counters.unfinished, 1u);
        }
        ray.next = FINISHED;
    } else {
        if !waited {
            atomicAdd(&counters.unfinished, 1u);
        }
        ray.lost = vec3(lost, sums_lost);
        ray.next = walk.next;
        ray.block = block;
        ray.used = used;
    }
    rays[id.x] = ray;
}
