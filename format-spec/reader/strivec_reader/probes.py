"""The probes of a file (section 3.16 of the format): whether this reader computes the pixels that the writer stored."""

import time
from collections import namedtuple

import numpy as np

from .errors import BudgetExceeded
from .field import Rays, density_features, trace

MIN_MARGIN = 2e-6  # model units; probes with a smaller decision margin are not compared (4.10)

# `traced` is the number of probes that the time sufficed for, or that have a small margin. `compared` is the number of `probes` with a margin above MIN_MARGIN. color, opacity, depth and density are the largest
# differences of these, that of the density feature f relative to max(1, |f|). `failed` lists the indices of the probes
# out of tolerance.
Report = namedtuple("Report", "probes traced compared color opacity depth density failed")


def check_probes(scene, budget=None, seconds=None):
    """The `Report` of a scene's probes, or None if it has none. Ends after `seconds`; raises BudgetExceeded if a ray takes more
    than `budget` bytes."""
    probes = scene.probes
    if probes is None:
        return None
    widths = scene.decoder.features + sum(sum(layer.weights.shape) for layer in scene.decoder.layers)
    needed = int(8 * (scene.rules.most_steps + 1.0) * (widths + 32))
    if budget is not None and needed > budget:
        raise BudgetExceeded("a ray of a probe", needed, budget)
    deadline = None if seconds is None else time.monotonic() + seconds
    wanted = np.flatnonzero(probes.margins > MIN_MARGIN)
    traced = []
    try:
        for probe in wanted:
            traced.append(trace(scene, probes.origins[[probe]], probes.directions[[probe]], deadline))
    except TimeoutError:
        pass
    compared = wanted[: len(traced)]
    rays = Rays(*(np.concatenate(part) for part in zip(*traced))) if traced else trace(scene, [], [])
    stored = probes.densities[compared]
    color = np.abs(rays.colors - probes.colors[compared]).max(axis=1, initial=0.0)
    opacity = np.abs(rays.opacities - probes.opacities[compared])
    depth = np.abs(rays.depths - probes.depths[compared])
    density = density_features(scene, probes.points[compared]) - stored
    density = np.abs(density) / np.maximum(1.0, np.abs(stored))
    holds = (
        (np.maximum(color, opacity) <= probes.color_tolerance)
        & (depth <= probes.depth_tolerance)
        & (density <= probes.density_tolerance)
    )
    largest = [float(difference.max(initial=0.0)) for difference in (color, opacity, depth, density)]
    traced = len(probes.margins) - (len(wanted) - len(compared))
    return Report(len(probes.margins), traced, len(compared), *largest, [int(probe) for probe in compared[~holds]])
