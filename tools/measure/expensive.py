#!/usr/bin/env python3
"""Crafts small files that ask for much, verifies them, and prints seconds, memory and result of each.

    tools/measure/expensive.py FOLDER [--pack strivec-pack] [--only NAME...]

The files follow the layout of the format, with right checksums; some are beyond its limits. Needs zstandard and /usr/bin/time.
"""

import argparse
import math
import os
import struct
import subprocess
import tempfile
import time
import zlib

import zstandard

NONE = (0xFFFF, 0xFFFFFFFF)


def zstd(body):
    return zstandard.ZstdCompressor(level=9).compress(body)


def aligned(data):
    return data + bytes(-len(data) % 64)


class Scene:
    """A scene in sections; `scales` is a list of `Scale`."""

    def __init__(self, scales, step=0.01, layers=None, contraction=False, probes=0, occupancy=None, mode=0):
        self.sections = []
        features = 3
        layers = layers or [(features + 3, 3)]
        self.add("FRAME", struct.pack("<11d3fBB", 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 100, 0, 0, 0, 2, 0))
        bounds = (-2.0, 2.0) if contraction else (-1.0, 1.0)
        rules = struct.pack("<H6B", len(scales), 1, 0, 0, 0, int(contraction), 4 if contraction else 0)
        rules += struct.pack("<6d", *[bounds[0]] * 3, *[bounds[1]] * 3)
        # Transparent: no threshold ends a ray.
        rules += struct.pack("<6d", -30.0, 1.0, step, 0.0, 0.0, 1.0 if contraction else 0.0)
        self.add("RULES", rules + (struct.pack("<75f", *[0.1] * 75) if contraction else b""))
        numbers = sum(inputs * outputs + outputs for inputs, outputs in layers)
        record = struct.pack("<BIIQ", mode, 0, 0, len(layers)) + b"".join(struct.pack("<2I", *layer) for layer in layers)
        self.add("DECODER", record + array(), bytes(4 * numbers))
        if occupancy:
            vertices, bits = occupancy
            self.add("OCCUPANCY", struct.pack("<6d3I", *[-1.0] * 3, *[1.0] * 3, *vertices), bits)
        for number, scale in enumerate(scales):
            scale.add_to(self, number, features)
        if probes:
            probe = struct.pack("<18d", -1.5, 0.01, 0.02, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1e-3, 0, 0)
            self.add("PROBES", struct.pack("<3dQ", 1, 1, 1, probes), probe * probes, codec=0, flags=0)

    def add(self, kind, record, body=None, place=NONE, codec=1, flags=1):
        payload, decoded, used = record, len(record), 0
        if body is not None:
            start = aligned(record)
            decoded = len(start) + len(body)
            used = codec if body else 0
            payload = start + (zstd(body) if used else body)
        self.sections.append((kind, flags, *place, used, payload, decoded))

    def bytes(self):
        table, payloads, end = b"", b"", 64 + 64 * len(self.sections)
        for kind, flags, scale, chunk, codec, payload, decoded in self.sections:
            offset = end + -end % 64
            payloads += bytes(offset - end) + payload
            end = offset + len(payload)
            table += struct.pack("<12sHHIHHIIQQQQ", kind.encode(), flags, scale, chunk, codec, 0, zlib.crc32(payload), 0, offset, len(payload), decoded, 0)
        rest = table + payloads
        head = b"\xb3STV\r\n\x1a\n" + struct.pack("<HHIQII28x", 1, 0, len(self.sections), 64 + len(rest), zlib.crc32(table), zlib.crc32(rest))
        return head + struct.pack("<I", zlib.crc32(head)) + rest


def array():
    return struct.pack("<4Bf", 0, 0, 0, 0, 0.0)


