"""The Kaitai Struct description of the format against this reader: both find the same numbers in all files that open.

Needs Node, the packages of `npm --prefix tools/web ci`, and the package kaitaistruct. If one is missing, the tests are
skipped, or fail if the variable CI is set.
"""

import enum
import functools
import io
import math
import os
import re
import shutil
import struct
import subprocess
import types
import unittest
import zlib
from pathlib import Path

import numpy as np
import zstandard

from strivec_reader import StrivecError, arrays, factors, limits, scales, sections
from strivec_reader.container import HEADER, ZSTD, Container, Payload

ROOT = Path(__file__).resolve().parents[3]
WEB = ROOT / "tools" / "web"
FIXTURES = ROOT / "fixtures"
DESCRIPTION = (ROOT / "format-spec" / "strivec.ksy").read_text(encoding="utf-8")
FILES = [path for folder in ("v1", "skipped") for path in sorted((FIXTURES / folder).glob("*.strivec"))]
BODIES = ("body", "numbers", "masks", "gaps", "centers", "encoded")

try:
    from kaitaistruct import KaitaiStream, KaitaiStruct

    there = shutil.which("node") and (WEB / "node_modules" / "kaitai-struct-compiler").exists()
except ImportError:
    there = False
if not there and not os.environ.get("CI"):
    raise unittest.SkipTest("Node, tools/web/node_modules/kaitai-struct-compiler or the package kaitaistruct is missing")


@functools.lru_cache(maxsize=None)
def parser(description):
    """The class of the parser that is compiled from `description`."""
    command = ["node", str(WEB / "kaitai.mjs"), "python"]
    run = subprocess.run(command, input=description, stdout=subprocess.PIPE, encoding="utf-8", check=True)
    module = types.ModuleType("strivec_ksy")
    exec(run.stdout, module.__dict__)
    return module.Strivec


def compare(data, original=None, description=DESCRIPTION):
    """Parses `data`, asserts that it holds what the reader finds in `original`, and returns the kinds of its sections."""
    return Comparison(data if original is None else original).run(parser(description)(KaitaiStream(io.BytesIO(data))))


def leaves(value):
    """The numbers, texts, bytes and names of codes of a parsed record, in the order of the file. Asserts that reserved bytes
    are zeros."""
    if isinstance(value, enum.Enum):
        yield value.name
    elif isinstance(value, list):
        for item in value:
            yield from leaves(item)
    elif not isinstance(value, KaitaiStruct):
        yield value
    else:
        for name, field in vars(value).items():
            if name.startswith("reserved"):
                assert not any([field] if isinstance(field, int) else field), f"{name} must be 0, is {field}"
            elif not name.startswith("_") and name not in (*BODIES, "padding", "groups_before"):
                yield from leaves(field)


def same(place, found, expected):
    found, expected = list(found), list(expected)
    assert len(found) == len(expected), f"{place}: {len(found)} fields, must be {len(expected)}"
    for number, (a, b) in enumerate(zip(found, expected)):
        # None: a PSNR that was not measured.
        assert struct.pack("<d", a) == b"\xff" * 8 if b is None else a == b, f"{place}: field {number} must be {b}, is {a}"


def text(string):
    return len(string.encode()), string


def pose(pose):
    return *pose.position, *pose.rotation


def code(name):
    """The reader's name of a code as the description spells it."""
    for old, new in ((" ", "_"), ("+", "plus_"), ("-", "minus_"), ("∞", "_infinity")):
        name = name.replace(old, new)
    return name.lower()


def head(payload):
    """The array head at the end of a record that the reader has read."""
    encoding, bits, filter, _ = payload.data[payload.record.offset - 4 : payload.record.offset]
    return arrays.ENCODINGS[encoding], bits, arrays.FILTERS[filter]


def numbers(array, lengths):
    """float32 of a stored array with groups of these lengths."""
    encoding = array.head.encoding.name
    if encoding == "grid":
        return np.repeat(arrays.STEPS[array.step_codes], lengths) * np.array(array.integers, np.float32)
    if array.head.filter.name == "planes":
        dtype = {"f32": "<f4", "f16": "<f2"}[encoding]
        planes = np.frombuffer(array.planes, np.uint8).reshape(np.dtype(dtype).itemsize, -1)
        return np.ascontiguousarray(planes.T).view(dtype).ravel().astype(np.float32)
    return np.array(array.f32, np.float32) if encoding == "f32" else np.array(array.f16, "<u2").view("<f2").astype(np.float32)


