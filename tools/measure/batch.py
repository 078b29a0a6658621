#!/usr/bin/env python3
"""Runs a batch of synthetic scenes on a Ray cluster of two machines of one core each, undisturbed and with one of them killed.

    python tools/measure/batch.py --scenes 24 -o FOLDER

Needs the Python package with its extra `ray` (pip install './tools/python[ray]'). Prints figures as JSON; ends with an error unless all
scenes are done in both runs with the same bytes, no stage of a finished job was begun again, and the broken scene is the only failure.
"""

import argparse
import hashlib
import json
import time
from pathlib import Path

import ray
import strivec
from ray.cluster_utils import Cluster
from strivec.batch import report, schedule, specification
from strivec.batch.store import Store

LAYOUTS = ("blender", "transforms", "colmap")


def datasets(folder, count, size, layouts=LAYOUTS):
    """Makes `count` synthetic datasets; returns their folders."""
    made = []
    for number in range(count):
        path = folder / f"data{number:02}"
        if not path.exists():
            layout = layouts[number % len(layouts)]
            strivec.command(
                "synth", path, layout=layout, views=12, test_views=2, size=f"{size}x{size}", seed=number
            )
        made.append(path)
    return made


def batch_of(folders, output, steps, is_quick=False):
    """The batch of the datasets in `folders`, and of one that is broken; with small models, hardly measured, if `is_quick`."""
    broken = folders[0].parent / "broken"
    if not broken.exists():
        broken.mkdir()
        (broken / "transforms_train.json").write_text('{"camera_angle_x": 0.7, "frames": [{"file_path": "absent"', encoding="utf-8")
    scenes = "".join(f'[[scene]]\nname = "{path.name}"\ndataset = "{path}"\n{prior(path)}' for path in [*folders, broken])
    train = 'set = ["sampling.batch_rays=64", "decoder.hidden=[32]"], max_params = 100000' if is_quick else 'set = ["sampling.batch_rays=256"]'
    effort = 0.1 if is_quick else 1
    text = f"""
output = "{output}"
defaults.train = {{ preset = "preview", steps = {steps}, {train}, checkpoint_every = {max(steps // 8, 1)} }}
defaults.pack = {{ lossless = true, no_prefixes = true, effort = {effort} }}
defaults.evaluate = {{ split = "test" }}
{scenes}"""
    return specification.read(text, "batch")


def prior(folder):
    """The line that names the mesh of the dataset; every tenth begins from its photographs alone, which takes longer."""
    mesh = folder / "mesh.ply"
    return f'prior = ["{mesh}"]\n' if mesh.exists() and not folder.name.endswith("7") else ""


class Killer:
    """Kills the second machine once so many scenes are done, and starts another in its place."""

    def __init__(self, cluster, node, after):
        self.cluster, self.node, self.after, self.killed = cluster, node, list(after), 0

    def told(self, jobs):
        """Kills if it is time, in the middle of a training."""
        done = sum(one.state == "done" for one in jobs)
        if self.after and done >= self.after[0] and any(one.state == "train" for one in jobs):
            self.after.pop(0)
            self.cluster.remove_node(self.node, allow_graceful=False)
            self.killed += 1
            self.node = self.cluster.add_node(num_cpus=1)


def run(batch, kills=(), told=lambda jobs: None):
    """Runs `batch` on two machines of one core; returns its jobs, the seconds, and how often a machine was killed."""
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        node = cluster.add_node(num_cpus=1)
        ray.init(address=cluster.address, log_to_driver=False, logging_level="error")
        cluster.wait_for_nodes()
        killer = Killer(cluster, node, kills)

        def listen(jobs):
            killer.told(jobs)
            told(jobs)

        start = time.perf_counter()
        jobs = schedule.run(batch, told=listen)
        seconds = time.perf_counter() - start
        report.write(Store(batch.output), jobs)
        return jobs, seconds, killer.killed
    finally:
        ray.shutdown()
        cluster.shutdown()


def begun_again(output):
    """Stages that were begun after they were done."""
    again = []
    for done in Path(output).glob("objects/*/*/done.json"):
        stage, key = done.parts[-3], done.parts[-2]
        ended = done.stat().st_mtime
        for begun in Path(output).glob(f"runs/{stage}/{key}/*.json"):
            if json.loads(begun.read_text())["time"] > ended:
                again.append(f"{stage}/{key}")
    return again


def begun(output):
    """The number of times that stages were begun."""
    return len(list(Path(output).glob("runs/*/*/*.json")))


def digests(output):
    """The digests of the scenes."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in Path(output).glob("scenes/*.strivec")}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--size", type=int, default=48)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    folder = arguments.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    folders = datasets(folder, arguments.scenes, arguments.size)
    figures = {}
    for name, kills in (("undisturbed", ()), ("killed", (arguments.scenes // 4, arguments.scenes // 2))):
        output = folder / name
        jobs, seconds, killed = run(batch_of(folders, output, arguments.steps), kills, report.Terminal().told)
        failed = [one.job.name for one in jobs if one.state == "failed"]
        assert failed == ["broken"], failed
        assert killed == len(kills), killed
        assert not begun_again(output), begun_again(output)
        work = sum(one.facts["stage_seconds"] for job in jobs for one in job.done)
        figures[name] = {
            "scenes": len(jobs) - 1,
            "minutes": seconds / 60,
            "killed": killed,
            "stages_begun": begun(output),
            "stage_seconds": work,
            "overhead_seconds_a_job": (2 * seconds - work) / len(jobs),
        }
    assert digests(folder / "undisturbed") == digests(folder / "killed"), "the scenes differ"
    before = begun(folder / "killed")
    _, seconds, _ = run(batch_of(folders, folder / "killed", arguments.steps))
    # The broken scene's stage alone.
    figures["again"] = {"minutes": seconds / 60, "stages_begun": begun(folder / "killed") - before}
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