class Scale:
    """A block of `extent` cells of a lattice, all occupied, around the origin. `value` fills the factors; None for tensors
    without components."""

    def __init__(self, extent, pitch, half, resolution=1, rank=1, top_k=16, value=None):
        self.__dict__.update(locals())

    def add_to(self, scene, number, features):
        extent, pitch, half, rank = self.extent, self.pitch, self.half, self.rank
        count = math.prod(extent)
        origin = [-0.5 * pitch * n for n in extent]
        center = lambda axis, cell: origin[axis] + (cell + 0.5) * pitch
        low = [center(a, 0) - half for a in range(3)]
        high = [center(a, extent[a] - 1) + half for a in range(3)]
        record = struct.pack("<2I3d3IBBH4I", count, self.top_k, *[half] * 3, *[self.resolution] * 3, 0, 0, 0, rank, rank, 1, 0)
        record += struct.pack("<6d3I", *origin, *[pitch] * 3, *extent)
        place = (number, 0xFFFFFFFF)
        scene.add("SCALE", record, struct.pack("<I6d", count, *low, *high), place)
        scene.add("MATRIX", struct.pack("<2I", features, rank) + array(), bytes(4 * features * rank), place)
        place = (number, 0)
        scene.add("PLACEMENT", b"", bytes(count), place)
        rows = 3 * (self.resolution + 1)
        if self.value is None:
            body = bytes((rank + 7) // 8 * count)
        else:
            body = struct.pack("<f", self.value) * (count * rows * rank)
        for kind in ("DENSITY", "APPEARANCE"):
            scene.add(kind, struct.pack("<B7x", int(self.value is None)) + array(), body, place)


def files():
    """Name, bytes, arguments of strivec-pack."""
    few = lambda **more: Scale((2, 2, 2), 0.5, 0.6, **more)
    render = ["verify", "--render"]
    fine = 2 * math.sqrt(3) / 1_000_000  # a million steps on the diagonal
    deep = [(6, 1024)] + [(1024, 1024)] * 14 + [(1024, 3)]
    heavy = [Scale((4, 4, 2), 0.01, 1.0, rank=256, value=0.1) for _ in range(16)]
    dense = lambda n: (n, bytes([255]) * (math.prod(n) // 8))
    yield "tensors-2^24", Scene([Scale((4096, 4096, 1), 1e-3, 1e-3)]), ["verify"]
    yield "tensors-2^22", Scene([Scale((2048, 2048, 1), 1e-3, 1e-3)]), ["verify"]
    yield "tensors-2^22-traced", Scene([Scale((2048, 2048, 1), 1e-3, 1e-3)], probes=1), render
    yield "tensors-2^20-traced", Scene([Scale((1024, 1024, 1), 1e-3, 1e-3)], probes=64), render
    yield "tensors-2^22-all-ranks", Scene([Scale((2048, 2048, 1), 1e-3, 1e-3, resolution=1024, rank=256)]), ["verify"]
    yield "layer-16384", Scene([few()], layers=[(6, 16384), (16384, 3)]), ["verify"]
    yield "layers-16-of-1024", Scene([few()], layers=deep), ["verify"]
    yield "occupancy-2^30", Scene([few()], occupancy=((1024, 1024, 1024), bytes(1 << 27))), ["verify"]
    yield "occupancy-2^28", Scene([few()], occupancy=dense((1024, 512, 512))), ["verify"]
    yield "occupancy-2^28-traced", Scene([few()], occupancy=dense((1024, 512, 512)), probes=64), render
    yield "steps-64-probes", Scene([few()], step=fine, probes=64), render
    yield "steps-4-probes", Scene([few(value=0.1)], step=fine, probes=4), render
    yield "overlap-4096", Scene([Scale((16, 16, 16), 1e-3, 1.0)], step=fine, probes=4), render
    yield "overlap-4096-often", Scene([Scale((16, 16, 16), 1e-3, 1.0)], step=2 * math.sqrt(3) / 2000, probes=2000), render
    yield "overlap-2^16", Scene([Scale((64, 32, 32), 1e-5, 1.0)], step=2 * math.sqrt(3) / 50_000, probes=64), render
    yield "overlap-2^20", Scene([Scale((128, 128, 64), 1e-5, 1.0)], step=fine, probes=4), render
    yield "overlap-2^22", Scene([Scale((256, 128, 128), 1e-5, 1.0)], step=fine, probes=4), render
    yield "scales-16-ranks-256", Scene(heavy, step=fine, probes=4), render
    yield "scales-16-layers-16", Scene(heavy, step=fine, probes=4, layers=deep), render
    yield "probes-6000", Scene(heavy, step=2 * math.sqrt(3) / 690, probes=6000, layers=deep), render
    yield "contraction-and-sky", Scene(heavy, step=4 * math.sqrt(3) / 1_000_000, probes=4, contraction=True, layers=deep), render
    yield "residual", Scene(heavy, step=fine, probes=4, layers=deep, mode=2), render
    yield "factors-40M", Scene([Scale((5, 5, 2), 0.1, 0.1, resolution=1023, rank=64, value=0.1)]), ["verify"]
    yield "occupancy-2^28-mixed-adaptive", Scene([few()], occupancy=((1024, 512, 512), mixed(1024, 512))), ["convert", "verify"]


def mixed(columns, edge):
    """The bits of `columns` × `edge` × `edge` vertices, one of them set in each block of 8³."""
    row = bytes([1]) * (columns // 8)
    layer = (row + bytes(len(row) * 7)) * (edge // 8)
    return (layer + bytes(len(layer) * 7)) * (edge // 8)


def run(command):
    """Exit code, last message, seconds, seconds of all cores, and peak MiB of a command."""
    with tempfile.NamedTemporaryFile("r") as peak:
        start = time.monotonic()
        # Through time, as the peak of a child begins with that of this program.
        timed = ["/usr/bin/time", "--quiet", "-f", "%M %U %S", "-o", peak.name, *command]
        process = subprocess.run(timed, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        seconds = time.monotonic() - start
        messages = process.stderr.strip().splitlines()
        kilobytes, user, system = map(float, peak.read().split())
        return process.returncode, messages[-1] if messages else "", seconds, user + system, int(kilobytes) >> 10


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--pack", default="target/release/strivec-pack")
    parser.add_argument("--only", nargs="*")
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    print("| file | bytes | command | exit code | s | s of all cores | peak MiB | message |\n|---|---|---|---|---|---|---|---|")
    for name, scene, command in files():
        if arguments.only and name not in arguments.only:
            continue
        path = os.path.join(arguments.folder, name + ".strivec")
        with open(path, "wb") as file:
            file.write(scene.bytes())
        if command[0] == "convert":
            # The codec adaptive, by the program's own writer.
            source, path = path, os.path.join(arguments.folder, name + "-written.strivec")
            subprocess.run([arguments.pack, "convert", source, "-o", path, "--force", "--quiet", "--encoding", "grid8", "--level", "19", "--memory", "4096"], check=True)
            command = command[1:]
        code, message, seconds, cores, peak = run([arguments.pack, *command, path])
        message = message.replace(path, "").replace("strivec-pack: ", "").lstrip(": ")
        print(f"| {name} | {os.path.getsize(path)} | {' '.join(command)} | {code} | {seconds:.1f} | {cores:.1f} | {peak} | {message} |", flush=True)


if __name__ == "__main__":
    main()
