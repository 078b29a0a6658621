"""What is done, in a store of any kind that fsspec knows.

    objects/STAGE/KEY/          the files of a stage's result, and `done.json`, which is written last
    checkpoints/KEY.state       of trainings that are not done
    runs/STAGE/KEY/ID.json      one for each time that a stage was begun
    inputs/ID.json              the digests of input files, by address, size and time
    scenes/NAME.strivec         the results, NAME.png with a picture, and NAME.json with the facts of all stages
    failed/NAME.json            scenes that could not be made, and why

A key is the digest of a stage's inputs, settings and version, so a result that exists is the result. Files appear whole: stores of
objects write so, and in folders a file is written under another name, synced and renamed. Names in inputs are untrusted: a file is
fetched or unpacked only if its name stays in its folder.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import posixpath
import random
import shutil
import tarfile
import time
import zipfile
from pathlib import Path
from typing import Any, Callable, ContextManager, Dict, Iterator, List, Optional, Tuple, TypeVar

import fsspec
from fsspec.implementations.local import LocalFileSystem

from .._files import inside, leads_out, replacing, scratch
from ..errors import InputError

T = TypeVar("T")

TRIES = 6
"""Times that a request is made before its failure counts."""
FIRST_WAIT = 0.1
"""Seconds before the second; each wait is twice as long."""


_LASTING = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError, TypeError, ValueError)
"""Failures that another try does not mend."""
_FULL = (errno.EDQUOT, errno.ENOSPC)
"""Those of a full disk."""
_CHECKS_LINKS = hasattr(tarfile, "data_filter")
"""Whether this Python checks the links in an archive as it follows them: all do since 3.12, older ones since a later release. Without,
links are left out."""


def digest(value: Any) -> str:
    """The SHA-256 of a value as canonical JSON."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def tried(place: str, request: Callable[[], T]) -> T:
    """Makes a request of a store, again after a failure that may pass. Raises an InputError that names `place`."""
    for left in reversed(range(TRIES)):
        try:
            return request()
        except Exception as error:  # Each kind of store has its own.
            if left == 0 or isinstance(error, _LASTING) or getattr(error, "errno", None) in _FULL:
                raise InputError(f"{place}: {_reason(error)}") from error
            time.sleep(FIRST_WAIT * 2 ** (TRIES - 1 - left) * random.uniform(0.5, 1.0))
    raise AssertionError("a loop of tries ends in a result or an error")


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).rstrip(".")


