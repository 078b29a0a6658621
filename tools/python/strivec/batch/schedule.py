"""Jobs on Ray: every stage of every scene is a task, with the cores and the memory that it needs."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Optional

import ray

from ..errors import InputError
from . import stages
from .specification import Batch, Job
from .stages import STAGES, Done
from .store import Store

SYSTEM_RETRIES = 5
"""Times that a stage is begun again after its worker or its machine died."""
INPUT_RETRIES = 2
"""Times that a stage is begun again after an error of input or output."""
SMALL_MEMORY = 1 << 30
"""Bytes that a stage takes before there is a plan."""
AHEAD = 4
"""Tasks a core that are handed to Ray before others have ended."""
LOOK_EVERY = 0.5
"""Seconds between two looks at all jobs and at the cluster."""
PUBLISH = "publish"
"""The last task of a job, after its stages."""


@dataclass
class Progress:
    """Where a job is."""

    job: Job
    waiting: List[str]
    done: List[Done] = field(default_factory=list)
    state: str = "waiting"
    """waiting, a stage's name, publish, done or failed"""
    error: Optional[str] = None
    begun: Optional[float] = None
    ended: Optional[float] = None

    @property
    def keys(self) -> Dict[str, str]:
        """The keys of the stages that are done."""
        return {one.stage: one.key for one in self.done}


def run(
    batch: Batch,
    cores: int = 1,
    told: Callable[[List[Progress]], None] = lambda jobs: None,
    task: Callable[..., Done] = stages.run,
    finish: Callable[..., Dict[str, Any]] = stages.publish,
) -> List[Progress]:
    """Makes all scenes of `batch` on the cluster that Ray is connected to, with `cores` for each large stage. `told` learns now and
    then where the jobs are. A job that fails does not keep others: its error goes to the store. Returns all jobs."""
    store = Store(batch.output)
    jobs = [Progress(job, [*stages.wanted(job), PUBLISH]) for job in batch.jobs]
    queue = jobs[::-1]
    running: Dict[Any, Progress] = {}
    do_stage, do_publish = ray.remote(task), ray.remote(finish)

    def begin(progress: Progress) -> None:
        name = progress.waiting[0]
        is_large = name != PUBLISH and STAGES[name].is_large
        plan = next((one.facts for one in progress.done if one.stage == "plan"), {})
        memory = int(plan.get("memory_bytes", SMALL_MEMORY)) if is_large else SMALL_MEMORY
        options = {
            "num_cpus": cores if is_large else 1,
            # A machine that has less may still do it; Ray would wait for ever for one that has more.
            "memory": min(memory, largest_memory),
            "max_retries": SYSTEM_RETRIES,
            "retry_exceptions": False,
            "name": f"{progress.job.name}: {name}",
        }
        progress.state = name
        progress.begun = progress.begun or time.time()
        if name == PUBLISH:
            reference = do_publish.options(**options).remote(batch.output, progress.job, progress.done)
        else:
            arguments = batch.output, progress.job, name, progress.keys, options["num_cpus"]
            reference = do_stage.options(**options).remote(*arguments)
        running[reference] = progress

    tries: Dict[str, int] = {}
    looked_at = -math.inf
    while queue or running:
        if time.monotonic() - looked_at >= LOOK_EVERY:
            looked_at = time.monotonic()
            told(jobs)
            # Clusters grow and shrink.
            most, largest_memory = AHEAD * max(int(ray.cluster_resources().get("CPU", 1)), 1), _largest_memory()
        while queue and len(running) < most:
            begin(queue.pop())
        ended, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
        for reference in ended:
            progress = running.pop(reference)
            try:
                result = ray.get(reference)
            except Exception as error:  # Whatever a worker raised, others go on.
                cause = getattr(error, "cause", None) or error
                label = f"{progress.job.name}/{progress.waiting[0]}"
                tries[label] = tries.get(label, 0) + 1
                if isinstance(cause, InputError) and tries[label] <= INPUT_RETRIES:
                    begin(progress)
                else:
                    _fail(store, progress, cause)
                continue
            if progress.waiting.pop(0) == PUBLISH:
                progress.state, progress.ended = "done", time.time()
            else:
                progress.done.append(result)
                begin(progress)
    told(jobs)
    return jobs


def _fail(store: Store, progress: Progress, error: BaseException) -> None:
    """Ends a job, and keeps its error where people look."""
    stage = progress.waiting[0]
    progress.state, progress.error, progress.ended = "failed", f"{stage}: {error}", time.time()
    letter = {
        "scene": progress.job.name,
        "stage": stage,
        "class": type(error).__name__,
        "error": Exception.__str__(error),
        "log": list(getattr(error, "lines", [])),
    }
    store.write_json(f"failed/{progress.job.name}.json", letter)


def _largest_memory() -> int:
    """Bytes of memory of the largest machine."""
    nodes = [node["Resources"].get("memory", 0) for node in ray.nodes() if node["Alive"]]
    return int(max(nodes, default=SMALL_MEMORY)) or SMALL_MEMORY
