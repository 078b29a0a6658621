// Interpolation of factors (spec 4.3). Twin: src/field/gather.rs.

// The factors to interpolate.
const DENSITY: u32 = 0u;
const APPEARANCE: u32 = 1u;

// A block of a neighbor, prepared for interpolation.
struct InterpolationSite {
    // The first factor quad of the lower of two rows, and the fraction of the way to the next. Of three vectors: by axis.
    // Else of the vector, and of the matrix at the lower and the upper vertex of its second axis; the fractions are those
    // of the vector and of both axes of the matrix.
    rows: vec3<u32>,
    weight: f32,
    fractions: vec3<f32>,
    // Quads of a row.
    quads: u32,
}

// The interpolation site in the factors `part` of block `b` of the tensor at quad `candidate` of scale `s`.
fn locate(s: u32, b: u32, candidate: u32, weight: f32, position: vec3<f32>, part: u32) -> InterpolationSite {
    let center_and_tensor = quad(candidate);
    let offset = position - bitcast<vec3<f32>>(center_and_tensor.xyz);
    let u = (offset + scene.scales[s].half_edge) * scene.scales[s].factor_cells_per_unit;
    // A point on the upper face is in the last cell, with a fraction of 1.
    let cell = clamp(vec3<i32>(floor(u)), vec3(0), vec3<i32>(scene.scales[s].last_cell));
    let lower = vec3<u32>(cell);
    let fractions = u - vec3<f32>(cell);
    let tensor = quad(scene.scales[s].tensors + center_and_tensor.w * BLOCKS + b);
    let factors = select(tensor.xy, tensor.zw, part == APPEARANCE);
    // BLOCKS is a constant: scenes of three vectors alone have no branch.
    if BLOCKS == 1u || scene.scales[s].has_matrices == 0u {
        let rows = factors.x + (scene.scales[s].first_row + lower) * factors.y;
        return InterpolationSite(rows, weight, fractions, factors.y);
    }
    let vertices = scene.scales[s].last_cell + 2u;
    let first = select(0u, 1u, b == 0u);
    let second = select(2u, 1u, b == 2u);
    let corner = vertices[b] + lower[second] * vertices[first] + lower[first];
    let rows = factors.x + vec3(lower[b], corner, corner + vertices[first]) * factors.y;
    return InterpolationSite(rows, weight, vec3(fractions[b], fractions[first], fractions[second]), factors.y);
}

// Four components, interpolated between the row at factor quad `i` and the next one, which is `quads` further.
fn interpolate(i: u32, quads: u32, fraction: f32) -> vec4<f32> {
    let lower = factor(i);
    return lower + fraction * (factor(i + quads) - lower);
}

// weight times the four components `q`, of scale `s`.
fn product(s: u32, q: u32, site: InterpolationSite) -> vec4<f32> {
    let x = interpolate(site.rows.x + q, site.quads, site.fractions.x);
    if BLOCKS == 1u || scene.scales[s].has_matrices == 0u {
        let y = interpolate(site.rows.y + q, site.quads, site.fractions.y);
        let z = interpolate(site.rows.z + q, site.quads, site.fractions.z);
        return site.weight * x * y * z;
    }
    let lower = interpolate(site.rows.y + q, site.quads, site.fractions.y);
    let upper = interpolate(site.rows.z + q, site.quads, site.fractions.y);
    return site.weight * x * (lower + site.fractions.z * (upper - lower));
}
