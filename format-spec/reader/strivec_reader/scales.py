"""SCALE, MATRIX and the chunks (sections 3.7 to 3.10 of the format): one scale with its tensors in canonical order."""

import math
from collections import namedtuple

import numpy as np

from . import limits
from .errors import Malformed, InvalidScene
from .factors import read_factors
from .scene import Block, Scale
from .sections import read_matrix

CHUNK = np.dtype([("tensors", "<u4"), ("box_min", "<f8", 3), ("box_max", "<f8", 3)])  # 52 bytes
MAX_LEB128_BYTES = 9  # of a cell's number
PLACEMENT_TRANSIENT = 96  # bytes for each tensor

Layout = namedtuple(
    "Layout",
    "tensors top_k half_edges resolution placement density_rank appearance_rank origin pitch extent axis_ranks chunks",
)


def read_scale(container, index, features):
    """Reads the `Scale` of this index, from SCALE to its last chunk, in a scene of `features` features."""
    budget = container.budget
    payload = container.require("SCALE", index)
    layout = _read_layout(payload)
    matrix = read_matrix(container.require("MATRIX", index), features, layout.appearance_rank)

    shapes = [block_shapes(layout, part) for part in (0, 1)]
    numbers = layout.tensors * sum(rank * math.prod(shape) for part in shapes for _, rank, all in part for shape in all)
    budget.take(24 * layout.tensors + 4 * numbers, payload.name)
    centers = np.zeros((layout.tensors, 3))
    density, appearance = ([empty_block(layout.tensors, *shape) for shape in part] for part in shapes)
    extent = np.zeros(3, np.int64)
    start = 0
    for chunk, row in enumerate(layout.chunks):
        rows = slice(start, start + int(row["tensors"]))
        placement = container.require("PLACEMENT", index, chunk)
        extent = np.maximum(extent, _read_placement(placement, layout, centers[rows]))
        _check_box(placement.name, centers[rows], layout.half_edges, row)
        for kind, blocks in (("DENSITY", density), ("APPEARANCE", appearance)):
            out = [Block(block.axis, [array[rows] for array in block.factors]) for block in blocks]
            read_factors(container.require(kind, index, chunk), out)
        start = rows.stop
    if layout.placement == "lattice" and tuple(extent) != layout.extent:
        raise Malformed(f"{payload.name} extent", tuple(int(e) for e in extent), layout.extent)
    _sort(payload.name, budget, centers, [array for block in density + appearance for array in block.factors])
    return Scale(
        layout.top_k,
        np.array(layout.half_edges),
        layout.resolution,
        len(layout.chunks),
        centers,
        density,
        appearance,
        matrix,
    )


def block_shapes(layout, part):
    """The blocks of density (0) or appearance (1): axis, rank, and the shapes of the factors, of rank 1 or more."""
    vertices = [cells + 1 for cells in layout.resolution]
    if layout.axis_ranks is None:
        rank = (layout.density_rank, layout.appearance_rank)[part]
        return [(None, rank, [(count,) for count in vertices])]
    shapes = []
    for axis, rank in enumerate(layout.axis_ranks[part]):
        first, second = (vertices[other] for other in range(3) if other != axis)
        shapes += [(axis, rank, [(vertices[axis],), (second, first)])] if rank else []
    return shapes


def empty_block(tensors, axis, rank, shapes):
    return Block(axis, [np.zeros((tensors, rank, *shape), np.float32) for shape in shapes])


def _read_layout(payload):
    record = payload.record
    record.check_codes([(44, "factor kind", range(2)), (45, "placement", range(2))], [(46, 2), (60, 4)])
    tensors = record.u32("tensors", limits.TENSORS)
    top_k = record.u32("top_k", limits.TOP_K)
    half_edges = record.f64s(3, "half edges", "a positive finite number")
    resolution = record.u32s(3, "resolution", limits.RESOLUTION)
    has_axes = record.code("factor kind", (False, True))
    placement = record.code("placement", ("lattice", "explicit"))
    record.take(2, "reserved bytes")
    density_rank = record.u32("density rank", limits.RANK)
    appearance_rank = record.u32("appearance rank", limits.RANK)
    count = record.u32("chunks", limits.CHUNKS)
    record.take(4, "reserved bytes")
    if placement == "lattice":
        origin = record.f64s(3, "origin")
        pitch = record.f64s(3, "pitch", "a positive finite number")
        extent = record.u32s(3, "extent", limits.CELL_EXTENT)
    else:
        origin = pitch = extent = None
        record.zeros(60, "origin, pitch and extent of an explicit placement")
    axis_ranks = None
    if has_axes:
        axis_ranks = [record.u32s(3, "components along the axes", (0, limits.RANK[1])) for _ in range(2)]
        for rank, of_axes in zip((density_rank, appearance_rank), axis_ranks):
            if sum(of_axes) != rank:
                raise Malformed(f"{payload.name} components along all axes", rank, sum(of_axes))

    size = CHUNK.itemsize * count
    payload.budget.take(size, payload.name)
    with payload.body(size) as body:
        chunks = np.frombuffer(body, CHUNK).copy()
    for found in chunks["tensors"]:
        limits.check(int(found), limits.TENSORS, f"{payload.name} tensors of a chunk")
    total = int(chunks["tensors"].sum(dtype=np.int64))
    if total != tensors:
        raise Malformed(f"{payload.name} tensors of all chunks", tensors, total)
    return Layout(
        tensors,
        top_k,
        half_edges,
        resolution,
        placement,
        density_rank,
        appearance_rank,
        origin,
        pitch,
        extent,
        axis_ranks,
        chunks,
    )


