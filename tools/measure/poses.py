#!/usr/bin/env python3
"""Errors of estimated camera poses against known ones.

    strivec pose fox/images -o fox-pose
    tools/measure/poses.py fox-pose fox/transforms.json

compares DIR/sparse/0 of COLMAP with the poses of a transforms.json (OpenGL axes) by the pictures' names. A similarity, the least
squares fit of the estimated camera centers to the known ones (Umeyama 1991), maps the one world to the other. Positions are in
percent of the largest distance between two known centers, rotations in degrees. --worst N lists the N largest errors. Needs
numpy.
"""

import argparse
import json
import struct
from pathlib import Path

import numpy as np


def read_colmap(path):
    """World from camera, OpenCV axes, as 4 x 4 matrices by the names in images.bin."""
    raw, at, poses = path.read_bytes(), 8, {}
    for _ in range(struct.unpack_from("<Q", raw)[0]):
        w, x, y, z, *translation = struct.unpack_from("<7d", raw, at + 4)
        at += 4 + 56 + 4
        end = raw.index(b"\0", at)
        name = raw[at:end].decode()
        at = end + 9 + 24 * struct.unpack_from("<Q", raw, end + 1)[0]
        camera_from_world = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        pose = np.eye(4)
        pose[:3, :3] = camera_from_world.T
        pose[:3, 3] = -camera_from_world.T @ np.array(translation)
        poses[name] = pose
    return poses


def read_transforms(path):
    """World from camera, OpenCV axes, by file name."""
    poses = {}
    for frame in json.loads(path.read_text())["frames"]:
        pose = np.array(frame["transform_matrix"], np.float64)
        poses[Path(frame["file_path"]).name] = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    return poses


def similarity(source, target):
    """Scale, rotation and translation that map the points `source` (N, 3) to `target` with the least squared error."""
    a, b = source - source.mean(0), target - target.mean(0)
    u, singular, vt = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ np.diag(sign) @ vt
    scale = (singular * sign).sum() / (a**2).sum()
    return scale, rotation, target.mean(0) - scale * rotation @ source.mean(0)


def errors(estimated, true):
    """Rotations in degrees and distances of centers between poses (N, 4, 4), after the similarity that maps the centers."""
    scale, rotation, translation = similarity(estimated[:, :3, 3], true[:, :3, 3])
    centers = scale * estimated[:, :3, 3] @ rotation.T + translation
    between = np.swapaxes(rotation @ estimated[:, :3, :3], 1, 2) @ true[:, :3, :3]
    # The sine is exact for small angles, where the cosine is not.
    axis = np.stack([between[:, 2, 1] - between[:, 1, 2], between[:, 0, 2] - between[:, 2, 0], between[:, 1, 0] - between[:, 0, 1]], 1)
    angles = np.degrees(np.arctan2(np.linalg.norm(axis, axis=1), np.trace(between, axis1=1, axis2=2) - 1))
    return angles, np.linalg.norm(centers - true[:, :3, 3], axis=1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path, help="output folder of strivec pose")
    parser.add_argument("transforms", type=Path, help="transforms.json with the known poses")
    parser.add_argument("--worst", type=int, default=3, metavar="N", help="pictures to list (default 3)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    args = parser.parse_args()
    found, known = read_colmap(args.capture / "sparse/0/images.bin"), read_transforms(args.transforms)
    names = sorted(found.keys() & known.keys())
    if len(names) < 3:
        parser.error(f"only {len(names)} pictures have both poses")
    estimated, true = (np.array([poses[name] for name in names]) for poses in (found, known))
    size = np.linalg.norm(true[:, None, :3, 3] - true[None, :, :3, 3], axis=2).max()
    angle, position = errors(estimated, true)
    position *= 100 / size
    result = {
        "pictures": len(names),
        "rotation_degrees": {"median": float(np.median(angle)), "largest": float(angle.max())},
        "position_percent": {"median": float(np.median(position)), "largest": float(position.max())},
    }
    if args.json:
        print(json.dumps(result, indent=1))
        return
    print(f"{len(names)} pictures with both poses; the known centers are up to {size:.3f} apart")
    print(f"rotation: median {np.median(angle):.3f} degrees, largest {angle.max():.3f}")
    print(f"position: median {np.median(position):.3f} % of that distance, largest {position.max():.3f} %")
    for n in np.argsort(-position)[: args.worst]:
        print(f"  {names[n]}: {angle[n]:.3f} degrees, {position[n]:.3f} %")


if __name__ == "__main__":
    main()
