#!/usr/bin/env python3
"""Writes a copy of a dataset in Blender's layout whose training cameras are turned and moved at random.

    tools/measure/disturb_poses.py LEGO OUT [--degrees 0.5] [--share 0.01] [--seed 0]
    tools/measure/disturb_poses.py LEGO OUT --compare lego.strivec.poses.json

Each camera is turned by a rotation vector of normal numbers whose root mean square length is DEGREES, and moved by a normal
vector of SHARE of its distance from the mean of all cameras' positions. Test cameras stay. Pictures are linked, not copied.

--compare prints how far refined poses are from the exact ones, after the similarity between both, beside the disturbed ones.
"""

import argparse
import json
import os
from pathlib import Path

import numpy as np
from poses import errors


def rotation(vector):
    """The rotation matrix of a rotation vector."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / max(angle, 1e-300)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def disturb(source, target, degrees, share, seed):
    random = np.random.default_rng(seed)
    target.mkdir(parents=True)
    for entry in source.iterdir():
        if entry.name != "transforms_train.json":
            os.symlink(entry.resolve(), target / entry.name)
    data = json.loads((source / "transforms_train.json").read_text())
    poses = [np.array(frame["transform_matrix"]) for frame in data["frames"]]
    middle = np.mean([pose[:3, 3] for pose in poses], axis=0)
    for frame, pose in zip(data["frames"], poses):
        turn, move = random.normal(size=(2, 3)) / np.sqrt(3)
        pose[:3, :3] = pose[:3, :3] @ rotation(np.radians(degrees) * turn)
        pose[:3, 3] += share * np.linalg.norm(pose[:3, 3] - middle) * move
        frame["transform_matrix"] = pose.tolist()
    (target / "transforms_train.json").write_text(json.dumps(data, indent=1))


def poses_of(path):
    frames = json.loads(Path(path).read_text())["frames"]
    return {Path(frame["file_path"]).stem: np.array(frame["transform_matrix"]) for frame in frames}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--degrees", type=float, default=0.5)
    parser.add_argument("--share", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--compare", type=Path, metavar="FILE")
    options = parser.parse_args()
    if options.compare is None:
        disturb(options.source, options.target, options.degrees, options.share, options.seed)
        return
    exact = poses_of(options.source / "transforms_train.json")
    for name, path in ("disturbed", options.target / "transforms_train.json"), ("refined", options.compare):
        found = poses_of(path)
        names = sorted(exact.keys() & found.keys())
        angles, positions = errors(*(np.array([poses[name] for name in names]) for poses in (found, exact)))
        print(f"{name}: rotation {np.median(angles):.4f} degrees in the median, {angles.max():.4f} at most; "
              f"position {np.median(positions):.5f} units, {positions.max():.5f}")


if __name__ == "__main__":
    main()
