"""Cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Dict, Optional, Sequence, Tuple

Vector = Sequence[float]


@dataclass(frozen=True)
class Camera:
    """A camera with a lens.

    `pose` is the 4×4 camera-to-world matrix by rows; the camera looks along -z, y is up (OpenGL, Blender). `size` is (width,
    height), and `focal` and `principal` are (x, y), in pixels from the top left corner. `lens` is a projection and a distortion as
    in a scene's description; None for a pinhole.
    """

    pose: Tuple[Tuple[float, ...], ...]
    size: Tuple[int, int]
    focal: Tuple[float, float]
    principal: Tuple[float, float]
    lens: Optional[Dict[str, Any]] = None

    @classmethod
    def from_pose(
        cls,
        pose: Any,
        size: Tuple[int, int],
        focal: Optional[float] = None,
        angle_x: Optional[float] = None,
    ) -> Camera:
        """The pinhole camera of a 4×4 or 3×4 camera-to-world matrix, its focal length in pixels or from the horizontal angle of view in
        radians, as `camera_angle_x` of transforms.json."""
        from ._arrays import to_numpy

        matrix = to_numpy(pose, "float64")
        if matrix.shape not in ((4, 4), (3, 4)):
            raise ValueError(f"a pose must be a 4×4 or a 3×4 matrix; found the shape {matrix.shape}")
        if (focal is None) == (angle_x is None):
            raise ValueError("give either focal or angle_x")
        width, height = size
        if focal is None:
            assert angle_x is not None
            focal = 0.5 * width / math.tan(0.5 * angle_x)
        rows = tuple(tuple(float(number) for number in row) for row in matrix[:3]) + ((0.0, 0.0, 0.0, 1.0),)
        return cls(rows, (width, height), (focal, focal), (0.5 * width, 0.5 * height))

    @classmethod
    def look_at(
        cls,
        position: Vector,
        target: Vector,
        size: Tuple[int, int],
        angle_x: float = 0.7,
        up: Vector = (0.0, 0.0, 1.0),
    ) -> Camera:
        """A pinhole camera at `position` that looks at `target`, with a horizontal angle of view in radians."""
        import numpy as np

        eye, center, upward = (np.asarray(vector, dtype="float64") for vector in (position, target, up))
        back = eye - center
        right = np.cross(upward, back)
        if not np.linalg.norm(right) > 0.0:
            raise ValueError("position and target must differ, and up must not be along the line of sight")
        back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
        pose = np.stack([right, np.cross(back, right), back, eye], axis=1)
        return cls.from_pose(pose, size, angle_x=angle_x)

    def resized(self, width: int, height: int) -> Camera:
        """The same view with other numbers of pixels."""
        x, y = width / self.size[0], height / self.size[1]
        return replace(
            self,
            size=(width, height),
            focal=(x * self.focal[0], y * self.focal[1]),
            principal=(x * self.principal[0], y * self.principal[1]),
        )
