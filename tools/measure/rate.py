#!/usr/bin/env python3
"""PSNR of scene files against their bytes, beside those of other methods: a table, and a plot.

    tools/measure/rate.py --dataset LEGO --curve packed 2MB.strivec 1MB.strivec --curve trained 2MB-trained.strivec \\
        --peers docs/images/peers-lego.csv --out docs/images/rate

writes OUT.csv and OUT.svg: a line for each curve, and one for each method of the peers' table (method, psnr, bytes, source).
`strivec eval` measures PSNR on the dataset's test views. Needs matplotlib, and this project's command in target/release (or
--command FILE).
"""

import argparse
import csv
import json
import subprocess
from pathlib import Path

COLUMNS = ["method", "scene", "parameters", "bytes", "psnr"]


def said(words):
    return json.loads(subprocess.run(words, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=True).stdout)


def measure(arguments, curve, scene):
    quiet = [arguments.command, "--quiet", "--json"]
    of_views = ["--split", "test", "--every", str(arguments.every)]
    return {
        "method": curve,
        "scene": scene.stem,
        "parameters": said([*quiet, "info", scene])["nonzero_parameters"],
        "bytes": scene.stat().st_size,
        "psnr": round(said([*quiet, "eval", scene, arguments.dataset, *of_views])["psnr"], 3),
    }


def lines(rows):
    """(method, megabytes, PSNR), by bytes."""
    methods = dict.fromkeys(row["method"] for row in rows)
    for method in methods:
        points = sorted((int(row["bytes"]) / 1e6, float(row["psnr"])) for row in rows if row["method"] == method)
        yield method, *zip(*points)


def plot(path, rows, peers):
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"svg.hashsalt": "strivec", "font.size": 9})
    figure, axes = plt.subplots(figsize=(6.5, 4.5))
    for (method, megabytes, psnr), marker in zip(lines(rows), "osD^"):
        axes.plot(megabytes, psnr, marker + "-", label=f"Strivec, {method}", markersize=4, linewidth=2)
    for (method, megabytes, psnr), marker in zip(lines(peers), "xv<>^+1234pP*"):
        axes.plot(megabytes, psnr, marker + ":", label=method, markersize=5, linewidth=1)
    axes.set_xscale("log")
    ticks = [0.5, 0.75, 1, 1.5, 2, 3, 4, 6]
    axes.set_xticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlabel("MB")
    axes.set_ylabel("PSNR, dB")
    axes.grid(True, linewidth=0.3)
    axes.legend(fontsize=7)
    figure.savefig(path, bbox_inches="tight", metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--curve", nargs="+", action="append", required=True, metavar="NAME FILE", help="a curve's name and scenes")
    parser.add_argument("--dataset", required=True, help="dataset of the scenes' training")
    parser.add_argument("--peers", type=Path, required=True, help="table of other methods")
    parser.add_argument("--out", type=Path, required=True, help="path of the results without an extension")
    parser.add_argument("--every", type=int, default=1, help="measure PSNR on every Nth test view (default: %(default)s)")
    parser.add_argument("--command", type=Path, default=Path("target/release/strivec"))
    arguments = parser.parse_args()
    rows = [measure(arguments, name, Path(scene)) for name, *scenes in arguments.curve for scene in scenes]
    with arguments.out.with_suffix(".csv").open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    with arguments.peers.open(newline="") as file:
        plot(arguments.out.with_suffix(".svg"), rows, list(csv.DictReader(file)))
    print("| | scene | parameters | MB | PSNR, dB |\n|---|---|---|---|---|")
    for row in rows:
        print(f"| {row['method']} | {row['scene']} | {row['parameters'] / 1e6:.2f} M | {row['bytes'] / 1e6:.3f} | {row['psnr']:.2f} |")


if __name__ == "__main__":
    main()
