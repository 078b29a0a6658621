"""The stages of a scene, each from files to files, and what makes their keys. Nothing here knows of Ray."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import socket
import sys
import time
import uuid
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Dict, List, Tuple

from .. import commands
from .._files import scratch
from .._strivec import VERSION
from ..errors import Error
from ..scene import Scene
from .specification import Job
from .store import Input, Store, digest

LAYOUT = 1
"""Raised when the stages of an older version made something else of the same inputs."""
CHECKPOINT_EVERY = 500
"""Steps between two checkpoints of a training, unless its options say otherwise."""
UPLOAD_EVERY = 60.0
"""Least seconds between two checkpoints that go to the store: they are the most that a batch moves."""
UPLOAD_SHARE = 0.05
"""The most of a training's time that checkpoints are on their way: fewer are sent where that is slow."""
TAIL = 40
"""Lines of a job's log that are kept of a failure."""
_WARNING = "warning: "
"""How messages begin that are warnings."""

Facts = Dict[str, Any]

_OF_PHOTOGRAPHS = ("downscale", "every", "layout", "max_memory", "skip_missing", "test_every", "test_names", "turn")
_WHEN_RESUMED = ("callback", "checkpoint", "checkpoint_every", "eval_every", "threads", *_OF_PHOTOGRAPHS)
"""Options of `train` that a checkpoint does not hold."""


@dataclass(frozen=True)
class Done:
    """The result of a stage."""

    stage: str
    key: str
    facts: Facts
    """What the stage told, and its seconds, cores, peak memory, bytes and warnings."""
    is_new: bool
    """False if it was there before."""


class Work:
    """A stage at work: where its files are, and who is told."""

    def __init__(self, store: Store, job: Job, key: str, cores: int, inputs: Dict[str, Path], folder: Path) -> None:
        self.store, self.job, self.key, self.cores, self.inputs, self.folder = store, job, key, cores, inputs, folder
        self.log: List[str] = []
        self.warnings: List[str] = []

    def told(self, event: Any) -> None:
        """Takes a message or progress of a command."""
        if isinstance(event, commands.Message):
            self.log.append(event.text)
            if event.text.startswith(_WARNING):
                self.warnings.append(event.text[len(_WARNING) :])
        elif not self.log or not self.log[-1].startswith(f"{event.task}: "):
            self.log.append(f"{event.task}: {event.done}/{event.total}, {event.detail}")
        else:
            self.log[-1] = f"{event.task}: {event.done}/{event.total}, {event.detail}"

    def options(self, stage: str) -> Dict[str, Any]:
        """The job's options of `stage`, and those of every command here."""
        return {**self.job.of(stage), "callback": self.told, "threads": self.cores}


def _pose(work: Work) -> Facts:
    return commands.pose(work.inputs["photographs"], work.folder / "dataset", **work.options("pose"))


def _prior(work: Work) -> Facts:
    files = [path for name, path in sorted(work.inputs.items()) if name.startswith("prior")]
    return commands.prior(*files, output=work.folder / "prior.npz", **work.options("prior_options"))


def _prior_of(work: Work) -> List[Path]:
    return [work.inputs["prior.npz"]] if "prior.npz" in work.inputs else []


def _plan(work: Work) -> Facts:
    options = work.options("train")
    for name in ("checkpoint_every", "eval_every", "log", "encoding", "keep_dead"):
        options.pop(name, None)
    plan = commands.plan(work.inputs["dataset"], prior=_prior_of(work), **options)
    _write_json(work.folder / "plan.json", plan)
    return {name: plan[name] for name in ("parameters", "file_bytes", "memory_bytes", "minutes")}


def _train(work: Work) -> Facts:
    """A training whose checkpoints go to the store, so that another machine can go on."""
    state, remote = work.folder / "state", f"checkpoints/{work.key}.state"
    options = {"checkpoint_every": CHECKPOINT_EVERY, **work.options("train"), "checkpoint": state}
    if work.store.exists(remote):
        work.store.download(remote, state)
        options = {name: value for name, value in options.items() if name in _WHEN_RESUMED}
        options["resume"] = True
    else:
        options["prior"] = _prior_of(work)
    sent, next_at = state.stat().st_mtime_ns if state.exists() else 0, 0.0
    sent_bytes = 0

    def told(event: Any) -> None:
        nonlocal sent, sent_bytes, next_at
        work.told(event)
        start = time.monotonic()
        if start < next_at or not state.exists():
            return
        found = state.stat()
        if found.st_mtime_ns != sent:
            sent, sent_bytes = found.st_mtime_ns, sent_bytes + found.st_size
            work.store.upload(state, remote)
            next_at = start + max(UPLOAD_EVERY, (time.monotonic() - start) / UPLOAD_SHARE)

    options["callback"] = told
    facts = commands.command("train", work.inputs["dataset"], output=work.folder / "scene.strivec", **options)
    return {**{name: facts[name] for name in ("bytes", "parameters", "steps", "seconds")}, "checkpoint_bytes": sent_bytes}


