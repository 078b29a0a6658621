"""The classes of error of section 7 of the format, one exception for each.

Every message names the field, its allowed values and the value in the file. `name` is the name of the class in the
format. `exit_code` is the exit code of the command: 3 if the file is damaged or invalid, 5 if this reader does not
support it or it exceeds the caller's budget.
"""


class StrivecError(Exception):
    """Why a file is refused."""

    name = None
    exit_code = 3


class NotStrivec(StrivecError):
    """The file does not begin with the magic."""

    name = "foreign"

    def __init__(self, start):
        super().__init__(f"not a .strivec file: it begins with {_hex(start)}")


class LineEndingDamage(StrivecError):
    """The file begins with a damaged magic: it was transferred as text."""

    name = "text-transfer"

    def __init__(self, start):
        super().__init__(f"damaged by a transfer as text: the file begins with {_hex(start)}; transfer it as binary")


class UnsupportedVersion(StrivecError):
    """The major version is not 1."""

    name = "version"
    exit_code = 5

    def __init__(self, major, minor):
        super().__init__(f"version {major}.{minor} of the format is not supported; this reader supports major version 1")


class Truncated(StrivecError):
    """The file is shorter than its header, table or declared length."""

    name = "truncated"

    def __init__(self, place, start, end):
        super().__init__(f"truncated: {place} needs bytes {start} to {end}, which are missing")


class Corrupt(StrivecError):
    """A checksum is wrong."""

    name = "corrupt"

    def __init__(self, place, start, end, found, expected):
        super().__init__(
            f"corrupt: the checksum of {place} (bytes {start} to {end}) must be {expected:08x}; found {found:08x}"
        )


class UnknownCritical(StrivecError):
    """A critical section of a kind that this reader does not know."""

    name = "kind"
    exit_code = 5

    def __init__(self, kind):
        super().__init__(f"section {kind} is unknown to this reader, and the scene cannot be read without it")


class Unsupported(StrivecError):
    """A code that this reader does not know, or a reserved field that is not zero."""

    name = "code"
    exit_code = 5

    def __init__(self, place, what):
        super().__init__(f"{place}: {what} is not supported")


class MissingSection(StrivecError):
    """A section that every file, scale or chunk must have is not in the table."""

    name = "missing"

    def __init__(self, section):
        super().__init__(f"section {section} is missing")


class LimitExceeded(StrivecError):
    """A number outside the limits of section 5."""

    name = "limit"

    def __init__(self, place, found, minimum, maximum):
        super().__init__(f"{place} must be within the format's limits, {minimum} to {maximum}; found {found}")


class BudgetExceeded(StrivecError):
    """The file needs more memory than the caller allows."""

    name = "budget"
    exit_code = 5

    def __init__(self, place, needed, left):
        super().__init__(f"{place} needs {needed} bytes of memory, but {left} bytes of the budget are left")


class Malformed(StrivecError):
    """The file breaks a rule on the layout of bytes."""

    name = "malformed"

    def __init__(self, place, expected, found):
        super().__init__(f"malformed: {place} must be {expected}; found {found}")


class InvalidScene(StrivecError):
    """The file breaks a rule on values."""

    name = "value"

    def __init__(self, place, expected, found):
        super().__init__(f"not a valid scene: {place} must be {expected}; found {found}")


def _hex(data):
    return data.hex(" ") or "nothing"
