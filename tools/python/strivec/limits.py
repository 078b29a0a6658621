"""The limits of section 5 of the format, and the budget of memory."""

from contextlib import contextmanager

from .errors import OutOfRange, OverBudget

DEFAULT_BUDGET = 4 << 30  # bytes

SECTIONS = (1, 65_536)
SCALES = (1, 16)
TENSORS = (1, 16_777_216)
CHUNKS = (1, 16_384)
EXTENT = (1, 1_048_576)
NEIGHBOURS = (1, 16)
RESOLUTION = (1, 1_024)
RANK = (1, 256)
PREFIX_RANKS = (1, 4_096)
COSINE_GROUP = (1, 1_025)
FEATURES = (1, 256)
FREQUENCIES = (0, 16)
LAYERS = (1, 16)
LAYER_WIDTH = (1, 16_384)
OCCUPANCY_AXIS = (2, 4_096)
OCCUPANCY_VERTICES = (8, 1_073_741_824)
STRING = (0, 4_096)  # bytes
TEXT = (0, 1_048_576)  # bytes
RECORD = (0, 8_388_608)  # bytes
LIST = (0, 65_536)  # probes, poses, cameras, notes
THUMBNAIL = (1, 4_194_304)  # bytes
MARCH_STEPS = 1_048_576  # the bounds' diagonal over the step, section 10


def check(value, limit, place):
    """`value`, or OutOfRange where it is not in `limit`, a pair of the least and the most."""
    least, most = limit
    if not least <= value <= most:
        raise OutOfRange(place, value, least, most)
    return value


class Budget:
    """Bytes that may still be allocated; asked before each allocation whose size comes from the file."""

    def __init__(self, size):
        self.left = size

    def take(self, size, place):
        """Spends `size` bytes for what lives as long as the scene."""
        if size > self.left:
            raise OverBudget(place, size, self.left)
        self.left -= size

    @contextmanager
    def borrow(self, size, place):
        """Spends `size` bytes for what lives as long as the `with` block."""
        self.take(size, place)
        try:
            yield
        finally:
            self.left += size