def _pack(work: Work) -> Facts:
    options = work.options("pack")
    rows = commands.pack(work.inputs["scene.strivec"], work.folder / "packed.strivec", **options)
    row = rows[0] if isinstance(rows, list) else rows
    return {name: row[name] for name in ("bytes", "bytes_before", "psnr_to_before")}


def _evaluate(work: Work) -> Facts:
    report = commands.evaluate(work.inputs["packed.strivec"], work.inputs["dataset"], **work.options("evaluate"))
    _write_json(work.folder / "report.json", report)
    return {name: value for name, value in report.items() if isinstance(value, (int, float)) and name in ("psnr", "ssim")}


def _thumbnail(work: Work) -> Facts:
    """The file's own picture, or one from its first viewpoint."""
    scene = Scene.load(work.inputs["packed.strivec"])
    target = work.folder / "thumbnail.png"
    if scene.thumbnail is not None and scene.thumbnail[0] == "png":
        target.write_bytes(scene.thumbnail[1])
    else:
        options = {"orbit": 1, "size": "256x256", **work.options("thumbnail")}
        folder = work.folder / "pictures"
        commands.command("render", work.inputs["packed.strivec"], out=folder, **options)
        shutil.copyfile(sorted(folder.glob("*.png"))[0], target)
    return {}


@dataclass(frozen=True)
class Stage:
    """A stage: what it needs, what it makes, and how."""

    run: Callable[[Work], Facts]
    files: Tuple[str, ...]
    """Those of its result."""
    needs: Tuple[str, ...]
    """Earlier stages whose results it reads."""
    reads: Tuple[str, ...] = ()
    """Of "photographs", "dataset" (that of `pose` if there is one) and "prior", what it reads."""
    options: str = ""
    """The options that it depends on."""
    is_wanted: Callable[[Job], bool] = lambda job: True
    is_large: bool = False
    """It takes all the cores of a job, and the memory of the plan."""


STAGES: Dict[str, Stage] = {
    "pose": Stage(_pose, ("dataset.zip",), (), ("photographs",), "pose", lambda job: "pose" in job.options),
    "prior": Stage(_prior, ("prior.npz",), (), ("prior",), "prior_options", lambda job: bool(job.prior)),
    "plan": Stage(_plan, ("plan.json",), ("prior",), ("dataset",), "train"),
    "train": Stage(_train, ("scene.strivec",), ("prior",), ("dataset",), "train", is_large=True),
    "pack": Stage(_pack, ("packed.strivec",), ("train",), (), "pack"),
    "evaluate": Stage(
        _evaluate, ("report.json",), ("pack",), ("dataset",), "evaluate", lambda job: "evaluate" in job.options
    ),
    "thumbnail": Stage(_thumbnail, ("thumbnail.png",), ("pack",), (), "thumbnail"),
}
"""In the order of a job."""


def wanted(job: Job) -> List[str]:
    """The stages of `job`."""
    return [name for name, stage in STAGES.items() if stage.is_wanted(job)]


def key_of(store: Store, job: Job, name: str, done: Dict[str, str]) -> str:
    """The key of the stage `name`, by the keys of those that are `done`."""
    stage = STAGES[name]
    inputs: Dict[str, Any] = {other: done[other] for other in stage.needs if other in done}
    for kind in stage.reads:
        if kind == "prior":
            inputs["files"] = [Input(url).identity(store) for url in job.prior]
        elif kind == "dataset" and "pose" in done:
            inputs["pose"] = done["pose"]
        else:
            inputs[kind] = Input(job.dataset).identity(store)
    return digest({"layout": LAYOUT, "version": VERSION, "stage": name, "options": job.of(stage.options), "inputs": inputs})


