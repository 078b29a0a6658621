// Cells in which samples can count (spec 4.8), one bit per cell, in bricks of 4³ cells that store their distance to the
// nearest such cells. Twin: src/field/cells.rs.

// A span of a ray's path over which occupancy does not change.
struct Span {
    // True if samples in it count.
    occupied: bool,
    // Its length along the path.
    distance: f32,
}

// The bits of the 2³ cells at the lower corner of a brick.
const OCTANT = 0x330033u;

// The cube of cells around a position that have the same occupancy.
struct Cube {
    occupied: bool,
    // The position in cells, the cube's lower corner, which may lie outside the grid, and its width in cells; a width of
    // 0 if the position is outside the grid.
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
    let place = cell >> vec3(2u);
    let brick = u32((place.z * scene.grid_bricks.y + place.y) * scene.grid_bricks.x + place.x);
    // Four distances to a word.
    let distance = i32((word(scene.grid_distances + (brick >> 2u)) >> (8u * (brick & 3u))) & 255u);
    // Strides as wide as the empty space around: a frame's march takes 0.42 of the time of bits alone
    // (docs/experiments/2026-11-26-tight-occupancy.md).
    if distance > 0 {
        return Cube(false, at, (place + (1 - distance)) << vec3(2u), 4 * (2 * distance - 1));
    }
    // A word has two layers of the brick.
    let within = vec3<u32>(cell & vec3(3));
    let layers = word(scene.grid_masks + 2u * brick + (within.z >> 1u));
    let occupied = ((layers >> (16u * (within.z & 1u) + 4u * within.y + within.x)) & 1u) == 1u;
    let octant = (layers >> (4u * (within.y & 2u) + (within.x & 2u))) & OCTANT;
    let is_alike = octant == select(0u, OCTANT, occupied);
    return Cube(occupied, at, select(cell, cell & vec3(-2), is_alike), select(1, 2, is_alike));
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
    // Rounding may put the position beyond a face of its own cube.
    let distances = max(min(below, f32(cube.width) - below), vec3(0.0)) / scene.grid_cells_per_unit;
    return Span(cube.occupied, min(distances.x, min(distances.y, distances.z)));
}
