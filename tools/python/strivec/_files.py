"""Files that appear whole, folders for temporary files, and names from outside that must stay in their folder."""

from __future__ import annotations

import contextlib
import errno
import os
import posixpath
import re
import shutil
import tempfile
import time
import uuid
from pathlib import Path
from typing import IO, Iterator
from urllib.parse import unquote

from .errors import MalformedError

_DRIVE_OR_SERVER = re.compile(r"[A-Za-z]:|[A-Za-z][A-Za-z0-9+.-]*://")
_NO_FOLDER_SYNC = (errno.EINVAL, errno.ENOTSUP)
"""Errors of file systems that cannot sync a folder."""
_SCRATCH = "strivec-scratch-"
"""The beginning of the names of folders for temporary files."""
_LEFT_FOR = 3600.0
"""Seconds after which a partial file that nothing was written to is of a process that died."""


def inside(folder: Path, name: str, place: str) -> Path:
    """The path of the file `name` in `folder`, with symbolic links resolved.

    `name` comes from outside: it is a link in a web page, the key of an object, an entry of an archive or of a list of files. `place`
    is the address of its origin. Raises a MalformedError unless the path is below `folder`. Backslashes count as separators, and
    percent-encoded characters as themselves, because other programs read them so.
    """
    if any(map(_leads_out, (name, unquote(name)))):
        raise leads_out(folder, name, place)
    root = folder.resolve()
    try:
        os.fsencode(name)
        path = (root / name).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise _no_file(folder, name, place) from error
    if "\0" in name or path == root:
        raise _no_file(folder, name, place)
    if root not in path.parents:
        raise leads_out(folder, name, place)
    return path


def leads_out(folder: object, name: str, place: str) -> MalformedError:
    """The error for a `name` at `place` that is not in `folder`."""
    return MalformedError(
        f"{place}: the name {name!r} leads out of the folder {folder}; expected a relative path below it: rename or remove the file there"
    )


def _no_file(folder: Path, name: str, place: str) -> MalformedError:
    return MalformedError(
        f"{place}: {name!r} is not the name of a file in the folder {folder}: rename or remove the file there"
    )


def _leads_out(name: str) -> bool:
    """Whether the text `name` is absolute, names another drive or server, or begins with `..` once it is normalized."""
    path = name.replace("\\", "/")
    is_absolute = path.startswith("/") or _DRIVE_OR_SERVER.match(path) is not None
    return is_absolute or posixpath.normpath(path).split("/")[0] == ".."


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path beside `path`, for a file that becomes `path` at the end, once it is on the disk. After an exception, or if the process
    dies, `path` is as before. The next call that writes `path` removes what a process that died left."""
    partial = _partial(path)
    try:
        yield partial
        sync(partial)
        os.replace(partial, path)
        sync(path.parent)
    finally:
        partial.unlink(missing_ok=True)


def _partial(path: Path) -> Path:
    """A new file beside `path`, with a name that is found again, unless another process is writing `path`."""
    partial = path.with_name(f".{path.name}.strivec-partial")
    with contextlib.suppress(FileNotFoundError):
        if time.time() - partial.stat().st_mtime > _LEFT_FOR:
            partial.unlink()
    try:
        partial.touch(exist_ok=False)
    except FileExistsError:
        partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.strivec-partial")
    return partial


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for temporary files, which is removed at the end. Removes those of processes that died, too: a process locks its own.
    Only on systems with such locks, not on Windows."""
    import fcntl

    def lock(path: Path, mode: str) -> IO[bytes]:
        file = open(path, mode)
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return file

    for left in Path(tempfile.gettempdir()).glob(f"{_SCRATCH}*/lock"):
        with contextlib.suppress(OSError), lock(left, "rb"):
            shutil.rmtree(left.parent, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=_SCRATCH) as name:
        folder = Path(name)
        with lock(folder / "locking", "wb"):
            # Locked before it has the name that others look for.
            os.rename(folder / "locking", folder / "lock")
            (folder / "files").mkdir()
            yield folder / "files"


def sync(path: Path) -> None:
    """Returns once the disk holds the file `path`, or the names in the folder `path`."""
    is_folder = path.is_dir()
    if is_folder and os.name == "nt":
        # Windows cannot open folders.
        return
    handle = os.open(path, os.O_RDONLY if is_folder else os.O_RDWR)
    try:
        os.fsync(handle)
    except OSError as error:
        if not is_folder or error.errno not in _NO_FOLDER_SYNC:
            raise
    finally:
        os.close(handle)
