"""The codec adaptive (section 2.5 of the format)."""

from collections import defaultdict
from itertools import islice

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
        return self.p >> 6

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
        self.taken = 0
        self.width, self.offset = 2**64 - 1, self._take(8)
        if self.offset == self.width:
            raise Malformed(f"{name} first 8 bytes of the codec adaptive", "not all 255", "all 255")

    def _take(self, count):
        """The number that the next bytes are; those behind the end are zeros."""
        taken = self.data[self.taken : self.taken + count]
        self.taken += count
        return int.from_bytes(taken.ljust(count, b"\0"), "big")

    def bit(self, probability):
        ones = (self.width >> 16) * probability
        bit = self.offset < ones
        if bit:
            self.width = ones
        else:
            self.width -= ones
            self.offset -= ones
        if self.width < 2**32:
            self.width <<= 32
            self.offset = self.offset << 32 | self._take(4)
        return bit

    def bit_in(self, counter):
        bit = self.bit(counter.probability)
        counter.learn(bit)
        return bit

    def finish(self):
        """Checks the length and the last bytes."""
        if len(self.data) != self.taken - 4:
            raise Malformed(f"{self.name} bytes of the codec adaptive", self.taken - 4, len(self.data))
        more = self.width - 1 - self.offset >> 32
        if more:
            found = int.from_bytes(self.data[-4:], "big")
            raise Malformed(f"{self.name} last 4 bytes of the codec adaptive", found + more, found)


