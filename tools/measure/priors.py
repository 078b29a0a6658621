#!/usr/bin/env python3
"""Tensors, parameters, minutes and PSNR of the same training on different priors.

    strivec synth toy --views 60 --test-views 20 --size 128x128
    tools/measure/priors.py toy --out priors-toy --config src/cli/demo.toml --steps 1500
    tools/measure/priors.py LEGO --out priors-lego --config docs/configs/quarter.toml --steps 5500 --downscale 4 \\
        --prior "TensoRF's alpha mask" lego.th

trains DATASET once on each prior and prints a table. Priors of a synthetic dataset: the exact mesh, the mesh without a tenth of
its area, its points with 2 % of outliers (unfiltered, and with --outliers), its occupancy. Priors of all datasets: the coarse
reconstruction and the bootstrap. --prior adds a file. OUT is a folder; rows in OUT/rows.json are not measured again. Needs numpy, and target/release/strivec (or --command FILE).
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np

OUTLIERS = 0.02
# Share of the mesh's area that is removed, and the radius of the patches.
TORN, PATCH = 0.1, 0.12


def read_mesh(path):
    """Vertices (N, 3) and triangles (M, 3) of the binary PLY file that `strivec synth` writes."""
    raw = path.read_bytes()
    end = raw.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in raw[:end].decode().splitlines() if line.startswith("element")]
    vertices = np.frombuffer(raw, "<f4", 3 * counts[0], end).reshape(-1, 3)
    kind = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    return vertices, np.frombuffer(raw, kind, counts[1], end + 12 * counts[0])["corners"]


def write_torn(source, target):
    """The mesh without the parts of triangles near random places of its surface; triangles are cut into small ones first."""
    vertices, triangles = read_mesh(source)
    corners = vertices[triangles].astype(np.float64)
    while True:
        edges = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2)
        large = edges.max(1) > 0.25 * PATCH
        if not large.any():
            break
        part, longest = corners[large], edges[large].argmax(1)
        n = np.arange(len(part))
        a, b, c = (part[n, (longest + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        halves = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        corners = np.concatenate([corners[~large], halves])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    centers, random = corners.mean(1), np.random.default_rng(0)
    kept = np.ones(len(corners), bool)
    while area[kept].sum() > (1 - TORN) * area.sum():
        at = centers[random.choice(len(centers), p=area / area.sum())]
        kept &= np.linalg.norm(centers - at, axis=1) > PATCH
    corners = corners[kept].astype("<f4")
    faces = np.empty(len(corners), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, np.arange(3 * len(corners)).reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {3 * len(corners)}"]
    header += [f"property float {a}" for a in "xyz"] + [f"element face {len(corners)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    target.write_bytes("\n".join(header).encode() + corners.tobytes() + faces.tobytes())


def write_noisy(source, target):
    """The cloud's points, and outliers within twice their bounds."""
    raw = source.read_bytes()
    end = raw.index(b"end_header\n") + len(b"end_header\n")
    kind = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("color", "u1", 3)])
    points = np.frombuffer(raw, kind, offset=end)["position"].astype(np.float64)
    low, high = points.min(0), points.max(0)
    random = np.random.default_rng(0)
    count = round(OUTLIERS * len(points) / (1 - OUTLIERS))
    outliers = random.uniform(1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low, (count, 3))
    np.save(target, np.concatenate([points, outliers]))


def shaped(arguments, source, *options):
    """The prior that `strivec prior` makes of a file."""
    target = source.with_suffix(".npz")
    subprocess.run([arguments.command, "--quiet", "--force", "prior", source, "-o", target, *options], check=True)
    return target


def priors(arguments):
    """(name, arguments of train)."""
    found = [("coarse reconstruction", []), ("bootstrap", ["--bootstrap"]), ("coarse, pruned in training", ["--set", "schedule.prune=true"])]
    dataset = arguments.dataset
    if (dataset / "occupancy.npz").exists():
        torn, noisy = arguments.out / "torn.ply", arguments.out / "noisy.npy"
        write_torn(dataset / "mesh.ply", torn)
        write_noisy(dataset / "points.ply", noisy)
        found += [
            ("exact mesh", ["--prior", dataset / "mesh.ply"]),
            ("mesh with holes", ["--prior", torn]),
            ("mesh with holes, filled", ["--prior", shaped(arguments, torn, "--close", str(PATCH))]),
            ("points", ["--prior", dataset / "points.ply"]),
            ("points, 2 % outliers", ["--prior", noisy]),
            ("the same without outliers", ["--prior", shaped(arguments, noisy, "--outliers", "16,2")]),
            ("occupancy", ["--prior", dataset / "occupancy.npz"]),
        ]
    return found + [(name, ["--prior", file]) for name, file in arguments.prior]


def said(words):
    return json.loads(subprocess.run(words, stdout=subprocess.PIPE, check=True).stdout)


def measure(arguments, name, options):
    scene = arguments.out / "scene.strivec"
    common = ["--downscale", str(arguments.downscale)]
    command = [arguments.command, "--quiet", "--json", "--force"]
    train = ["train", arguments.dataset, "-o", scene, "--steps", str(arguments.steps), "--seed", str(arguments.seed)]
    config = ["--config", arguments.config] if arguments.config else []
    trained = said(command + train + config + common + options)
    seen = said(command + ["eval", scene, arguments.dataset, "--split", "test", *common])
    return {
        "prior": name,
        "tensors": [scale["tensors"] for scale in trained["scales"]],
        "parameters": trained["parameters"],
        "minutes": trained["seconds"] / 60,
        "bytes": trained["bytes"],
        "psnr": seen["psnr"],
        "ssim": seen["ssim"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--config")
    parser.add_argument("--steps", type=int, default=30_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--prior", nargs=2, action="append", default=[], metavar=("NAME", "FILE"))
    parser.add_argument("--command", default="target/release/strivec")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    results = arguments.out / "rows.json"
    rows = json.loads(results.read_text()) if results.exists() else []
    for name, options in priors(arguments):
        if all(row["prior"] != name for row in rows):
            rows.append(measure(arguments, name, options))
            results.write_text(json.dumps(rows, indent=1))
    print("| prior | tensors | parameters | min | file, MB | PSNR, dB | SSIM |\n|---|---|---|---|---|---|---|")
    for row in rows:
        tensors = ", ".join(map(str, row["tensors"]))
        figures = f"{row['parameters'] / 1e6:.2f} M | {row['minutes']:.1f} | {row['bytes'] / 1e6:.2f}"
        print(f"| {row['prior']} | {tensors} | {figures} | {row['psnr']:.2f} | {row['ssim']:.4f} |")


if __name__ == "__main__":
    main()
