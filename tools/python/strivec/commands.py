"""Training, and the other commands of `strivec` and `strivec-pack` as functions.

`train` calls the library. The other functions are commands: arguments of a command come first, and options follow by name:
`max_size="2MB"` is `--max-size 2MB`, `auto=True` is `--auto`, and a list repeats an option. Results are those of `--json`.
`help(strivec.pack)` names the usual options, and `strivec-pack pack --help` all.
"""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Union

from . import _strivec
from .scene import Path, Scene

Settings = Dict[str, Any]


@dataclass(frozen=True)
class Message:
    """A line that a command says, such as a warning."""

    text: str


@dataclass(frozen=True)
class Progress:
    """`done` of `total` steps of a `task`; `detail` as in "41000 rays/s, train 28.31 dB"."""

    task: str
    done: int
    total: int
    detail: str


Callback = Callable[[Union[Message, Progress]], object]


def command(
    *words: Any, program: str = "strivec", callback: Optional[Callback] = None, **options: Any
) -> Any:
    """Runs the command `words` of `program`, "strivec" or "strivec-pack", in this process, and returns its result.

    `callback` is told of messages and of progress; what it raises ends the command. Ctrl-C ends a command as in a terminal: a training
    keeps its checkpoint, and KeyboardInterrupt follows. Raises the errors of `strivec.errors`.
    """
    if program not in ("strivec", "strivec-pack"):
        raise ValueError(f'program must be "strivec" or "strivec-pack"; found {program!r}')

    arguments = [_argument(word) for word in words]
    for name, value in options.items():
        arguments += _option("--" + name.replace("_", "-"), value)
    results = _strivec.command(program == "strivec-pack", arguments, _listener(callback))
    parsed = [_parsed(text) for text in results]
    return parsed[0] if len(parsed) == 1 else parsed or None


def _listener(callback: Optional[Callback]) -> Optional[Callable[..., None]]:
    """The function that the native half calls."""
    if callback is None:
        return None

    def listener(*event: Any) -> None:
        callback(Message(*event) if len(event) == 1 else Progress(*event))

    return listener


def _word(word: Any) -> str:
    return os.fspath(word) if isinstance(word, (str, os.PathLike)) else str(word)


def _argument(word: Any) -> str:
    """An argument that no file's name turns into an option."""
    word = _word(word)
    return os.path.join(".", word) if word.startswith("-") and word != "-" else word


def _option(flag: str, value: Any) -> List[str]:
    if value is None or value is False:
        return []
    if value is True:
        return [flag]
    if isinstance(value, (list, tuple)):
        return [word for one in value for word in _option(flag, one)]
    # In one word, as a value may begin with a minus sign.
    return [f"{flag}={_word(value)}"]


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def settings(preset: str = "best", toml: str = "") -> Settings:
    """The settings of a training: those of `preset`, replaced by those of TOML text. A dictionary of the names and values that
    `strivec train --print-config` prints, which `train` and `plan` take."""
    return json.loads(_strivec.settings_of_toml(toml, preset))


def settings_toml(settings: Settings) -> str:
    """Settings as TOML, for `--config`."""
    return _strivec.toml_of_settings(json.dumps(settings))


def _with_settings(settings: Optional[Settings], run: Callable[..., Any], *words: Any, **options: Any) -> Any:
    """Calls `run`, with a file of `settings` if there are any."""
    if settings is None:
        return run(*words, **options)
    if "config" in options:
        raise TypeError("give either settings or config")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "settings.toml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(settings_toml(settings))
        return run(*words, config=path, **options)


def train(
    dataset: Path,
    output: Path,
    preset: Optional[str] = None,
    settings: Optional[Settings] = None,
    callback: Optional[Callback] = None,
    *,
    steps: Optional[int] = None,
    prior: Union[Path, Sequence[Path]] = (),
    prior_options: Optional[Mapping[str, Any]] = None,
    bootstrap: bool = False,
    auto: bool = False,
    max_params: Optional[int] = None,
    max_size: Union[None, int, str] = None,
    downscale: Optional[int] = None,
    every: int = 1,
    skip_missing: bool = False,
    max_memory: Union[None, int, str] = None,
    checkpoint: Optional[Path] = None,
    checkpoint_every: Optional[int] = None,
    resume: bool = False,
    keep_dead: bool = False,
    encoding: str = "f16",
    force: bool = False,
    **overrides: Any,
) -> Dict[str, Any]:
    """Trains a scene on the photographs of `dataset` and writes the file `output`, to the same bytes as `strivec train`; returns its
    size, parameters, steps and seconds.

    `settings` are those of `settings()`; `preset` replaces their preset, scales and decoder. Every other name is a setting, or a table
    of some, as in `seed=1, sampling={"batch_rays": 1024}`. `steps` scales the whole schedule of `settings`, not of these.

    prior: geometry files of the dataset's space. prior_options: voxel, thickness, min_points, close, dilate; `prior()` has more.
    bootstrap: find the scene with eight coarse tensors. auto: derive tensors from the photographs' detail. max_params, max_size: the
    most parameters, and bytes as a number or as "2MB". downscale, every, skip_missing, max_memory: the photographs. checkpoint: the file
    of an unfinished run, by default `output` + ".state"; resume: continue from it. keep_dead: keep components that no ray uses.
    encoding: "f16" or "f32". force: overwrite.

    `callback` is told of messages and of progress; what it raises, and Ctrl-C, end the training after it has kept a checkpoint.
    """
    if encoding not in ("f16", "f32"):
        raise ValueError(f'encoding must be "f16" or "f32"; found {encoding!r}')
    if settings is None or preset is not None:
        toml = "" if settings is None else settings_toml(settings)
        settings = json.loads(_strivec.settings_of_toml(toml, preset))
    files = [prior] if isinstance(prior, (str, os.PathLike)) else prior
    request = {
        "settings": settings,
        "steps": steps,
        "overrides": overrides,
        "prior": [os.fspath(file) for file in files],
        "prior_options": dict(prior_options or {}),
        "bootstrap": bootstrap,
        "auto": auto,
        "max_params": max_params,
        "max_size": _bytes(max_size),
        "downscale": downscale,
        "every": every,
        "skip_missing": skip_missing,
        "max_memory": _bytes(max_memory),
        "checkpoint": None if checkpoint is None else os.fspath(checkpoint),
        "checkpoint_every": checkpoint_every,
        "resume": resume,
        "keep_dead": keep_dead,
        "full_precision": encoding == "f32",
        "force": force,
    }
    return json.loads(_strivec.train(dataset, output, json.dumps(request), _listener(callback)))


