#!/usr/bin/env python3
"""How exact a trained scene of `strivec synth --outdoor` is: colors, distances and skyline of its test views.

    strivec synth meadow --outdoor --views 140 --test-views 20
    strivec synth object --views 140 --test-views 20
    strivec train meadow -o meadow.strivec
    strivec train object -o object.strivec
    tools/measure/outdoor.py meadow.strivec meadow object --out compared [--bounded object.strivec] [--downscale N]

OUTDOOR and OBJECT are made with the same seed, so that OBJECT's opacity says which pixels see the object. Pixels at the edge of
the object or of the ground count for colors only. Printed are:

- PSNR over all pixels and over those that see the object, the ground, or the sky; with --bounded, over those that see the
  object, that of the scene trained without surroundings;
- the share of distances within 2 % of the exact ones, and their median error, by distance from the scene's center;
- the skyline: by how many pixels the row of the steepest change of color differs from the photograph's, in columns in which
  the sky meets the hills.

Needs numpy, pillow, and target/release/strivec (or --command FILE).
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np
from PIL import Image

# Distances from the center, in units of the object's half extent, 1.
RINGS = [0, 1.8, 5, 10, 20, 70]
TOLERANCE = 0.02
# A pixel is at an edge if a neighbor's distance differs by more than this share.
EDGE = 0.15
# Rows around the skyline in which a rendering's is sought.
SKYLINE_ROWS = 6


def averaged(picture, factor):
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    blocks = picture[: height * factor, : width * factor].reshape(height, factor, width, factor, -1)
    return blocks.mean(axis=(1, 3))


def picture(path):
    """Straight RGBA in [0, 1]."""
    return np.asarray(Image.open(path).convert("RGBA"), dtype=np.float64) / 255


def depths(path, scale):
    """Distances in dataset units; 0 and infinity where the renderer found nothing."""
    gray = np.asarray(Image.open(path), dtype=np.float64)
    if "unit" in scale:
        return gray * scale["unit"]
    with np.errstate(divide="ignore"):
        return np.where(gray > 0, scale["scale"] * (65535 / gray - 1), np.inf)


def directions(frame, height, width, angle):
    """Unit directions of the pixels' rays in the dataset's space, (height, width, 3)."""
    focal = 0.5 * width / np.tan(0.5 * angle)
    x, y = np.meshgrid((np.arange(width) + 0.5 - 0.5 * width) / focal, (0.5 * height - np.arange(height) - 0.5) / focal)
    rays = np.stack([x, y, -np.ones_like(x)], axis=-1) @ np.array(frame["transform_matrix"])[:3, :3].T
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def psnr(errors):
    return -10 * np.log10(np.mean(errors)) if len(errors) else np.nan


def at_edges(distance):
    """True where a neighbor is much nearer or farther."""
    near = 1 / distance
    padded = np.pad(near, 1, mode="edge")
    around = [padded[y : y + near.shape[0], x : x + near.shape[1]] for y in range(3) for x in range(3)]
    return np.maximum.reduce(around) - np.minimum.reduce(around) > EDGE * np.maximum.reduce(around)


def skyline(rendered, photograph, is_sky):
    """Row errors of the skyline, one per column whose sky ends once, at something that is not at the picture's border."""
    errors = []
    steps = [np.abs(np.diff(p, axis=0)).sum(axis=-1) for p in (photograph, rendered)]
    for column in range(is_sky.shape[1]):
        ends = np.flatnonzero(is_sky[:-1, column] & ~is_sky[1:, column])
        if len(ends) != 1 or not SKYLINE_ROWS < ends[0] < len(is_sky) - SKYLINE_ROWS - 1 or not is_sky[0, column]:
            continue
        rows = slice(ends[0] - SKYLINE_ROWS, ends[0] + SKYLINE_ROWS + 1)
        exact, found = (int(np.argmax(step[rows, column])) for step in steps)
        errors.append(found - exact)
    return errors


def render(options, scene, out):
    subprocess.run(
        [options.command, "render", scene, "--cameras", options.outdoor, "--downscale", str(options.downscale),
         "--depth", "--out", out, "--force"],
        check=True,
        stdout=subprocess.DEVNULL,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("outdoor", type=Path)
    parser.add_argument("object", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--bounded", type=Path, metavar="SCENE", help="a scene of OBJECT")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--command", default="target/release/strivec")
    options = parser.parse_args()
    render(options, options.scene, options.out)
    if options.bounded:
        render(options, options.bounded, options.out / "bounded")
    scale = json.loads((options.out / "depth.json").read_text())
    views = json.loads((options.outdoor / "transforms_test.json").read_text())
    colors = {name: [] for name in ("all", "object", "ground", "sky", "bounded")}
    places, errors, rows = [], [], []
    factor = options.downscale
    for frame in views["frames"]:
        name = Path(frame["file_path"]).stem
        photograph = averaged(picture(options.outdoor / "test" / f"{name}.png"), factor)[..., :3]
        object_photograph = averaged(picture(options.object / "test" / f"{name}.png"), factor)
        rendered = picture(options.out / f"{name}.png")[..., :3]
        distance = np.load(options.outdoor / "distances" / f"{name}.npy").astype(np.float64)
        with np.errstate(divide="ignore"):
            distance = 1 / averaged(1 / distance[..., None], factor)[..., 0]
        sees_object = object_photograph[..., 3] == 1
        is_sky = np.isinf(distance)
        square = ((rendered - photograph) ** 2).mean(axis=-1)
        sees_ground = ~is_sky & (object_photograph[..., 3] == 0)
        for kind, mask in [("object", sees_object), ("ground", sees_ground), ("sky", is_sky)]:
            colors[kind].append(square[mask])
        colors["all"].append(square.ravel())
        if options.bounded:
            bounded = picture(options.out / "bounded" / f"{name}.png")[..., :3]
            colors["bounded"].append(((bounded - object_photograph[..., :3]) ** 2).mean(axis=-1)[sees_object])
        counted = ~is_sky & ~at_edges(distance)
        rays = directions(frame, *distance.shape, views["camera_angle_x"])
        points = np.array(frame["transform_matrix"])[:3, 3] + rays * distance[..., None]
        found = depths(options.out / f"{name}_depth.png", scale)
        places.append(np.linalg.norm(points[counted], axis=-1))
        errors.append(np.abs(found[counted] / distance[counted] - 1))
        rows += skyline(rendered, photograph, is_sky)
    for kind, parts in colors.items():
        if parts:
            print(f"PSNR, {kind}: {psnr(np.concatenate(parts)):.2f} dB")
    places, errors = np.concatenate(places), np.concatenate(errors)
    for low, high in zip(RINGS, RINGS[1:]):
        ring = errors[(places >= low) & (places < high)]
        if len(ring):
            within = 100 * np.mean(ring <= TOLERANCE)
            print(f"distances {low} to {high}: {within:.1f} % within 2 %, median error {100 * np.median(ring):.2f} %")
    near = errors[places < RINGS[-2]]
    print(f"distances to {RINGS[-2]}: {100 * np.mean(near <= TOLERANCE):.1f} % within 2 %")
    if rows:
        rows = np.abs(rows)
        print(f"skyline: {np.mean(rows):.2f} pixels off in the mean, {100 * np.mean(rows <= 1):.1f} % within 1 of {len(rows)}")


if __name__ == "__main__":
    main()
