"""The field of a scene, and the march along a ray (section 4 of the format), in float64.

Written to be compared with, not to be fast: a ray meets the tensors whose boxes it touches, and each of its samples is
compared with all of those. Points are in model space, lengths in model units.
"""

from collections import namedtuple

import numpy as np

PAIRS = 1 << 22  # samples times tensors that are compared at a time
ROUNDING = 1e-9  # of a tensor's half edges: by how much boxes grow when a ray's tensors are looked up

Rays = namedtuple("Rays", "colours opacities depths")
Field = namedtuple("Field", "inside densities features")


def trace(scene, origins, directions):
    """The pixels of rays: colours float64[n][3], opacities and depths float64[n].

    origins and directions are float64[n][3], the directions of length 1.
    """
    rays = [_march(scene, origin, direction) for origin, direction in zip(origins, directions)]
    colours, opacities, depths = zip(*rays) if rays else ([], [], [])
    return Rays(np.array(colours).reshape(-1, 3), np.array(opacities), np.array(depths))


def density_features(scene, points):
    """The density feature f at each point, float64[n]; 0 where no scale has a tensor that covers it."""
    tensors = [np.arange(len(scale.centres)) for scale in scene.scales]
    return evaluate(scene, np.asarray(points, np.float64), tensors).densities


def _march(scene, origin, direction):
    """Colour, opacity and depth of one ray."""
    rules, frame = scene.rules, scene.frame
    background = np.array(frame.background, np.float64)
    enter, leave = _slab(np.array(rules.bounds[0]), np.array(rules.bounds[1]), origin, direction)
    first, last = max(enter, frame.near), min(leave, frame.far)
    if not first < last:
        return background, 0.0, 0.0
    distances = first + np.arange(int((last - first) / rules.step) + 2) * rules.step
    distances = distances[distances < last]
    points = origin + distances[:, None] * direction

    field = evaluate(scene, points, [_touched(scale, origin, direction) for scale in scene.scales])
    counts = field.inside
    if scene.occupancy is not None:
        counts = counts & (occupancy(scene.occupancy, points) > 0.0)
    distances, densities, features = distances[counts], field.densities[counts], field.features[counts]

    density = np.logaddexp(0.0, densities + rules.density_shift)
    alpha = -np.expm1(-density * rules.step * rules.distance_scale)
    after = np.cumprod(1.0 - alpha)
    ended = np.flatnonzero(after < rules.smallest_transmittance)
    samples = slice(0, ended[0] + 1 if len(ended) else len(after))
    before = np.concatenate([[1.0], after])[:-1]
    weights = (before * alpha)[samples]
    transmittance = after[samples][-1] if len(after) else 1.0
    total = weights.sum()
    depth = weights @ distances[samples] / total if total > 0.0 else 0.0

    coloured = weights > rules.smallest_weight
    weights, features = weights[coloured], features[samples][coloured]
    colour = transmittance * background
    if len(weights) and scene.decoder.mode == "per sample":
        colour = colour + weights @ _sigmoid(decode(scene.decoder, features, direction))
    elif len(weights):
        total = weights.sum()
        of_ray = decode(scene.decoder, (weights @ features / total)[None], direction)
        if scene.decoder.mode == "per ray":
            colour = colour + total * _sigmoid(of_ray)[0]
        else:
            colour = colour + weights @ _sigmoid(features[:, :3] + of_ray)
    return colour, 1.0 - transmittance, depth


def _slab(smallest, largest, origin, direction):
    """Where a ray enters and leaves boxes, each float64[...] for corners float64[...][3]; enter > leave for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (smallest - origin) / direction
        high = (largest - origin) / direction
    parallel = direction == 0.0
    within = (smallest <= origin) & (origin <= largest)
    enter = np.where(parallel, np.where(within, -np.inf, np.inf), np.minimum(low, high))
    leave = np.where(parallel, np.where(within, np.inf, -np.inf), np.maximum(low, high))
    return enter.max(axis=-1), leave.min(axis=-1)


def _touched(scale, origin, direction):
    """The numbers of the tensors whose boxes the ray's line touches, ascending."""
    half_edges = scale.half_edges * (1.0 + ROUNDING) + ROUNDING
    enter, leave = _slab(scale.centres - half_edges, scale.centres + half_edges, origin, direction)
    return np.flatnonzero(enter <= leave)


