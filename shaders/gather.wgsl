// Interpolation of factors (spec 4.3). Twin: src/field/gather.rs.

// The factors to interpolate.
const DENSITY: u32 = 0u;
const APPEARANCE: u32 = 1u;

// A neighbor, prepared for interpolation.
struct InterpolationSite {
    // By axis: the first factor quad of the lower of two rows, and the fraction of the way to the next.
    rows: vec3<u32>,
    weight: f32,
    fractions: vec3<f32>,
    // Quads of a row.
    quads: u32,
}

// The interpolation site in the factors `part` of the tensor at quad `candidate` of scale `s`.
fn locate(s: u32, candidate: u32, weight: f32, position: vec3<f32>, part: u32) -> InterpolationSite {
    let center_and_tensor = quad(candidate);
    let offset = position - bitcast<vec3<f32>>(center_and_tensor.xyz);
    let u = (offset + scene.scales[s].half_edge) * scene.scales[s].factor_cells_per_unit;
    let lower = clamp(vec3<i32>(floor(u)), vec3(0), vec3<i32>(scene.scales[s].last_cell));
    let tensor = quad(scene.scales[s].tensors + center_and_tensor.w);
    let factors = select(tensor.xy, tensor.zw, part == APPEARANCE);
    let rows = factors.x + (scene.scales[s].first_row + vec3<u32>(lower)) * factors.y;
    return InterpolationSite(rows, weight, u - vec3<f32>(lower), factors.y);
}

// Four components, interpolated between the row at factor quad `i` and the next one, which is `quads` further.
fn interpolate(i: u32, quads: u32, fraction: f32) -> vec4<f32> {
    let lower = factor(i);
    return lower + fraction * (factor(i + quads) - lower);
}

// weight·x·y·z of the four components `q`.
fn product(q: u32, site: InterpolationSite) -> vec4<f32> {
    let x = interpolate(site.rows.x + q, site.quads, site.fractions.x);
    let y = interpolate(site.rows.y + q, site.quads, site.fractions.y);
    let z = interpolate(site.rows.z + q, site.quads, site.fractions.z);
    return site.weight * x * y * z;
}
