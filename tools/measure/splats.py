#!/usr/bin/env python3
"""Pictures and values of Gaussian splats that another program read from exported files.

    strivec export lego.strivec -o lego.ply --as splats --harmonics 3
    strivec export lego.strivec -o lego.spz --harmonics 3
    strivec export lego.strivec -o lego.sog --harmonics 3
    splat-transform lego.spz spz.ply; splat-transform lego.sog sog.ply
    tools/measure/splats.py values lego.ply spz.ply sog.ply
    strivec render lego.strivec --cameras LEGO/transforms_test.json --size 200x200 --out frames
    tools/measure/splats.py pictures lego.ply spz.ply sog.ply --cameras LEGO/transforms_test.json --frames frames

`values` prints the differences of each property to those of the first file: root mean square, 99.9 % and largest. `pictures` draws
the splats as the paper does (Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering", 2023): projected
Gaussians (EWA), composited from front to back, and prints PSNR to the pictures in FRAMES. Needs numpy and Pillow; splat-transform
is of the package @playcanvas/splat-transform for Node.js.
"""

import argparse
import itertools
import json
import math
from pathlib import Path

import numpy as np

# Added to the variances of a projected Gaussian, in pixels, as the reference implementation does.
BLUR = 0.3
MAX_ALPHA = 0.99
MIN_ALPHA = 1 / 255
MIN_TRANSMITTANCE = 1e-4
NEAR = 0.2


