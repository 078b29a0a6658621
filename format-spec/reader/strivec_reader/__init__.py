"""A reader of .strivec scenes, written from the text of the format alone.

    scene = strivec_reader.open("lego.strivec")              # a scene.Scene; raises StrivecError
    report = strivec_reader.check_probes(scene)              # compares the file's stored rays with this reader's
    rays = strivec_reader.trace(scene, origins, directions)  # color, opacity and depth in float64
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