def run(url: str, job: Job, name: str, done: Dict[str, str], cores: int) -> Done:
    """Does the stage `name` of `job` if it is not done in the store at `url`, where the stages of the keys `done` are."""
    store = Store(url)
    stage = STAGES[name]
    key = key_of(store, job, name, done)
    place = f"objects/{name}/{key}"
    before = store.read_json(f"{place}/done.json")
    if before is not None:
        return Done(name, key, before, is_new=False)
    begun = {"scene": job.name, "host": socket.gethostname(), "process": os.getpid(), "time": time.time()}
    store.write_json(f"runs/{name}/{key}/{uuid.uuid4().hex}.json", begun)

    with ExitStack() as stack:
        temporary = stack.enter_context(scratch())
        inputs = _inputs(store, job, stage, done, temporary, stack)
        folder = temporary / "result"
        folder.mkdir()
        work = Work(store, job, key, cores, inputs, folder)
        start = time.perf_counter()
        _forget_peak_memory()
        try:
            facts = stage.run(work)
        except Error as error:
            error.lines = [*error.lines, *work.log[-TAIL:]]
            raise
        if name == "pose":
            shutil.make_archive(str(folder / "dataset"), "zip", folder / "dataset")
        size = 0
        for file in stage.files:
            size += (folder / file).stat().st_size
            store.upload(folder / file, f"{place}/{file}")
        facts = {
            **(facts or {}),
            "stage_seconds": time.perf_counter() - start,
            "stage_cores": cores,
            "stage_bytes": size,
            "peak_memory_bytes": _peak_memory(),
            "warnings": work.warnings,
        }
    store.write_json(f"{place}/done.json", facts)
    if name == "train":
        store.remove(f"checkpoints/{key}.state")
    return Done(name, key, facts, is_new=True)


def _inputs(
    store: Store, job: Job, stage: Stage, done: Dict[str, str], temporary: Path, stack: ExitStack
) -> Dict[str, Path]:
    """The files that `stage` reads, on this machine, by their names."""
    inputs: Dict[str, Path] = {}
    for name in stage.needs:
        if name in done:
            for file in STAGES[name].files:
                inputs[file] = temporary / file
                store.download(f"objects/{name}/{done[name]}/{file}", inputs[file])
    for kind in stage.reads:
        if kind == "prior":
            for number, url in enumerate(job.prior):
                inputs[f"prior{number:04}"] = stack.enter_context(Input(url).local())
        elif kind == "dataset" and "pose" in done:
            archive = store.place(f"objects/pose/{done['pose']}/dataset.zip")
            inputs[kind] = stack.enter_context(Input(archive).local())
        else:
            inputs[kind] = stack.enter_context(Input(job.dataset).local())
    return inputs


def publish(url: str, job: Job, done: List[Done]) -> Facts:
    """Puts the results of a job where people look; returns the facts of its row."""
    store = Store(url)
    keys, row = {one.stage: one.key for one in done}, summary(job, done)
    with scratch() as folder:
        for stage, published in (("pack", row["file"]), ("thumbnail", row["picture"])):
            (file,) = STAGES[stage].files
            local = folder / file
            store.download(f"objects/{stage}/{keys[stage]}/{file}", local)
            store.upload(local, published)
    store.write_json(f"scenes/{job.name}.json", {"row": row, "keys": keys})
    store.remove(f"failed/{job.name}.json")
    return row


def summary(job: Job, done: List[Done]) -> Facts:
    """What the tables say of a scene."""
    facts = {one.stage: one.facts for one in done}
    evaluated, plan = facts.get("evaluate", {}), facts.get("plan", {})
    return {
        "scene": job.name,
        "dataset": job.dataset,
        "file": f"scenes/{job.name}.strivec",
        "picture": f"scenes/{job.name}.png",
        "psnr": evaluated.get("psnr"),
        "ssim": evaluated.get("ssim"),
        "bytes": facts["pack"]["bytes"],
        "parameters": facts["train"]["parameters"],
        "steps": facts["train"]["steps"],
        "minutes": sum(one.facts["stage_seconds"] for one in done) / 60.0,
        "planned_minutes": plan.get("minutes"),
        "peak_memory_bytes": max(one.facts["peak_memory_bytes"] for one in done),
        "warnings": "\n".join(warning for one in done for warning in one.facts["warnings"]),
        "reused_stages": sum(not one.is_new for one in done),
        **{f"seconds_{one.stage}": one.facts["stage_seconds"] for one in done},
    }


def _forget_peak_memory() -> None:
    """Begins the peak memory of this process anew, as a worker does many stages; only Linux can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _peak_memory() -> int:
    """The peak memory of this process, in bytes."""
    with suppress(OSError):
        found = re.search(r"^VmHWM:\s+(\d+) kB$", Path("/proc/self/status").read_text(encoding="ascii"), re.MULTILINE)
        if found:
            return int(found[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=1), encoding="utf-8")

