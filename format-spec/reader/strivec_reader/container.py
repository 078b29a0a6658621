"""Header, section table and payloads (section 2 of the format): the bytes of a file to records and bodies.

A `Container` checks the length, the checksums and the padding of the file, then returns sections in the order of the
file. The module `sections` interprets records and bodies.
"""

import struct
import zlib
from collections import namedtuple
from contextlib import contextmanager

import zstandard

from . import limits
from .errors import (
    Corrupt,
    LineEndingDamage,
    Malformed,
    MissingSection,
    NotStrivec,
    Truncated,
    UnknownCritical,
    Unsupported,
    UnsupportedVersion,
)
from .record import Record

MAGIC = b"\xb3STV\r\n\x1a\n"
HEADER = 64  # bytes
ENTRY = struct.Struct("<12sHHIHHIIQQQQ")  # 64 bytes
ALIGNMENT = 64  # bytes
NO_SCALE = 0xFFFF
NO_CHUNK = 0xFFFFFFFF
STORED, ZSTD, ADAPTIVE = 0, 1, 2
ADAPTIVE_KINDS = ("DECODER", "OCCUPANCY", "MATRIX", "DENSITY", "APPEARANCE", "PREFIX")
MAX_WINDOW = 1 << 27  # bytes
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
NAME_BYTES = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-")

Kind = namedtuple("Kind", "critical compressible of_scale of_chunk", defaults=(False, False))

KINDS = {
    "FRAME": Kind(True, False),
    "RULES": Kind(True, False),
    "PROVENANCE": Kind(False, False),
    "LICENCE": Kind(False, False),
    "QUALITY": Kind(False, False),
    "VIEWS": Kind(False, False),
    "DECODER": Kind(True, True),
    "OCCUPANCY": Kind(True, True),
    "SCALE": Kind(True, True, True),
    "MATRIX": Kind(True, True, True),
    "PLACEMENT": Kind(True, True, True, True),
    "DENSITY": Kind(True, True, True, True),
    "APPEARANCE": Kind(True, True, True, True),
    "PREFIX": Kind(False, True, True),
    "PROBES": Kind(False, False),
    "CAMERAS": Kind(False, True),
    "THUMBNAIL": Kind(False, False),
    "NOTES": Kind(False, True),
}


class Section(
    namedtuple("Section", "kind critical scale chunk codec checksum offset length decoded_length uses_reserved")
):
    """One entry of the table; `offset` and the lengths are in bytes."""

    @property
    def key(self):
        return self.kind, self.scale, self.chunk

    @property
    def end(self):
        return self.offset + self.length

    @property
    def name(self):
        return section_name(*self.key)


def section_name(kind, scale, chunk):
    """The name of a section in errors, such as `DENSITY of chunk 0 of scale 1`."""
    name = kind
    if chunk != NO_CHUNK:
        name += f" of chunk {chunk}"
    if scale != NO_SCALE:
        name += f" of scale {scale}"
    return name