def evaluate(scene, points, tensors):
    """Coverage, density feature f and features F of points float64[n][3], from these tensors of each scale alone.

    inside bool[n], densities float64[n], features float64[n][P]; zeros where no scale covers the point.
    """
    rules = scene.rules
    covering = np.zeros(len(points), np.int64)  # scales that cover the point
    densities = np.zeros(len(points))
    features = np.zeros((len(points), scene.decoder.features))
    for scale, numbers in zip(scene.scales, tensors):
        batch = max(1, PAIRS // max(1, len(numbers)))
        for start in range(0, len(points), batch):
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
    """Whether the scale covers each point, its density feature and its appearance components, float64[n][R]."""
    count = len(points)
    offsets = points[:, None, :] - scale.centres[numbers]  # [n][tensors][3]
    covers = (np.abs(offsets) <= scale.half_edges).all(axis=2)
    distances = np.where(covers, np.sqrt((offsets**2).sum(axis=2)), np.inf)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, : scale.neighbours]
    distances = np.take_along_axis(distances, nearest, axis=1)  # [n][neighbours], inf where there are fewer
    weights = _weights(rules.aggregation, distances)

    point, neighbour = np.nonzero(np.isfinite(distances))
    tensor = numbers[nearest[point, neighbour]]
    weight = weights[point, neighbour]
    local = points[point] - scale.centres[tensor]
    density = np.zeros(count)
    np.add.at(density, point, weight * _components(scale, scale.density, tensor, local).sum(axis=1))
    appearance = np.zeros((count, scale.appearance[0].shape[1]))
    np.add.at(appearance, point, weight[:, None] * _components(scale, scale.appearance, tensor, local))
    return covers.any(axis=1), density, appearance


def _weights(aggregation, distances):
    """The weights of neighbours, float64[n][neighbours], from their distances, inf for a neighbour that is not there."""
    if aggregation == "clamped":
        inverse = 1.0 / (distances + 1e-6)
        return inverse / np.maximum(inverse.sum(axis=1, keepdims=True), 1.0)
    at_centre = distances == 0.0
    inverse = 1.0 / np.where(at_centre, 1.0, distances)
    total = inverse.sum(axis=1, keepdims=True)
    weights = inverse / np.where(total > 0.0, total, 1.0)
    return np.where(at_centre.any(axis=1, keepdims=True), at_centre.astype(np.float64), weights)


def _components(scale, factors, tensor, local):
    """The components of tensors at points, float64[n][rank]; `local` float64[n][3] is from the tensor's centre."""
    product = 1.0
    for axis, (vectors, half_edge, cells) in enumerate(zip(factors, scale.half_edges, scale.resolution)):
        u = (local[:, axis] + half_edge) / (2.0 * half_edge) * cells
        i = np.clip(np.floor(u).astype(np.int64), 0, cells - 1)
        fraction = (u - i)[:, None]
        low, high = vectors[tensor, :, i].astype(np.float64), vectors[tensor, :, i + 1].astype(np.float64)
        product = product * ((1.0 - fraction) * low + fraction * high)
    return product


def occupancy(grid, points):
    """The trilinear interpolation of a grid's bits at points, float64[n]; 0 outside its box."""
    smallest, largest = np.array(grid.corners)
    vertices = np.array(grid.vertices)
    u = (points - smallest) / (largest - smallest) * (vertices - 1)
    i = np.clip(np.floor(u).astype(np.int64), 0, vertices - 2)
    fraction = u - i
    value = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (i + corner).T
        bit = (z * vertices[1] + y) * vertices[0] + x
        value += np.where(corner, fraction, 1.0 - fraction).prod(axis=1) * (grid.bits[bit // 8] >> (bit % 8) & 1)
    inside = ((smallest <= points) & (points <= largest)).all(axis=1)
    return np.where(inside, value, 0.0)


def decode(decoder, features, direction):
    """The network's outputs float64[n][3], before the sigmoid, for features float64[n][P] seen along one direction."""
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
    """The positional encoding of vectors [n][m], [n][2 m frequencies]: all sines, then all cosines."""
    angles = (vectors[:, :, None] * 2.0 ** np.arange(frequencies)).reshape(len(vectors), -1)
    return np.concatenate([np.sin(angles), np.cos(angles)], axis=1)
