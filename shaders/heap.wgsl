// The scene's numbers, in one array of quads that may be split over several bindings (`quad`, in the prelude).

fn word(i: u32) -> u32 {
    return quad(i >> 2u)[i & 3u];
}

fn number(i: u32) -> f32 {
    return bitcast<f32>(word(i));
}
