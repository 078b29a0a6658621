"""The sections without factors (sections 3.1 to 3.6 and 3.11 to 3.18 of the format): a `Payload` to its contents."""

import math

import numpy as np

from . import adaptive, arrays, limits
from .errors import InvalidScene, Malformed, Unsupported
from .record import Record
from .scene import (
    Camera,
    Decoder,
    Frame,
    Layer,
    Occupancy,
    Pose,
    Prefix,
    Probes,
    Provenance,
    Quality,
    Rules,
    Thumbnail,
    Views,
)

UPS = ("+x", "+y", "+z", "-x", "-y", "-z")
POSE = 56  # bytes
PROBE = 144  # bytes
CAMERA = 192  # bytes
PROJECTIONS = ("perspective", "fisheye", "equirectangular")


def read_frame(payload):
    """Section 3.1."""
    record = payload.record
    record.check_codes([(100, "up axis", range(len(UPS))), (101, "color space", range(1))])
    scale = record.f64("scale", "a positive finite number")
    rotation = record.quaternion("rotation")
    translation = record.f64s(3, "translation")
    meters_per_unit = record.f64_unless_zero("meters per unit", "a positive finite number")
    near = record.f64("near", "a number of at least 0")
    far = record.f64("far")
    record.require(far > near, "far", f"more than near, {near}", far)
    background = record.f32s(3, "background")
    for value in background:
        record.require(0.0 <= value <= 1.0, "background", "a number in [0, 1]", value)
    up = record.code("up", UPS)
    color_space = record.code("color space", ("sRGB",))
    payload.end()
    return Frame(scale, rotation, translation, meters_per_unit, near, far, background, up, color_space)


def read_rules(payload):
    """Section 3.2."""
    record = payload.record
    names = ("coverage", "aggregation", "density reduction", "appearance reduction", "contraction")
    record.check_codes([(2 + n, name, range(2)) for n, name in enumerate(names)] + [(7, "sky", range(5))])
    scales = limits.check(record.u16("scales"), limits.SCALES, "RULES number of scales")
    if record.data[6:7] == b"\0":
        Record(record.data[96:104], record.place).zeros(8, "shell of the contraction")
    coverage = record.code("coverage", ("all", "any"))
    aggregation = record.code("aggregation", ("normalized", "clamped"))
    density_reduction = record.code("density reduction", ("sum", "mean"))
    appearance_reduction = record.code("appearance reduction", ("sum", "mean"))
    contraction = record.code("contraction", ("none", "L∞"))
    degree = record.code("sky", range(5))
    bounds = _read_box(record, "bounds")
    density_shift = record.f64("density shift")
    distance_scale = record.f64("distance scale", "a positive finite number")
    step = record.f64("step", "a positive finite number")
    steps = (4.0 * math.sqrt(3.0) if contraction == "L∞" else math.dist(*bounds)) / step
    limits.check(steps, limits.MARCH_STEPS, "RULES steps along the bounds' diagonal")
    min_transmittance = record.f64("minimum transmittance", "a number in [0, 1)")
    min_weight = record.f64("minimum weight", "a number in [0, 1)")
    shell = None
    if contraction == "none":
        record.take(8, "shell of the contraction")
    else:
        shell = record.f64("shell of the contraction")
        record.require(0.0 < shell <= 1.0, "shell of the contraction", "a number above 0, at most 1", shell)
        expected = ((-1.0 - shell,) * 3, (1.0 + shell,) * 3)
        record.require(tuple(map(tuple, bounds)) == expected, "bounds", f"those of the contraction, {expected}", bounds)
    sky = None
    if degree > 0:
        terms = (degree + 1) ** 2
        sky = np.array(record.f32s(3 * terms, "coefficients of the sky")).reshape(3, terms)
        record.require(np.isfinite(sky).all(), "coefficients of the sky", "finite numbers", "another number")
    payload.end()
    return Rules(
        scales,
        coverage,
        aggregation,
        density_reduction,
        appearance_reduction,
        bounds,
        density_shift,
        distance_scale,
        step,
        min_transmittance,
        min_weight,
        shell,
        sky,
    )


def read_provenance(payload):
    """Section 3.4."""
    record = payload.record
    steps, seed = record.u64("training steps"), record.u64("seed")
    dataset, preset, tool = record.string("dataset"), record.string("preset"), record.string("tool")
    payload.end()
    return Provenance(steps, seed, dataset, preset, tool)


def read_license(payload):
    """Section 3.15."""
    license = payload.record.string("text", limits.TEXT)
    payload.end()
    return license


def read_quality(payload, scales):
    """Section 3.12, for a scene of `scales` scales."""
    record = payload.record
    encoding, test, original = (record.f64_unless_absent("PSNR") for _ in range(3))
    count = record.u64("number of prefixes")
    if count not in (0, scales):
        raise Malformed("QUALITY number of prefixes", f"0 or {scales}", count)
    prefixes = [record.f64_unless_absent("PSNR of a prefix") for _ in range(count)]
    dataset = record.string("dataset")
    payload.end()
    return Quality(encoding, test, original, prefixes, dataset)


