#!/usr/bin/env python3
"""Bytes against PSNR for every encoding of a scene: a table, and a plot.

    tools/measure/encodings.py lego.strivec LEGO --out docs/images/encodings-lego --every 10

writes OUT.csv and OUT.svg and prints the table of docs/experiments/2026-11-22-rate-distortion.md. strivec-pack makes each
encoding; `strivec eval` measures it on the dataset's test views. Rows in OUT.csv are not measured again. Needs matplotlib,
and both commands of this project in target/release (or --commands FOLDER).
"""

import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

# Name and arguments of strivec-pack, for encodings with a bounded error per number. Encodings by importance follow.
UNIFORM = [(name, ["convert", "--encoding", name]) for name in ("f32", "f16", "grid8", "grid6", "grid5", "grid4", "grid3")]
LOSSES = "0.001,0.003,0.01,0.03,0.1,0.3,1,3"
COLUMNS = ["encoding", "bytes", "percent_of_raw", "psnr", "ssim"]


def run(command):
    result = subprocess.run(command, stdout=subprocess.PIPE, check=True, stdin=subprocess.DEVNULL)
    return json.loads(result.stdout)


def measure(arguments, name, pack, folder):
    """One row: size and quality of the scene after `pack`."""
    commands = arguments.commands
    out = str(folder / "encoded.strivec")
    run([commands / "strivec-pack", "--quiet", "--json", "--force", *pack, arguments.scene, "-o", out])
    seen = run(
        [commands / "strivec", "--quiet", "--json", "eval", out, arguments.dataset, "--split", "test"]
        + ["--downscale", str(arguments.downscale), "--every", str(arguments.every)]
    )
    size = Path(out).stat().st_size
    raw = 4 * run([commands / "strivec", "--quiet", "--json", "info", out])["parameters"]
    return {"encoding": name, "bytes": size, "percent_of_raw": 100 * size / raw, "psnr": seen["psnr"], "ssim": seen["ssim"]}


def read(path):
    if not path.exists():
        return []
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [{key: value if key == "encoding" else float(value) for key, value in row.items()} for row in rows]


def write(path, rows):
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)


def text(rows):
    best = rows[0]["psnr"]
    lines = ["| encoding | bytes | of raw | PSNR, dB | lost, dB | SSIM |", "|---|---|---|---|---|---|"]
    for row in rows:
        size = f"{int(row['bytes']):,}".replace(",", " ")
        lost = best - row["psnr"]
        lines.append(
            f"| {row['encoding']} | {size} | {row['percent_of_raw']:.1f} % | {row['psnr']:.3f} | {lost:.3f} | {row['ssim']:.4f} |"
        )
    return "\n".join(lines)


def plot(path, rows, title):
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"svg.hashsalt": "strivec", "font.size": 9})
    figure, axes = plt.subplots(figsize=(7, 4.2))
    uniform = {name for name, _ in UNIFORM}
    for label, marker, chosen in [
        ("one encoding for all numbers", "s", [r for r in rows if r["encoding"] in uniform]),
        ("strivec-pack pack --max-loss", "o", [r for r in rows if r["encoding"] not in uniform]),
    ]:
        axes.plot([r["bytes"] / 1e6 for r in chosen], [r["psnr"] for r in chosen], marker, label=label, linestyle="-", markersize=4)
        for row in chosen:
            name = row["encoding"].removeprefix("max-loss ")
            axes.annotate(name, (row["bytes"] / 1e6, row["psnr"]), textcoords="offset points", xytext=(4, -9), fontsize=7)
    axes.set_xscale("log")
    axes.set_xlabel("bytes of the file, MB")
    axes.set_ylabel("PSNR of test views, dB")
    axes.set_title(title)
    axes.grid(True, which="both", linewidth=0.3)
    axes.legend()
    figure.savefig(path, bbox_inches="tight", metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", help="scene file with factors in f32 or f16")
    parser.add_argument("dataset")
    parser.add_argument("--out", type=Path, required=True, help="path of the results without an extension")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--losses", default=LOSSES, help="losses in dB for strivec-pack pack --max-loss (default: %(default)s)")
    parser.add_argument("--title", default="")
    parser.add_argument("--commands", type=Path, default=Path("target/release"))
    arguments = parser.parse_args()
    table = arguments.out.with_suffix(".csv")
    rows = read(table)
    judged = [(f"max-loss {loss} dB", ["pack", "--max-loss", f"{loss}dB"]) for loss in arguments.losses.split(",")]
    for name, pack in UNIFORM + judged:
        if any(row["encoding"] == name for row in rows):
            continue
        with tempfile.TemporaryDirectory() as folder:
            rows.append(measure(arguments, name, pack, Path(folder)))
        write(table, rows)
    plot(arguments.out.with_suffix(".svg"), rows, arguments.title or Path(arguments.scene).stem)
    print(text(rows))


if __name__ == "__main__":
    main()
