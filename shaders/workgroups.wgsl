// The number of the decoder's workgroups: one for each tile of rows or of rays. No twin.

@compute @workgroup_size(1)
fn main() {
    let count = select(atomicLoad(&counters.shaded_rays), atomicLoad(&counters.rows), DECODES_SAMPLES);
    let tiles = (count + ROWS - 1u) / ROWS;
    // A dimension has at most 65535 workgroups.
    let across = min(tiles, MAX_ACROSS);
    workgroups[0] = across;
    workgroups[1] = (tiles + max(across, 1u) - 1u) / max(across, 1u);
    workgroups[2] = 1u;
}
