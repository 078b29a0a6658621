"""The limits of section 5 of the format, and the memory budget."""

from contextlib import contextmanager

from .errors import LimitExceeded, BudgetExceeded


SECTIONS = (1, 65_536)
SCALES = (1, 16)
TENSORS = (1, 4_194_304)
CHUNKS = (1, 16_384)
CELL_EXTENT = (1, 1_048_576)
TOP_K = (1, 16)
RESOLUTION = (1, 1_024)
RANK = (1, 512)
RANK_SUM = (1, 4_096)
FEATURES = (1, 256)
FREQUENCIES = (0, 16)
LAYERS = (1, 16)
LAYER_WIDTH = (1, 1_024)
OCCUPANCY_AXIS = (2, 4_096)
OCCUPANCY_VERTICES = (8, 268_435_456)
STRING = (0, 4_096)  # bytes
TEXT = (0, 1_048_576)  # bytes
RECORD = (0, 8_388_608)  # bytes
ITEMS = (0, 65_536)  # probes, poses, cameras, notes
THUMBNAIL = (1, 4_194_304)  # bytes
MARCH_STEPS = (0, 1_048_576)  # steps on the longest ray
PROBE_STEPS = (0, 4_194_304)  # probes, times these steps


def default_budget(length):
    """Bytes of memory for a file of `length` bytes, unless the caller knows better."""
    return min((512 << 20) + 64 * length, 4 << 30)


def check(value, limit, place):
    """Returns `value`; raises LimitExceeded if it is not within `limit`, a pair of minimum and maximum."""
    minimum, maximum = limit
    if not minimum <= value <= maximum:
        raise LimitExceeded(place, value, minimum, maximum)
    return value


class Budget:
    """Bytes that may still be allocated. Each allocation whose size comes from the file takes its bytes here first."""

    def __init__(self, size):
        self.left = size

    def take(self, size, place):
        """Takes `size` bytes for data that lives as long as the scene."""
        if size > self.left:
            raise BudgetExceeded(place, size, self.left)
        self.left -= size

    @contextmanager
    def borrow(self, size, place):
        """Takes `size` bytes for the duration of the `with` block."""
        self.take(size, place)
        try:
            yield
        finally:
            self.left += size
