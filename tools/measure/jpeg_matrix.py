#!/usr/bin/env python3
"""JPEG pictures of all kinds with the pixels that libjpeg decodes them to, for the tests of the decoder.

    tools/measure/jpeg_matrix.py --out fixtures/jpeg.zip
    tools/measure/jpeg_matrix.py --full --out /tmp/jpeg.zip

writes an archive of small pictures and of `expected.tsv`: name, columns, rows, channels and the checksum (CRC-32) of the
samples by `djpeg`, or why the picture is refused. Without --full it has a picture of each pair of a sampling and a script of
scans; with it, each combination of sampling, script, restart interval and size, and a file NAME.pnm with each picture's
samples. Runs `cjpeg` and `djpeg` of libjpeg-turbo (Debian: libjpeg-turbo-progs). Pictures of four components, which `cjpeg`
does not write, are put together from gray ones.
"""

import argparse
import itertools
import struct
import subprocess
import tempfile
import zipfile
import zlib
from pathlib import Path

SAMPLINGS = [
    "1x1", "2x1", "2x2", "1x2", "4x1", "1x4", "4x2", "3x1", "3x2",
    "2x2,2x1,2x1", "2x2,1x2,1x2", "2x2,2x1,1x2", "4x1,2x1,1x1", "1x4,1x2,1x1", "1x1,2x1,1x1", "1x1,1x1,2x2", "4x4", "2x2,2x2,2x2",
]
# Samplings whose minimum coded unit has more than ten blocks, which no scan of all components may have.
SEPARATE_ONLY = {"4x4", "2x2,2x2,2x2"}

# Scripts of scans: name, and a text for `cjpeg -scans`, or None for one without.
SEQUENTIAL = {
    "interleaved": None,
    "each": "0;1;2;",
    "reversed": "2;1;0;",
    "luma-second": "1;0;2;",
    "luma-first": "0;1,2;",
    "luma-last": "1,2;0;",
}
PROGRESSIVE = {
    "progressive": "",
    "spectral": "0,1,2: 0-0, 0, 0; 2: 1-63, 0, 0; 0: 1-9, 0, 0; 1: 1-63, 0, 0; 0: 10-63, 0, 0;",
    "means-each": "2: 0-0, 0, 0; 0: 0-0, 0, 0; 1: 0-0, 0, 0; 0: 1-63, 0, 0; 1: 1-63, 0, 0; 2: 1-63, 0, 0;",
    "bitwise": "".join([
        "1: 0-0, 0, 2; 0: 0-0, 0, 2; 2: 0-0, 0, 2;",
        "".join(f"{c}: 1-5, 0, 3; {c}: 6-63, 0, 3;" for c in "201"),
        "".join(f"{c}: 0-0, {low + 1}, {low};" for low in (1, 0) for c in "021"),
        "".join(f"{c}: 1-63, {low + 1}, {low};" for low in (2, 1, 0) for c in "012"),
    ]),
}
SCRIPTS = SEQUENTIAL | PROGRESSIVE
TOGETHER = {"interleaved", "progressive", "spectral"}
RESTARTS = ["0", "1B", "3B", "1"]
SIZES = [(35, 27), (64, 16), (1, 1), (17, 33), (50, 3), (2, 41), (48, 48)]
QUALITIES = ["35", "75", "95"]