def read_views(payload):
    """Section 3.13."""
    record = payload.record
    angle = record.f64("vertical angle of view", "an angle in (0, pi)")
    initial = _read_pose(record)
    target = record.f64s(3, "target")
    duration = record.f64("duration", "a positive finite number")
    closed = record.u8("closed")
    record.require(closed <= 1, "closed", "0 or 1", closed)
    count = record.u64("poses of the path", limits.ITEMS)
    payload.budget.take(8 * POSE * count, payload.name)
    path = [_read_pose(record) for _ in range(count)]
    payload.end()
    return Views(angle, initial, target, duration, closed == 1, path)


def read_thumbnail(payload):
    """Section 3.14."""
    record = payload.record
    record.check_codes([(0, "format", range(2))], [(1, 1)])
    format = record.code("format", ("PNG", "JPEG"))
    record.take(1, "reserved byte")
    width, height = record.u16("width"), record.u16("height")
    size = limits.check(payload.body_length, limits.THUMBNAIL, "THUMBNAIL bytes")
    payload.budget.take(size, payload.name)
    with payload.body(size) as body:
        return Thumbnail(format, width, height, bytes(body))


def read_decoder(payload):
    """Section 3.5."""
    record = payload.record
    record.check_codes([(0, "mode", range(3))])
    if len(record.data) >= 17:
        count = int.from_bytes(record.data[9:17], "little")
        if count <= limits.LAYERS[1]:
            arrays.check_head(record, 17 + 8 * count)
    mode = record.code("mode", ("per sample", "per ray", "residual"))
    feature_frequencies = record.u32("frequencies of features", limits.FREQUENCIES)
    direction_frequencies = record.u32("frequencies of the direction", limits.FREQUENCIES)
    count = record.u64("layers", limits.LAYERS)
    shapes = [record.u32s(2, f"width of layer {layer}", limits.LAYER_WIDTH) for layer in range(count)]
    for layer in range(1, count):
        expected, found = shapes[layer - 1][1], shapes[layer][0]
        record.require(found == expected, f"inputs of layer {layer}", expected, found)
    record.require(shapes[-1][1] == 3, "outputs of the last layer", 3, shapes[-1][1])
    direction = 3 * (1 + 2 * direction_frequencies)
    features, rest = divmod(shapes[0][0] - direction, 1 + 2 * feature_frequencies)
    fits = rest == 0 and limits.FEATURES[0] <= features <= limits.FEATURES[1]
    expected = f"{direction} plus 1 to 256 times {1 + 2 * feature_frequencies}"
    record.require(fits, "inputs of layer 0", expected, shapes[0][0])
    record.require(features >= 3 or mode != "residual", "features", "at least 3", features)
    head = arrays.read_head(record)

    lengths = np.concatenate([[inputs] * outputs + [outputs] for inputs, outputs in shapes])
    numbers = _read_array(payload, head, lengths)
    layers = []
    start = 0
    for inputs, outputs in shapes:
        middle, end = start + inputs * outputs, start + (inputs + 1) * outputs
        layers.append(Layer(numbers[start:middle].reshape(outputs, inputs), numbers[middle:end]))
        start = end
    return Decoder(mode, features, feature_frequencies, direction_frequencies, layers)


