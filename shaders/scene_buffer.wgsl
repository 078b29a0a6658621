// The scene's numbers, in one array of quads that may be split over several bindings (`quad`, in the prelude).

fn word(i: u32) -> u32 {
    return quad(i >> 2u)[i & 3u];
}

fn numbers(i: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(quad(i));
}