def vectors(found, tensors, rank, vertices):
    """The factors of a stored DENSITY or APPEARANCE: for each axis float32[N][rank][vertices of the axis]."""
    mask = np.ones((tensors, rank), bool)
    if found.components.name == "listed":
        bits = np.frombuffer(b"".join(found.masks), np.uint8).reshape(tensors, -1)
        mask = np.unpackbits(bits, axis=1, bitorder="little")[:, :rank].astype(bool)
    rows = np.split(numbers(found.numbers, sum(vertices)), np.cumsum(mask.sum(axis=1) * sum(vertices)))
    assert len(rows.pop()) == 0, "numbers without a component"
    out = [np.zeros((tensors, rank, count), np.float32) for count in vertices]
    for tensor, row in enumerate(rows):
        components, starts = mask[tensor].sum(), np.cumsum(vertices)[:-1]
        if found.head.encoding.name == "grid":
            parts = np.split(row.reshape(components, sum(vertices)), starts, axis=1)
        else:
            parts = [part.reshape(count, components).T for part, count in zip(np.split(row, starts * components), vertices)]
        for axis, part in enumerate(parts):
            out[axis][tensor, mask[tensor]] = part
    return out


class Comparison:
    """A parsed file with the sections that the reader finds in `data`."""

    def __init__(self, data):
        self.data = data
        self.container = Container(data, limits.Budget(1 << 30))
        self.ranks = 0  # sum of the appearance ranks so far

    def run(self, parsed):
        container, kinds = self.container, []
        expected = [container.count, container.length, container.table_checksum, container.file_checksum]
        expected = [self.data[:8], 1, container.minor, *expected, zlib.crc32(self.data[: HEADER - 4])]
        same("header", leaves(parsed.header), expected)
        for entry, section in zip(parsed.table, container.sections):
            fields = [entry.kind, entry.is_critical, entry.scale, entry.chunk, getattr(entry.codec, "value", entry.codec)]
            fields += [entry.checksum, entry.offset, entry.length, entry.decoded_length]
            reserved = entry.flags > 1 or any(entry.reserved_2 + entry.reserved_4 + entry.reserved_8)
            same(f"entry of {section.name}", [*fields, reserved], section)
            read = getattr(self, section.kind.lower().replace("-", "_"), None)
            if read is None:
                same(section.name, [entry.payload], [self.data[section.offset : section.end]])
                continue
            try:
                payload = Payload(container, section)
                # Reads the whole section before its fields are compared.
                expected = read(payload, entry)
            except StrivecError:
                assert not section.critical, section.name
                continue
            same(section.name, leaves(entry.payload), expected)
            self.check_encoded(entry, payload)
            assert entry.payload._io.is_eof(), f"bytes after {section.name}"
            kinds.append(section.kind)
        return kinds

    def check_encoded(self, entry, payload):
        """The body of an entry that is not parsed fills its payload; it has the decoded length of the table."""
        encoded = getattr(entry.payload, "encoded", None)
        # Masks of matrices do not tell the number of groups by their bytes.
        is_parsed = entry.is_stored and getattr(entry.payload, "has_numbers", True)
        assert (encoded is None) == is_parsed, payload.name
        if encoded is not None:
            start = -(-payload.record.offset // 64) * 64
            same(f"body of {payload.name}", [encoded], [payload.data[start:]])
            if entry.codec.value == ZSTD:
                size = len(zstandard.ZstdDecompressor().decompress(encoded))
                same(f"decoded length of {payload.name}", [entry.decoded_length], [start + size])

    def check_numbers(self, entry, expected, lengths):
        if entry.is_stored:
            np.testing.assert_array_equal(numbers(entry.payload.body, lengths), np.concatenate(expected, axis=None))

    # A section each: its record's fields in the order of the file, by the reader.

    def frame(self, payload, entry):
        f = sections.read_frame(payload)
        return [
            *(f.scale, *f.rotation, *f.translation, f.meters_per_unit or 0, f.near, f.far, *f.background),
            *(code(f.up), code(f.color_space)),
        ]

    def rules(self, payload, entry):
        r = sections.read_rules(payload)
        sky = [] if r.sky is None else r.sky.ravel()
        codes = [r.coverage, r.aggregation, r.density_reduction, r.appearance_reduction]
        codes += [code("none" if r.shell is None else "L∞"), math.isqrt(len(sky) // 3) - 1 if len(sky) else 0]
        numbers = [r.density_shift, r.distance_scale, r.step, r.min_transmittance, r.min_weight, r.shell or 0]
        self.rules_read = r
        return [r.scales, *codes, *r.bounds[0], *r.bounds[1], *numbers, *sky]

    def provenance(self, payload, entry):
        p = sections.read_provenance(payload)
        return [p.steps, p.seed, *text(p.dataset), *text(p.preset), *text(p.tool)]

    def licence(self, payload, entry):
        return text(sections.read_license(payload))

    def quality(self, payload, entry):
        q = sections.read_quality(payload, self.rules_read.scales)
        psnr = [q.encoding_psnr, q.test_psnr, q.original_test_psnr, len(q.prefix_psnr), *q.prefix_psnr]
        return [*psnr, *text(q.dataset)]

    def views(self, payload, entry):
        v = sections.read_views(payload)
        path = [number for p in v.path for number in pose(p)]
        return [v.vertical_angle, *pose(v.initial), *v.target, v.duration, int(v.closed), len(v.path), *path]

    def thumbnail(self, payload, entry):
        t = sections.read_thumbnail(payload)
        return [code(t.format), t.width, t.height, t.data]

    def decoder(self, payload, entry):
        d = self.decoder_read = sections.read_decoder(payload)
        shapes = [layer.weights.shape[::-1] for layer in d.layers]
        lengths = [length for inputs, outputs in shapes for length in [inputs] * outputs + [outputs]]
        self.check_numbers(entry, [a for layer in d.layers for a in (layer.weights, layer.bias)], lengths)
        widths = [width for shape in shapes for width in shape]
        return [code(d.mode), d.feature_frequencies, d.direction_frequencies, len(shapes), *widths, *head(payload)]

    def occupancy(self, payload, entry):
        o = sections.read_occupancy(payload)
        return [*o.corners[0], *o.corners[1], *o.vertices, *([o.bits.tobytes()] if entry.is_stored else [])]

    def scale(self, payload, entry):
        s = self.layout = scales._read_layout(payload)
        self.ranks += s.appearance_rank
        kind = "cp" if s.axis_ranks is None else "vm"
        codes = [kind, s.placement, s.density_rank, s.appearance_rank, len(s.chunks)]
        lattice = [*s.origin, *s.pitch, *s.extent] if s.origin else [0] * 9
        boxes = [number for n, low, high in s.chunks.tolist() for number in (n, *low, *high)] if entry.is_stored else []
        of_axes = [rank for part in s.axis_ranks or [] for rank in part]
        return [s.tensors, s.top_k, *s.half_edges, *s.resolution, *codes, *lattice, *of_axes, *boxes]

    def matrix(self, payload, entry):
        features, rank = self.decoder_read.features, self.layout.appearance_rank
        self.check_numbers(entry, [sections.read_matrix(payload, features, rank)], rank)
        return [features, rank, *head(payload)]

    def placement(self, payload, entry):
        layout = self.layout
        expected = np.zeros((int(layout.chunks[payload.section.chunk]["tensors"]), 3))
        scales._read_placement(payload, layout, expected)
        if entry.is_stored and layout.placement == "lattice":
            cells = np.cumsum([gap.value + 1 for gap in entry.payload.gaps]) - 1
            x, y = layout.extent[:2]
            cells = np.stack([cells % x, cells // x % y, cells // (x * y)], axis=1)
            np.testing.assert_array_equal(layout.origin + (cells + 0.5) * layout.pitch, expected)
        elif entry.is_stored:
            same(payload.name, leaves(entry.payload.centers), expected.ravel())
        return []

    def density(self, payload, entry):
        return self.check_factors(payload, entry, 0)

    def appearance(self, payload, entry):
        return self.check_factors(payload, entry, 1)

    def check_factors(self, payload, entry, part):
        tensors = int(self.layout.chunks[payload.section.chunk]["tensors"])
        expected = [scales.empty_block(tensors, *shape) for shape in scales.block_shapes(self.layout, part)]
        factors.read_factors(payload, expected)
        if entry.payload.has_numbers:
            (block,) = expected
            vertices = [cells + 1 for cells in self.layout.resolution]
            for one, other in zip(vectors(entry.payload, tensors, block.rank, vertices), block.factors):
                np.testing.assert_array_equal(one, other)
        return [("all", "listed")[payload.data[0]], *head(payload)]

    def prefix(self, payload, entry):
        p = sections.read_prefix(payload, self.decoder_read.features, self.ranks)
        self.check_numbers(entry, [p.matrix], self.ranks)
        return [p.gain, p.offset, *p.matrix.shape, *head(payload)]

    def probes(self, payload, entry):
        p = sections.read_probes(payload, self.rules_read)
        columns = [p.origins, p.directions, p.colors, p.opacities, p.depths, p.points, p.densities, p.margins]
        return [p.color_tolerance, p.depth_tolerance, p.density_tolerance, len(p.depths), *np.column_stack(columns).ravel()]

    def cameras(self, payload, entry):
        cameras = sections.read_cameras(payload)
        rows = [
            [*pose(c.pose), *c.focal_length, *c.principal_point, *c.size, c.projection]
            + [*c.radial, *c.divisor, *c.tangential, *c.prism]
            for c in cameras
        ]
        return [len(cameras), *(number for row in rows for number in row if entry.is_stored)]

    def notes(self, payload, entry):
        notes = sections.read_notes(payload)
        texts = [field for note in notes.items() for string in note for field in text(string)]
        return [len(notes), *(texts if entry.is_stored else [])]


class Description(unittest.TestCase):
    def test_it_finds_what_this_reader_finds(self):
        kinds = set()
        for path in FILES:
            with self.subTest(path.name):
                kinds.update(compare(path.read_bytes()))
        self.assertEqual(len(kinds), 18, "sections of all kinds are compared")

    def test_a_changed_byte_is_seen(self):
        for name in ("smallest", "everything"):
            data = (FIXTURES / "v1" / f"{name}.strivec").read_bytes()
            parsed = Container(data, limits.Budget(1 << 30))
            places = [*range(HEADER + 64 * parsed.count), *(n for s in parsed.sections for n in range(s.offset, s.end))]
            for place in places[:: 1 if name == "smallest" else 7]:
                changed = bytearray(data)
                changed[place] ^= 0x41
                with self.subTest(f"byte {place} of {name}"), self.assertRaises(Exception):
                    compare(bytes(changed), data)

    def test_a_changed_description_is_seen(self):
        data = (FIXTURES / "v1" / "everything.strivec").read_bytes()
        for old, new in (
            ("{id: seed, type: u8", "{id: seed, type: u4"),
            ("      - {id: near, type: f8, doc: Where rays begin in model units from the camera}\n", ""),
            ("-_io.pos % 64", "-_io.pos % 32"),
            ("1: per_ray, 2: residual", "2: per_ray, 1: residual"),
        ):
            self.assertIn(old, DESCRIPTION)
            description = DESCRIPTION.replace(old, new)
            parser(description)  # compiles
            with self.subTest(old), self.assertRaises(Exception):
                compare(data, description=description)

    def test_references_are_sections_of_the_specification(self):
        titles = re.findall(r"^#+ (.+)$", (ROOT / "format-spec" / "v1.md").read_text(encoding="utf-8"), re.MULTILINE)
        anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
        references = re.findall(r"doc-ref: v1\.md#(\S+)", DESCRIPTION)
        self.assertGreater(len(references), 30)
        self.assertEqual(set(references) - anchors, set())


if __name__ == "__main__":
    unittest.main()
