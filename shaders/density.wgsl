// Density features (spec 4.5). Twin: src/field/density.rs.

struct Density {
    // True if the position is in the model.
    covered: bool,
    feature: f32,
}

fn density_feature(position: vec3<f32>) -> Density {
    var found = Density(false, 0.0);
    var covering = 0.0;
    // Fine scales first: they cover least.
    for (var remaining = SCALES; remaining > 0u; remaining -= 1u) {
        let s = remaining - 1u;
        let nearest = find_nearest(s, position);
        if nearest.count == 0u {
            if COVERAGE_IS_ALL {
                return Density(false, 0.0);
            }
            continue;
        }
        found.covered = true;
        covering += 1.0;
        var sum = vec4(0.0);
        for (var k = 0u; k < TOP_K; k += 1u) {
            if k >= nearest.count {
                break;
            }
            for (var b = 0u; b < BLOCKS; b += 1u) {
                let site = locate(s, b, nearest.candidates[k], nearest.weights[k], position, DENSITY);
                for (var q = 0u; q < site.quads; q += 1u) {
                    sum += product(s, q, site);
                }
            }
        }
        found.feature += sum.x + sum.y + sum.z + sum.w;
    }
    if DENSITY_IS_MEAN && found.covered {
        found.feature /= covering;
    }
    return found;
}
