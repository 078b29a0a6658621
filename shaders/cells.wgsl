// Cells in which samples can count (spec 4.8): one bit per cell and one per block of cells. Twin: src/field/cells.rs.

// A span of a ray over which occupancy does not change.
struct Span {
    // True if samples in it count.
    occupied: bool,
    // Its length along the ray.
    distance: f32,
}

// The bit of `cell` in the grid of `sizes` cells that begins at word `words`.
fn bit(words: u32, cell: vec3<i32>, sizes: vec3<i32>) -> bool {
    let index = u32((cell.z * sizes.y + cell.y) * sizes.x + cell.x);
    return ((word(words + (index >> 5u)) >> (index & 31u)) & 1u) == 1u;
}

// The span from `position` on, along a ray whose direction has the reciprocals `inverse`.
fn empty_span(position: vec3<f32>, inverse: vec3<f32>) -> Span {
    let at = (position - scene.grid_min) * scene.grid_cells_per_unit;
    let cell = vec3<i32>(floor(at));
    if any(cell < vec3(0)) || any(cell >= scene.grid_cells) {
        return Span(false, 0.0);
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
    return Span(occupied, min(distances.x, min(distances.y, distances.z)));
}