def _read_placement(payload, layout, centers):
    """Fills `centers`, float64[n][3]; returns their extent in cells, int[3]."""
    count = len(centers)
    extent = np.zeros(3, np.int64)
    with payload.budget.borrow(PLACEMENT_TRANSIENT * count, payload.name):
        if layout.placement == "explicit":
            with payload.body(24 * count) as body:
                centers[:] = np.frombuffer(body, "<f8").reshape(count, 3)
        else:
            with payload.body(count, MAX_LEB128_BYTES * count) as body:
                gaps = _read_leb128(body, count, payload.name)
            cells = _cells(gaps, layout.extent, payload.name)
            centers[:] = layout.origin + (cells + 0.5) * np.array(layout.pitch)
            extent = cells.max(axis=0) + 1
        if not np.isfinite(centers).all():
            raise InvalidScene(f"{payload.name} centers", "finite numbers", "another number")
        _check_ascending(payload.name, centers)
    return extent


def _read_leb128(data, count, place):
    """Decodes `count` LEB128 integers that fill `data`, uint64[count]."""
    data = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(data < 0x80)
    if len(ends) != count or ends[-1] != len(data) - 1:
        raise Malformed(place, f"{count} integers in all of the body", f"{len(ends)} in {len(data)} bytes")
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts + 1
    if lengths.max() > MAX_LEB128_BYTES:
        raise Malformed(place, f"integers of at most {MAX_LEB128_BYTES} bytes", f"one of {lengths.max()}")
    if ((lengths > 1) & (data[ends] == 0)).any():
        raise Malformed(place, "integers of as few bytes as possible", "one that ends with a zero")
    numbers = np.zeros(count, np.uint64)
    for byte in range(int(lengths.max())):
        has = lengths > byte
        bits = (data[starts[has] + byte] & 0x7F).astype(np.uint64)
        numbers[has] |= bits << np.uint64(7 * byte)
    return numbers


def _cells(gaps, extent, place):
    """The cells (i, j, k), int64[n][3], of ascending numbers, given as the gaps between them."""
    total = math.prod(extent)
    rough = np.cumsum(gaps.astype(np.float64) + 1.0) - 1.0  # in float64, which does not overflow
    if rough[-1] < 2.0**62:
        numbers = np.cumsum(gaps + np.uint64(1)) - np.uint64(1)
        outside = numbers >= np.uint64(total)
    else:
        numbers, outside = rough, rough >= float(total)
    if outside.any():
        cell = int(np.argmax(outside))
        raise Malformed(f"{place} cell {cell}", f"a number below {total}", int(numbers[cell]))
    numbers = numbers.astype(np.int64)
    x, y = extent[0], extent[1]
    return np.stack([numbers % x, numbers // x % y, numbers // (x * y)], axis=1)


def _check_ascending(place, centers):
    """Checks that centers ascend strictly by (z, y, x), with -0 equal to 0 and with -0 less than 0."""
    ascends = _ascends(centers) & _ascends(_total_order(centers))
    if not ascends.all():
        tensor = int(np.argmin(ascends)) + 1
        raise Malformed(
            f"{place} center {tensor}", f"one after {tuple(centers[tensor - 1])} by z, y, x", tuple(centers[tensor])
        )


def _ascends(keys):
    """Whether each row after the first of keys[n][3] is greater than its predecessor by (z, y, x), bool[n - 1]."""
    before, after = keys[:-1], keys[1:]
    greater = after[:, 2] > before[:, 2]
    for axis, tied in ((1, [2]), (0, [2, 1])):
        greater |= (after[:, tied] == before[:, tied]).all(axis=1) & (after[:, axis] > before[:, axis])
    return greater


def _total_order(centers):
    """Integers in the order of finite float64 numbers in which -0 is less than 0, int64 of the same shape."""
    bits = np.ascontiguousarray(centers).view(np.int64)
    return np.where(bits < 0, bits ^ np.int64(0x7FFFFFFFFFFFFFFF), bits)


def _check_box(place, centers, half_edges, chunk):
    box_min = (centers - half_edges).min(axis=0)
    box_max = (centers + half_edges).max(axis=0)
    if (box_min != chunk["box_min"]).any() or (box_max != chunk["box_max"]).any():
        expected = f"{box_min.tolist()} to {box_max.tolist()}"
        found = f"{chunk['box_min'].tolist()} to {chunk['box_max'].tolist()}"
        raise Malformed(f"box of {place}", expected, found)


def _sort(place, budget, centers, factors):
    """Sorts the tensors of all chunks by (z, y, x) of their centers, in place."""
    largest = max(array.nbytes for array in [centers, *factors])
    with budget.borrow(largest + 16 * len(centers), place):
        order = np.lexsort((centers[:, 0], centers[:, 1], centers[:, 2]))
        if (order == np.arange(len(order))).all():
            order = None
        for array in [centers, *factors] if order is not None else []:
            array[:] = array[order]
    _check_ascending(place, centers)
