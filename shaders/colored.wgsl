// Compaction: the samples that add colour, row after row, those of a ray side by side; and the rays that have any. Where
// a workgroup's rows lie depends on which came first, what is in them does not. Twin: src/field/colored.rs.

// Sums up to each lane: rows, and rays with rows.
var<workgroup> sums: array<vec2<u32>, COMPACT_LANES>;
var<workgroup> first: vec2<u32>;

@compute @workgroup_size(COMPACT_LANES)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let exists = id.x < frame.ray_count;
    var count = 0u;
    if exists {
        count = rays[id.x].colored;
    }
    let own = vec2(count, select(0u, 1u, count > 0u));
    sums[lane] = own;
    workgroupBarrier();
    for (var distance = 1u; distance < COMPACT_LANES; distance *= 2u) {
        var sum = sums[lane];
        if lane >= distance {
            sum += sums[lane - distance];
        }
        workgroupBarrier();
        sums[lane] = sum;
        workgroupBarrier();
    }
    if lane == 0u {
        let all = sums[COMPACT_LANES - 1u];
        first = vec2(atomicAdd(&counters.rows, all.x), atomicAdd(&counters.listed, all.y));
    }
    workgroupBarrier();
    if count == 0u {
        return;
    }
    let at = first + sums[lane] - own;
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
