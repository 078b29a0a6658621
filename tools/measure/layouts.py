#!/usr/bin/env python3
"""PSNR of the same synthetic scene through every layout and every camera model.

    tools/measure/layouts.py --out layouts --preset fast --steps 1500

makes the datasets with `strivec synth`, trains each and prints two tables. "own" is the PSNR of the dataset's own test views,
"pinhole" that of the test views of the Blender layout, which have the same viewpoints. Equirectangular pictures are 8.73 times as
wide and 4.365 times as high as the others, so that the scene has as many pixels. The last row of the second table trains on
pictures with distortion as if they had none. --prior gives all trainings the exact mesh. Rows in OUT/rows.json are not measured
again. Needs target/release/strivec (or --command FILE).
"""

import argparse
import json
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
    parser.add_argument("--seed", type=int, default=0)
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

    def measure(name, folder):
        key = name + (" prior" if args.prior else "")
        if key in rows:
            return
        scene = args.out / f"{key.replace(' ', '-')}.strivec"
        settings = ["--config", args.config] if args.config else ["--preset", args.preset]
        prior = ["--prior", truth / "mesh.ply"] if args.prior else []
        begin = time.time()
        trained = run("train", folder, "-o", scene, *settings, "--steps", args.steps, "--seed", args.seed, *prior)
        seconds = time.time() - begin
        own, pinhole = (run("eval", scene, where)["psnr"] for where in (folder, truth))
        rows[key] = {"own": own, "pinhole": pinhole, "seconds": seconds, "trained": trained}
        stored.write_text(json.dumps(rows, indent=1))
        print(f"{key}: own {own:.2f} dB, pinhole {pinhole:.2f} dB, {seconds:.0f} s", flush=True)

    truth = dataset("blender", "pinhole")
    for layout in LAYOUTS:
        measure(f"{layout} pinhole", dataset(layout, "pinhole"))
    for camera in CAMERAS[1:]:
        measure(f"colmap {camera}", dataset("colmap", camera))
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
    print("\n| dataset | own, dB | pinhole, dB | difference, dB | s |\n|---|---|---|---|---|")
    for key, row in rows.items():
        if key.endswith(" prior") == args.prior:
            difference = row["pinhole"] - reference["pinhole"]
            print(f"| {key} | {row['own']:.2f} | {row['pinhole']:.2f} | {difference:+.2f} | {row['seconds']:.0f} |")


if __name__ == "__main__":
    main()
