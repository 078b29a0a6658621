#!/usr/bin/env python3
"""Seconds and peak memory of `strivec prior` on files of the size of large scans.

    tools/measure/large_geometry.py FOLDER

makes a PLY and a LAZ of 20 million points and a PLY of 10 million triangles in FOLDER (about 900 MB; existing files are kept),
reads each, and prints a table. The points lie on a wavy ground with 1 % of noise above it; the triangles are that ground. Needs
numpy, laspy and lazrs, and target/release/strivec (or --command FILE).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

POINTS = 20_000_000
TRIANGLES = 10_000_000
PART = 1_000_000


def height(x, y):
    return 3 * np.sin(x / 7) * np.cos(y / 5) + 0.2 * np.sin(3 * x + y)


def points():
    """Parts of (N, 3) meters and (N, 3) colors, over 200 m x 200 m."""
    random = np.random.default_rng(0)
    for _ in range(POINTS // PART):
        x, y = random.uniform(0, 200, (2, PART))
        z = height(x, y) + random.normal(0, 0.01, PART)
        noise = random.random(PART) < 0.01
        z[noise] += random.uniform(1, 20, int(noise.sum()))
        color = np.stack([128 + 20 * z, 120 + 0 * z, 90 + 0 * z], 1).clip(0, 255).astype(np.uint8)
        yield np.stack([x, y, z], 1), color


def write_point_ply(path):
    kind = np.dtype([("position", "<f4", 3), ("color", "u1", 3)])
    with path.open("wb") as file:
        names = [f"property float {a}" for a in "xyz"] + [f"property uchar {c}" for c in ("red", "green", "blue")]
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {POINTS}", *names, "end_header", ""]
        file.write("\n".join(header).encode())
        for position, color in points():
            part = np.empty(len(position), kind)
            part["position"], part["color"] = position, color
            part.tofile(file)


def write_laz(path):
    import laspy

    header = laspy.LasHeader(version="1.2", point_format=2)
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    with laspy.open(path, mode="w", header=header) as writer:
        for position, color in points():
            part = laspy.ScaleAwarePointRecord.zeros(len(position), header=header)
            part.x, part.y, part.z = position.T
            part.red, part.green, part.blue = color.T.astype(np.uint16) << 8
            writer.write_points(part)


def write_mesh_ply(path):
    side = round((TRIANGLES / 2) ** 0.5)
    rows = np.arange(side + 1)
    with path.open("wb") as file:
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {(side + 1) ** 2}"]
        header += [f"property float {a}" for a in "xyz"] + [f"element face {2 * side * side}"]
        header += ["property list uchar int vertex_indices", "end_header", ""]
        file.write("\n".join(header).encode())
        for y in rows:
            x = rows * 200 / side
            at = np.full(side + 1, y * 200 / side)
            np.stack([x, at, height(x, at)], 1).astype("<f4").tofile(file)
        kind = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
        for y in rows[:-1]:
            first = y * (side + 1) + rows[:-1]
            part = np.empty(2 * side, kind)
            part["count"] = 3
            part["corners"][0::2] = np.stack([first, first + 1, first + side + 1], 1)
            part["corners"][1::2] = np.stack([first + 1, first + side + 2, first + side + 1], 1)
            part.tofile(file)
    return 2 * side * side


def run(command, path, options):
    """Seconds, peak resident bytes, and the output of the command."""
    with tempfile.TemporaryDirectory() as folder:
        words = [command, "--quiet", "--json", "prior", str(path), "-o", f"{folder}/prior.npz", *options]
        start = time.monotonic()
        process = subprocess.Popen(words, stdout=subprocess.PIPE)
        said = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.monotonic() - start
    if status != 0:
        sys.exit(f"{' '.join(words)}: status {status}")
    return seconds, usage.ru_maxrss * 1024, json.loads(said)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--command", default="target/release/strivec")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    files = {"points.ply": write_point_ply, "points.laz": write_laz, "mesh.ply": write_mesh_ply}
    for name, write in files.items():
        if not (arguments.folder / name).exists():
            partial = arguments.folder / f"partial-{name}"
            write(partial)
            partial.rename(arguments.folder / name)
    print("| file | MB | options | read | cells | s | MB at the peak |\n|---|---|---|---|---|---|---|")
    known = ["--voxel", "0.25"]
    for name, options in [
        ("points.ply", []),
        ("points.ply", known),
        ("points.ply", [*known, "--outliers", "8,2"]),
        ("points.laz", []),
        ("points.laz", known),
        ("mesh.ply", []),
        ("mesh.ply", known),
    ]:
        path = arguments.folder / name
        seconds, memory, said = run(arguments.command, path, options)
        read = f"{said['triangles']:,} triangles" if said["triangles"] else f"{said['points']:,} points"
        if said["outliers"]:
            read += f", {said['outliers']:,} outliers"
        row = [f"`{name}`", f"{path.stat().st_size / 1e6:.0f}", f"`{' '.join(options)}`" if options else "-"]
        row += [read.replace(",", " "), f"{said['cells']:,}".replace(",", " "), f"{seconds:.1f}", f"{memory / 1e6:.0f}"]
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
