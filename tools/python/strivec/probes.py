"""The probes of a file (section 3.16 of the format): whether this reader computes the pixels that the writer stored."""

from collections import namedtuple

import numpy as np

from .field import density_features, trace

MIN_MARGIN = 2e-6  # model units; probes with a smaller decision margin are not compared (4.10)

# `compared` is the number of `probes` with a margin above MIN_MARGIN. color, opacity, depth and density are the largest
# differences of these, that of the density feature f relative to max(1, |f|). `failed` lists the indices of the probes
# out of tolerance.
Report = namedtuple("Report", "probes compared color opacity depth density failed")


def check_probes(scene):
    """The `Report` of a scene's probes, or None if it has none."""
    probes = scene.probes
    if probes is None:
        return None
    compared = np.flatnonzero(probes.margins > MIN_MARGIN)
    rays = trace(scene, probes.origins[compared], probes.directions[compared])
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
    return Report(len(probes.margins), len(compared), *largest, [int(probe) for probe in compared[~holds]])