def occupancy(data, vertices, name):
    """The body of an OCCUPANCY of these `vertices`."""
    decoder = Decoder(data, name)
    blocks = _blocks(decoder, [-(-n // BLOCK) for n in vertices])
    width, height, depth = vertices
    counters = [defaultdict(Counter) for _ in range(3)]
    # Rows of vertices, x from the lowest bit on, by (y, z).
    rows = {}
    for z in range(depth):
        for y in range(height):
            rows[y, z] = 0
            at = {(dy, dz): rows.get((y + dy, z + dz), 0) << 2 for dy, dz in NEIGHBOR_ROWS}
            for x in range(0, width, BLOCK):
                block = blocks[x // BLOCK, y // BLOCK, z // BLOCK]
                end = min(x + BLOCK, width)
                if block == FULL:
                    at[0, 0] |= (1 << end) - (1 << x) << 2
                elif block == MIXED:
                    _run(decoder, at, x, end, *counters)
            rows[y, z] = at[0, 0] >> 2
    decoder.finish()
    bits = 0
    for z in reversed(range(depth)):
        for y in reversed(range(height)):
            bits = bits << width | rows[y, z]
    return bits.to_bytes(-(-width * height * depth // 8), "little")


def _run(decoder, at, first, end, near, whole, differs):
    """The vertices `first` to `end` - 1 of a row, set in `at`: rows by their offsets, from bit 2 on."""
    around = [_context(at, x) >> OWN for x in range(first, end)] + [at[0, 0] >> first & 3]
    for value, all_bits in [(0, [0] * len(around)), (1, [0xFFFF] * (end - first) + [3])]:
        if around == all_bits and not decoder.bit_in(differs[value]):
            at[0, 0] |= value * ((1 << end) - (1 << first)) << 2
            return
    for x in range(first, end):
        context = _context(at, x)
        counters = near[context & 0xFFF], whole[context]
        bit = decoder.bit(counters[counters[1].n >= ENOUGH].probability)
        for counter in counters:
            counter.learn(bit)
        at[0, 0] |= bit << x + 2


def _context(at, x):
    """The whole context of vertex `x`."""
    return sum((at[dy, dz] >> (x + dx + 2) & 1) << k for k, (dx, dy, dz) in enumerate(NEIGHBORS))


OWN = 2  # the first bits of a context, of the vertices before one in its row
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


CLASSES = 48
UNARY = 18  # bits that say whether a remainder is larger than 0, 1, 2, …
LARGEST_SIZE = 1023
EVEN = 1 << 15  # the probability of a bit that is as likely 0 as 1


def integers(data, length, bits, blocks, tensors, name, masks=None):
    """The body, of `length` bytes, of an array in the encoding grid of `bits` bits: masks, step codes and integers.

    Each of `blocks` is a number of groups for each of so many `tensors`, and the lengths of the vectors of each group. If
    the body begins with masks of components, `masks` is (tensors, rank), and as many groups count as the masks have bits.
    Without tensors, blocks are rows of networks, of one group each.
    """
    decoder = Decoder(data, name)
    width = 2 if bits > 8 else 1
    body = bytearray()
    counts = [count * (tensors or 1) for count, _ in blocks]
    if masks is not None:
        body += _masks(decoder, *masks)
        counts = _counts(body, *masks, [count for count, _ in blocks])
        groups = sum(count * (1 + width * sum(vectors)) for count, (_, vectors) in zip(counts, blocks))
        if len(body) + groups != length:
            raise Malformed(f"{name} bytes of the body", len(body) + groups, length)
    steps = _steps(decoder, sum(counts))
    body += bytes(steps)
    weights = []
    for _ in range(2):
        weight = _number(decoder, 16)
        weights.append(weight - (weight >> 15 << 16))
    model = _Integers(decoder, bits, weights)
    steps = iter(steps)
    for count, (_, vectors) in zip(counts, blocks):
        if tensors is not None:
            model.sizes.clear()
        for step in islice(steps, count):
            first = 0
            for length in vectors:
                for q in model.vector(first, length, step >> 2):
                    body += q.to_bytes(width, "little", signed=True)
                first += length
    decoder.finish()
    return body


def _counts(masks, tensors, rank, ranks):
    """The stored components of each block."""
    size = -(-rank // 8)
    counts = [0] * len(ranks)
    for tensor in range(tensors):
        mask = int.from_bytes(masks[tensor * size : (tensor + 1) * size], "little")
        for block, of_block in enumerate(ranks):
            counts[block] += (mask & (1 << of_block) - 1).bit_count()
            mask >>= of_block
    return counts


def _masks(decoder, tensors, rank):
    counters = defaultdict(Counter)
    before = [1] * rank
    masks = bytearray()
    for _ in range(tensors):
        mask, last = 0, 1
        for c in range(rank):
            last = int(decoder.bit_in(counters[c, last, before[c]]))
            before[c] = last
            mask |= last << c
        masks += mask.to_bytes(-(-rank // 8), "little")
    return masks


def _steps(decoder, count):
    zero, sign, larger = defaultdict(Counter), defaultdict(Counter), defaultdict(Counter)
    steps = []
    step = difference = 0
    for _ in range(count):
        size = min(abs(difference), 3)
        side = _sign(difference)
        difference = 0
        if decoder.bit_in(zero[size]):
            negative = decoder.bit_in(sign[side])
            difference = 1
            while difference < 128 and decoder.bit_in(larger[size, difference]):
                difference += 1
            if negative:
                difference = -difference
        step = (step + difference) % 256
        steps.append(step)
    return steps


class _Integers:
    """The contexts of the integers of a section."""

    def __init__(self, decoder, bits, weights):
        self.decoder = decoder
        self.largest = 2 ** (bits - 1) - 1
        self.weights = weights
        self.sizes = defaultdict(int)  # E, by vertex
        self.by_place, self.by_step = defaultdict(Counter), defaultdict(Counter)
        self.signs = defaultdict(Counter)

    def vector(self, first, length, step):
        """The numbers of the vertices from `first` on, in a group of this step code without its two lowest bits."""
        sizes, decoder = self.sizes, self.decoder
        near = sizes[first]
        before = [0, 0]
        remainder = 0
        for vertex in range(first, first + length):
            exact = self.weights[0] * before[0] + self.weights[1] * before[1]
            prediction = min(max(exact + 128 >> 8, -self.largest), self.largest)
            fraction = exact - 256 * prediction
            third = 0 if fraction < -42 else 1 if fraction <= 42 else 2
            after = sizes[vertex + 1] if vertex + 1 < first + length else sizes[vertex]
            kind = _class(3 * near + (3 * sizes[vertex] + after >> 2) >> 2)
            large = 0 if prediction == 0 else 1 if abs(prediction) <= 2 else 2
            place = (kind, third, remainder == 0, large)
            size = 0
            while size < UNARY and self._both((size, place), (size, kind, step)):
                size += 1
            negative = size > 0 and decoder.bit_in(self.signs[third, _sign(remainder)])
            if size == UNARY:
                size += self._more()
            remainder = -size if negative else size
            number = prediction + remainder
            if abs(number) > self.largest:
                raise Malformed(f"{decoder.name} integer", f"{-self.largest} to {self.largest}", number)
            limited = min(size, LARGEST_SIZE)
            near = 5 * near + 48 * limited >> 3
            sizes[vertex] = 7 * sizes[vertex] + 16 * limited >> 3
            before = [number, before[0]]
            yield number

    def _both(self, place, part):
        counters = self.by_place[place], self.by_step[part]
        bit = self.decoder.bit((counters[0].probability + counters[1].probability) // 2)
        for counter in counters:
            counter.learn(bit)
        return bit

    def _more(self):
        length = 0
        while self.decoder.bit(EVEN):
            length += 1
            if length > 17:
                raise Malformed(f"{self.decoder.name} integer", "at most 17 bits behind the first", "more")
        return (1 << length | _number(self.decoder, length)) - 1


def _class(size):
    octave = (size + 4).bit_length() - 3
    return min(4 * octave + (size + 4 >> octave) - 4, CLASSES - 1)


def _number(decoder, count):
    number = 0
    for _ in range(count):
        number = 2 * number + int(decoder.bit(EVEN))
    return number


def _sign(number):
    return (number > 0) - (number < 0)
