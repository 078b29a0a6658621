#!/usr/bin/env python3
"""Time, memory and bytes of scenes against their parameters, each relative to the largest scene: a table, and a plot.

    tools/measure/sizes.py full.strivec lego.strivec small.strivec --dataset LEGO --out docs/images/sizes

writes OUT.csv and OUT.svg. `strivec bench render` measures frames of 800x800, in rounds over all scenes, and the memory of
the process at its peak; `strivec eval` measures PSNR on the dataset's test views. Needs matplotlib, and this project's command
in target/release (or --command FILE).
"""

import argparse
import csv
import json
import statistics
import subprocess
from pathlib import Path

COLUMNS = ["scene", "parameters", "bytes", "frame_ms", "memory_bytes", "psnr"]


def said(words):
    return json.loads(subprocess.run(words, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=True).stdout)


def measure(arguments, scene):
    """One row, without a frame's time and memory."""
    quiet = [arguments.command, "--quiet", "--json"]
    of_views = ["--split", "test", "--every", str(arguments.every)]
    return {
        "scene": scene.stem,
        "parameters": said([*quiet, "info", scene])["nonzero_parameters"],
        "bytes": scene.stat().st_size,
        "psnr": said([*quiet, "eval", scene, arguments.dataset, *of_views])["psnr"],
    }


def frame(arguments, scene):
    """Median milliseconds, and bytes at the peak."""
    words = [arguments.command, "--quiet", "--json", "bench", "render", scene, "--size", "800x800", "--runs", "3"]
    [frame] = said(words)["frames"]
    return 1e3 * frame["seconds"]["median"], frame["peak_bytes"]


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
    rounds = [[frame(arguments, scene) for scene in arguments.scenes] for _ in range(arguments.rounds)]
    rows = [measure(arguments, scene) for scene in arguments.scenes]
    for row, frames in zip(rows, zip(*rounds)):
        row["frame_ms"], row["memory_bytes"] = (statistics.median(values) for values in zip(*frames))
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
