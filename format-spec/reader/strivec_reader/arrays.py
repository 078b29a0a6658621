"""Arrays of numbers (section 3.3 of the format): their head, and their decoding to float32.

The numbers of an array form groups, each a vector. `decode` returns them in the order of the file. The caller
interprets the order.
"""

from collections import namedtuple

import numpy as np

from . import adaptive
from .errors import Malformed, InvalidScene

ENCODINGS = ("f32", "f16", "grid")
FILTERS = ("none", "planes")
BITS = {"f32": (0,), "f16": (0,), "grid": (16, 8, 6, 5, 4, 3)}
FILTERS_OF = {
    "f32": ("none", "planes"),
    "f16": ("none", "planes"),
    "grid": ("none",),
}
TRANSIENT = 32  # maximum bytes for each number that decoding takes besides its result

_MANTISSAS = np.array(
    [0x3F800000, 0x3F8B95C2, 0x3F9837F0, 0x3FA5FED7, 0x3FB504F3, 0x3FC5672A, 0x3FD744FD, 0x3FEAC0C7], dtype="<u4"
).view("<f4")


def _steps():
    code = np.arange(255)
    steps = np.ldexp(_MANTISSAS[code % 8], code // 8 - 24).astype(np.float32)
    return np.concatenate([np.zeros(1, np.float32), steps])


STEPS = _steps()  # [step code], float32[256]

ArrayHead = namedtuple("ArrayHead", "encoding bits filter")


def check_head(record, offset):
    """Raises Unsupported if a code or the reserved byte of the array head at this offset belongs to a later version."""
    record.check_codes([(offset, "encoding", range(len(ENCODINGS)))])
    encoding = record.data[offset : offset + 1]
    bits = BITS[ENCODINGS[encoding[0]]] if len(encoding) else ()
    filters = range(len(FILTERS))
    record.check_codes([(offset + 1, "bits", bits), (offset + 2, "filter", filters)], [(offset + 3, 1)])


def read_head(record):
    """Reads the array head at the record's position, whose codes were checked."""
    encoding = record.code("encoding", ENCODINGS)
    bits = record.u8("bits")
    filter = record.code("filter", FILTERS)
    if filter not in FILTERS_OF[encoding]:
        raise Malformed(f"{record.place} filter", f"one of {FILTERS_OF[encoding]} for {encoding}", filter)
    record.take(1, "reserved byte")
    return ArrayHead(encoding, bits, filter)


def encoded_size(head, numbers, groups):
    """Bytes of an array of `numbers` numbers in `groups` groups."""
    steps = groups if head.encoding == "grid" else 0
    return steps + width(head) * numbers


def width(head):
    """Bytes of a number."""
    return {"f32": 4, "f16": 2, "grid": 1 if head.bits <= 8 else 2}[head.encoding]


def adaptive_decoder(head, blocks, tensors, name, masks=None):
    """What decodes the body of section `name` from the codec adaptive: see `adaptive.integers`."""

    def decode(data, length):
        if head.encoding != "grid":
            raise Malformed(f"{name} codec", "stored or zstd for floats", "adaptive")
        return adaptive.integers(data, length, head.bits, blocks, tensors, name, masks)

    return decode


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
        numbers = _decode_grid(head, data[groups:], lengths, steps, place)
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
    integers = np.frombuffer(data, "i1" if width(head) == 1 else "<i2", int(lengths.sum())).astype(np.int32)
    largest = 2 ** (head.bits - 1) - 1
    outside = np.abs(integers) > largest
    if outside.any():
        entry = int(np.argmax(outside))
        raise Malformed(f"{place} integer {entry}", f"{-largest} to {largest}", integers[entry])
    of_number = np.repeat(steps, lengths)
    _check_zero_steps(of_number, integers, place)
    return of_number * integers.astype(np.float32)


def _check_zero_steps(of_number, integers, place):
    wrong = (of_number == 0.0) & (integers != 0)
    if wrong.any():
        entry = int(np.argmax(wrong))
        raise Malformed(f"{place} integer {entry}", "0 in a group of step 0", integers[entry])
