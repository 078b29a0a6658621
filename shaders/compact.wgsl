// Compaction: the list of shaded samples, one row each, the rows of a ray side by side; and the list of rays that have
// any. The order of rays in both lists depends on the order in which workgroups or subgroups run; the rows do not.
// `allocate` is in compact_alloc.wgsl or compact_alloc_subgroup.wgsl. Twin: src/field/compact.rs.

@compute @workgroup_size(COMPACT_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let exists = id.x < frame.ray_count;
    var count = 0u;
    if exists {
        count = rays[id.x].shaded;
    }
    let own = vec2(count, select(0u, 1u, count > 0u));
    // Before any lane returns: all of them take part in its barriers.
    let allocated = allocate(own, lane);
    if count == 0u {
        return;
    }
    rays[id.x].first_row = allocated.x;
    // The list of rays is in the rays themselves: stages have at most four storage buffers.
    rays[allocated.y].compacted_ray = id.x;
    var block = rays[id.x].first_block;
    var used = 1u;
    for (var i = 0u; i < count; i += 1u) {
        if used == SLOTS {
            block = slots[(block - 1u) * SLOTS].x;
            used = 1u;
        }
        let slot = slots[(block - 1u) * SLOTS + used];
        used += 1u;
        rows[allocated.x + i] = vec4(id.x, slot.x, 0u, slot.y);
    }
}
