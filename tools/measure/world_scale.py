#!/usr/bin/env python3
"""The same dataset at other world scales: `--auto` should find the same model.

    tools/measure/world_scale.py DATASET --out auto --steps 1500 -- --config src/cli/demo.toml

copies a dataset in the Blender layout with camera positions multiplied by 1, 0.01 and 1000, or by the values of --scales
(pictures are linked), trains each with `strivec train --auto` and the arguments after --, and prints a table with the PSNR
between the pictures of the test views.
Needs numpy and pillow, and target/release/strivec (or --command FILE).
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np


def scaled(dataset, folder, scale):
    folder.mkdir(parents=True, exist_ok=True)
    for path in dataset.iterdir():
        link = folder / path.name
        if path.name.startswith("transforms_"):
            poses = json.loads(path.read_text())
            for frame in poses["frames"]:
                for row in frame["transform_matrix"][:3]:
                    row[3] *= float(scale)
            link.write_text(json.dumps(poses))
        elif path.is_dir() and not link.exists():
            link.symlink_to(path.resolve())
    return folder


def said(words):
    return json.loads(subprocess.run(words, stdout=subprocess.PIPE, check=True).stdout)


def pictures(command, scene, dataset, folder, downscale):
    from PIL import Image

    cameras = ["--cameras", dataset / "transforms_test.json", "--downscale", str(downscale)]
    subprocess.run([*command, "render", scene, *cameras, "--out", folder], stdout=subprocess.DEVNULL, check=True)
    return np.stack([np.asarray(Image.open(p).convert("RGB"), float) / 255 for p in sorted(folder.glob("*.png"))])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scales", nargs="+", default=["1", "0.01", "1000"])
    parser.add_argument("--steps", type=int, default=30_000)
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--command", default="target/release/strivec")
    end = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    arguments, more = parser.parse_args(sys.argv[1:end]), sys.argv[end + 1 :]
    command = [arguments.command, "--quiet", "--json", "--force"]
    common = ["--downscale", str(arguments.downscale)]
    print("| world scale | tensors | parameters | PSNR, dB | pictures to the first ones, dB |\n|---|---|---|---|---|")
    reference = None
    for scale in arguments.scales:
        dataset = scaled(arguments.dataset, arguments.out / scale, scale)
        scene = arguments.out / f"{scale}.strivec"
        train = ["train", dataset, "-o", scene, "--auto", "--steps", str(arguments.steps), *common, *more]
        trained = said(command + train)
        seen = said(command + ["eval", scene, dataset, "--split", "test", *common])
        shown = pictures(command, scene, dataset, arguments.out / f"{scale}-pictures", arguments.downscale)
        reference = shown if reference is None else reference
        error = ((shown - reference) ** 2).mean()
        close = f"{-10 * np.log10(error):.1f}" if error > 0 else "the same"
        tensors = ", ".join(str(s["tensors"]) for s in trained["scales"])
        print(f"| {scale} | {tensors} | {trained['parameters'] / 1e6:.2f} M | {seen['psnr']:.2f} | {close} |", flush=True)


if __name__ == "__main__":
    main()
