"""A reader of .strivec scenes, written from the text of the format alone.

    scene = strivec.open("lego.strivec")            # a strivec.scene.Scene, or a strivec.StrivecError
    report = strivec.check_probes(scene)            # compares the file's stored rays with this reader's
    rays = strivec.trace(scene, origins, directions)  # color, opacity and depth in float64
"""

from .errors import (
    Corrupt,
    LineEndingDamage,
    Malformed,
    MissingSection,
    InvalidScene,
    NotStrivec,
    LimitExceeded,
    BudgetExceeded,
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
