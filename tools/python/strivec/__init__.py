"""Strivec: sparse tri-vector radiance fields.

    scene = strivec.Scene.load("lego.strivec")
    camera = strivec.Camera.look_at((2, 2, 2), (0, 0, 0), size=(400, 400))
    picture = scene.render(camera)            # picture.color: float32[400][400][3]
    sigma = scene.density([[0.1, 0.2, 0.3]])  # float32[1]

    strivec.train("lego", "lego.strivec", preset="24", callback=print)
    strivec.evaluate("lego.strivec", "lego", split="test")
"""

from . import errors
from ._strivec import VERSION as __version__
from .camera import Camera
from .commands import (
    Message,
    Progress,
    command,
    compare,
    dataset,
    evaluate,
    export,
    import_checkpoint,
    pack,
    plan,
    pose,
    prior,
    settings,
    settings_toml,
    shrink,
    trade,
    train,
    verify,
)
from .errors import (
    DiffersError,
    Error,
    InputError,
    InternalError,
    MalformedError,
    MemoryLimitError,
    RunError,
    UnsupportedError,
    UsageError,
)
from .scene import Picture, Scene

__all__ = [
    "Camera",
    "DiffersError",
    "Error",
    "InputError",
    "InternalError",
    "MalformedError",
    "MemoryLimitError",
    "Message",
    "Picture",
    "Progress",
    "RunError",
    "Scene",
    "UnsupportedError",
    "UsageError",
    "command",
    "compare",
    "dataset",
    "errors",
    "evaluate",
    "export",
    "import_checkpoint",
    "pack",
    "plan",
    "pose",
    "prior",
    "settings",
    "settings_toml",
    "shrink",
    "trade",
    "train",
    "verify",
]
