// As compact_alloc.wgsl, with nothing to wait for: each subgroup takes places for its own lanes.

fn place_of(own: vec2<u32>, lane: u32) -> vec2<u32> {
    let before = subgroupExclusiveAdd(own);
    let all = subgroupAdd(own);
    var first = vec2(0u);
    if lane == subgroupBroadcastFirst(lane) {
        first = vec2(atomicAdd(&counters.rows, all.x), atomicAdd(&counters.listed, all.y));
    }
    return subgroupBroadcastFirst(first) + before;
}
