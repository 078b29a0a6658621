"""How a cluster would do: Ray's own scheduler and this package's, with stages that only wait.

    python -m strivec.batch.simulate --jobs 2000 --workers 50 --deaths 0.05

Stages last as long as measured, times `--scale`; a share of the workers dies during a stage.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import time
from collections import Counter
from typing import Any, Dict, List

from .schedule import SMALL_MEMORY, run
from .specification import Batch, Job
from .stages import Done

SECONDS = {"plan": 6.0, "train": 600.0, "pack": 20.0, "evaluate": 12.0, "thumbnail": 1.0}
"""Of the stages of a scan, by default."""


def simulate(
    jobs: int, workers: int, deaths: float, scale: float, seconds: Dict[str, float]
) -> Dict[str, Any]:
    """Runs `jobs` with stages of `seconds` on as many `workers` of one core each."""
    import ray

    machine = {"num_cpus": workers, "_memory": workers * SMALL_MEMORY}
    ray.init(address="local", include_dashboard=False, log_to_driver=False, logging_level="error", **machine)
    try:

        @ray.remote(num_cpus=0)
        class Published:
            """How often each job was published, by all workers."""

            def __init__(self) -> None:
                self.times: Counter = Counter()

            def add(self, name: str) -> None:
                self.times[name] += 1

            def all(self) -> Counter:
                return self.times

        published = Published.remote()

        def wait(url: str, job: Job, name: str, keys: Dict[str, str], cores: int) -> Done:
            # Each time that a stage is begun, it dies or not by other numbers.
            draw = random.Random()
            length = seconds[name] * scale
            if draw.random() < deaths:
                time.sleep(length * draw.random())
                os._exit(1)
            time.sleep(length)
            return Done(name, f"{job.name}-{name}", {"stage_seconds": length, "memory_bytes": 1}, is_new=True)

        def finish(url: str, job: Job, done: List[Done]) -> Dict[str, Any]:
            ray.get(published.add.remote(job.name))
            return {}

        options: Dict[str, Dict[str, Any]] = {"evaluate": {}}
        batch = Batch("memory://simulated", [Job(f"scene{n:05}", "memory://none", (), options) for n in range(jobs)])
        start = time.perf_counter()
        ended = run(batch, task=wait, finish=finish)
        wall = time.perf_counter() - start
        times = ray.get(published.all.remote())
    finally:
        ray.shutdown()
    work = jobs * sum(seconds.values()) * scale
    return {
        "jobs": jobs,
        "workers": workers,
        "deaths": deaths,
        "scale": scale,
        "done": sum(one.state == "done" for one in ended),
        "ended_once": sum(count == 1 for count in times.values()),
        "wall_seconds": wall,
        "stages_a_second": jobs * len(seconds) / wall,
        "busy_share": work / (wall * workers),
        "overhead_seconds_a_job": (wall * workers - work) / jobs,
    }


def main() -> None:
    """Prints the figures of a simulation as JSON."""
    parser = argparse.ArgumentParser(prog="python -m strivec.batch.simulate", description=__doc__)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=50)
    parser.add_argument("--deaths", type=float, default=0.05, help="share of the stages whose worker dies (default: 0.05)")
    parser.add_argument("--scale", type=float, default=0.01, help="seconds of waiting for a second of work (default: 0.01)")
    parser.add_argument("--seconds", type=json.loads, default=SECONDS, help="JSON: seconds of each stage")
    arguments = parser.parse_args()
    print(json.dumps(simulate(**vars(arguments)), indent=1))


if __name__ == "__main__":
    main()
