"""What this reader makes of files, for the conformance suite (format-spec/conformance)."""

import zlib

import numpy as np

from . import reader
from .errors import StrivecError
from .field import density_features, trace

TRACED = 4  # rays of a file that are traced, at most
CLEAR = 2e-4  # decision margin that no rounding reaches, in model units


def conform(paths, budget):
    """A row for each file, as the suite's README describes it."""
    return [_row(path, budget) for path in paths]


def _row(path, budget):
    try:
        scene = reader.open(path, budget)
    except StrivecError as error:
        return {"file": path, "class": error.name, "skipped": [], "numbers": None}
    skipped = [[skipped.name, skipped.error.name] for skipped in scene.skipped]
    return {"file": path, "class": None, "skipped": skipped, "numbers": _numbers(scene)}


def _numbers(scene):
    rules, occupancy = scene.rules, scene.occupancy
    layers = [array for layer in scene.decoder.layers for array in (layer.weights, layer.bias)]
    return {
        "bounds": [list(corner) for corner in rules.bounds],
        "step": rules.step,
        "scales": [_scale(scale) for scale in scene.scales],
        "decoder": _checksum(layers, "<f4"),
        "occupancy": None if occupancy is None else _checksum([occupancy.bits], "u1"),
        "probes": _probes(scene),
    }


def _scale(scale):
    return {
        "tensors": len(scale.centers),
        "resolution": [int(cells) for cells in scale.resolution],
        "ranks": [sum(block.rank for block in blocks) for blocks in (scale.density, scale.appearance)],
        "centers": _checksum([scale.centers], "<f8"),
        "density": _factors(scale.density),
        "appearance": _factors(scale.appearance),
        "matrix": _checksum([scale.matrix], "<f4"),
    }


def _factors(blocks):
    """The checksum of [block][tensor][row][component]."""
    rows = lambda array: array.reshape(*array.shape[:2], -1).transpose(0, 2, 1)
    return _checksum([np.concatenate([rows(array) for array in block.factors], axis=1) for block in blocks], "<f4")


def _checksum(arrays, kind):
    checksum = 0
    for array in arrays:
        checksum = zlib.crc32(np.ascontiguousarray(array, kind).tobytes(), checksum)
    return checksum


def _probes(scene):
    if scene.probes is None:
        return []
    clear = np.flatnonzero(scene.probes.margins > CLEAR)[:TRACED]
    rays = trace(scene, scene.probes.origins[clear], scene.probes.directions[clear])
    features = density_features(scene, scene.probes.points[clear])
    return [
        {
            "probe": int(probe),
            "color": [float(c) for c in rays.colors[n]],
            "opacity": float(rays.opacities[n]),
            "depth": float(rays.depths[n]),
            "feature": float(features[n]),
        }
        for n, probe in enumerate(clear)
    ]
