// The camera's rays, and the distances at which they enter and leave the bounds (spec 4.8). Twins:
// src/format/geometry/camera.rs, src/format/geometry/aabb.rs.

@compute @workgroup_size(RAY_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= frame.ray_count {
        return;
    }
    let pixel = pixel_of(frame.first_ray + id.x);
    let point = (vec2<f32>(pixel) + 0.5 - frame.principal) / frame.focal;
    let direction = normalize(point.x * frame.right - point.y * frame.up - frame.back);

    // A ray parallel to a slab lies inside it everywhere or nowhere.
    let parallel = direction == vec3(0.0);
    let outside = (frame.position < scene.bounds_min) | (frame.position > scene.bounds_max);
    let divisor = select(direction, vec3(1.0), parallel);
    let to_min = select((scene.bounds_min - frame.position) / divisor, vec3(-3e38), parallel);
    let to_max = select((scene.bounds_max - frame.position) / divisor, vec3(3e38), parallel);
    let entries = min(to_min, to_max);
    let exits = max(to_min, to_max);
    let entry = max(max(entries.x, max(entries.y, entries.z)), scene.near);
    let exit = min(min(exits.x, min(exits.y, exits.z)), scene.far);
    let is_in_picture = pixel.x < frame.width && pixel.y < frame.height;
    let hits = entry <= exit && !any(parallel & outside) && is_in_picture;

    var ray: Ray;
    if CONTRACTED {
        ray.direction = direction;
        ray.entry = -dot(frame.position, direction);
        // From the foot, so that the samples of a ray do not depend on where on it the camera is (spec 4.9).
        ray.start = frame.position + ray.entry * direction;
        ray.scale = max(length(ray.start) / INNER_RADIUS, 1.0);
        let path = path_of(ray);
        ray.first = parameter_of(path, scene.near);
        ray.length = select(0.0, parameter_of(path, scene.far) - ray.first, is_in_picture);
        rays[id.x] = ray;
        return;
    }
    ray.start = frame.position + entry * direction;
    ray.entry = entry;
    ray.direction = direction;
    ray.length = select(0.0, exit - entry, hits);
    rays[id.x] = ray;
}
