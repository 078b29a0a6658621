// Where samples can count: one bit a cell, and one a block of cells. Twin: src/field/cells.rs.

struct Surroundings {
    // Whether samples there count.
    occupied: bool,
    // How far along the ray that stays so.
    distance: f32,
}

fn bit(words: u32, cell: vec3<i32>, sizes: vec3<i32>) -> bool {
    let n = u32((cell.z * sizes.y + cell.y) * sizes.x + cell.x);
    return ((word(words + (n >> 5u)) >> (n & 31u)) & 1u) == 1u;
}

// What is around `position` on a ray whose direction's reciprocal is `inverse`.
fn empty_span(position: vec3<f32>, inverse: vec3<f32>) -> Surroundings {
    let at = (position - scene.grid_min) * scene.grid_cells_per_unit;
    let cell = vec3<i32>(floor(at));
    if any(cell < vec3(0)) || any(cell >= scene.grid_cells) {
        return Surroundings(false, 0.0);
    }
    var width = 1;
    var occupied = false;
    if bit(scene.grid_blocks, cell >> vec3(BLOCK_SHIFT), scene.grid_block_counts) {
        occupied = bit(scene.grid_words, cell, scene.grid_cells);
    } else {
        width = 1 << BLOCK_SHIFT;
    }
    let lower = cell & vec3(-width);
    let face = select(lower, lower + width, inverse > vec3(0.0));
    let distances = (vec3<f32>(face) - at) / scene.grid_cells_per_unit * inverse;
    return Surroundings(occupied, min(distances.x, min(distances.y, distances.z)));
}
