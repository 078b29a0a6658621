"""The field of a scene, and the march along a ray (section 4 of the format), in float64.

This is a reference, not a fast renderer: each sample of a ray is tested against all tensors whose boxes the ray
touches. Points are in model space, lengths in model units.
"""

import time
from collections import namedtuple

import numpy as np

MAX_PAIRS = 1 << 22  # pairs of sample and tensor that are tested at once
ROUNDING = 1e-9  # boxes grow by this share of their half edges, and this length, in the search for a ray's tensors

Rays = namedtuple("Rays", "colors opacities depths")
Field = namedtuple("Field", "inside densities features")


def trace(scene, origins, directions, deadline=None):
    """Marches rays (4.8): colors float64[n][3], opacities and depths float64[n].

    `origins` and `directions` are float64[n][3], the directions of length 1. Raises a TimeoutError once time.monotonic() is
    past `deadline`.
    """
    rays = [_march(scene, origin, direction, deadline) for origin, direction in zip(origins, directions)]
    colors, opacities, depths = zip(*rays) if rays else ([], [], [])
    return Rays(np.array(colors).reshape(-1, 3), np.array(opacities), np.array(depths))


def density_features(scene, points):
    """The density feature f (4.5) at points float64[n][3], float64[n]; 0 if no scale covers the point."""
    tensors = [np.arange(len(scale.centers)) for scale in scene.scales]
    return evaluate(scene, np.asarray(points, np.float64), tensors).densities


def _march(scene, origin, direction, deadline):
    """Color, opacity and depth of one ray (4.8)."""
    rules, frame = scene.rules, scene.frame
    behind = np.array(frame.background, np.float64) if rules.sky is None else sky_color(rules.sky, direction)
    if rules.shell is None:
        enter, leave = _slab(np.array(rules.bounds[0]), np.array(rules.bounds[1]), origin, direction)
        distances = _even(max(enter, frame.near), min(leave, frame.far), rules.step)
        points = origin + distances[:, None] * direction
        touched = [_touched(scale, origin, direction) for scale in scene.scales]
    else:
        distances = _spaced(rules, frame, origin, direction)
        points = contracted(rules.shell, origin + distances[:, None] * direction)
        touched = [np.arange(len(scale.centers)) for scale in scene.scales]
    if not len(distances):
        return behind, 0.0 if rules.sky is None else 1.0, 0.0

    field = evaluate(scene, points, touched, deadline)
    counts = field.inside
    if scene.occupancy is not None:
        counts = counts & (occupancy(scene.occupancy, points) > 0.0)
    distances, densities, features = distances[counts], field.densities[counts], field.features[counts]

    density = np.logaddexp(0.0, densities + rules.density_shift)
    alpha = -np.expm1(-density * rules.step * rules.distance_scale)
    after = np.cumprod(1.0 - alpha)
    ended = np.flatnonzero(after < rules.min_transmittance)
    samples = slice(0, ended[0] + 1 if len(ended) else len(after))
    before = np.concatenate([[1.0], after])[:-1]
    weights = (before * alpha)[samples]
    transmittance = after[samples][-1] if len(after) else 1.0
    total = weights.sum()
    depth = weights @ distances[samples] / total if total > 0.0 else 0.0

    shaded = weights > rules.min_weight
    weights, features = weights[shaded], features[samples][shaded]
    color = transmittance * behind
    if len(weights) and scene.decoder.mode == "per sample":
        color = color + weights @ _sigmoid(decode(scene.decoder, features, direction))
    elif len(weights):
        total = weights.sum()
        of_ray = decode(scene.decoder, (weights @ features / total)[None], direction)
        if scene.decoder.mode == "per ray":
            color = color + total * _sigmoid(of_ray)[0]
        else:
            color = color + weights @ _sigmoid(features[:, :3] + of_ray)
    return color, 1.0 - transmittance if rules.sky is None else 1.0, depth


def sky_color(coefficients, direction):
    """The sky's color B(d) (4.11), float64[3], for coefficients float64[3][(L + 1)²] and a direction of length 1."""
    return _sigmoid(coefficients @ harmonics(direction)[: coefficients.shape[1]])


