"""Arrays of numbers (section 3.3 of the format): their head, and their decoding to float32.

The numbers of an array form groups, each a vector. `decode` returns them in the order of the file. The caller
interprets the order.
"""

from collections import namedtuple

import numpy as np

from . import limits
from .errors import Malformed, InvalidScene, Unsupported

ENCODINGS = ("f32", "f16", "grid", "cosine")
FILTERS = ("none", "planes", "differences")
WIDTH = {"f32": 4, "f16": 2, "grid": 1, "cosine": 2}  # bytes of a number
BITS = {"f32": (0,), "f16": (0,), "grid": (8, 6, 5, 4, 3), "cosine": (16,)}
FILTERS_OF = {
    "f32": ("none", "planes"),
    "f16": ("none", "planes"),
    "grid": ("none", "differences"),
    "cosine": ("none", "planes"),
}
NETWORK_ENCODINGS = ("f32", "f16", "grid")
TRANSIENT = 32  # maximum bytes for each number that decoding takes besides its result
COSINE_BATCH = 1 << 16  # numbers of the cosine transform that are in float64 at once

_MANTISSAS = np.array(
    [0x3F800000, 0x3F8B95C2, 0x3F9837F0, 0x3FA5FED7, 0x3FB504F3, 0x3FC5672A, 0x3FD744FD, 0x3FEAC0C7], dtype="<u4"
).view("<f4")


def _steps():
    code = np.arange(255)
    steps = np.ldexp(_MANTISSAS[code % 8], code // 8 - 24).astype(np.float32)
    return np.concatenate([np.zeros(1, np.float32), steps])


STEPS = _steps()  # [step code], float32[256]

ArrayHead = namedtuple("ArrayHead", "encoding bits filter error")


def read_head(record, encodings=ENCODINGS):
    """Reads the array head at the record's position; its encoding must be one of `encodings`."""
    encoding = record.code("encoding", ENCODINGS)
    if encoding not in encodings:
        raise Malformed(f"{record.place} encoding", " or ".join(encodings), encoding)
    bits = record.u8("bits")
    if bits not in BITS[encoding]:
        raise Unsupported(f"{record.place} bits of {encoding}", f"code {bits}")
    filter = record.code("filter", FILTERS)
    if filter not in FILTERS_OF[encoding]:
        raise Malformed(f"{record.place} filter", f"one of {FILTERS_OF[encoding]} for {encoding}", filter)
    record.zeros(1)
    error = record.f32("error")
    record.require(np.isfinite(error) and error >= 0.0, "error", "a number of at least 0", error)
    record.require(encoding != "f32" or error == 0.0, "error", "0 for f32", error)
    return ArrayHead(encoding, bits, filter, error)


def encoded_size(head, numbers, groups):
    """Bytes of an array of `numbers` numbers in `groups` groups."""
    steps = groups if head.encoding in ("grid", "cosine") else 0
    return steps + WIDTH[head.encoding] * numbers


def decode(head, data, lengths, place):
    """Decodes an array to float32[sum of lengths], all finite.

    `data` is bytes-like, of `encoded_size` bytes. `lengths` holds the length of each group, int[groups].
    """
    total = int(lengths.sum())
    if head.encoding == "f32":
        numbers = _without_planes(head, data, "<f4", total).astype(np.float32)
    elif head.encoding == "f16":
        numbers = _without_planes(head, data, "<f2", total).astype(np.float32)
    else:
        groups = len(lengths)
        steps = STEPS[np.frombuffer(data, np.uint8, groups)]
        if head.encoding == "grid":
            numbers = _decode_grid(head, data[groups:], lengths, steps, place)
        else:
            numbers = _decode_cosine(head, data[groups:], lengths, steps, place)
    finite = np.isfinite(numbers)
    if not finite.all():
        entry = int(np.argmin(finite))
        raise InvalidScene(f"{place} entry {entry}", "a finite number", numbers[entry])
    return numbers


def _without_planes(head, data, dtype, count):
    dtype = np.dtype(dtype)
    if head.filter != "planes":
        return np.frombuffer(data, dtype, count)
    planes = np.frombuffer(data, np.uint8, count * dtype.itemsize).reshape(dtype.itemsize, count)
    return np.ascontiguousarray(planes.T).view(dtype).reshape(count)


def _decode_grid(head, data, lengths, steps, place):
    total = int(lengths.sum())
    integers = np.frombuffer(data, np.uint8, total)
    if head.filter == "differences":
        integers = np.cumsum(integers, dtype=np.uint8)  # modulo 256, over all groups at once
        ends = np.cumsum(lengths)
        before = np.concatenate([np.zeros(1, np.uint8), integers[ends[:-1] - 1]])
        integers = integers - np.repeat(before, lengths)
    integers = integers.view(np.int8)
    largest = 2 ** (head.bits - 1) - 1
    outside = (integers > largest) | (integers < -largest)
    if outside.any():
        entry = int(np.argmax(outside))
        raise Malformed(f"{place} integer {entry}", f"{-largest} to {largest}", integers[entry])
    of_number = np.repeat(steps, lengths)
    _check_zero_steps(of_number, integers, place)
    return of_number * integers.astype(np.float32)


def _decode_cosine(head, data, lengths, steps, place):
    limits.check(int(lengths.max()), limits.COSINE_LENGTH, f"{place} numbers of a group")
    total = int(lengths.sum())
    zigzag = _without_planes(head, data, "<u2", total)
    integers = (zigzag >> 1).astype(np.int32) ^ -(zigzag & 1).astype(np.int32)
    _check_zero_steps(np.repeat(steps, lengths), integers, place)
    starts = np.cumsum(lengths) - lengths
    numbers = np.empty(total, np.float32)
    for length in np.unique(lengths):
        basis = cosine_basis(int(length))
        of_length = np.flatnonzero(lengths == length)
        batch = max(1, COSINE_BATCH // int(length))
        for first in range(0, len(of_length), batch):
            groups = of_length[first : first + batch]
            entries = starts[groups, None] + np.arange(length)
            coefficients = steps[groups, None].astype(np.float64) * integers[entries]
            numbers[entries] = coefficients @ basis
    return numbers


def cosine_basis(n):
    """The basis of the orthonormal cosine transform of n numbers, float64[coefficient k][number i]."""
    k = np.arange(n)[:, None]
    i = np.arange(n)[None, :]
    scale = np.where(k == 0, np.sqrt(1.0 / n), np.sqrt(2.0 / n))
    return scale * np.cos(np.pi * (i + 0.5) * k / n)


def _check_zero_steps(of_number, integers, place):
    wrong = (of_number == 0.0) & (integers != 0)
    if wrong.any():
        entry = int(np.argmax(wrong))
        raise Malformed(f"{place} integer {entry}", "0 in a group of step 0", integers[entry])
