// compact_alloc.wgsl with subgroup operations: each subgroup allocates for its own lanes, without barriers. Twin:
// src/field/compact.rs.

fn allocate(own: vec2<u32>, lane: u32) -> vec2<u32> {
    let before = subgroupExclusiveAdd(own);
    let all = subgroupAdd(own);
    var first = vec2(0u);
    if lane == subgroupBroadcastFirst(lane) {
        first = vec2(atomicAdd(&counters.rows, all.x), atomicAdd(&counters.shaded_rays, all.y));
    }
    return subgroupBroadcastFirst(first) + before;
}