def harmonics(direction):
    """The real spherical harmonics up to degree 4 (4.11) in directions float64[...][3], float64[25][...]."""
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    root = lambda number: np.sqrt(number / np.pi)
    return np.array(
        [
            root(1) / 2 * np.ones_like(x),
            root(3) / 2 * y,
            root(3) / 2 * z,
            root(3) / 2 * x,
            root(15) / 2 * x * y,
            root(15) / 2 * y * z,
            root(5) / 4 * (3 * z**2 - 1),
            root(15) / 2 * x * z,
            root(15) / 4 * (x**2 - y**2),
            root(35 / 2) / 4 * y * (3 * x**2 - y**2),
            root(105) / 2 * x * y * z,
            root(21 / 2) / 4 * y * (5 * z**2 - 1),
            root(7) / 4 * z * (5 * z**2 - 3),
            root(21 / 2) / 4 * x * (5 * z**2 - 1),
            root(105) / 4 * z * (x**2 - y**2),
            root(35 / 2) / 4 * x * (x**2 - 3 * y**2),
            3 * root(35) / 4 * x * y * (x**2 - y**2),
            3 * root(35 / 2) / 4 * y * z * (3 * x**2 - y**2),
            3 * root(5) / 4 * x * y * (7 * z**2 - 1),
            3 * root(5 / 2) / 4 * y * z * (7 * z**2 - 3),
            3 * root(1) / 16 * (35 * z**4 - 30 * z**2 + 3),
            3 * root(5 / 2) / 4 * x * z * (7 * z**2 - 3),
            3 * root(5) / 8 * (x**2 - y**2) * (7 * z**2 - 1),
            3 * root(35 / 2) / 4 * x * z * (x**2 - 3 * y**2),
            3 * root(35) / 16 * (x**4 - 6 * x**2 * y**2 + y**4),
        ]
    )


def contracted(shell, points):
    """The images of points float64[n][3] by the contraction (4.9)."""
    norms = np.maximum(np.abs(points).max(axis=-1, keepdims=True), 1.0)
    return points / norms * np.where(norms > 1.0, 1.0 + shell - shell / norms, 1.0)


def _even(first, last, step):
    """The samples from `first` on that lie before `last`, float64[n]."""
    if not first < last:
        return np.zeros(0)
    samples = first + np.arange(int((last - first) / step) + 2) * step
    return samples[samples < last]


def _spaced(rules, frame, origin, direction):
    """The distances of a ray's samples in a contracted scene (4.9), float64[n]."""
    root = np.sqrt(3.0)
    of_foot = -origin @ direction
    unit = max(1.0, np.linalg.norm(origin + of_foot * direction) / root)
    ends = (np.array([frame.near, frame.far]) - of_foot) / unit
    far = np.sign(ends) * (2.0 * root - 3.0 / np.maximum(np.abs(ends), root))
    u = _even(*np.where(np.abs(ends) <= root, ends, far), rules.step)
    beyond = np.sign(u) * 3.0 / np.maximum(2.0 * root - np.abs(u), 1e-12)
    return of_foot + unit * np.where(np.abs(u) <= root, u, beyond)


def _slab(box_min, box_max, origin, direction):
    """Where a ray enters and leaves boxes, float64[...] for corners float64[...][3]; enter > leave if it misses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (box_min - origin) / direction
        high = (box_max - origin) / direction
    parallel = direction == 0.0
    within = (box_min <= origin) & (origin <= box_max)
    enter = np.where(parallel, np.where(within, -np.inf, np.inf), np.minimum(low, high))
    leave = np.where(parallel, np.where(within, np.inf, -np.inf), np.maximum(low, high))
    return enter.max(axis=-1), leave.min(axis=-1)


def _touched(scale, origin, direction):
    """The indices of the tensors whose boxes the ray's line touches, ascending."""
    half_edges = scale.half_edges * (1.0 + ROUNDING) + ROUNDING
    enter, leave = _slab(scale.centers - half_edges, scale.centers + half_edges, origin, direction)
    return np.flatnonzero(enter <= leave)


def evaluate(scene, points, tensors, deadline=None):
    """The `Field` at points float64[n][3] (4.1 to 4.6), from the tensors with the given indices of each scale.

    inside bool[n], density features float64[n], appearance features float64[n][P]; zeros if no scale covers the point.
    Raises a TimeoutError once time.monotonic() is past `deadline`.
    """
    rules = scene.rules
    covering = np.zeros(len(points), np.int64)  # number of scales that cover the point
    densities = np.zeros(len(points))
    features = np.zeros((len(points), scene.decoder.features))
    for scale, numbers in zip(scene.scales, tensors):
        batch = max(1, MAX_PAIRS // max(1, len(numbers)))
        for start in range(0, len(points), batch):
            if deadline is not None and time.monotonic() > deadline:
                raise TimeoutError
            rows = slice(start, start + batch)
            covered, density, appearance = _evaluate_scale(rules, scale, points[rows], numbers)
            covering[rows] += covered
            densities[rows] += density
            features[rows] += appearance @ scale.matrix.astype(np.float64).T
    number = np.maximum(covering, 1)
    if rules.density_reduction == "mean":
        densities = densities / number
    if rules.appearance_reduction == "mean":
        features = features / number[:, None]
    inside = covering == len(scene.scales) if rules.coverage == "all" else covering > 0
    return Field(inside, densities, features)


def _evaluate_scale(rules, scale, points, numbers):
    """Whether the scale covers each point, its density feature, and its summed appearance components float64[n][R]."""
    count = len(points)
    offsets = points[:, None, :] - scale.centers[numbers]  # [n][tensors][3]
    covers = (np.abs(offsets) <= scale.half_edges).all(axis=2)
    distances = np.where(covers, np.sqrt((offsets**2).sum(axis=2)), np.inf)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, : scale.top_k]
    distances = np.take_along_axis(distances, nearest, axis=1)  # [n][top_k], inf for missing neighbors
    weights = _weights(rules.aggregation, distances)

    point, neighbor = np.nonzero(np.isfinite(distances))
    tensor = numbers[nearest[point, neighbor]]
    weight = weights[point, neighbor]
    local = points[point] - scale.centers[tensor]
    density = np.zeros(count)
    np.add.at(density, point, weight * _components(scale, scale.density, tensor, local).sum(axis=1))
    appearance = np.zeros((count, scale.matrix.shape[1]))
    np.add.at(appearance, point, weight[:, None] * _components(scale, scale.appearance, tensor, local))
    return covers.any(axis=1), density, appearance


