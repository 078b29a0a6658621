#!/usr/bin/env python3
"""The first lines that training prints for each layout, and the errors of likely mistakes.

    tools/measure/newcomer.py --out newcomer

writes a dataset in each layout with `strivec synth`, trains each for ten steps, and prints two Markdown tables: the first three
lines, and the message after each of three mistakes per layout. The output folder's name is left out of messages. Needs
target/release/strivec (or --command FILE).
"""

import argparse
import json
import re
import shutil
import subprocess
from pathlib import Path

# Lines that a terminal overwrites.
PROGRESS = re.compile(r"\w+: \d+/\d+")
SIZE = ["--views", "21", "--test-views", "3", "--size", "80x80"]


def keys(path, change):
    """Changes the JSON file at `path`."""
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def first(folder, pattern="*"):
    return sorted(folder.glob(pattern))[0]


def rename_pictures(folder):
    for picture in folder.glob("*.png"):
        picture.rename(picture.with_suffix(".jpeg"))


def cut(path, length):
    path.write_bytes(path.read_bytes()[:length])


def without_focal(content):
    for holder in [content, *content["frames"]]:
        for key in ("fl_x", "fl_y", "camera_angle_x", "camera_angle_y"):
            holder.pop(key, None)


# Layout: mistakes, each a description and a function of the folder.
MISTAKES = {
    "blender": [
        ("pictures in another folder", lambda f: (f / "train").rename(f / "pictures")),
        ("`transforms_train.json` not copied", lambda f: (f / "transforms_train.json").unlink()),
        ("a pose of three numbers", lambda f: keys(f / "transforms_train.json", lambda c: c["frames"][2].update(transform_matrix=[[1, 2, 3, 4]]))),
    ],
    "transforms": [
        ("no focal length", lambda f: keys(f / "transforms.json", without_focal)),
        ("pictures with another ending", lambda f: [rename_pictures(g) for g in f.iterdir() if g.is_dir()]),
        ("a camera model that no one knows", lambda f: keys(f / "transforms.json", lambda c: c.update(camera_model="OMNI"))),
    ],
    "colmap": [
        ("`images/` not copied", lambda f: shutil.rmtree(f / "images")),
        ("`sparse/0` without `images.bin`", lambda f: (f / "sparse/0/images.bin").unlink()),
        ("a copy cut short", lambda f: cut(f / "sparse/0/images.bin", 1000)),
    ],
    "nsvf": [
        ("`intrinsics.txt` not copied", lambda f: (f / "intrinsics.txt").unlink()),
        ("a pose that is not a matrix", lambda f: first(f / "pose").write_text("nan\n")),
        ("`rgb/` without pictures", lambda f: [picture.unlink() for picture in (f / "rgb").iterdir()]),
    ],
    "llff": [
        ("a picture removed", lambda f: first(f / "images").unlink()),
        ("`images/` not copied", lambda f: shutil.rmtree(f / "images")),
        ("the array of another program", lambda f: cut(f / "poses_bounds.npy", 64)),
    ],
    "scannet": [
        ("no `color/`", lambda f: shutil.rmtree(f / "color")),
        ("no intrinsics", lambda f: [shutil.rmtree(f / "intrinsic"), (f / "scannet.txt").unlink()]),
        ("a frame without a pose file", lambda f: first(f / "pose").unlink()),
    ],
    "metashape": [
        ("`images/` not copied", lambda f: shutil.rmtree(f / "images")),
        ("a sensor without a calibration", lambda f: (f / "cameras.xml").write_text((f / "cameras.xml").read_text().replace("calibration", "other"))),
        ("cameras that were not aligned", lambda f: (f / "cameras.xml").write_text((f / "cameras.xml").read_text().replace("transform", "other"))),
    ],
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="Folder of the datasets")
    parser.add_argument("--command", default="target/release/strivec")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)

    def run(*words):
        return subprocess.run([args.command, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def lines(text):
        return [line.replace(f"{args.out}/", "") for line in text.replace("\r", "\n").splitlines() if line.strip()]

    def train(folder):
        scene = args.out / "scene.strivec"
        return lines(run("train", folder, "-o", scene, "--steps", 10, "--preset", "fast", "--force").stderr)

    print("| layout | lines |\n|---|---|")
    for layout in MISTAKES:
        folder = args.out / layout
        if not folder.exists():
            made = run("synth", folder, "--layout", layout, *SIZE)
            if made.returncode != 0:
                raise SystemExit(made.stderr)
        shown = [line for line in train(folder) if not PROGRESS.match(line)][:3]
        print(f"| `{layout}` | {'; '.join(f'`{line}`' for line in shown)} |", flush=True)
    print("\n| layout | mistake | message |\n|---|---|---|")
    for layout, mistakes in MISTAKES.items():
        for what, make in mistakes:
            changed = args.out / "scene"
            shutil.rmtree(changed, ignore_errors=True)
            shutil.copytree(args.out / layout, changed)
            make(changed)
            last = train(changed)[-1].removeprefix("strivec: ").removeprefix("error: ")
            print(f"| `{layout}` | {what} | `{last}` |", flush=True)


if __name__ == "__main__":
    main()
