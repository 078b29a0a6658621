"""Jobs on Ray: every stage of every scene is a task, with the cores and the memory that it needs."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Optional

import ray

from ..errors import Error, InputError
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


@dataclass
class Progress:
    """Where a job is."""

    job: Job
    waiting: List[str]
    done: List[Done] = field(default_factory=list)
    state: str = "waiting"
    """waiting, a stage's name, done or failed"""
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
    """Makes all scenes of `batch` on the cluster that Ray is connected to, with `cores` for each large stage. `told` learns of
    every change. A job that fails does not keep others: its error goes to the store. Returns all jobs."""
    store = Store(batch.output)
    jobs = [Progress(job, stages.wanted(job)) for job in batch.jobs]
    queue = list(jobs)
    running: Dict[Any, Progress] = {}
    most = max(AHEAD * int(ray.cluster_resources().get("CPU", 1)), 1)

    def begin(progress: Progress) -> None:
        name = progress.waiting[0]
        stage = STAGES[name]
        plan = next((one.facts for one in progress.done if one.stage == "plan"), {})
        options = {
            "num_cpus": cores if stage.is_large else 1,
            "memory": int(plan.get("memory_bytes", SMALL_MEMORY)) if stage.is_large else SMALL_MEMORY,
            "max_retries": SYSTEM_RETRIES,
            "name": f"{progress.job.name}: {name}",
        }
        # A machine that has less may still do it; Ray would wait for ever for one that has more.
        options["memory"] = min(options["memory"], _largest_memory())
        remote = ray.remote(task).options(retry_exceptions=False, **options)
        progress.state = name
        progress.begun = progress.begun or time.time()
        running[remote.remote(batch.output, progress.job, name, progress.keys, options["num_cpus"])] = progress

    tries: Dict[str, int] = {}
    while queue or running:
        while queue and len(running) < most:
            begin(queue.pop(0))
        told(jobs)
        ended, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
        for reference in ended:
            progress = running.pop(reference)
            try:
                one = ray.get(reference)
            except Exception as error:  # Whatever a worker raised, others go on.
                cause = getattr(error, "cause", None) or error
                label = f"{progress.job.name}/{progress.waiting[0]}"
                tries[label] = tries.get(label, 0) + 1
                if isinstance(cause, InputError) and tries[label] <= INPUT_RETRIES:
                    begin(progress)
                else:
                    _fail(store, progress, cause)
                continue
            progress.done.append(one)
            progress.waiting.pop(0)
            if progress.waiting:
                begin(progress)
                continue
            try:
                finish(batch.output, progress.job, progress.done)
            except Error as error:
                _fail(store, progress, error)
                continue
            progress.state, progress.ended = "done", time.time()
    told(jobs)
    return jobs


def _fail(store: Store, progress: Progress, error: BaseException) -> None:
    """Ends a job, and keeps its error where people look."""
    progress.error, progress.ended = f"{progress.waiting[0] if progress.waiting else 'publish'}: {error}", time.time()
    progress.state = "failed"
    letter = {
        "scene": progress.job.name,
        "stage": progress.waiting[0] if progress.waiting else "publish",
        "class": type(error).__name__,
        "error": Exception.__str__(error),
        "log": list(getattr(error, "lines", [])),
    }
    store.write_json(f"failed/{progress.job.name}.json", letter)


def _largest_memory() -> int:
    """Bytes of memory of the largest machine."""
    nodes = [node["Resources"].get("memory", 0) for node in ray.nodes() if node["Alive"]]
    return int(max(nodes, default=SMALL_MEMORY)) or SMALL_MEMORY