def _weights(aggregation, distances):
    """The weights of neighbors (4.4), float64[n][top_k], from their distances, which are inf for missing neighbors."""
    if aggregation == "clamped":
        inverse = 1.0 / (distances + 1e-6)
        return inverse / np.maximum(inverse.sum(axis=1, keepdims=True), 1.0)
    at_center = distances == 0.0
    inverse = 1.0 / np.where(at_center, 1.0, distances)
    total = inverse.sum(axis=1, keepdims=True)
    weights = inverse / np.where(total > 0.0, total, 1.0)
    return np.where(at_center.any(axis=1, keepdims=True), at_center.astype(np.float64), weights)


def _components(scale, blocks, tensor, local):
    """The components of tensors at points (4.3), float64[n][rank]; `local` float64[n][3] is relative to the center."""
    u = (local + scale.half_edges) / (2.0 * scale.half_edges) * scale.resolution
    lower = np.clip(np.floor(u).astype(np.int64), 0, np.array(scale.resolution) - 1)
    fractions = u - lower
    return np.concatenate([_block(block, tensor, lower, fractions) for block in blocks], axis=1)


def _block(block, tensor, lower, fractions):
    """The components of a block, float64[n][rank]."""
    def vector(numbers, axis, *row):
        low, high = (numbers[(tensor, slice(None), *row, lower[:, axis] + n)].astype(np.float64) for n in (0, 1))
        return low + fractions[:, axis, None] * (high - low)

    if block.axis is None:
        return vector(block.factors[0], 0) * vector(block.factors[1], 1) * vector(block.factors[2], 2)
    along, matrix = block.factors
    first, second = (axis for axis in range(3) if axis != block.axis)
    low, high = (vector(matrix, first, lower[:, second] + n) for n in (0, 1))
    return vector(along, block.axis) * (low + fractions[:, second, None] * (high - low))


def occupancy(grid, points):
    """The trilinear interpolation of a grid's bits at points (4.8), float64[n]; 0 outside its box."""
    box_min, box_max = np.array(grid.corners)
    vertices = np.array(grid.vertices)
    u = (points - box_min) / (box_max - box_min) * (vertices - 1)
    i = np.clip(np.floor(u).astype(np.int64), 0, vertices - 2)
    fraction = u - i
    value = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (i + corner).T
        bit = (z * vertices[1] + y) * vertices[0] + x
        value += np.where(corner, fraction, 1.0 - fraction).prod(axis=1) * (grid.bits[bit // 8] >> (bit % 8) & 1)
    inside = ((box_min <= points) & (points <= box_max)).all(axis=1)
    return np.where(inside, value, 0.0)


def decode(decoder, features, direction):
    """The decoder's outputs y(F, d) (4.7), float64[n][3], for features float64[n][P] and one direction."""
    directions = np.broadcast_to(direction, (len(features), 3))
    values = np.concatenate(
        [
            features,
            directions,
            _encode(features, decoder.feature_frequencies),
            _encode(directions, decoder.direction_frequencies),
        ],
        axis=1,
    )
    for layer in decoder.layers[:-1]:
        values = np.maximum(values @ layer.weights.T.astype(np.float64) + layer.bias, 0.0)
    last = decoder.layers[-1]
    return values @ last.weights.T.astype(np.float64) + last.bias


def _sigmoid(values):
    return np.exp(-np.logaddexp(0.0, -values))


def _encode(vectors, frequencies):
    """The positional encoding of vectors [n][m], [n][2·m·frequencies]: all sines, then all cosines."""
    angles = (vectors[:, :, None] * 2.0 ** np.arange(frequencies)).reshape(len(vectors), -1)
    return np.concatenate([np.sin(angles), np.cos(angles)], axis=1)