def align(offset):
    """The first multiple of 64 that is at least `offset`."""
    return -(-offset // ALIGNMENT) * ALIGNMENT


class Container:
    """The sections of a file. `data` is a bytes-like object, `budget` a `limits.Budget`."""

    def __init__(self, data, budget):
        self.data = memoryview(data)
        self.budget = budget
        self.unknown = []  # ancillary sections of unknown kinds
        self._read_header()
        self._read_table()
        self._check_bytes()
        self._next = 0  # index of the next section
        self._keys = {section.key for section in self.sections}

    def _read_header(self):
        data = self.data
        start = bytes(data[: len(MAGIC)])
        if start != MAGIC:
            if MAGIC.startswith(start):
                raise Truncated("header", len(data), HEADER)
            damaged = bytes(data[:12])
            raise (LineEndingDamage if is_damaged_magic(damaged) else NotStrivec)(start)
        if len(data) >= 12:
            major, minor = struct.unpack_from("<HH", data, 8)
            if major != 1:
                raise UnsupportedVersion(major, minor)
        if len(data) < HEADER:
            raise Truncated("header", len(data), HEADER)
        count, self.length, self.table_checksum, self.file_checksum = struct.unpack_from("<IQII", data, 12)
        _check_sum(data, 0, 60, struct.unpack_from("<I", data, 60)[0], "header")
        self.minor = minor
        self.count = limits.check(count, limits.SECTIONS, "header section count")
        if any(data[32:60]):
            raise Unsupported("header reserved bytes", "a value other than 0")

    def _read_table(self):
        end = HEADER + self.count * ENTRY.size
        if end > len(self.data):
            raise Truncated("section table", len(self.data), end)
        _check_sum(self.data, HEADER, end, self.table_checksum, "section table")
        self.budget.take(16 * (end - HEADER), "section table")
        self.sections = []
        for index in range(self.count):
            section = _read_entry(index, ENTRY.unpack_from(self.data, HEADER + index * ENTRY.size))
            if section.offset != align(end):
                raise Malformed(f"{section.name} offset", align(end), section.offset)
            end = section.end  # Python's integers do not overflow
            self.sections.append(section)
        if end != self.length:
            raise Malformed("header file length", end, self.length)
        for section in self.sections:
            if section.kind not in KINDS and section.critical:
                raise UnknownCritical(section.name)

    def _check_bytes(self):
        """Checks length, checksums and padding. `damaged` has the errors of ancillary sections, by their entries."""
        size = len(self.data)
        if size < self.length:
            cut = next(section for section in self.sections if section.end > size)
            raise Truncated(cut.name, size, self.length)
        if size > self.length:
            raise Malformed("bytes in the file", self.length, size)
        self.damaged = {}
        for section in self.sections:
            try:
                _check_sum(self.data, section.offset, section.end, section.checksum, section.name)
            except Corrupt as error:
                if section.critical:
                    raise
                self.damaged[section] = error
        if not self.damaged:
            _check_sum(self.data, HEADER, self.length, self.file_checksum, "file")
        end = HEADER + self.count * ENTRY.size
        for section in self.sections:
            if any(self.data[end : section.offset]):
                raise Malformed(f"padding before {section.name}", "zeros", "another byte")
            end = section.end

    def check_usable(self, section):
        """Raises the error for which an entry or its payload as a whole cannot be used."""
        if section in self.damaged:
            raise self.damaged[section]
        if section.uses_reserved:
            raise Unsupported(f"{section.name} flags or reserved bytes", "a value that version 1.0 does not define")

    def _pass(self):
        section = self.sections[self._next]
        self._next += 1
        return section

    def _pass_unknown(self):
        while self._next < self.count and self.sections[self._next].kind not in KINDS:
            self.unknown.append(self._pass())

    def find(self, kind, scale=NO_SCALE, chunk=NO_CHUNK):
        """The `Payload` of this section if it is next in the file, otherwise None."""
        self._pass_unknown()
        if self._next == self.count or self.sections[self._next].key != (kind, scale, chunk):
            return None
        return Payload(self, self._pass())

    def require(self, kind, scale=NO_SCALE, chunk=NO_CHUNK):
        """The `Payload` of this section, which must be next in the file."""
        payload = self.find(kind, scale, chunk)
        if payload is None:
            if (kind, scale, chunk) not in self._keys:
                raise MissingSection(section_name(kind, scale, chunk))
            found = self.sections[self._next].name if self._next < self.count else "the end of the table"
            raise Malformed("next section", section_name(kind, scale, chunk), found)
        return payload

    def finish(self):
        """Checks that no known section is left."""
        self._pass_unknown()
        if self._next < self.count:
            raise Malformed("next section", "of an unknown kind", self.sections[self._next].name)


class Payload:
    """A section's bytes. Read `record` first, then `body`, or call `end` if the section has no body."""

    def __init__(self, container, section):
        container.check_usable(section)
        if section.codec not in (STORED, ZSTD, ADAPTIVE):
            raise Unsupported(section.name, f"codec {section.codec}")
        if section.codec == ZSTD and not KINDS[section.kind].compressible:
            raise Malformed(f"{section.name} codec", STORED, section.codec)
        if section.codec == ADAPTIVE and section.kind not in ADAPTIVE_KINDS:
            raise Malformed(f"{section.name} codec", "0 or 1", section.codec)
        self.name = section.name
        self.section = section
        self.budget = container.budget
        self.data = container.data[section.offset : section.end]
        self.record = Record(self.data, self.name)

    def end(self):
        """Checks that the record fills the payload."""
        if self.record.offset != len(self.data):
            raise Malformed(f"{self.name} length", self.record.offset, len(self.data))

    @property
    def body_length(self):
        """Bytes of the decoded body, by the table. Read the record first."""
        start = self._body_start()
        if self.section.decoded_length < start:
            raise Malformed(f"{self.name} decoded length", f"at least {start}", self.section.decoded_length)
        return self.section.decoded_length - start

    @contextmanager
    def body(self, minimum, maximum=None, adaptive=None):
        """The decoded body for the duration of a `with` block, of `minimum` bytes or of `minimum` to `maximum` bytes.

        A stored body is a view into the file. Another one is decoded into memory of the budget, in the codec adaptive by
        `adaptive`, from its bytes and the length of the body.
        """
        maximum = minimum if maximum is None else maximum
        length = self.body_length
        if not minimum <= length <= maximum:
            expected = f"{minimum}" if minimum == maximum else f"{minimum} to {maximum}"
            raise Malformed(f"{self.name} bytes of the body", expected, length)
        stored = self.data[self._body_start() :]
        if self.section.codec == STORED:
            yield stored
            return
        if self.section.codec == ADAPTIVE:
            with self.budget.borrow(length, self.name):
                yield memoryview(adaptive(stored, length))
            return
        _check_zstd_frame(stored, length, self.name)
        with self.budget.borrow(length, self.name):
            yield memoryview(_decode_zstd(stored, length, self.name))

    def _body_start(self):
        end = self.record.offset
        start = align(end)
        if start > len(self.data):
            raise Malformed(f"{self.name} length", f"at least {start}", len(self.data))
        if any(self.data[end:start]):
            raise Malformed(f"{self.name} padding before the body", "zeros", "another byte")
        return start


def is_damaged_magic(start):
    """Whether `start` begins with a damaged magic (section 2.1)."""
    for first in (b"\xb3", b"\x33", b"\xc2\xb3", b"\xef\xbf\xbd"):
        if start.startswith(first + b"STV"):
            rest = start[len(first) + 3 :]
            line_ends = len(rest) - len(rest.lstrip(b"\r\n"))
            return line_ends <= 4 and rest[line_ends : line_ends + 1] == b"\x1a"
    return False


def _check_sum(data, start, end, expected, place):
    found = zlib.crc32(data[start:end])
    if found != expected:
        raise Corrupt(place, start, end, found, expected)


def _read_entry(index, fields):
    name, flags, scale, chunk, codec, reserved, checksum, reserved4, offset, length, decoded_length, reserved8 = fields
    letters = name.rstrip(b"\0")
    if not letters or not NAME_BYTES.issuperset(letters):
        expected = "capital letters, digits and hyphens, then zeros"
        raise Malformed(f"name of section {index}", expected, name.hex(" "))
    section = Section(
        letters.decode(),
        bool(flags & 1),
        scale,
        chunk,
        codec,
        checksum,
        offset,
        length,
        decoded_length,
        flags > 1 or reserved != 0 or reserved4 != 0 or reserved8 != 0,
    )
    kind = KINDS.get(section.kind)
    if kind is not None and kind.critical != section.critical:
        raise Malformed(f"{section.name} flags", "critical" if kind.critical else "ancillary", "the other")
    if kind is not None and (scale != NO_SCALE, chunk != NO_CHUNK) != (kind.of_scale, kind.of_chunk):
        raise Malformed(f"section {section.kind}", "of its scale and chunk, if it has them", section.name)
    if codec == STORED and decoded_length != length:
        raise Malformed(f"{section.name} decoded length", length, decoded_length)
    return section


def _check_zstd_frame(frame, length, place):
    """Checks that `frame` begins a zstd frame without dictionary that declares `length` bytes of content."""
    if frame[:4] != ZSTD_MAGIC:
        raise Malformed(place, "a zstd frame", bytes(frame[:4]).hex(" "))
    try:
        parameters = zstandard.get_frame_parameters(frame)
    except zstandard.ZstdError as error:
        raise Malformed(place, "a whole zstd frame", error) from None
    if parameters.content_size != length:
        unknown = parameters.content_size == zstandard.CONTENTSIZE_UNKNOWN
        found = "no declared size" if unknown else parameters.content_size
        raise Malformed(f"{place} content of the zstd frame", f"{length} bytes", found)
    is_single_segment = frame[4] & 0x20 != 0
    if parameters.window_size > MAX_WINDOW and not is_single_segment:
        raise Malformed(f"{place} window of the zstd frame", f"at most {MAX_WINDOW} bytes", parameters.window_size)
    if parameters.dict_id:
        raise Malformed(f"{place} dictionary of the zstd frame", "none", parameters.dict_id)


def _decode_zstd(frame, length, place):
    """The content of one zstd frame that declares `length` bytes; never writes more than those."""
    if length == 0:
        # The decompressor does not look at such a frame as a whole.
        return _decode_empty_frame(frame, place)
    try:
        # One pass into a buffer of the declared size: the frame's window takes no memory of its own.
        content = zstandard.ZstdDecompressor().decompress(frame, allow_extra_data=False)
    except zstandard.ZstdError as error:
        raise Malformed(place, "a whole zstd frame", error) from None
    if len(content) != length:
        raise Malformed(f"{place} content of the zstd frame", f"{length} bytes", len(content))
    return content


def _decode_empty_frame(frame, place):
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    try:
        content = decompressor.decompress(bytes(frame))
    except zstandard.ZstdError as error:
        raise Malformed(place, "a whole zstd frame", error) from None
    if content or not decompressor.eof or decompressor.unused_data:
        raise Malformed(place, "one whole zstd frame of no content", f"{len(frame)} bytes")
    return content
