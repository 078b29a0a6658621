// Where a lane's rows, and its ray in the list of those that have any, lie: sums over the lanes before, by doubling distances.

// Sums up to each lane.
var<workgroup> sums: array<vec2<u32>, COMPACT_LANES>;
var<workgroup> first: vec2<u32>;

fn place_of(own: vec2<u32>, lane: u32) -> vec2<u32> {
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
    return first + sums[lane] - own;
}
