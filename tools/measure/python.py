#!/usr/bin/env python3
"""Times the Python package: points and frames a second, and `import strivec`. Frames are compared with the command's, by turns.

    python tools/measure/python.py STRIVEC SCENE [--points 1000000] [--size 800] [--rounds 7]

STRIVEC is the command, of the same build profile; its pictures are also written, 20 ms or so. Needs the Python package. Prints medians
and the ratio of frames as JSON.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import strivec


def command(program, *words):
    """The JSON of a command."""
    return json.loads(subprocess.run([program, *map(str, words), "--quiet", "--json"], check=True, capture_output=True).stdout)


def seconds(work):
    """The seconds that `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def import_seconds(code):
    """The seconds that Python takes to start and run `code`."""
    return seconds(lambda: subprocess.run([sys.executable, "-c", code], check=True))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command")
    parser.add_argument("scene")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--size", type=int, default=800)
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measured(arguments, folder), indent=1))


def measured(arguments, folder):
    """The medians of all times, their ratios, and the seconds of the import."""
    scene = strivec.Scene.load(arguments.scene)
    bounds = scene.description["bounds"]
    points = np.random.default_rng(0).uniform(bounds["min"], bounds["max"], (arguments.points, 3))
    size = (arguments.size, arguments.size)
    camera = strivec.Camera.look_at((2.5, 2.5, 2.0), (0.0, 0.0, 0.0), size, angle_x=math.radians(40.0))
    pose = "--pose=" + ",".join(str(number) for row in camera.pose for number in row)
    work = {
        "density": lambda: scene.density(points, space="model"),
        "features": lambda: scene.features(points, space="model"),
        "render": lambda: scene.render(camera),
    }
    times = {f"python {what}": [] for what in work}
    times.update({"command render": [], "python start": [], "python start and import": []})
    picture = ("render", arguments.scene, pose, "--fov", 40, "--size", f"{arguments.size}x{arguments.size}", "--out", folder, "--force")
    for _ in range(arguments.rounds):
        times["command render"].append(command(arguments.command, *picture)["seconds"])
        for what, run in work.items():
            run()
            times[f"python {what}"].append(seconds(run))
        times["python start"].append(import_seconds("pass"))
        times["python start and import"].append(import_seconds("import strivec"))
    medians = {name: statistics.median(values) for name, values in times.items()}
    ratio = medians["python render"] / medians["command render"]
    import_time = medians["python start and import"] - medians["python start"]
    return {"seconds": medians, "python to command, render": ratio, "import seconds": import_time}


if __name__ == "__main__":
    main()