def read_ply(path):
    """The floats of the vertices of a binary PLY file, by their names."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    rows = np.frombuffer(data, "<f4", count * len(names), end).reshape(count, len(names))
    return {name: rows[:, n].astype(np.float64) for n, name in enumerate(names)}


def columns(splats, name, count):
    return np.stack([splats[f"{name}_{n}"] for n in range(count)], axis=1)


def centers(splats):
    return np.stack([splats[axis] for axis in "xyz"], axis=1)


def opacities(splats):
    return 1 / (1 + np.exp(-splats["opacity"]))


def unit_rotations(splats):
    """Quaternions w, x, y, z."""
    rotations = columns(splats, "rot", 4)
    return rotations / np.linalg.norm(rotations, axis=1, keepdims=True)


def covariances(splats):
    """Those of the Gaussians, n x 3 x 3."""
    w, x, y, z = unit_rotations(splats).T
    rotations = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    scaled = rotations * np.exp(columns(splats, "scale", 3))[:, None, :]
    return scaled @ scaled.transpose(0, 2, 1)


def harmonics(splats):
    """Coefficients, n x terms x 3."""
    first = columns(splats, "f_dc", 3)[:, None, :]
    rest = sum(name.startswith("f_rest_") for name in splats)
    if rest == 0:
        return first
    higher = columns(splats, "f_rest", rest).reshape(len(first), 3, rest // 3).transpose(0, 2, 1)
    return np.concatenate([first, higher], axis=1)


def basis(directions):
    """The harmonics of the reference implementation (utils/sh_utils.py) at unit vectors, n x 16."""
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack(
        [
            np.full(len(x), 0.28209479177387814),
            *(-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x),
            *(1.0925484305920792 * x * y, -1.0925484305920792 * y * z, 0.31539156525252005 * (2 * zz - xx - yy)),
            *(-1.0925484305920792 * x * z, 0.5462742152960396 * (xx - yy)),
            *(-0.5900435899266435 * y * (3 * xx - yy), 2.890611442640554 * x * y * z),
            *(-0.4570457994644658 * y * (4 * zz - xx - yy), 0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy)),
            *(-0.4570457994644658 * x * (4 * zz - xx - yy), 1.445305721320277 * z * (xx - yy)),
            -0.5900435899266435 * x * (xx - 3 * yy),
        ],
        axis=1,
    )


def draw(splats, pose, focal, size, background):
    """The picture, height x width x 3, of a camera that looks along its -z; `splats` as `prepared` makes them."""
    width, height = size
    # Right, down, front.
    axes = pose[:3, :3] * [1, -1, -1]
    away = splats["centers"] - pose[:3, 3]
    x, y, z = (away @ axes).T
    # Beyond this the linear projection of a Gaussian is no likeness, as in the reference implementation.
    limits = [1.3 * 0.5 * extent / focal for extent in size]
    shown = np.flatnonzero((z > NEAR) & (np.abs(x / z) < limits[0]) & (np.abs(y / z) < limits[1]))
    shown = shown[np.argsort(z[shown], kind="stable")]
    x, y, z, away = x[shown], y[shown], z[shown], away[shown]
    zero = np.zeros(len(z))
    jacobian = focal * np.array([[1 / z, zero, -x / z**2], [zero, 1 / z, -y / z**2]]).transpose(2, 0, 1)
    projection = jacobian @ axes.T
    flat = projection @ splats["covariances"][shown] @ projection.transpose(0, 2, 1) + BLUR * np.eye(2)
    inverses = np.linalg.inv(flat)
    radii = np.ceil(3 * np.sqrt(np.stack([flat[:, 0, 0], flat[:, 1, 1]], axis=1)))
    places = np.stack([focal * x / z + width / 2, focal * y / z + height / 2], axis=1) - 0.5
    terms = splats["harmonics"].shape[1]
    values = basis(away / np.linalg.norm(away, axis=1, keepdims=True))[:, :terms]
    colors = np.maximum(0.5 + np.einsum("nk,nkc->nc", values, splats["harmonics"][shown]), 0)
    opacities = splats["opacities"][shown]
    picture, left = np.zeros((height, width, 3)), np.ones((height, width))
    first = np.maximum(np.ceil(places - radii), 0).astype(int)
    last = np.minimum(np.floor(places + radii), [width - 1, height - 1]).astype(int)
    rows, ranks = np.arange(height), np.arange(width)
    for n in np.flatnonzero((first <= last).all(axis=1)):
        (left_x, top), (right, bottom) = first[n], last[n]
        patch = left[top : bottom + 1, left_x : right + 1]
        if patch.max() < MIN_TRANSMITTANCE:
            continue
        dx = (ranks[left_x : right + 1] - places[n, 0])[None, :]
        dy = (rows[top : bottom + 1] - places[n, 1])[:, None]
        (a, b), (_, c) = inverses[n]
        alpha = opacities[n] * np.exp(-0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy)
        alpha = np.where((alpha < MIN_ALPHA) | (patch < MIN_TRANSMITTANCE), 0, np.minimum(alpha, MAX_ALPHA))
        picture[top : bottom + 1, left_x : right + 1] += (patch * alpha)[:, :, None] * colors[n]
        patch *= 1 - alpha
    return np.clip(picture + left[:, :, None] * background, 0, 1)


def prepared(path):
    splats = read_ply(path)
    return {
        "centers": centers(splats),
        "covariances": covariances(splats),
        "harmonics": harmonics(splats),
        "opacities": opacities(splats),
    }


def pictures(arguments):
    from PIL import Image

    description = json.loads(arguments.cameras.read_text())
    frames = description["frames"][:: arguments.every]
    print("file | splats | bytes | PSNR, dB")
    for path in arguments.files:
        splats = prepared(path)
        errors = []
        for frame in frames:
            expected = Image.open(arguments.frames / f"{Path(frame['file_path']).stem}.png").convert("RGB")
            focal = 0.5 * expected.width / math.tan(0.5 * description["camera_angle_x"])
            found = draw(splats, np.array(frame["transform_matrix"]), focal, expected.size, np.array(arguments.background))
            errors.append(np.mean((found - np.asarray(expected) / 255) ** 2))
            if arguments.out:
                arguments.out.mkdir(parents=True, exist_ok=True)
                name = f"{path.stem}-{Path(frame['file_path']).stem}.png"
                Image.fromarray(np.round(found * 255).astype(np.uint8)).save(arguments.out / name)
        mean = np.mean([-10 * math.log10(error) for error in errors])
        print(f"{path.name} | {len(splats['centers'])} | {path.stat().st_size} | {mean:.2f}", flush=True)


def matched(expected, found):
    """For each of the points `expected` the number of the nearest one of `found`, which is less than a cell away."""
    edge = 1e-3 * np.ptp(expected, axis=0).max()
    origin = expected.min(axis=0) - 2 * edge

    def keys(points, offset=(0, 0, 0)):
        x, y, z = (np.floor((points - origin) / edge).astype(np.int64) + offset).T
        return (x * 2048 + y) * 2048 + z

    order = np.argsort(keys(found), kind="stable")
    sorted_keys = keys(found)[order]
    best, nearest = np.full(len(expected), np.inf), np.zeros(len(expected), int)
    for offset in itertools.product((-1, 0, 1), repeat=3):
        wanted = keys(expected, offset)
        first, last = (np.searchsorted(sorted_keys, wanted, side) for side in ("left", "right"))
        for n in range((last - first).max()):
            has = np.flatnonzero(first + n < last)
            candidates = order[first[has] + n]
            distances = ((found[candidates] - expected[has]) ** 2).sum(axis=1)
            closer = distances < best[has]
            nearest[has[closer]], best[has[closer]] = candidates[closer], distances[closer]
    return nearest


def show(name, off, rms):
    tail, most = (np.quantile(off, 0.999), off.max()) if off.size else (0, 0)
    print(f"  {name}: root mean square {rms:.3g}, 99.9 % {tail:.3g}, at most {most:.3g}")


def properties(splats):
    """What is compared component by component, each n x components."""
    return {
        "centers": centers(splats),
        "logarithms of scales": columns(splats, "scale", 3),
        "opacity": opacities(splats)[:, None],
        "degree 0": columns(splats, "f_dc", 3),
        "degrees 1 to 3": harmonics(splats)[:, 1:].reshape(len(splats["x"]), -1),
    }


def values(arguments):
    reference = read_ply(arguments.files[0])
    expected, rotations = properties(reference), unit_rotations(reference)
    for path in arguments.files[1:]:
        splats = read_ply(path)
        order = matched(expected["centers"], centers(splats))
        # Centers that are nearer to each other than a file's step are no match.
        known = np.unique(order, return_counts=True)
        is_single = np.isin(order, known[0][known[1] == 1])
        print(f"{path.name}: {len(splats['x'])} splats of {len(order)}, {is_single.sum()} of them matched")
        order = order[is_single]
        found = properties(splats)
        for name, of_reference in expected.items():
            width = found[name].shape[1]
            off = np.abs(found[name][order] - of_reference[is_single, :width])
            show(name, off, math.sqrt(np.mean(off**2)) if off.size else 0)
        turned = unit_rotations(splats)[order]
        angles = 2 * np.arccos(np.clip(np.abs((turned * rotations[is_single]).sum(axis=1)), 0, 1))
        show("degrees of rotations", np.degrees(angles), math.sqrt(np.mean(np.degrees(angles) ** 2)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("values", help="differences to the splats of the first file")
    command.add_argument("files", nargs="+", type=Path, metavar="PLY")
    command.set_defaults(run=values)
    command = commands.add_parser("pictures", help="PSNR to rendered pictures")
    command.add_argument("files", nargs="+", type=Path, metavar="PLY")
    command.add_argument("--cameras", required=True, type=Path, help="transforms.json of the pictures")
    command.add_argument("--frames", required=True, type=Path, help="folder of pictures, named like the cameras")
    command.add_argument("--every", type=int, default=1, metavar="N", help="draw every N-th camera")
    command.add_argument("--background", type=float, nargs=3, default=[1, 1, 1], help="default: white")
    command.add_argument("--out", type=Path, help="folder for the drawn pictures")
    command.set_defaults(run=pictures)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
