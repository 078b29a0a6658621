// Compaction: the samples that add color, row after row, those of a ray side by side; and the rays that have any. Where
// rows lie depends on which workgroup or subgroup came first, what is in them does not (`place_of`: compact_alloc.wgsl or
// compact_alloc_subgroup.wgsl). Twin: src/field/shaded.rs.

@compute @workgroup_size(COMPACT_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let exists = id.x < frame.ray_count;
    var count = 0u;
    if exists {
        count = rays[id.x].colored;
    }
    let own = vec2(count, select(0u, 1u, count > 0u));
    let at = place_of(own, lane);
    if count == 0u {
        return;
    }
    rays[id.x].first_row = at.x;
    rays[at.y].listed = id.x;
    var block = rays[id.x].first_block;
    var used = 1u;
    for (var n = 0u; n < count; n += 1u) {
        if used == SLOTS {
            block = slots[(block - 1u) * SLOTS].x;
            used = 1u;
        }
        let slot = slots[(block - 1u) * SLOTS + used];
        used += 1u;
        rows[at.x + n] = vec4(id.x, slot.x, 0u, slot.y);
    }
}
