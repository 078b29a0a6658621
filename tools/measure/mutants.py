#!/usr/bin/env python3
"""Compares what the two readers of the format make of changed files.

    PYTHONPATH=format-spec/reader python tools/measure/mutants.py target/release/strivec-pack -o mutants

Takes the valid vectors apart, changes something, repairs the checksums of section, table, file and header, and lets
`strivec-pack verify` and format-spec/reader read each file. A change is one of: bytes of a payload's record, of its decoded
body (compressed again), or of its body as stored; bytes of a table entry or of the header; the length of a payload or of
a decoded body; two sections that change places, or one that is there twice or not at all. Mutant N of a seed does not
depend on the others. Compared are whether the file is refused, the group and the class of the error (section 7), and the
sections that are skipped with the classes of their errors. Files on which the readers disagree are kept in the folder OUT,
by seed and number, and printed.

Needs numpy and zstandard, as format-spec/reader does.
"""

import argparse
import json
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from pathlib import Path

import zstandard

import strivec_reader

ROOT = Path(__file__).resolve().parents[2]
ENTRY = struct.Struct("<12sHHIHHIIQQQQ")
CODEC, CHECKSUM, OFFSET, LENGTH, DECODED = 4, 6, 8, 9, 10  # fields of an entry
BATCH = 500  # files that one call of strivec-pack reads
MEMORY = 256  # MiB, for both readers
GROUPS = {
    "foreign": "foreign",
    "text-transfer": "damaged",
    "truncated": "damaged",
    "corrupt": "damaged",
    "version": "unsupported",
    "kind": "unsupported",
    "code": "unsupported",
    "missing": "invalid",
    "limit": "invalid",
    "malformed": "invalid",
    "value": "invalid",
    "budget": "over budget",
}
SPECIAL = [0.0, -0.0, 1.0, -1.0, 5e-324, 1e308, -1e308, float("inf"), float("-inf"), float("nan")]


