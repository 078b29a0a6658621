// Allocation for compaction: a prefix sum over the lanes of a workgroup by doubling distances. Twin:
// src/field/compact.rs.

// [lane] inclusive prefix sums.
var<workgroup> sums: array<vec2<u32>, COMPACT_LANES>;
var<workgroup> first: vec2<u32>;

// The first row of `lane`, which needs own.x rows, and the index of its ray in the list of shaded rays, which takes
// own.y.
fn allocate(own: vec2<u32>, lane: u32) -> vec2<u32> {
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
        // One addition for all lanes.
        first = vec2(atomicAdd(&counters.rows, all.x), atomicAdd(&counters.shaded_rays, all.y));
    }
    workgroupBarrier();
    return first + sums[lane] - own;
}
