// Access to the scene buffer: one array of quads, which may be split over several bindings (`quad`, in the prelude).
// Written by src/field/render/gpu/packed.rs.

// Word `i`.
fn word(i: u32) -> u32 {
    return quad(i >> 2u)[i & 3u];
}

// Quad `i`, as floats.
fn floats(i: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(quad(i));
}
