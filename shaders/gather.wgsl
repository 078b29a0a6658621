// Interpolation of factors (spec 4.3). Twin: src/field/gather.rs.

// A neighbor, prepared for interpolation: the lower of two rows and the fraction of the way to the next, per axis.
struct InterpolationSite {
    rows: vec3<u32>,
    weight: f32,
    fractions: vec3<f32>,
}

// The interpolation site of the tensor at quad `candidate` of scale `s`.
fn locate(s: u32, candidate: u32, weight: f32, position: vec3<f32>) -> InterpolationSite {
    let center_and_tensor = quad(candidate);
    let offset = position - bitcast<vec3<f32>>(center_and_tensor.xyz);
    let u = (offset + scene.scales[s].half_edge) * scene.scales[s].factor_cells_per_unit;
    let lower = clamp(vec3<i32>(floor(u)), vec3(0), vec3<i32>(scene.scales[s].last_cell));
    let rows = center_and_tensor.w * scene.scales[s].rows + scene.scales[s].first_row + vec3<u32>(lower);
    return InterpolationSite(rows, weight, u - vec3<f32>(lower));
}

// Four components, interpolated between the row at factor quad `i` and the next one, which is `quads` further.
fn interpolate(i: u32, quads: u32, fraction: f32) -> vec4<f32> {
    let lower = factor(i);
    return lower + fraction * (factor(i + quads) - lower);
}

// weight·x·y·z of the four components `q` of factors that begin at quad `first`, with `quads` quads per row.
fn product(first: u32, quads: u32, q: u32, site: InterpolationSite) -> vec4<f32> {
    let x = interpolate(first + site.rows.x * quads + q, quads, site.fractions.x);
    let y = interpolate(first + site.rows.y * quads + q, quads, site.fractions.y);
    let z = interpolate(first + site.rows.z * quads + q, quads, site.fractions.z);
    return site.weight * x * y * z;
}
