// Neighbors of a sample and their weights (spec 4.1, 4.2, 4.4). Twin: src/field/neighbors.rs.

const FAR: f32 = 3e38;

// The neighbors in one scale, nearest first.
struct Nearest {
    count: u32,
    // The quads of the tensors in the candidate list.
    candidates: array<u32, TOP_K>,
    weights: array<f32, TOP_K>,
}

// The neighbors of `position` in scale `s`.
fn find_nearest(s: u32, position: vec3<f32>) -> Nearest {
    let last = vec3<i32>(scene.scales[s].cells) - 1;
    let at = (position - scene.scales[s].min) * scene.scales[s].cells_per_unit;
    // No box contains a point outside the grid, so any cell will do for it.
    let cell = vec3<u32>(clamp(vec3<i32>(floor(at)), vec3(0), last));
    let sizes = scene.scales[s].cells;
    let list = word(scene.scales[s].lists + (cell.z * sizes.y + cell.y) * sizes.x + cell.x);
    let first = word(scene.scales[s].starts + list);
    let end = word(scene.scales[s].starts + list + 1u);
    let half_edge = scene.scales[s].half_edge;

    var found: Nearest;
    for (var k = 0u; k < TOP_K; k += 1u) {
        found.weights[k] = FAR;
    }
    for (var i = first; i < end; i += 1u) {
        let candidate = scene.scales[s].candidates + i;
        let offset = position - bitcast<vec3<f32>>(quad(candidate).xyz);
        if any(abs(offset) > half_edge) {
            continue;
        }
        // Candidates ascend, so of equally near tensors the first remains in front.
        var square = dot(offset, offset);
        var moved = candidate;
        var inserted = false;
        // Insertion by a loop of fixed length: lanes of different counts stay together.
        for (var k = 0u; k < TOP_K; k += 1u) {
            if inserted || square < found.weights[k] {
                let behind = found.weights[k];
                let moved_behind = found.candidates[k];
                found.weights[k] = square;
                found.candidates[k] = moved;
                square = behind;
                moved = moved_behind;
                inserted = true;
            }
        }
        found.count += 1u;
    }
    // All candidates are counted, and TOP_K is the largest of all scales.
    found.count = min(found.count, scene.scales[s].top_k);
    weigh(&found);
    return found;
}

// Turns squared distances, nearest first, into weights (spec 4.4).
fn weigh(found: ptr<function, Nearest>) {
    let nearest = (*found).weights[0];
    var sum = 0.0;
    for (var k = 0u; k < TOP_K; k += 1u) {
        var weight = 0.0;
        if k < (*found).count {
            let square = (*found).weights[k];
            if IS_CLAMPED {
                weight = 1.0 / (sqrt(square) + 1e-6);
            } else if nearest > 0.0 {
                // Relative to the nearest: 1/d overflows beside a center.
                weight = sqrt(nearest / square);
            } else {
                // At a center, that tensor alone has a weight.
                weight = select(0.0, 1.0, k == 0u);
            }
        }
        (*found).weights[k] = weight;
        sum += weight;
    }
    let divisor = select(sum, max(sum, 1.0), IS_CLAMPED);
    for (var k = 0u; k < TOP_K; k += 1u) {
        (*found).weights[k] /= divisor;
    }
}
