"""The codec adaptive (section 2.5 of the format)."""

from collections import defaultdict

from .errors import Malformed

RATES = [(655_360 + (10 * n + 16) // 2) // (10 * n + 16) for n in range(255)]
BLOCK = 8  # vertices along an edge
EMPTY, FULL, MIXED = range(3)
BLOCKS_BEFORE = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)]
ENOUGH = 2  # bits that the counter of a whole context has seen before it counts


class Counter:
    """The probability of a 1 in a context, and the number of bits seen there."""

    __slots__ = ("p", "n")

    def __init__(self):
        self.p = 1 << 21
        self.n = 0

    @property
    def probability(self):
        """In units of 1/65536."""
        return min(max(self.p >> 6, 32), 65_504)

    def learn(self, bit):
        rate = RATES[self.n]
        if bit:
            self.p += ((1 << 22) - self.p) * rate >> 16
        else:
            self.p -= self.p * rate >> 16
        self.n = min(self.n + 1, 254)


class Decoder:
    """Bits of `data`, which the section `name` has."""

    def __init__(self, data, name):
        self.data = bytes(data)
        self.name = name
        self.low, self.high = 0, 0xFFFFFFFF
        self.taken = 0
        self.number = int.from_bytes(self.data[:4].ljust(4, b"\0"), "big")

    def bit(self, probability):
        middle = self.low + ((self.high - self.low) * probability >> 16)
        bit = self.number <= middle
        if bit:
            self.high = middle
        else:
            self.low = middle + 1
        while self.low >> 24 == self.high >> 24:
            self.low = self.low << 8 & 0xFFFFFFFF
            self.high = self.high << 8 & 0xFFFFFFFF | 0xFF
            at = self.taken + 4
            self.number = self.number << 8 & 0xFFFFFFFF | (self.data[at] if at < len(self.data) else 0)
            self.taken += 1
        return bit

    def bit_in(self, counter):
        bit = self.bit(counter.probability)
        counter.learn(bit)
        return bit

    def finish(self):
        """Checks the length and the last byte."""
        if len(self.data) != self.taken + 1:
            raise Malformed(f"{self.name} bytes of the codec adaptive", self.taken + 1, len(self.data))
        if self.data[-1] != self.high >> 24:
            raise Malformed(f"{self.name} last byte of the codec adaptive", self.high >> 24, self.data[-1])


def occupancy(data, vertices, name):
    """The body of an OCCUPANCY of these `vertices`."""
    decoder = Decoder(data, name)
    blocks = _blocks(decoder, [-(-n // BLOCK) for n in vertices])
    width, height, depth = vertices
    near, whole = defaultdict(Counter), defaultdict(Counter)
    # Rows of vertices, x from the lowest bit on, by (y, z).
    rows = {}
    for z in range(depth):
        for y in range(height):
            rows[y, z] = row = 0
            at = {(dy, dz): rows.get((y + dy, z + dz), 0) << 2 for dy, dz in NEIGHBOR_ROWS}
            for x in range(width):
                block = blocks[x // BLOCK, y // BLOCK, z // BLOCK]
                bit = block == FULL
                if block == MIXED:
                    at[0, 0] = row << 2
                    context = 0
                    for k, (dx, dy, dz) in enumerate(NEIGHBORS):
                        context |= (at[dy, dz] >> (x + dx + 2) & 1) << k
                    counters = near[context & 0xFFF], whole[context]
                    bit = decoder.bit(counters[counters[1].n >= ENOUGH].probability)
                    for counter in counters:
                        counter.learn(bit)
                row |= bit << x
            rows[y, z] = row
    decoder.finish()
    bits = 0
    for z in reversed(range(depth)):
        for y in reversed(range(height)):
            bits = bits << width | rows[y, z]
    return bits.to_bytes(-(-width * height * depth // 8), "little")


# The vertices before one that are its context, and their rows.
NEIGHBORS = [
    (-2, 0, 0),
    (-1, 0, 0),
    (-1, -1, 0),
    (0, -1, 0),
    (1, -1, 0),
    (-1, 0, -1),
    (0, 0, -1),
    (1, 0, -1),
    (0, -2, 0),
    (0, 0, -2),
    (0, -1, -1),
    (0, 1, -1),
    (-2, -1, 0),
    (2, -1, 0),
    (-1, -1, -1),
    (1, -1, -1),
    (-1, 1, -1),
    (1, 1, -1),
]
NEIGHBOR_ROWS = {(dy, dz) for _, dy, dz in NEIGHBORS}


def _blocks(decoder, counts):
    """The states of blocks, by (x, y, z)."""
    is_mixed, is_full = defaultdict(Counter), defaultdict(Counter)
    blocks = {}
    width, height, depth = counts
    for z in range(depth):
        for y in range(height):
            for x in range(width):
                context = 0
                for dx, dy, dz in BLOCKS_BEFORE:
                    context = 3 * context + blocks.get((x - dx, y - dy, z - dz), EMPTY)
                if decoder.bit_in(is_mixed[context]):
                    blocks[x, y, z] = MIXED
                else:
                    blocks[x, y, z] = FULL if decoder.bit_in(is_full[context]) else EMPTY
    return blocks
