#!/usr/bin/env python3
"""PSNR of the same synthetic scene through every layout and every camera model.

    tools/measure/layouts.py --out layouts --preset fast --steps 1500

makes the datasets with `strivec synth`, trains each and prints a table. "own" is the PSNR of the dataset's own test views,
"pinhole" that of the test views of the Blender layout, which have the same viewpoints. Equirectangular pictures are 8.73 times as
wide and 4.365 times as high as the others, so that the scene has as many pixels. The last row trains on pictures with distortion
as if they had none. --prior gives all trainings the exact mesh. With --seeds N, rows are means of trainings with the seeds 0 to
N - 1, with their standard errors; layouts that are read as the same numbers train to the same file, so only camera models repeat.
Trainings in OUT/rows.json are not repeated. Needs target/release/strivec (or --command FILE).
"""

import argparse
import json
import statistics
import subprocess
import time
from pathlib import Path

LAYOUTS = ["blender", "transforms", "colmap", "colmap-text", "nsvf", "llff", "metashape"]
CAMERAS = [
    "pinhole",
    "simple-radial",
    "radial",
    "opencv",
    "full-opencv",
    "opencv-fisheye",
    "simple-radial-fisheye",
    "radial-fisheye",
    "thin-prism-fisheye",
    "equirectangular",
]
# Width of an equirectangular picture by that of a pinhole's with as many pixels on the scene.
WIDER = 8.73


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="Folder of datasets, scenes and rows.json")
    parser.add_argument("--views", type=int, default=52)
    parser.add_argument("--test-views", type=int, default=8)
    parser.add_argument("--size", type=int, default=100, help="Columns and rows of the pictures")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--config", help="Settings of `strivec train`; replaces --preset")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=0, help="Seed of the scene")
    parser.add_argument("--seeds", type=int, default=1, help="Trainings of each camera model")
    parser.add_argument("--prior", action="store_true", help="Give all trainings the exact mesh")
    parser.add_argument("--command", default="target/release/strivec")
    return parser.parse_args()


def main():
    args = arguments()
    args.out.mkdir(parents=True, exist_ok=True)
    stored = args.out / "rows.json"
    rows = json.loads(stored.read_text()) if stored.exists() else {}

    def run(*words):
        words = [args.command, *map(str, words), "--json", "--quiet", "--force"]
        return json.loads(subprocess.run(words, check=True, stdout=subprocess.PIPE).stdout)

    def dataset(layout, camera):
        folder = args.out / f"{layout}-{camera}"
        if not folder.exists():
            wide = camera == "equirectangular"
            size = [round(WIDER * args.size), round(WIDER / 2 * args.size)] if wide else [args.size] * 2
            words = ["--layout", layout, "--camera", camera, "--size", f"{size[0]}x{size[1]}", "--seed", args.seed]
            run("synth", folder, *words, "--views", args.views, "--test-views", args.test_views)
        return folder

    def measure(name, folder, seeds=1):
        key = name + (" prior" if args.prior else "")
        row = rows.setdefault(key, [])
        for seed in range(len(row), seeds):
            scene = args.out / f"{key.replace(' ', '-')}.strivec"
            settings = ["--config", args.config] if args.config else ["--preset", args.preset]
            prior = ["--prior", truth / "mesh.ply"] if args.prior else []
            begin = time.time()
            run("train", folder, "-o", scene, *settings, "--steps", args.steps, "--seed", seed, *prior)
            seconds = time.time() - begin
            own, pinhole = (run("eval", scene, where)["psnr"] for where in (folder, truth))
            row.append({"own": own, "pinhole": pinhole, "seconds": seconds})
            stored.write_text(json.dumps(rows, indent=1))
            print(f"{key}, seed {seed}: own {own:.2f} dB, pinhole {pinhole:.2f} dB, {seconds:.0f} s", flush=True)

    truth = dataset("blender", "pinhole")
    measure("blender pinhole", truth, args.seeds)
    for layout in LAYOUTS[1:]:
        measure(f"{layout} pinhole", dataset(layout, "pinhole"))
    for camera in CAMERAS[1:]:
        measure(f"colmap {camera}", dataset("colmap", camera), args.seeds)
    for layout in ("transforms", "metashape"):
        for camera in ("opencv", "opencv-fisheye"):
            measure(f"{layout} {camera}", dataset(layout, camera))
    # Distorted pictures with their lens taken away.
    folder = dataset("transforms", "opencv")
    path = folder / "transforms.json"
    text = path.read_text()
    without = json.loads(text)
    for key in ("k1", "k2", "p1", "p2"):
        del without[key]
    path.write_text(json.dumps(without))
    try:
        measure("transforms opencv without its lens", folder)
    finally:
        path.write_text(text)
    reference = rows["blender pinhole" + (" prior" if args.prior else "")]
    print("\n| dataset | trainings | own, dB | pinhole, dB | difference, dB | s |\n|---|---|---|---|---|---|")
    for key, row in rows.items():
        if key.endswith(" prior") == args.prior:
            own, pinhole, seconds = (statistics.mean(r[what] for r in row) for what in ("own", "pinhole", "seconds"))
            # Against trainings with the same seeds.
            apart = [r["pinhole"] - o["pinhole"] for r, o in zip(row, reference)]
            error = f" ± {statistics.stdev(apart) / len(apart) ** 0.5:.2f}" if len(apart) > 1 else ""
            difference = f"{statistics.mean(apart):+.2f}{error}"
            print(f"| {key} | {len(row)} | {own:.2f} | {pinhole:.2f} | {difference} | {seconds:.0f} |")


if __name__ == "__main__":
    main()
