// Marching rays front to back, density only (spec 4.8): the samples' weights. Shaded samples go to blocks of slots. A
// ray that has not ended in this pass resumes in the next one. Twin: src/field/march.rs.

// `Ray::next` of a ray that has ended.
const FINISHED = 0xffffffffu;

// `values`, opaque to the compiler, which could otherwise simplify (a + b) - a to b and so remove the compensation of
// sums.
fn opaque(values: vec2<f32>) -> vec2<f32> {
    return bitcast<vec2<f32>>(bitcast<vec2<u32>>(values) ^ vec2(frame.opaque_zero));
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
    var marcher = marcher_of(ray);
    let was_unfinished = ray.next > 0u;
    if !was_unfinished {
        ray.transmittance = 1.0;
        ray.used = SLOTS;
    }
    // Kahan compensation of the transmittance, without which faint samples would be lost.
    var lost = ray.lost.x;
    // Kahan compensation of Σ w and Σ w·t.
    var sums_lost = ray.lost.yz;
    // Blocks are numbered from 1; 0 is no block.
    var block = ray.block;
    var used = ray.used;
    var is_finished = false;
    loop {
        let sample = advance(&marcher);
        if sample < 0.0 {
            is_finished = sample == NO_SAMPLE;
            break;
        }
        // Density in the same stage: a stage of its own would write and read every sample's neighbors, and lanes of a
        // tile of pixels mostly meet the same tensors.
        let density = density_feature(position_of(marcher.path, sample));
        if !density.covered {
            continue;
        }
        ray.evaluated += 1u;
        let alpha = opacity_of(softplus(density.feature + scene.density_shift) * scene.depth_scale);
        let weight = ray.transmittance * alpha;
        // In f32, 1 − 2e-8 is 1: a plain sum loses fog entirely (docs/numerics.md).
        let change = -weight - lost;
        let after = opaque(vec2(ray.transmittance + change)).x;
        lost = (after - ray.transmittance) - change;
        ray.transmittance = max(after, 0.0);
        let sums = vec2(ray.weights, ray.distances);
        let added = weight * vec2(1.0, distance_of(marcher.path, sample)) - sums_lost;
        let sums_after = opaque(sums + added);
        sums_lost = (sums_after - sums) - added;
        ray.weights = sums_after.x;
        ray.distances = sums_after.y;
        if weight > scene.min_weight {
            if used == SLOTS {
                // Blocks from a pool: rays have from none to hundreds of shaded samples, so that room for the most
                // would mostly stay empty.
                let taken = atomicAdd(&counters.blocks, 1u) + 1u;
                if taken > frame.blocks {
                    // The pool is full. The host reads the counter and repeats the batch in parts.
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
            slots[(block - 1u) * SLOTS + used] = vec2(bitcast<u32>(sample), bitcast<u32>(weight));
            used += 1u;
            ray.shaded += 1u;
            ray.shaded_weights += weight;
        } else if weight > scene.own_min_weight {
            ray.skipped_weights += weight;
        }
        if ray.transmittance < scene.min_transmittance {
            is_finished = true;
            break;
        }
    }
    if is_finished {
        if was_unfinished {
            atomicSub(&counters.unfinished, 1u);
        }
        ray.next = FINISHED;
    } else {
        if !was_unfinished {
            atomicAdd(&counters.unfinished, 1u);
        }
        // The compensations are a part of the state, so that passes do not change the sums.
        ray.lost = vec3(lost, sums_lost);
        ray.next = marcher.next;
        ray.block = block;
        ray.used = used;
    }
    rays[id.x] = ray;
}
