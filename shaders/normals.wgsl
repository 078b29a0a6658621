// Normals: the direction against the density's gradient, at the ray's expected depth. Twin: src/field/render/cpu.rs
// (`normal_at`).

// A direction as an integer from 1 to 2²², by octahedral coordinates. `normal_of` in display.wgsl is the inverse.
fn coded(direction: vec3<f32>) -> f32 {
    let flat = direction.xy / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    let signs = select(vec2(-1.0), vec2(1.0), flat >= vec2(0.0));
    let folded = select(flat, (1.0 - abs(flat.yx)) * signs, direction.z < 0.0);
    let steps = round((0.5 + 0.5 * folded) * 2047.0);
    return 1.0 + steps.x * 2048.0 + steps.y;
}

fn density_at(point: vec3<f32>) -> f32 {
    let found = density_feature(contracted(point));
    return select(0.0, softplus(found.feature + scene.density_shift), found.covered);
}

@compute @workgroup_size(RAY_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_index(id.x);
    if pixel == NOWHERE {
        return;
    }
    let ray = rays[id.x];
    // A ray that lets half of the light pass has no surface.
    if ray.transmittance > 0.5 || !(ray.weights > 0.0) {
        return;
    }
    let point = ray.start + (ray.distances / ray.weights - ray.entry) * ray.direction;
    // Contracted space is about as much smaller than the scene.
    let sizes = abs(point);
    let h = 2.0 * scene.step * select(1.0, max(1.0, max(sizes.x, max(sizes.y, sizes.z))), CONTRACTED);
    var gradient = vec3(0.0);
    for (var axis = 0u; axis < 3u; axis += 1u) {
        var offset = vec3(0.0);
        offset[axis] = h;
        gradient[axis] = density_at(point + offset) - density_at(point - offset);
    }
    let length = length(gradient);
    if length > 0.0 {
        pixels[2u * pixel + 1u].w = coded(-gradient / length);
    }
}
