// Marching one ray from sample to sample with empty-space skipping (spec 4.8). Twin: src/field/ray_marcher.rs.

struct RayMarcher {
    start: vec3<f32>,
    direction: vec3<f32>,
    // 1 over the direction, per axis; 1e30 if the component is 0.
    inverse: vec3<f32>,
    // The length of the ray from its start.
    length: f32,
    // The index of the next sample.
    next: u32,
    // The number of samples from `next` on that are known to be occupied.
    known: u32,
    // The number of strides left in this pass.
    strides: u32,
}

// Results of `advance` without a sample: the ray has ended, or the pass has no strides left.
const NO_SAMPLE = -1.0;
const LATER = -2.0;

fn marcher_of(ray: Ray) -> RayMarcher {
    let inverse = select(1.0 / ray.direction, vec3(1e30), ray.direction == vec3(0.0));
    return RayMarcher(ray.start, ray.direction, inverse, ray.length, ray.next, 0u, frame.strides);
}

// The distance from the start to the next sample that may count; else NO_SAMPLE or LATER.
fn advance(marcher: ptr<function, RayMarcher>) -> f32 {
    loop {
        let distance = f32((*marcher).next) * scene.step;
        if !(distance < (*marcher).length) {
            return NO_SAMPLE;
        }
        if (*marcher).strides == 0u {
            return LATER;
        }
        (*marcher).strides -= 1u;
        if (*marcher).known == 0u && HAS_GRID {
            let position = (*marcher).start + distance * (*marcher).direction;
            let span = empty_span(position, (*marcher).inverse);
            let margin = 0.01 * scene.step + scene.position_error;
            let steps = clamp((span.distance - margin) / scene.step, 0.0, 1e6);
            let alike = u32(steps) + 1u;
            if !span.occupied {
                (*marcher).next += alike;
                continue;
            }
            (*marcher).known = alike;
        }
        (*marcher).known = max((*marcher).known, 1u) - 1u;
        (*marcher).next += 1u;
        return distance;
    }
    return LATER;
}