def picture(width, height, channels):
    """A netpbm picture with edges, waves and noise that do not depend on a library's random numbers."""
    samples, state = bytearray(), 12345
    for y, x, c in itertools.product(range(height), range(width), range(channels)):
        state = (1103515245 * state + 12345) % 2**31
        wave = 60 if (x // 5 + y // 7 + c) % 2 else 190
        samples.append(max(0, min(255, wave + (3 * x * (c + 1) + 2 * y) % 53 - 26 + state // 2**16 % 21 - 10)))
    return b"P%d\n%d %d\n255\n" % (6 if channels == 3 else 5, width, height) + samples


def run(arguments, data):
    return subprocess.run(arguments, input=data, capture_output=True, check=True).stdout


def encoded(size, channels, *arguments, script=None):
    command = ["cjpeg", *arguments]
    if script:
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
            file.write(script)
            file.flush()
            return run([*command, "-scans", file.name], picture(*size, channels))
    return run(command, picture(*size, channels))


def decoded(jpeg):
    """The netpbm picture of `djpeg`, and its columns, rows, channels and checksum in a line."""
    pnm = run(["djpeg", "-pnm"], jpeg)
    magic, size, _, samples = pnm.split(b"\n", 3)
    width, height = map(int, size.split())
    channels = 3 if magic == b"P6" else 1
    assert len(samples) == width * height * channels
    return pnm, f"{width}\t{height}\t{channels}\t{zlib.crc32(samples):08x}"


def segments(jpeg):
    """Marker, segment and, behind a scan's, its data, for each marker with a segment."""
    at = 2
    while jpeg[at + 1] != 0xD9:
        marker, length = jpeg[at + 1], struct.unpack(">H", jpeg[at + 2 : at + 4])[0]
        content, at = jpeg[at + 4 : at + 2 + length], at + 2 + length
        start = at
        if marker == 0xDA:
            while jpeg[at] != 0xFF or jpeg[at + 1] == 0 or 0xD0 <= jpeg[at + 1] <= 0xD7:
                at += 1
        yield marker, content, jpeg[start:at]


def segment(marker, data):
    return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data


def joined(size, samplings, identifiers, application=b"", order=None):
    """A picture of one gray picture per component, each in a scan of its own with its own tables."""
    finest = [max(sampling[axis] for sampling in samplings) for axis in (0, 1)]
    components, scans = b"", {}
    for number, (sampling, identifier) in enumerate(zip(samplings, identifiers)):
        own = [-(-size[axis] * sampling[axis] // finest[axis]) for axis in (0, 1)]
        gray = encoded(own, 1, "-grayscale", "-quality", str(60 + 10 * number))
        components += bytes([identifier, sampling[0] << 4 | sampling[1], number])
        scans[number] = b""
        for marker, content, data in segments(gray):
            if marker == 0xDB:
                scans[number] += segment(marker, bytes([content[0] & 0xF0 | number]) + content[1:])
            elif marker == 0xC4:
                scans[number] += segment(marker, content)
            elif marker == 0xDA:
                scans[number] += segment(marker, bytes([1, identifier, 0, 0, 63, 0])) + data
    frame = struct.pack(">BHHB", 8, size[1], size[0], len(samplings)) + components
    ordered = b"".join(scans[number] for number in order or scans)
    return b"\xff\xd8" + application + segment(0xC0, frame) + ordered + b"\xff\xd9"


def adobe(transform):
    return segment(0xEE, b"Adobe\0\x64\0\0\0\0" + bytes([transform]))


def combinations(is_full):
    """Name, size, arguments and script of each picture of three components that `cjpeg` writes."""
    count = itertools.count()
    for sampling, (name, script) in itertools.product(SAMPLINGS, SCRIPTS.items()):
        if sampling in SEPARATE_ONLY and name in TOGETHER:
            continue
        n = next(count)
        size = SIZES[n * 3 % 7]
        some = [(RESTARTS[n % 4], size if n % 7 or size != (1, 1) else SIZES[0])]
        for restart, size in itertools.product(RESTARTS, SIZES) if is_full else some:
            arguments = ["-sample", sampling, "-restart", restart, "-quality", QUALITIES[n % 3]]
            arguments += ["-progressive"] if script == "" else []
            arguments += ["-optimize"] if n % 4 else []
            yield f"{sampling.replace(',', '+')}_{name}_{restart}_{size[0]}x{size[1]}", size, arguments, script


def entries(is_full):
    for label, size, arguments, script in combinations(is_full):
        yield label, encoded(size, 3, *arguments, script=script)
    for size, sampling, kind in itertools.product(SIZES if is_full else SIZES[:2], ("1x1", "2x2", "4x1"), ([], ["-progressive"])):
        arguments = ["-grayscale", "-sample", sampling, "-restart", "3B", *kind]
        yield f"gray{''.join(kind)}_{sampling}_{size[0]}x{size[1]}", encoded(size, 1, *arguments)
    size = SIZES[0]
    whole, half, coarse = (1, 1), (2, 2), (2, 1)
    yield "rgb", encoded(size, 3, "-rgb")
    yield "rgb-progressive", encoded(size, 3, "-rgb", "-progressive", "-restart", "1B")
    yield "extended", encoded(size, 3, "-quality", "90").replace(b"\xff\xc0", b"\xff\xc1", 1)
    yield "16-bit-steps", encoded(size, 3, "-quality", "1")
    yield "adobe-rgb-123", joined(size, [whole] * 3, [1, 2, 3], adobe(0))
    yield "adobe-ycc-rgb-names", joined(size, [whole] * 3, b"RGB", adobe(1))
    yield "names-0-1-2", joined(size, [half, whole, whole], [0, 1, 2])
    yield "names-99-7-255", joined(size, [coarse, whole, whole], [99, 7, 255], order=[1, 0, 2])
    jfif = segment(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0")
    yield "jfif-and-adobe-rgb", joined(size, [whole] * 3, [1, 2, 3], jfif + adobe(0))
    for transform, kind in ((None, "plain-cmyk"), (0, "cmyk"), (2, "ycck")):
        application = b"" if transform is None else adobe(transform)
        for samplings in ([whole] * 4, [half, whole, whole, half], [half, coarse, whole, half]):
            label = "-".join(f"{h}x{v}" for h, v in samplings)
            yield f"{kind}_{label}", joined(size, samplings, [1, 2, 3, 4], application)
        yield f"{kind}_reversed", joined(size, [half, whole, whole, half], [1, 2, 3, 4], application, [3, 2, 1, 0])


def refused():
    size = (16, 16)
    plain = encoded(size, 3)
    at = plain.index(b"\xff\xc0")

    def with_frame(marker, precision=8):
        return plain[: at + 1] + bytes([marker, *plain[at + 2 : at + 4], precision]) + plain[at + 5 :]

    yield "arithmetic", encoded(size, 3, "-arithmetic"), "arithmetic coding"
    yield "arithmetic-progressive", encoded(size, 3, "-arithmetic", "-progressive"), "arithmetic coding"
    yield "12-bit", with_frame(0xC1, 12), "samples of other than 8 bits"
    yield "lossless", with_frame(0xC3), "lossless coding"
    yield "hierarchical", with_frame(0xC5), "hierarchical coding"
    yield "jpeg-ls", with_frame(0xF7), "JPEG-LS coding"
    yield "no-height", plain[: at + 5] + b"\0\0" + plain[at + 7 :], "a height behind its data"
    yield "two-components", joined(size, [(1, 1)] * 2, [1, 2]), "other than 1, 3 or 4 components"
    yield "fractions", joined(size, [(3, 1), (2, 1), (1, 1)], [1, 2, 3]), "no whole fraction"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="archive to write")
    parser.add_argument("--full", action="store_true", help="all combinations")
    arguments = parser.parse_args()
    rows = []
    with zipfile.ZipFile(arguments.out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        def add(name, data):
            # A fixed date, so that the same pictures make the same archive.
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED, 9)

        for name, jpeg in entries(arguments.full):
            pnm, line = decoded(jpeg)
            rows.append(f"{name}\t{line}\n")
            add(f"{name}.jpg", jpeg)
            if arguments.full:
                add(f"{name}.pnm", pnm)
        for name, jpeg, why in refused():
            rows.append(f"{name}\trefused\t{why}\n")
            add(f"{name}.jpg", jpeg)
        add("expected.tsv", "".join(rows))
    print(f"{len(rows)} pictures, {arguments.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