def _bytes(size: Union[None, int, str]) -> Optional[int]:
    """A number of bytes, or one with a unit, as in "2MB" or "700kB"."""
    if not isinstance(size, str):
        return size
    for unit, times in (("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("KiB", 2.0**10), ("MiB", 2.0**20), ("B", 1.0)):
        if size.endswith(unit):
            return round(float(size[: -len(unit)]) * times)
    raise ValueError(f"a size needs a unit (B, kB, MB, GB, KiB or MiB), as in 2MB or 700kB; found {size!r}")


def plan(dataset: Path, settings: Optional[Settings] = None, **options: Any) -> Dict[str, Any]:
    """Estimates parameters, bytes, memory and time of a training. Options as for the command `strivec train`."""
    return _with_settings(settings, command, "plan", dataset, **options)


def evaluate(scene: Union[Scene, Path], dataset: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Compares a scene's pictures with photographs. Usual options: split="test", downscale, views, ssim="3dgs",
    report, csv."""
    return _with_file(scene, lambda path: command("eval", path, dataset, callback=callback, **options))


def pack(scene: Union[Scene, Path], output: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Compresses a scene as far as its pictures allow. Usual options: quality="balanced", target_size="1MB", max_loss, dataset, lossless=True,
    levels=True."""
    return _with_file(
        scene,
        lambda path: command("pack", path, program="strivec-pack", output=output, callback=callback, **options),
    )


def prior(*files: Path, output: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Turns meshes, point clouds, grids and octrees into a prior, the occupied cells. Usual options: voxel, resolution, crop,
    close, dilate."""
    return command("prior", *files, output=output, callback=callback, **options)


def shrink(
    scene: Union[Scene, Path], dataset: Path, output: Path, callback: Optional[Callback] = None, **options: Any
) -> Any:
    """Removes the parameters that a scene needs least. Usual options: max_loss, max_params, steps."""
    return _with_file(scene, lambda path: command("shrink", path, dataset, output=output, callback=callback, **options))


def trade(scene: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Measures speed against quality, and stores the render settings that are worth choosing in the file. Usual options: data (photographs
    to compare with), backend, rounds."""
    return command("trade", scene, callback=callback, **options)


def compare(*scenes: Path, dataset: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Compares several scenes with each other over the same photographs."""
    return command("compare", *scenes, dataset, callback=callback, **options)


def import_checkpoint(checkpoint: Path, output: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Turns a checkpoint of TensoRF or of the Strivec authors' program into a scene file. Checkpoints are parsed, never run."""
    return command("import", checkpoint, output=output, callback=callback, **options)


def export(scene: Union[Scene, Path], output: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Writes a scene for other programs: a mesh, points, splats, a grid, arrays, or a checkpoint of PyTorch. The kind is that of the
    name, or `as_`."""
    if "as_" in options:
        options["as"] = options.pop("as_")
    return _with_file(scene, lambda path: command("export", path, output=output, callback=callback, **options))


def pose(photographs: Path, output: Path, callback: Optional[Callback] = None, **options: Any) -> Any:
    """Computes camera poses of photographs or of a video by COLMAP."""
    return command("pose", photographs, output=output, callback=callback, **options)


def dataset(folder: Path, **options: Any) -> Any:
    """What is understood of a dataset: layout, photographs, sizes, poses."""
    return command("dataset", "info", folder, **options)


def verify(*scenes: Path, **options: Any) -> Any:
    """Checks that files are complete, undamaged and valid, and that the renderers reproduce their probes."""
    return command("verify", *scenes, program="strivec-pack", **options)


def _with_file(scene: Union[Scene, Path], run: Callable[[Path], Any]) -> Any:
    """Calls `run` with the file of `scene`, for which one is written if it is in memory."""
    if not isinstance(scene, Scene):
        return run(scene)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "scene.strivec")
        scene.save(path)
        return run(path)
