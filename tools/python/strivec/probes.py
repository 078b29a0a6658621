"""The probes of a file (section 3.16 of the format): whether this reader computes what the writer saw."""

from collections import namedtuple

import numpy as np

from .field import density_features, trace

SMALLEST_MARGIN = 2e-6  # model units; nearer to a jump of the field two implementations may rightly differ

# `compared` of `probes` were far enough from a jump. The largest differences in colour, opacity, depth and density
# feature (the latter relative to the larger of 1 and its size), and the numbers of the probes that are out of tolerance.
Report = namedtuple("Report", "probes compared colour opacity depth density failed")


def check_probes(scene):
    """The `Report` of a scene's probes, or None where it has none."""
    probes = scene.probes
    if probes is None:
        return None
    compared = np.flatnonzero(probes.margins > SMALLEST_MARGIN)
    rays = trace(scene, probes.origins[compared], probes.directions[compared])
    stored = probes.densities[compared]
    colour = np.abs(rays.colours - probes.colours[compared]).max(axis=1, initial=0.0)
    opacity = np.abs(rays.opacities - probes.opacities[compared])
    depth = np.abs(rays.depths - probes.depths[compared])
    density = density_features(scene, probes.points[compared]) - stored
    density = np.abs(density) / np.maximum(1.0, np.abs(stored))
    holds = (
        (np.maximum(colour, opacity) <= probes.colour_tolerance)
        & (depth <= probes.depth_tolerance)
        & (density <= probes.density_tolerance)
    )
    largest = [float(difference.max(initial=0.0)) for difference in (colour, opacity, depth, density)]
    return Report(len(probes.margins), len(compared), *largest, [int(probe) for probe in compared[~holds]])
