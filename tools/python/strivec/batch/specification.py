"""The batch file.

    output = "s3://scans/done"              # the store
    defaults.train = { preset = "24", steps = 3000 }

    [[scene]]
    name = "kitchen"
    dataset = "s3://scans/kitchen"          # a folder, or a file .zip, .tar, .tar.gz
    prior = ["s3://scans/kitchen/mesh.ply"] # files for `strivec prior`
    pack = { quality = "balanced" }         # options of the command, by its names with underscores

The options of a stage are those of its command: `pose`, `prior_options`, `train`, `pack`, `evaluate`, `thumbnail`.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from typing import Any, Dict, List, Tuple

from ..errors import MalformedError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_OPTIONS = ("pose", "prior_options", "train", "pack", "evaluate", "thumbnail")
_STRINGS = ("name", "dataset")


@dataclass(frozen=True)
class Job:
    """A scene to make."""

    name: str
    dataset: str
    """URL of the photographs, posed or, with options of `pose`, not."""
    prior: Tuple[str, ...] = ()
    """URLs of files with geometry."""
    options: Dict[str, Dict[str, Any]] = field(default_factory=dict)
    """Options by stage; a stage `pose` or `evaluate` without any is left out."""

    def of(self, stage: str) -> Dict[str, Any]:
        """The options of `stage`."""
        return self.options.get(stage, {})


@dataclass(frozen=True)
class Batch:
    """Scenes to make, and where."""

    output: str
    jobs: List[Job]


def read(text: str, place: str) -> Batch:
    """The batch in TOML `text` of the file `place`. Raises a MalformedError that names the place."""

    def refuse(where: str, expected: str, found: Any) -> MalformedError:
        return MalformedError(f"{place}: {where} must be {expected}; found {found!r}")

    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MalformedError(f"{place}: {error}") from error
    output, defaults, scenes = document.get("output"), document.get("defaults", {}), document.get("scene", [])
    if not isinstance(output, str):
        raise refuse("output", "the URL of a folder", output)
    unknown = set(document) - {"output", "defaults", "scene"}
    if unknown:
        raise refuse("a key", "output, defaults or scene", sorted(unknown)[0])
    if not isinstance(scenes, list) or not scenes:
        raise refuse("[[scene]]", "at least one table", scenes)

    def options(table: Any, where: str) -> Dict[str, Dict[str, Any]]:
        if not isinstance(table, dict):
            raise refuse(where, "a table", table)
        found = {}
        for stage, values in table.items():
            if stage not in _OPTIONS:
                raise refuse(f"a key of {where}", ", ".join(_OPTIONS), stage)
            if not isinstance(values, dict):
                raise refuse(f"{stage} of {where}", "a table of options", values)
            found[stage] = values
        return found

    common = options(defaults, "defaults")
    jobs: Dict[str, Job] = {}
    for number, scene in enumerate(scenes):
        where = f"scene {number}"
        if not isinstance(scene, dict):
            raise refuse(where, "a table", scene)
        for key in _STRINGS:
            if not isinstance(scene.get(key), str):
                raise refuse(f"{key} of {where}", "text", scene.get(key))
        name, files = scene["name"], scene.get("prior", [])
        if not _NAME.fullmatch(name):
            raise refuse(f"name of {where}", "at most 100 letters, digits, dots, hyphens and underscores", name)
        if name in jobs:
            raise refuse(f"name of {where}", "another than those before", name)
        if not isinstance(files, list) or not all(isinstance(file, str) for file in files):
            raise refuse(f"prior of {where}", "a list of URLs", files)
        rest = {key: value for key, value in scene.items() if key not in (*_STRINGS, "prior")}
        own = options(rest, where)
        merged = {stage: {**common.get(stage, {}), **own.get(stage, {})} for stage in {*common, *own}}
        jobs[name] = Job(name, scene["dataset"], tuple(files), merged)
    return Batch(output, list(jobs.values()))