class Store:
    """The folder at an fsspec URL."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self.fs, self.root = fsspec.core.url_to_fs(self.url)
        self.is_local = isinstance(self.fs, LocalFileSystem)

    def path(self, name: str) -> str:
        """The address of the file `name` within its file system."""
        return f"{self.root.rstrip('/')}/{name}"

    def place(self, name: str) -> str:
        """The address that people read."""
        return f"{self.url}/{name}"

    def exists(self, name: str) -> bool:
        """Whether there is a file `name`."""
        return tried(self.place(name), lambda: self.fs.isfile(self.path(name)))

    def read(self, name: str) -> bytes:
        """The bytes of the file `name`."""
        return tried(self.place(name), lambda: self.fs.cat_file(self.path(name)))

    def write(self, name: str, data: bytes) -> None:
        """Writes the file `name`, whole."""

        def write() -> None:
            if not self.is_local:
                self.fs.pipe_file(self.path(name), data)
                return
            with self._replacing(name) as partial:
                partial.write_bytes(data)

        tried(self.place(name), write)

    def upload(self, local: Path, name: str) -> None:
        """Writes the file `name` from a local one, whole."""

        def write() -> None:
            if not self.is_local:
                self.fs.put_file(str(local), self.path(name))
                return
            with self._replacing(name) as partial:
                shutil.copyfile(local, partial)

        tried(self.place(name), write)

    def download(self, name: str, local: Path) -> None:
        """Copies the file `name` to a local one, which appears whole."""
        with replacing(local) as partial:
            tried(self.place(name), lambda: self.fs.get_file(self.path(name), str(partial)))

    def remove(self, name: str) -> None:
        """Removes the file `name`, if it is there."""

        def remove() -> None:
            with contextlib.suppress(FileNotFoundError):
                self.fs.rm_file(self.path(name))

        tried(self.place(name), remove)

    def read_json(self, name: str) -> Optional[Any]:
        """The value in the file `name`; None without a file, or with one that is no JSON."""
        if not self.exists(name):
            return None
        try:
            return json.loads(self.read(name))
        except ValueError:
            return None

    def write_json(self, name: str, value: Any) -> None:
        """Writes `value` as the file `name`."""
        self.write(name, json.dumps(value, indent=1, sort_keys=True).encode())

    def _replacing(self, name: str) -> ContextManager[Path]:
        """A path beside the file `name` of a local store, for a file that becomes it."""
        path = Path(self.path(name))
        path.parent.mkdir(parents=True, exist_ok=True)
        return replacing(path)


class Input:
    """A file or a folder at an fsspec URL."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self.fs, self.root = fsspec.core.url_to_fs(self.url)

    def files(self) -> Dict[str, Dict[str, Any]]:
        """What the store knows of its files, by their names in it; a single file has the name "". The names are untrusted."""
        found = tried(self.url, lambda: self.fs.find(self.root, detail=True))
        files = {self._name(path): info for path, info in found.items() if not path.endswith("/")}
        if len(files) > 1:
            # Some stores list a folder as an empty file beside those in it.
            files.pop("", None)
        if not files:
            raise InputError(f"{self.url}: there is no such file or folder, or it is empty")
        return files

    def _name(self, path: str) -> str:
        """The name of the file that the store lists as `path`."""
        folder = self.root.rstrip("/")
        if path == folder:
            return ""
        if folder and not path.startswith(f"{folder}/"):
            raise leads_out(self.url, path, self.url)
        return path[len(folder) + 1 :] if folder or path.startswith("/") else path

    def _path(self, name: str) -> str:
        """The address of the file `name` within its file system."""
        return f"{self.root}/{name}" if name else self.root

    def identity(self, cache: Store) -> str:
        """The digest of the names and the contents of its files. Contents are read once: `cache` keeps their digests, which hold as long
        as a file has its size and its time, or its version."""
        name = f"inputs/{digest(self.url)}.json"
        known = cache.read_json(name) or {}
        digests = {}
        for file, info in sorted(self.files().items()):
            state = [info.get("size"), *(str(info[key]) for key in ("ETag", "etag", "mtime", "LastModified") if key in info)]
            before = known.get(file)
            if before is not None and before[0] == state and len(state) > 1:
                digests[file] = before
            else:
                digests[file] = [state, self._digest_of(file)]
        if digests != known:
            cache.write_json(name, digests)
        return digest({file: sha256 for file, (_, sha256) in digests.items()})

    def _digest_of(self, file: str) -> str:
        path = self._path(file)

        def read() -> str:
            sha256 = hashlib.sha256()
            with self.fs.open(path, "rb") as source:
                while block := source.read(1 << 20):
                    sha256.update(block)
            return sha256.hexdigest()

        return tried(f"{self.url}/{file}", read)

    @contextlib.contextmanager
    def local(self) -> Iterator[Path]:
        """Its path on this machine: its own, or that of a copy, which is removed at the end. Archives are unpacked."""
        is_archive = self.url.endswith((".zip", ".tar", ".tar.gz", ".tgz"))
        if isinstance(self.fs, LocalFileSystem) and not is_archive:
            if not os.path.exists(self.root):
                raise InputError(f"{self.url}: there is no such file or folder")
            yield Path(self.root)
            return
        with scratch() as folder:
            target = inside(folder, self.root.rstrip("/").rsplit("/", 1)[-1] or "input", self.url)
            for file in self.files():
                self._fetch(file, inside(target, file, self.url) if file else target)
            yield _unpacked(target, folder / "unpacked", self.url) if is_archive else target

    def _fetch(self, name: str, path: Path) -> None:
        """Copies the file `name` to `path`."""

        def fetch() -> None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.fs.get_file(self._path(name), str(path))

        tried(f"{self.url}/{name}", fetch)


def _unpacked(archive: Path, folder: Path, place: str) -> Path:
    """The folder in an archive: its only folder, if it holds nothing else."""
    folder.mkdir()
    try:
        if archive.suffix == ".zip":
            with zipfile.ZipFile(archive) as packed:
                _check_entries(folder, [(info.filename, info.file_size) for info in packed.infolist()], place)
                packed.extractall(folder)
        else:
            with tarfile.open(archive) as packed:
                _check_entries(folder, [entry for info in packed for entry in _entries(info)], place)
                if _CHECKS_LINKS:
                    packed.extractall(folder, filter="data")
                else:
                    packed.extractall(folder, [info for info in packed if info.isfile() or info.isdir()])
    except (zipfile.BadZipFile, tarfile.TarError, OSError) as error:
        raise InputError(f"{place}: {_reason(error)}") from error
    entries = [entry for entry in folder.iterdir() if not entry.name.startswith(("__MACOSX", "."))]
    return entries[0] if len(entries) == 1 and entries[0].is_dir() else folder


def _entries(info: tarfile.TarInfo) -> Iterator[Tuple[str, int]]:
    """The name and the bytes of a member of an archive, and the name that it links to."""
    yield info.name, info.size
    if info.issym():
        yield posixpath.join(posixpath.dirname(info.name), info.linkname), 0
    elif info.islnk():
        yield info.linkname, 0


def _check_entries(folder: Path, entries: List[Tuple[str, int]], place: str) -> None:
    """Refuses `entries`, names and bytes, that would not stay in `folder` or have no room there."""
    _check_room(folder, sum(size for _, size in entries))
    for name, _ in entries:
        # Archives may list their own folder.
        if posixpath.normpath(name) != ".":
            inside(folder, name, place)


def _check_room(folder: Path, needed: int) -> None:
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise OSError(errno.ENOSPC, f"unpacked it takes {needed:,} bytes; {free:,} are free in {folder.parent}")
