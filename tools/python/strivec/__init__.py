"""A reader of .strivec scenes, made from the format's text alone.

    scene = strivec.open("lego.strivec")            # a strivec.scene.Scene, or a strivec.StrivecError
    report = strivec.check_probes(scene)            # how far the rays that the file holds are from what they should be
    rays = strivec.trace(scene, origins, directions)  # colour, opacity and depth in float64
"""

from .errors import (
    Corrupt,
    LineEndings,
    Malformed,
    MissingSection,
    NotAScene,
    NotStrivec,
    OutOfRange,
    OverBudget,
    StrivecError,
    Truncated,
    UnknownCritical,
    Unsupported,
    UnsupportedVersion,
)
from .field import density_features, trace
from .probes import check_probes
from .reader import open, read
from .scene import Scene
