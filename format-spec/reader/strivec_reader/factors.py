"""DENSITY and APPEARANCE (section 3.10 of the format): the factors of a chunk's tensors."""

import math

import numpy as np

from . import arrays
from .errors import Malformed


def read_factors(payload, out):
    """Decodes a chunk's factors into `out`, a list of `Block`s whose numbers are zeros.

    Leaves the components that are not stored as they are in `out`.
    """
    tensors = len(out[0].factors[0])
    rank = sum(block.rank for block in out)
    record = payload.record
    record.check_codes([(0, "components", range(2))], [(1, 7)])
    arrays.check_head(record, 8)
    has_masks = record.code("components", (False, True))
    record.take(7, "reserved bytes")
    head = arrays.read_head(record)

    lengths = [_length(block) for block in out]
    full = arrays.encoded_size(head, tensors * sum(b.rank * n for b, n in zip(out, lengths)), tensors * rank)
    mask_size = tensors * -(-rank // 8) if has_masks else 0
    minimum = mask_size if has_masks else full
    transient = arrays.TRANSIENT * tensors * sum(b.rank * n for b, n in zip(out, lengths)) + 16 * mask_size
    masks = (tensors, rank) if has_masks else None
    groups = [(block.rank, _vectors(block)) for block in out]
    decoder = arrays.adaptive_decoder(head, groups, tensors, payload.name, masks)
    with payload.budget.borrow(transient, payload.name), payload.body(minimum, mask_size + full, decoder) as body:
        if has_masks:
            mask = _read_mask(body[:mask_size], tensors, rank, payload.name)
        else:
            mask = np.ones((tensors, rank), bool)
        ends = np.cumsum([block.rank for block in out])
        masks = np.split(mask, ends[:-1], axis=1)
        counts = [int(mask.sum()) for mask in masks]
        size = mask_size + arrays.encoded_size(head, sum(c * n for c, n in zip(counts, lengths)), sum(counts))
        if len(body) != size:
            raise Malformed(f"{payload.name} bytes of the body", size, len(body))
        if not any(counts):
            return
        numbers = arrays.decode(head, body[mask_size:], np.repeat(lengths, counts), f"{payload.name} factors")
        start = 0
        for block, mask, count, length in zip(out, masks, counts, lengths):
            part = numbers[start : start + count * length]
            start += count * length
            if head.encoding == "grid":
                _place_by_component(part, mask, block.factors)
            else:
                _place_by_row(part, mask, block.factors)


def _length(block):
    """Numbers of a component."""
    return sum(math.prod(array.shape[2:]) for array in block.factors)


def _vectors(block):
    """The lengths of the vectors of a component: a matrix has one for each row."""
    return [array.shape[-1] for array in block.factors for _ in range(math.prod(array.shape[2:-1]))]


def _read_mask(data, tensors, rank, place):
    """Which components are stored, bool[tensors][rank]."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8).reshape(tensors, -1), axis=1, bitorder="little")
    if bits[:, rank:].any():
        raise Malformed(f"{place} unused bits of components", "zeros", "another bit")
    return bits[:, :rank].astype(bool)


def _place_by_component(numbers, mask, out):
    """Puts numbers in the order [tensor][component][row] into `out`."""
    rows = numbers.reshape(-1, sum(math.prod(array.shape[2:]) for array in out))
    start = 0
    for array in out:
        count = math.prod(array.shape[2:])
        array[mask] = rows[:, start : start + count].reshape(-1, *array.shape[2:])
        start += count


def _place_by_row(numbers, mask, out):
    """Puts numbers in the order [tensor][row][stored component] into `out`."""
    present = mask.sum(axis=1)
    starts = (np.cumsum(present) - present) * sum(math.prod(array.shape[2:]) for array in out)
    for components in np.unique(present[present > 0]):
        tensors = np.flatnonzero(present == components)
        which, component = np.nonzero(mask[tensors])
        start = starts[tensors]
        for array in out:
            count = math.prod(array.shape[2:])
            entries = start[:, None] + np.arange(count * components)
            factors = numbers[entries].reshape(-1, count, components).transpose(0, 2, 1)
            array[tensors[which], component] = factors.reshape(-1, *array.shape[2:])
            start = start + count * components
