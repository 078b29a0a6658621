"""The exceptions of this package.

Each message is one sentence that names the file, the place in it, what was expected and what was found.
"""

from __future__ import annotations

from typing import List


class Error(Exception):
    """The base of all of them."""

    lines: List[str]
    """Lines of a file or of a program's log that show the fault."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.lines = []

    def __str__(self) -> str:
        return "\n  ".join([super().__str__(), *self.lines])


class UsageError(Error, ValueError):
    """An argument is not valid, or a file exists that would be overwritten."""


class InputError(Error, OSError):
    """A file cannot be read or written."""

    def __str__(self) -> str:
        # OSError formats its arguments by itself.
        return Error.__str__(self)


class MalformedError(Error, ValueError):
    """A file, or an array, does not have the content that it should."""


class UnsupportedError(Error):
    """A file is of another version, or needs what this build lacks."""


class MemoryLimitError(UnsupportedError, MemoryError):
    """A scene or a picture needs more memory than it may take."""


class DiffersError(Error):
    """Two things that were compared are not the same."""


class RunError(Error, RuntimeError):
    """Anything else, such as a training that was interrupted."""


class InternalError(Error):
    """A fault of this package itself."""
