"""DENSITY and APPEARANCE (section 3.10 of the format): the factor vectors of a chunk's tensors."""

from itertools import repeat

import numpy as np

from . import arrays
from .errors import Malformed


def read_factors(payload, rank, resolution, out):
    """Decodes a chunk's vectors into `out`, for each axis a an array float32[N][rank][D_a + 1] of zeros.

    Leaves the components that are not stored as they are in `out`.
    """
    tensors = len(out[0])
    record = payload.record
    record.check_codes([(0, "components", range(2))], [(1, 7)])
    arrays.check_head(record, 8)
    has_masks = record.code("components", (False, True))
    record.take(7, "reserved bytes")
    head = arrays.read_head(record)
    vertices = [cells + 1 for cells in resolution]

    components = tensors * rank
    full = arrays.encoded_size(head, components * sum(vertices), components)
    mask_size = tensors * -(-rank // 8) if has_masks else 0
    minimum = mask_size if has_masks else full
    transient = arrays.TRANSIENT * components * sum(vertices) + 16 * mask_size
    masks = (tensors, rank) if has_masks else None
    decoder = arrays.adaptive_decoder(head, repeat(vertices), components, payload.name, masks)
    with payload.budget.borrow(transient, payload.name), payload.body(minimum, mask_size + full, decoder) as body:
        if has_masks:
            mask = _read_mask(body[:mask_size], tensors, rank, payload.name)
            components = int(mask.sum())
            size = mask_size + arrays.encoded_size(head, components * sum(vertices), components)
            if len(body) != size:
                raise Malformed(f"{payload.name} bytes of the body", size, len(body))
        else:
            mask = np.ones((tensors, rank), bool)
        if components == 0:
            return
        lengths = np.full(components, sum(vertices))
        numbers = arrays.decode(head, body[mask_size:], lengths, f"{payload.name} factors")
        if head.encoding == "grid":
            _place_by_component(numbers, mask, vertices, out)
        else:
            _place_by_vertex(numbers, mask, vertices, out)


def _read_mask(data, tensors, rank, place):
    """Which components are stored, bool[tensors][rank]."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8).reshape(tensors, -1), axis=1, bitorder="little")
    if bits[:, rank:].any():
        raise Malformed(f"{place} unused bits of components", "zeros", "another bit")
    return bits[:, :rank].astype(bool)


def _place_by_component(numbers, mask, vertices, out):
    """Puts numbers in the order [tensor][component][axis][vertex] into `out`."""
    rows = numbers.reshape(-1, sum(vertices))
    start = 0
    for axis, count in enumerate(vertices):
        out[axis][mask] = rows[:, start : start + count]
        start += count


def _place_by_vertex(numbers, mask, vertices, out):
    """Puts numbers in the order [tensor][axis][vertex][stored component] into `out`."""
    present = mask.sum(axis=1)
    starts = (np.cumsum(present) - present) * sum(vertices)
    for components in np.unique(present[present > 0]):
        tensors = np.flatnonzero(present == components)
        which, component = np.nonzero(mask[tensors])
        start = starts[tensors]
        for axis, count in enumerate(vertices):
            entries = start[:, None] + np.arange(count * components)
            vectors = numbers[entries].reshape(-1, count, components).transpose(0, 2, 1)
            out[axis][tensors[which], component] = vectors.reshape(-1, count)
            start = start + count * components