def read_occupancy(payload):
    """Section 3.6."""
    record = payload.record
    corners = _read_box(record, "box")
    vertices = record.u32s(3, "vertices", limits.OCCUPANCY_AXIS)
    total = limits.check(math.prod(vertices), limits.OCCUPANCY_VERTICES, "OCCUPANCY vertices")
    size = -(-total // 8)
    payload.budget.take(size, payload.name)
    with payload.body(size, adaptive=lambda data, _: adaptive.occupancy(data, vertices, payload.name)) as body:
        bits = np.frombuffer(body, np.uint8).copy()
    if total % 8 and bits[-1] >> (total % 8):
        raise Malformed("OCCUPANCY unused bits", "zeros", f"{bits[-1]:#04x} in the last byte")
    return Occupancy(corners, vertices, bits)


def read_matrix(payload, features, rank):
    """Section 3.8: float32[P][R], with P = `features` and R = `rank`."""
    record = payload.record
    arrays.check_head(record, 8)
    found_features = record.u32("features", limits.FEATURES)
    found = record.u32("appearance rank", limits.RANK)
    expected = f"{features}, by the inputs of the decoder"
    record.require(found_features == features, "features", expected, found_features)
    if found != rank:
        raise Malformed(f"{payload.name} appearance rank", rank, found)
    head = arrays.read_head(record)
    return _read_array(payload, head, np.full(features, rank)).reshape(features, rank)


def read_prefix(payload, features, ranks):
    """Section 3.11, for a prefix whose appearance ranks sum to `ranks`."""
    record = payload.record
    arrays.check_head(record, 24)
    gain = record.f64("gain", "a positive finite number")
    offset = record.f64("offset")
    found_features = record.u32("features", limits.FEATURES)
    found = record.u32("sum of appearance ranks", limits.RANK_SUM)
    if found_features != features:
        raise Malformed(f"{payload.name} features", features, found_features)
    if found != ranks:
        raise Malformed(f"{payload.name} sum of appearance ranks", ranks, found)
    head = arrays.read_head(record)
    matrix = _read_array(payload, head, np.full(features, ranks)).reshape(features, ranks)
    return Prefix(gain, offset, matrix)


def read_probes(payload, rules):
    """Section 3.16, in a scene of these rules."""
    record = payload.record
    rule = "a positive finite number"
    color, depth, density = (record.f64(f"tolerance of {what}", rule) for what in ("color", "depth", "density"))
    count = record.u64("number of probes", limits.ITEMS)
    payload.budget.take(PROBE * count, payload.name)
    with payload.body(PROBE * count) as body:
        reserved = np.frombuffer(body, "<u8").reshape(count, 18)[:, 16:]
        if reserved.any():
            raise Unsupported("PROBES reserved bytes", "a value other than 0")
        rows = np.frombuffer(body, "<f8").reshape(count, 18)[:, :16].astype(np.float64)
    if not np.isfinite(rows).all():
        raise InvalidScene("PROBES", "finite numbers", "another number")
    lengths = np.linalg.norm(rows[:, 3:6], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > 1e-6)
    if len(wrong):
        raise InvalidScene(f"PROBES direction of probe {wrong[0]}", "length 1", lengths[wrong[0]])
    wrong = np.flatnonzero(rows[:, 15] < 0.0)
    if len(wrong):
        raise InvalidScene(f"PROBES margin of probe {wrong[0]}", "a number of at least 0", rows[wrong[0], 15])
    steps = max(math.ceil(rules.most_steps), 1) * count
    limits.check(steps, limits.PROBE_STEPS, "PROBES times the steps on the longest ray")
    return Probes(
        color,
        depth,
        density,
        origins=rows[:, 0:3],
        directions=rows[:, 3:6],
        colors=rows[:, 6:9],
        opacities=rows[:, 9],
        depths=rows[:, 10],
        points=rows[:, 11:14],
        densities=rows[:, 14],
        margins=rows[:, 15],
    )


def read_cameras(payload):
    """Section 3.17."""
    count = payload.record.u64("number of cameras", limits.ITEMS)
    payload.budget.take(8 * CAMERA * count, payload.name)
    with payload.body(CAMERA * count) as data:
        for start in range(0, CAMERA * count, CAMERA):
            camera = Record(data[start : start + CAMERA], payload.name)
            camera.check_codes([(96, "projection", range(len(PROJECTIONS)))], [(97, 7)])
        body = Record(data, payload.name)
        return [_read_camera(body) for _ in range(count)]


def _read_camera(body):
    pose = _read_pose(body)
    focal_length = body.f64s(2, "focal length", "a positive finite number")
    principal_point = body.f64s(2, "principal point")
    size = tuple(body.u32(name) for name in ("width", "height"))
    body.require(min(size) > 0, "width and height", "at least 1", 0)
    projection = body.code("projection", PROJECTIONS)
    body.take(7, "reserved bytes")
    radial, divisor, tangential, prism = (body.f64s(count, "distortion") for count in (4, 3, 2, 2))
    return Camera(pose, focal_length, principal_point, size, projection, radial, divisor, tangential, prism)


def read_notes(payload):
    """Section 3.18."""
    count = payload.record.u64("number of notes", limits.ITEMS)
    size = limits.check(payload.body_length, limits.TEXT, "NOTES bytes of the body")
    payload.budget.take(8 * size, payload.name)
    with payload.body(size) as data:
        return _read_notes(Record(data, payload.name), count)


def _read_notes(body, count):
    notes = {}
    last = None
    for _ in range(count):
        key = body.string("key", limits.TEXT)
        if last is not None and key.encode() <= last.encode():
            raise Malformed("NOTES keys", "in strictly ascending order", f"{key!r} after {last!r}")
        notes[key] = body.string("value", limits.TEXT)
        last = key
    if body.offset != len(body.data):
        raise Malformed("NOTES bytes of the body", body.offset, len(body.data))
    return notes


def _read_box(record, name):
    box_min = record.f64s(3, f"{name} minimum corner")
    box_max = record.f64s(3, f"{name} maximum corner")
    for low, high in zip(box_min, box_max):
        record.require(low < high, f"{name} maximum corner", f"more than {low}", high)
    return box_min, box_max


def _read_pose(record):
    return Pose(record.f64s(3, "position"), record.quaternion("rotation"))


def _read_array(payload, head, lengths):
    """Reads an array that is the whole body of a section, float32[sum of lengths]."""
    total = int(lengths.sum())
    size = arrays.encoded_size(head, total, len(lengths))
    payload.budget.take(4 * total, payload.name)
    decoder = arrays.adaptive_decoder(head, [(1, [length]) for length in lengths.tolist()], None, payload.name)
    with payload.budget.borrow(arrays.TRANSIENT * total, payload.name), payload.body(size, adaptive=decoder) as body:
        return arrays.decode(head, body, lengths, payload.name)
