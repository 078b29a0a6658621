"""The classes of error of section 7 of the format, one exception each.

Every message names the place, what was expected and what was found. `exit_code` is what the command returns: 3 where
the file is at fault, 5 where this reader or its caller's budget is.
"""


class StrivecError(Exception):
    """Why a file is refused."""

    exit_code = 3


class NotStrivec(StrivecError):
    """The file does not begin with the magic."""

    def __init__(self, start):
        super().__init__(f"not a .strivec file: it begins with [{_hex(start)}]")


class LineEndings(StrivecError):
    """The file begins with what a transfer as text makes of the magic."""

    def __init__(self, start):
        super().__init__(f"damaged by a transfer as text: the magic arrived as [{_hex(start)}]")


class UnsupportedVersion(StrivecError):
    """The major version is not 1."""

    exit_code = 5

    def __init__(self, major, minor):
        super().__init__(f"version {major}.{minor} of the format; this reader knows major version 1")


class Truncated(StrivecError):
    """The file ends before what it announces."""

    def __init__(self, place, start, end):
        super().__init__(f"truncated: {place} needs bytes {start} to {end}, which are missing")


class Corrupt(StrivecError):
    """A checksum is wrong."""

    def __init__(self, place, start, end, found, expected):
        super().__init__(
            f"corrupt: {place} (bytes {start} to {end}) has checksum {found:08x} where {expected:08x} was written"
        )


class UnknownCritical(StrivecError):
    """A critical section of a kind that this reader does not know."""

    exit_code = 5

    def __init__(self, kind):
        super().__init__(f"section {kind} is unknown to this reader, and the scene cannot be understood without it")


class Unsupported(StrivecError):
    """A code, codec, contraction or factor kind that this reader does not know or support."""

    exit_code = 5

    def __init__(self, place, what):
        super().__init__(f"{place}: {what} is not supported")


class MissingSection(StrivecError):
    """A section that every file, scale or chunk has is not in the table."""

    def __init__(self, section):
        super().__init__(f"section {section} is missing")


class OutOfRange(StrivecError):
    """A number outside the table of section 5."""

    def __init__(self, place, found, least, most):
        super().__init__(f"{place}: {found} is not in the format's range of {least} to {most}")


class OverBudget(StrivecError):
    """More memory than the caller allows."""

    exit_code = 5

    def __init__(self, place, needed, left):
        super().__init__(f"{place} needs {needed} bytes of memory where {left} are left of what is allowed")


class Malformed(StrivecError):
    """A rule on how bytes are laid out is broken."""

    def __init__(self, place, expected, found):
        super().__init__(f"malformed: {place}: expected {expected}, found {found}")


class NotAScene(StrivecError):
    """A rule on values is broken."""

    def __init__(self, place, expected, found):
        super().__init__(f"not a valid scene: {place}: expected {expected}, found {found}")


def _hex(data):
    return ", ".join(f"{byte:02x}" for byte in data)