def align(offset):
    return -(-offset // 64) * 64


class File:
    """The parts of a valid file: its header, and for each section the fields of its entry and its payload."""

    def __init__(self, data):
        self.header = bytearray(data[:64])
        count = struct.unpack_from("<I", data, 12)[0]
        self.sections = []
        for index in range(count):
            entry = list(ENTRY.unpack_from(data, 64 + 64 * index))
            payload = bytearray(data[entry[OFFSET] : entry[OFFSET] + entry[LENGTH]])
            self.sections.append([entry, payload])

    def bytes(self, change_table=None):
        """The file with its layout and checksums; `change_table` may change the entries before these are computed."""
        end = 64 + 64 * len(self.sections)
        body = bytearray()
        for entry, payload in self.sections:
            start = align(end)
            body += bytes(start - end) + payload
            entry[OFFSET], entry[LENGTH], entry[CHECKSUM] = start, len(payload), zlib.crc32(payload)
            end = start + len(payload)
        table = bytearray().join(ENTRY.pack(*entry) for entry, _ in self.sections)
        struct.pack_into("<IQ", self.header, 12, len(self.sections), end)
        if change_table is not None:
            change_table(self.header, table)
        after = bytes(table) + bytes(body)
        struct.pack_into("<II", self.header, 24, zlib.crc32(table), zlib.crc32(after))
        struct.pack_into("<I", self.header, 60, zlib.crc32(self.header[:60]))
        return bytes(self.header) + after


def record_length(entry, payload):
    """Bytes of a payload before its body: a guess that is right for all kinds with a body but DECODER's of many layers."""
    kind = entry[0].rstrip(b"\0").decode()
    record = {"DECODER": 21, "OCCUPANCY": 60, "SCALE": 124, "MATRIX": 12, "PLACEMENT": 0, "DENSITY": 12, "APPEARANCE": 12}
    record.update({"PREFIX": 28, "THUMBNAIL": 6, "PROBES": 32, "CAMERAS": 8, "NOTES": 8})
    if kind not in record:
        return len(payload)
    layers = struct.unpack_from("<Q", payload, 9)[0] if kind == "DECODER" else 0
    return min(record[kind] + 8 * layers, len(payload))


def change_bytes(rng, data, start, end):
    """Overwrites a byte, or an aligned or unaligned number, of data[start:end] by another value."""
    if end <= start:
        return
    for _ in range(rng.choice((1, 1, 1, 2))):
        at = rng.randrange(start, end)
        choice = rng.random()
        if choice < 0.5:
            data[at] = rng.choice((data[at] ^ 1 << rng.randrange(8), rng.randrange(256), 0, 1, 0x7F, 0x80, 0xFF))
            continue
        size, values = rng.choice((
            (2, [0, 1, 0x7C00, 0xFFFF]),
            (4, [0, 1, 2, 257, 4097, 16_385, 1 << 24, 0xFFFFFFFF]),
            (8, [0, 1, 17, 4097, 65_537, 1 << 40, (1 << 64) - 1]),
            (4, SPECIAL),
            (8, SPECIAL),
        ))
        at -= (at - start) % size if rng.random() < 0.8 else 0
        if at + size > end:
            continue
        value = rng.choice(values)
        code = {2: "H", 4: "I", 8: "Q"}[size] if isinstance(value, int) else {4: "f", 8: "d"}[size]
        try:
            struct.pack_into("<" + code, data, at, value)
        except OverflowError:  # 1e308 as f32
            struct.pack_into("<f", data, at, float("inf"))


def mutate(rng, file):
    """Changes `file`; returns its bytes and what was changed."""
    how = rng.choices(
        ("record", "decoded body", "stored body", "entry", "header", "length", "decoded length", "order"),
        (30, 25, 15, 10, 4, 8, 4, 4),
    )[0]
    entry, payload = rng.choice(file.sections)
    name = entry[0].rstrip(b"\0").decode()
    record = record_length(entry, payload)
    body = min(align(record), len(payload))
    if how == "record":
        change_bytes(rng, payload, 0, record)
    elif how == "stored body":
        change_bytes(rng, payload, body, len(payload))
    elif how == "decoded body":
        content = bytearray(payload[body:])
        if entry[CODEC] == 1:
            content = bytearray(zstandard.ZstdDecompressor().decompress(bytes(content)))
        if entry[CODEC] < 2:
            change_bytes(rng, content, 0, len(content))
            if rng.random() < 0.3 and content:
                content = content[: rng.randrange(len(content))] if rng.random() < 0.5 else content + b"\0"
            compress = rng.random() < 0.5
            entry[CODEC], entry[DECODED] = int(compress), body + len(content)
            packed = zstandard.ZstdCompressor(3).compress(bytes(content)) if compress else content
            payload[body:] = packed
    elif how == "length":
        length = len(payload)
        cut = rng.choice((rng.randrange(length + 1), max(length - 1, 0), record, body, length + 1, length + 64))
        del payload[cut:]
        payload.extend(bytes(cut - len(payload)))
        if entry[CODEC] == 0:
            entry[DECODED] = len(payload)
    elif how == "decoded length":
        entry[DECODED] = rng.choice((0, body, entry[DECODED] - 1, entry[DECODED] + 1, 1 << 40, (1 << 64) - 1)) % (1 << 64)
    elif how == "order":
        index = file.sections.index([entry, payload])
        other = rng.randrange(len(file.sections))
        action = rng.choice(("swap", "remove", "repeat"))
        name += f" {action} {other}"
        if action == "swap":
            file.sections[index], file.sections[other] = file.sections[other], file.sections[index]
        elif action == "remove":
            del file.sections[index]
        else:
            file.sections.insert(other, [list(entry), bytearray(payload)])
    change_table = None
    if how == "entry":
        index = rng.randrange(len(file.sections))
        change_table = lambda header, table: change_bytes(rng, table, 64 * index, 64 * index + 64)
    elif how == "header":
        change_table = lambda header, table: change_bytes(rng, header, 0, 60)
    return file.bytes(change_table), f"{how} of {name}"


def of_python(data):
    """The class of the error that refuses the file, or the sections that are skipped, by this reader."""
    try:
        scene = strivec_reader.read(data, MEMORY << 20)
    except strivec_reader.StrivecError as error:
        return error.name, [], str(error)
    return None, sorted((skipped.name, skipped.error.name) for skipped in scene.skipped), ""


def of_rust(program, folder, names):
    """The same by `strivec-pack verify`, for each of the files."""
    command = [program, "verify", "--json", "--quiet", "--memory", str(MEMORY), *names]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if run.returncode not in (0, 3, 5):
        sys.exit(f"{program}: exit code {run.returncode}: {run.stderr[-2000:]}")
    for row in json.loads(run.stdout):
        skipped = sorted((section["section"], section["class"]) for section in row["skipped"])
        yield row["class"], skipped, row["error"] or ""


def compare(one, other):
    """What two readers disagree on: `verdict`, `group`, `class`, `skipped`; None if they agree.

    A file that needs more memory than the budget may be refused for that by one reader, which takes more, and for another
    reason or not at all by the other.
    """
    if "budget" in (one[0], other[0]):
        return None if one[0] == other[0] else "budget"
    if (one[0] is None) != (other[0] is None):
        return "verdict"
    if one[0] != other[0]:
        return "group" if GROUPS[one[0]] != GROUPS[other[0]] else "class"
    if one[1] != other[1]:
        same = [name for name, _ in one[1]] == [name for name, _ in other[1]]
        return "class" if same and all(GROUPS[a] == GROUPS[b] for (_, a), (_, b) in zip(one[1], other[1])) else "skipped"
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="strivec-pack")
    parser.add_argument("-n", "--number", type=int, default=20_000, help="mutants (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="default: %(default)s")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="folder for files to keep")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    program = str(Path(arguments.program).resolve())
    vectors = [path.read_bytes() for path in sorted((ROOT / "fixtures" / "v1").glob("*.strivec"))]
    verdicts, disagreements, accepted_changes = Counter(), Counter(), 0
    end = arguments.first + arguments.number
    for first in range(arguments.first, end, BATCH):
        numbers = range(first, min(first + BATCH, end))
        with tempfile.TemporaryDirectory() as folder:
            made = {}
            for number in numbers:
                rng = random.Random(f"{arguments.seed} {number}")
                data, what = mutate(rng, File(rng.choice(vectors)))
                name = f"{arguments.seed}-{number}.strivec"
                (Path(folder) / name).write_bytes(data)
                made[name] = (data, what)
            for name, rust in zip(made, of_rust(program, folder, list(made))):
                data, what = made[name]
                python = of_python(data)
                verdicts[rust[0] or ("skipped" if rust[1] else "accepted")] += 1
                difference = compare(rust, python)
                if difference is None:
                    continue
                disagreements[difference] += 1
                shutil.copy(Path(folder) / name, arguments.output)
                print(f"{difference}: {name}: {what}\n  rust   {rust}\n  python {python}", flush=True)
        print(f"{numbers[-1] + 1 - arguments.first} mutants", file=sys.stderr)
    print(f"seed {arguments.seed}, mutants {arguments.first} to {end}")
    print("by strivec-pack: " + ", ".join(f"{name} {count}" for name, count in verdicts.most_common()))
    print("disagreements: " + (", ".join(f"{name} {count}" for name, count in disagreements.most_common()) or "none"))
    sys.exit(1 if set(disagreements) - {"budget"} else 0)


if __name__ == "__main__":
    main()
