// Cells in which samples can count (spec 4.8): one bit per cell and one per block of cells. Twin: src/field/cells.rs.

// A span of a ray's path over which occupancy does not change.
struct Span {
    // True if samples in it count.
    occupied: bool,
    // Its length along the path.
    distance: f32,
}

// The bit of `cell` in the grid of `sizes` cells that begins at word `words`.
fn bit(words: u32, cell: vec3<i32>, sizes: vec3<i32>) -> bool {
    let index = u32((cell.z * sizes.y + cell.y) * sizes.x + cell.x);
    return ((word(words + (index >> 5u)) >> (index & 31u)) & 1u) == 1u;
}

// The cube of cells around a position that have the same occupancy.
struct Cube {
    occupied: bool,
    // The position in cells, the cube's lower corner and its width in cells; a width of 0 outside the grid.
    at: vec3<f32>,
    lower: vec3<i32>,
    width: i32,
}

fn cube_around(position: vec3<f32>) -> Cube {
    let at = (position - scene.grid_min) * scene.grid_cells_per_unit;
    let cell = vec3<i32>(floor(at));
    if any(cell < vec3(0)) || any(cell >= scene.grid_cells) {
        return Cube(false, at, cell, 0);
    }
    if bit(scene.grid_blocks, cell >> vec3(BLOCK_SHIFT), scene.grid_block_counts) {
        return Cube(bit(scene.grid_words, cell, scene.grid_cells), at, cell, 1);
    }
    let width = 1 << BLOCK_SHIFT;
    return Cube(false, at, cell & vec3(-width), width);
}

// The span from `position` on, along a ray whose direction has the reciprocals `inverse`.
fn span_along(position: vec3<f32>, inverse: vec3<f32>) -> Span {
    let cube = cube_around(position);
    if cube.width == 0 {
        return Span(false, 0.0);
    }
    let face = select(cube.lower, cube.lower + cube.width, inverse > vec3(0.0));
    let distances = (vec3<f32>(face) - cube.at) / scene.grid_cells_per_unit * inverse;
    return Span(cube.occupied, min(distances.x, min(distances.y, distances.z)));
}

// The span from `position` on, along a path in any direction that changes each coordinate by at most its length.
fn span_around(position: vec3<f32>) -> Span {
    let cube = cube_around(position);
    let below = cube.at - vec3<f32>(cube.lower);
    let distances = max(min(below, f32(cube.width) - below), vec3(0.0)) / scene.grid_cells_per_unit;
    return Span(cube.occupied, min(distances.x, min(distances.y, distances.z)));
}
