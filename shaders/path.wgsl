// Positions and distances along a ray's path, and the contraction of unbounded scenes (spec 4.8, 4.9). Twins:
// src/format/geometry/ray_path.rs, src/format/geometry/contraction.rs.

// Half the diagonal of the inner cube, and the largest spacing parameter.
const INNER_RADIUS = 1.7320508;
const MAX_SPACING = 3.4641016;

struct Path {
    // The first sample's position and distance; in a contracted scene those of the ray's foot.
    start: vec3<f32>,
    entry: f32,
    direction: vec3<f32>,
    // The unit of the spacing, and the spacing parameter of the first sample.
    scale: f32,
    first: f32,
}

fn path_of(ray: Ray) -> Path {
    return Path(ray.start, ray.entry, ray.direction, ray.scale, ray.first);
}

// The image of `point`.
fn contracted(point: vec3<f32>) -> vec3<f32> {
    if !CONTRACTED {
        return point;
    }
    let sizes = abs(point);
    let norm = max(max(sizes.x, max(sizes.y, sizes.z)), 1.0);
    return point / norm * select(1.0, 1.0 + scene.shell - scene.shell / norm, norm > 1.0);
}

// The length of the path from its start to the sample `advance` behind the first one, both in units of the samples'
// parameter.
fn length_of(path: Path, advance: f32) -> f32 {
    if !CONTRACTED {
        return advance;
    }
    let u = path.first + advance;
    // The parameter ends where the distance is infinite.
    let far = INNER_RADIUS * INNER_RADIUS / max(MAX_SPACING - abs(u), 1e-12);
    return path.scale * select(select(far, -far, u < 0.0), u, abs(u) <= INNER_RADIUS);
}

fn distance_of(path: Path, advance: f32) -> f32 {
    return path.entry + length_of(path, advance);
}

fn position_of(path: Path, advance: f32) -> vec3<f32> {
    return contracted(path.start + length_of(path, advance) * path.direction);
}

// The spacing parameter of the point at distance `t`.
fn parameter_of(path: Path, t: f32) -> f32 {
    let s = (t - path.entry) / path.scale;
    let far = MAX_SPACING - INNER_RADIUS * INNER_RADIUS / max(abs(s), INNER_RADIUS);
    return select(select(far, -far, s < 0.0), s, abs(s) <= INNER_RADIUS);
}

// A bound of the speed of contracted points outside the inner cube, on each axis.
fn max_speed(path: Path) -> f32 {
    return ((1.0 + scene.shell) * length(path.start) + scene.shell) / path.scale;
}
