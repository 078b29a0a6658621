"""A record, read field by field: little-endian numbers without padding (sections 1 and 2.2 of the format)."""

import math
import struct

from . import limits
from .errors import Malformed, InvalidScene, Unsupported

_ABSENT = b"\xff" * 8  # the f64 for "not measured"


class Record:
    """Reads fields in order from the start of `data`; `place` names the section in errors."""

    def __init__(self, data, place):
        self.data = data
        self.place = place
        self.offset = 0

    def take(self, size, name):
        """The next `size` bytes."""
        end = self.offset + size
        if end > len(self.data):
            raise Malformed(f"{self.place} {name}", f"at least {end} bytes", len(self.data))
        limits.check(end, limits.RECORD, f"{self.place} bytes of the record")
        field = bytes(self.data[self.offset : end])
        self.offset = end
        return field

    def _numbers(self, layout, name):
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout), name))

    def u8(self, name):
        return self._numbers("B", name)[0]

    def u16(self, name):
        return self._numbers("H", name)[0]

    def u32(self, name, limit=None):
        """A u32, within `limit` if one is given."""
        value = self._numbers("I", name)[0]
        return value if limit is None else limits.check(value, limit, f"{self.place} {name}")

    def u32s(self, count, name, limit):
        """A tuple of `count` u32, each within `limit`."""
        return tuple(limits.check(value, limit, f"{self.place} {name}") for value in self._numbers(f"{count}I", name))

    def u64(self, name, limit=None):
        """A u64, within `limit` if one is given."""
        value = self._numbers("Q", name)[0]
        return value if limit is None else limits.check(value, limit, f"{self.place} {name}")

    def f32(self, name):
        return self._numbers("f", name)[0]

    def f32s(self, count, name):
        return self._numbers(f"{count}f", name)

    def f64(self, name, rule="a finite number"):
        """An f64 that satisfies `rule`, a key of `RULES`."""
        value = self._numbers("d", name)[0]
        self.require(RULES[rule](value), name, rule, value)
        return value

    def f64s(self, count, name, rule="a finite number"):
        """A tuple of `count` f64 that each satisfy `rule`."""
        values = self._numbers(f"{count}d", name)
        for value in values:
            self.require(RULES[rule](value), name, rule, value)
        return values

    def f64_unless_zero(self, name, rule):
        """An f64 that satisfies `rule`, or None if all its bits are zero."""
        if self.take(8, name) == bytes(8):
            return None
        self.offset -= 8
        return self.f64(name, rule)

    def f64_unless_absent(self, name):
        """A finite f64 or +infinity, or None if all its bits are set."""
        field = self.take(8, name)
        if field == _ABSENT:
            return None
        value = struct.unpack("<d", field)[0]
        self.require(value > -math.inf, name, "a finite number, +infinity or all bits set", value)
        return value

    def quaternion(self, name):
        """Four f64 x, y, z, w of length 1 within 1e-6."""
        values = self.f64s(4, name)
        length = math.sqrt(sum(value * value for value in values))
        self.require(abs(length - 1.0) <= 1e-6, name, "length 1", length)
        return values

    def string(self, name, limit=limits.STRING):
        """A UTF-8 string whose number of bytes is within `limit`."""
        size = self.u64(name, limit)
        field = self.take(size, name)
        try:
            return field.decode("utf-8")
        except UnicodeDecodeError as error:
            raise Malformed(f"{self.place} {name}", "UTF-8", f"{error.reason} at byte {error.start}") from None

    def code(self, name, choices):
        """The entry of `choices` that a u8 selects."""
        value = self.u8(name)
        if value >= len(choices):
            raise Unsupported(f"{self.place} {name}", f"code {value}")
        return choices[value]

    def check_codes(self, codes=(), reserved=()):
        """Raises Unsupported if a code or a reserved byte of the record belongs to a later version.

        `codes` has an offset, a name and the known codes for each code of the record, `reserved` an offset and a size.
        Bytes that are not there are left to what reads them.
        """
        for offset, name, known in codes:
            field = self.data[offset : offset + 1]
            if len(field) and field[0] not in known:
                raise Unsupported(f"{self.place} {name}", f"code {field[0]}")
        for offset, size in reserved:
            if any(self.data[offset : offset + size]):
                raise Unsupported(f"{self.place} reserved bytes", "a value other than 0")

    def zeros(self, size, name):
        """Bytes that must be zero."""
        if any(self.take(size, name)):
            raise Malformed(f"{self.place} {name}", "zeros", "another byte")

    def require(self, holds, name, expected, found):
        """Raises InvalidScene unless `holds`."""
        if not holds:
            raise InvalidScene(f"{self.place} {name}", expected, found)


RULES = {
    "a number": lambda value: True,
    "a finite number": math.isfinite,
    "a positive finite number": lambda value: math.isfinite(value) and value > 0.0,
    "a number of at least 0": lambda value: math.isfinite(value) and value >= 0.0,
    "a number in [0, 1)": lambda value: 0.0 <= value < 1.0,
    "an angle in (0, pi)": lambda value: 0.0 < value < math.pi,
}
