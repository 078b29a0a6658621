// Walking one ray from sample to sample, over what is empty in strides. Twin: src/field/ray_marcher.rs.

struct RayMarcher {
    start: vec3<f32>,
    direction: vec3<f32>,
    // 1 over the direction; where that is 0, large.
    inverse: vec3<f32>,
    // Samples are up to here behind the start.
    length: f32,
    // The next sample.
    next: u32,
    // How many samples from it on are known to count.
    known: u32,
    // Strides that are left in this pass.
    strides: u32,
}

// What `advance` says where there is no sample, and where there may be one, but not in this pass.
const NO_SAMPLE = -1.0;
const LATER = -2.0;

fn walk_of(ray: Ray) -> RayMarcher {
    let inverse = select(1.0 / ray.direction, vec3(1e30), ray.direction == vec3(0.0));
    return RayMarcher(ray.start, ray.direction, inverse, ray.length, ray.next, 0u, frame.strides);
}

// How far behind the start the next sample is that may count; else NO_SAMPLE or LATER.
fn advance(walk: ptr<function, RayMarcher>) -> f32 {
    loop {
        let distance = f32((*walk).next) * scene.step;
        if !(distance < (*walk).length) {
            return NO_SAMPLE;
        }
        if (*walk).strides == 0u {
            return LATER;
        }
        (*walk).strides -= 1u;
        if (*walk).known == 0u && HAS_GRID {
            let position = (*walk).start + distance * (*walk).direction;
            let around = empty_span(position, (*walk).inverse);
            let margin = 0.01 * scene.step + scene.position_error;
            let steps = clamp((around.distance - margin) / scene.step, 0.0, 1e6);
            let alike = u32(steps) + 1u;
            if !around.occupied {
                (*walk).next += alike;
                continue;
            }
            (*walk).known = alike;
        }
        (*walk).known = max((*walk).known, 1u) - 1u;
        (*walk).next += 1u;
        return distance;
    }
    return LATER;
}
