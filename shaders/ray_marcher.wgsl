// Marching one ray from sample to sample with empty-space skipping (spec 4.8). Twin: src/field/ray_marcher.rs.

struct RayMarcher {
    path: Path,
    // 1 over the direction, per axis; 1e30 if the component is 0.
    inverse: vec3<f32>,
    // The advance at which samples end, and 1 over the bound of the path's speed where it is not straight.
    length: f32,
    slowness: f32,
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
    // 1e30 and not infinity: at a face, 0 times infinity is NaN.
    let inverse = select(1.0 / ray.direction, vec3(1e30), ray.direction == vec3(0.0));
    let path = path_of(ray);
    return RayMarcher(path, inverse, ray.length, 1.0 / max_speed(path), ray.next, 0u, frame.strides);
}

// The span from `position` on in a contracted scene, in units of the path's parameter.
fn contracted_span(marcher: ptr<function, RayMarcher>, position: vec3<f32>) -> Span {
    let inverse = (*marcher).inverse;
    let sizes = abs(position);
    if max(sizes.x, max(sizes.y, sizes.z)) >= 1.0 {
        let around = span_around(position);
        return Span(around.occupied, around.distance * (*marcher).slowness);
    }
    // Straight up to the faces of the inner cube.
    let straight = span_along(position, inverse);
    let faces = (select(vec3(-1.0), vec3(1.0), inverse > vec3(0.0)) - position) * inverse;
    return Span(straight.occupied, min(straight.distance, min(faces.x, min(faces.y, faces.z))));
}

// The advance from the first sample to the next one that may count; else NO_SAMPLE or LATER.
fn advance(marcher: ptr<function, RayMarcher>) -> f32 {
    loop {
        let sample = f32((*marcher).next) * scene.step;
        if !(sample < (*marcher).length) {
            return NO_SAMPLE;
        }
        if (*marcher).strides == 0u {
            return LATER;
        }
        // llvmpipe ends loops after 65 535 iterations without a sign
        // (docs/experiments/2026-11-28-software-device.md).
        (*marcher).strides -= 1u;
        if (*marcher).known == 0u && HAS_GRID {
            let position = position_of((*marcher).path, sample);
            var span: Span;
            if CONTRACTED {
                span = contracted_span(marcher, position);
            } else {
                span = span_along(position, (*marcher).inverse);
            }
            let margin = 0.01 * scene.step + scene.position_error;
            // A margin, so that rounding skips no sample that counts.
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
        return sample;
    }
    return LATER;
}
