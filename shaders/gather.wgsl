// Interpolating factors. Twin: src/field/gather.rs.

// A neighbor, ready for interpolation: the lower of two rows and the fraction of the way to the next, per axis.
struct InterpolationSite {
    rows: vec3<u32>,
    weight: f32,
    fractions: vec3<f32>,
}

fn locate(s: u32, candidate: u32, weight: f32, position: vec3<f32>) -> InterpolationSite {
    let center_and_tensor = quad(candidate);
    let offset = position - bitcast<vec3<f32>>(center_and_tensor.xyz);
    let u = (offset + scene.scales[s].half) * scene.scales[s].factor_cells_per_unit;
    let lower = clamp(vec3<i32>(floor(u)), vec3(0), vec3<i32>(scene.scales[s].last_cell));
    let rows = center_and_tensor.w * scene.scales[s].rows + scene.scales[s].first_row + vec3<u32>(lower);
    return InterpolationSite(rows, weight, u - vec3<f32>(lower));
}

// Four components between a row and the next, which is `quads` behind.
fn interpolate(i: u32, quads: u32, fraction: f32) -> vec4<f32> {
    let lower = factor(i);
    return lower + fraction * (factor(i + quads) - lower);
}

// weight·x·y·z of the components `q` of factors that begin at quad `first` with `quads` a row.
fn product(first: u32, quads: u32, q: u32, at: InterpolationSite) -> vec4<f32> {
    let x = interpolate(first + at.rows.x * quads + q, quads, at.fractions.x);
    let y = interpolate(first + at.rows.y * quads + q, quads, at.fractions.y);
    let z = interpolate(first + at.rows.z * quads + q, quads, at.fractions.z);
    return at.weight * x * y * z;
}
