#!/usr/bin/env python3
"""What `strivec` makes of datasets as other programs and people have written them.

    tools/measure/foreign_datasets.py --strivec target/release/strivec --data DIR [NAME …]

For each folder NAME of DIR (all by default) a line of a table in Markdown: the PSNR of DIR/good.strivec, the scene that the
datasets show, against all of their photographs, or the error; and the lines on the folder that `dataset info` prints. A dataset
that is read rightly has 28.9 dB (PNG) or 26.7 dB (JPEG).
"""

import argparse
import json
import subprocess
from pathlib import Path

# Further arguments of both commands, by name.
ARGUMENTS = {
    "colmap-images2-other-names": ["--downscale", "2"],
    "colmap-images4-fullsize": ["--downscale", "4"],
}
LABELS = ("not there", "check", "not used")


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def line_of(error, folder):
    """The last line of `error`, without the path of the folder."""
    lines = error.strip().splitlines() or [""]
    return lines[-1].replace(f"{folder}/", "").replace(str(folder), folder.name).removeprefix("strivec: ")


def row(strivec, folder, scene):
    arguments = ARGUMENTS.get(folder.name, [])
    code, out, error = run(strivec, "eval", scene, folder, "--split", "all", "--json", *arguments)
    if code == 0:
        result = json.loads(out)
        quality = f"{result['psnr']:.1f} dB, {len(result['views'])} photographs"
    else:
        quality = line_of(error, folder)
    code, out, error = run(strivec, "dataset", "info", folder)
    told = [line for line in out.splitlines() if line.startswith(LABELS)] if code == 0 else [line_of(error, folder)]
    told = ["" if line == quality else " ".join(line.split()) for line in told]
    return f"| {folder.name} | {quality} | {'<br>'.join(told).replace('|', '&#124;')} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strivec", type=Path, required=True, help="program")
    parser.add_argument("--data", type=Path, required=True, help="folder of the datasets and of good.strivec")
    parser.add_argument("names", nargs="*", help="datasets; all by default")
    arguments = parser.parse_args()
    names = arguments.names or sorted(path.name for path in arguments.data.iterdir() if path.is_dir())
    print("| dataset | `eval` | told |\n|---|---|---|")
    for name in names:
        print(row(arguments.strivec, arguments.data / name, arguments.data / "good.strivec"), flush=True)


if __name__ == "__main__":
    main()
