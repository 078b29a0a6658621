#!/usr/bin/env python3
"""Time, memory and bytes of scenes against their parameters, each relative to the largest scene: a table, and a plot.

    tools/measure/sizes.py full.strivec lego.strivec small.strivec --dataset LEGO --out docs/images/sizes

writes OUT.csv and OUT.svg. `strivec bench render` measures frames of 800x800, in rounds over all scenes, and in another run
their memory: what the process takes at its peak more than before it opens the scene's field. `strivec eval` measures PSNR on the
dataset's test views. Needs matplotlib, and this project's command in target/release (or --command FILE).
"""

import argparse
import csv
import json
import os
import statistics
import subprocess
from pathlib import Path

COLUMNS = ["scene", "parameters", "bytes", "frame_ms", "memory_bytes", "psnr"]
# Makes glibc give memory back as soon as it is free. Else, what was read of the file before would be used again and not count.
GIVES_MEMORY_BACK = {"MALLOC_MMAP_THRESHOLD_": "65536", "MALLOC_TRIM_THRESHOLD_": "65536"}


def said(words, **environment):
    environment = os.environ | environment
    process = subprocess.run(words, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=True, env=environment)
    return json.loads(process.stdout)


def measure(arguments, scene):
    """One row, without a frame's time."""
    quiet = [arguments.command, "--quiet", "--json"]
    of_views = ["--split", "test", "--every", str(arguments.every)]
    return {
        "scene": scene.stem,
        "parameters": said([*quiet, "info", scene])["nonzero_parameters"],
        "bytes": scene.stat().st_size,
        "memory_bytes": frame(arguments, scene, runs=1, **GIVES_MEMORY_BACK)["peak_bytes"],
        "psnr": said([*quiet, "eval", scene, arguments.dataset, *of_views])["psnr"],
    }


def frame(arguments, scene, runs, **environment):
    """What `bench render` says of frames of 800x800."""
    words = [arguments.command, "--quiet", "--json", "bench", "render", scene, "--size", "800x800", "--runs", str(runs)]
    return said(words, **environment)["frames"][0]


def plot(path, rows):
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"svg.hashsalt": "strivec", "font.size": 9})
    figure, axes = plt.subplots(figsize=(6, 4))
    millions = [row["parameters"] / 1e6 for row in rows]
    for label, column, marker in [
        ("time of a frame", "frame_ms", "o"),
        ("memory while rendering", "memory_bytes", "^"),
        ("bytes of the file", "bytes", "s"),
    ]:
        axes.plot(millions, [row[column] / rows[-1][column] for row in rows], marker + "-", label=label, markersize=4)
    for row, x in zip(rows, millions):
        axes.annotate(f"{row['psnr']:.1f} dB", (x, 0), textcoords="offset points", xytext=(-8, 4), fontsize=7)
    axes.set_ylim(0, 1.05)
    axes.set_xlabel("parameters, millions")
    axes.set_ylabel(f"share of {rows[-1]['scene']}")
    axes.grid(True, linewidth=0.3)
    axes.legend()
    figure.savefig(path, bbox_inches="tight", metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+", help="scene files")
    parser.add_argument("--dataset", required=True, help="dataset of the scenes' training")
    parser.add_argument("--out", type=Path, required=True, help="path of the results without an extension")
    parser.add_argument("--every", type=int, default=1, help="measure PSNR on every Nth test view (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=5, help="measured frames are medians of so many rounds (default: %(default)s)")
    parser.add_argument("--command", type=Path, default=Path("target/release/strivec"))
    arguments = parser.parse_args()
    frames = [[frame(arguments, scene, runs=3) for scene in arguments.scenes] for _ in range(arguments.rounds)]
    rows = [measure(arguments, scene) for scene in arguments.scenes]
    for row, of_scene in zip(rows, zip(*frames)):
        row["frame_ms"] = 1e3 * statistics.median(measured["seconds"]["median"] for measured in of_scene)
    rows.sort(key=lambda row: row["parameters"])
    with arguments.out.with_suffix(".csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    plot(arguments.out.with_suffix(".svg"), rows)
    print("| scene | parameters | MB | frame, ms | memory, MB | PSNR, dB |\n|---|---|---|---|---|---|")
    for row in rows:
        megabytes = [row[column] / 1e6 for column in ("bytes", "memory_bytes")]
        print(
            f"| {row['scene']} | {row['parameters'] / 1e6:.2f} M | {megabytes[0]:.1f} | {row['frame_ms']:.0f} "
            f"| {megabytes[1]:.0f} | {row['psnr']:.2f} |"
        )


if __name__ == "__main__":
    main()
