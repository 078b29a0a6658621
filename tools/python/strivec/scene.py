"""Scenes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from ._arrays import to_numpy
from ._strivec import NativeRenderer, NativeScene
from .camera import Camera
from .errors import RunError

if TYPE_CHECKING:
    from numpy import float32
    from numpy.typing import NDArray

Path = Union[str, "os.PathLike[str]"]
Color = Sequence[float]

DESCRIPTION = "description"
"""The key of what is not an array in `Scene.to_arrays`."""


@dataclass(frozen=True)
class Picture:
    """Pixels of a picture, [height][width], or of rays, [n]."""

    color: NDArray[float32]
    """[…][3], sRGB, composited on the background."""
    opacity: NDArray[float32]
    """1 − the transmittance at the end of the ray; 1 in scenes with a sky, as that belongs to the picture."""
    depth: NDArray[float32]
    """The expected distance along the ray; 0 where there is nothing."""

    def on(self, background: Color, before: Color) -> Picture:
        """The picture on another background than `before`."""
        change = to_numpy(background, "float32") - to_numpy(before, "float32")
        return Picture(self.color + (1.0 - self.opacity)[..., None] * change, self.opacity, self.depth)

    def to_uint8(self) -> NDArray[Any]:
        """The colors as bytes, for Pillow, imageio or OpenCV."""
        return (self.color.clip(0.0, 1.0) * 255.0 + 0.5).astype("uint8")


class Scene:
    """A radiance field: what a `.strivec` file holds.

    A scene never changes; edits return another. Points, rays, cameras and depths are in the space of the dataset's cameras, or in
    model space, that of the arrays, with `space="model"`. Work is done on all cores, and other threads of Python go on meanwhile.
    In a process that was forked after the first use, it raises a RunError: forks copy no threads.
    """

    _native: NativeScene

    def __init__(self, native: NativeScene) -> None:
        self._native = native
        self._renderers: Dict[Tuple[str, str], NativeRenderer] = {}
        self._description: Optional[Dict[str, Any]] = None

    # Files

    @classmethod
    def load(cls, path: Path, max_memory: Optional[int] = None) -> Scene:
        """The scene in the file `path`. What is decoded takes at most `max_memory` bytes; by default 512 MiB and 64 bytes for each of
        the file's, at most 4 GiB."""
        return cls(NativeScene.read(os.fspath(path), max_memory))

    @classmethod
    def loads(cls, data: bytes, max_memory: Optional[int] = None) -> Scene:
        """The scene in the bytes of a file."""
        return cls(NativeScene.decode(bytes(data), "scene in memory", max_memory))

    def save(self, path: Path, overwrite: bool = False) -> None:
        """Writes the file `path`, which is whole at any time: it appears, or is replaced, at the end."""
        self._native.write(os.fspath(path), overwrite)

    def dumps(self) -> bytes:
        """The bytes of the file. Those of a scene that was loaded are the file's own."""
        return self._native.bytes()

    def encoded(self, bits: int) -> Scene:
        """The scene with its factors as floats of 16 or 32 bits. `strivec.pack` makes smaller files."""
        return Scene(self._native.encoded(bits))

    # Contents

    def info(self) -> Dict[str, Any]:
        """The facts that `strivec info` prints: bytes, parameters, scales, sections and more."""
        return json.loads(self._native.info())

    @property
    def description(self) -> Dict[str, Any]:
        """All of the scene but its arrays: frame, bounds, rules, provenance, the shapes of its scales and of its decoder; and its license,
        views, cameras and notes."""
        if self._description is None:
            self._description = json.loads(self._native.description())
        return self._description

    @property
    def license(self) -> Optional[str]:
        """The terms of use of the scene, and its authors."""
        return self.description["license"]

    @property
    def notes(self) -> Dict[str, str]:
        """Keys and values that anyone may add."""
        return dict(self.description["notes"])

    @property
    def views(self) -> Optional[Dict[str, Any]]:
        """The first pose of a viewer, and a path of poses, in model space."""
        return self.description["views"]

    @property
    def thumbnail(self) -> Optional[Tuple[str, bytes]]:
        """The format, "png" or "jpeg", and the bytes of a small picture. They are as untrusted as the file."""
        return self._native.thumbnail()

    @property
    def background(self) -> Tuple[float, float, float]:
        """The color behind the scene, sRGB."""
        red, green, blue = self.description["frame"]["background"]
        return red, green, blue

    def with_parts(self, **parts: Any) -> Scene:
        """The scene with another `license` (str or None), other `notes` (a dictionary), other `views` or other `cameras` (as in
        `description`). All else stays as it is, byte for byte."""
        known = {name: self.description[name] for name in ("license", "views", "cameras", "notes")}
        unknown = set(parts) - set(known)
        if unknown:
            raise TypeError(f"a scene has no {', '.join(sorted(unknown))}; expected {', '.join(known)}")
        return Scene(self._native.with_parts(json.dumps({**known, **parts})))

    # Arrays

    def to_arrays(self) -> Dict[str, Any]:
        """The scene as arrays: for each scale S `scaleS_cells` u32[tensor][3] or `scaleS_centers` f64[tensor][3], `scaleS_density` and
        `scaleS_appearance` f32[tensor][vertex of x, then y, then z][component], `scaleS_matrix` f32[feature][component]; for each layer L
        `decoderL_weights` f32[output][input] and `decoderL_bias`; `occupancy` bool[z][y][x]; and the `description`. Arrays of f32 show
        the scene's own memory and cannot be written: copy them to change them."""
        return {**self._native.arrays(), DESCRIPTION: json.loads(self._native.description())}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Scene:
        """The scene of such arrays, which may be those of any library. Its file has floats of 16 bits where that loses nothing,
        else of 32."""
        description = arrays.get(DESCRIPTION)
        if description is None:
            raise TypeError(f"the arrays need a {DESCRIPTION}, as `to_arrays` gives it")
        native = {name: to_numpy(array, _dtype(name)) for name, array in arrays.items() if name != DESCRIPTION}
        return cls(NativeScene.assemble(json.dumps(description), native))

    # Queries

    def density(self, points: Any, space: str = "dataset") -> NDArray[float32]:
        """The densities σ at `points` [n][3], f32[n]: 0 outside of the scene. As in the format, an optical depth is σ times
        `description["rules"]["distance_scale"]` times a length in model units."""
        return self._native.densities(to_numpy(points, "float64"), _in_dataset(space))

    def features(self, points: Any, space: str = "dataset") -> NDArray[float32]:
        """The appearance features at `points` [n][3], f32[n][P]: zeros outside of the scene."""
        return self._native.features(to_numpy(points, "float64"), _in_dataset(space))

    # Pictures

    @property
    def cameras(self) -> List[Camera]:
        """The cameras of the training photographs that the file names, in the space of the dataset."""
        import numpy as np

        frame = self.description["frame"]["model_from_dataset"]
        rotation, translation = _matrix(frame["rotation"]), np.array(frame["translation"])
        cameras = []
        for camera in self.description["cameras"]:
            axes = rotation.T @ _matrix(camera["pose"]["rotation"])
            position = rotation.T @ (np.array(camera["pose"]["position"]) - translation) / frame["scale"]
            pose = np.concatenate([axes, position[:, None]], axis=1)
            width, height = camera["size"]
            posed = Camera.from_pose(pose, (width, height), focal=1.0)
            cameras.append(
                Camera(posed.pose, posed.size, tuple(camera["focal"]), tuple(camera["principal"]), camera["lens"])
            )
        return cameras

    def render(
        self,
        camera: Camera,
        size: Optional[Tuple[int, int]] = None,
        background: Optional[Color] = None,
        backend: str = "cpu",
        approximation: Optional[Mapping[str, Any]] = None,
        space: str = "dataset",
    ) -> Picture:
        """The picture of `camera`, at another `size` (width, height) if one is given, on another `background`.

        `backend` is cpu, gpu or reference. `approximation` trades exactness for speed, as in the file's render settings: for
        example {"step_scale": 2.0, "min_weight": 0.01}.
        """
        if size is not None:
            camera = camera.resized(*size)
        lens = None if camera.lens is None else json.dumps(camera.lens)
        pose = [number for row in camera.pose for number in row]
        arguments = (pose, camera.size, camera.focal, camera.principal, lens, _in_dataset(space))
        picture = Picture(*self._renderer(backend, approximation).render(*arguments))
        return picture if background is None else picture.on(background, self.background)

    def render_path(self, cameras: Iterable[Camera], **options: Any) -> Iterator[Picture]:
        """The pictures of `cameras`, one after the other, with the options of `render`."""
        for camera in cameras:
            yield self.render(camera, **options)

    def trace(
        self,
        origins: Any,
        directions: Any,
        background: Optional[Color] = None,
        backend: str = "cpu",
        approximation: Optional[Mapping[str, Any]] = None,
        space: str = "dataset",
    ) -> Picture:
        """The pixels of rays with these `origins` and unit `directions`, [n][3]."""
        rays = to_numpy(origins, "float64"), to_numpy(directions, "float64")
        pixels = Picture(*self._renderer(backend, approximation).trace(*rays, _in_dataset(space)))
        return pixels if background is None else pixels.on(background, self.background)

    def _renderer(self, backend: str, approximation: Optional[Mapping[str, Any]]) -> NativeRenderer:
        """A renderer, which is prepared once."""
        key = (backend, json.dumps(dict(approximation or {}), sort_keys=True))
        if key not in self._renderers:
            self._renderers[key] = NativeRenderer(self._native, *key)
        return self._renderers[key]

    # Display

    def __repr__(self) -> str:
        facts = self.info()
        scales = " + ".join(str(scale["tensors"]) for scale in facts["scales"])
        return f"<strivec.Scene: {scales} tensors, {facts['nonzero_parameters']:,} parameters, {facts['bytes']:,} bytes>"

    def _repr_html_(self) -> str:
        from .notebook import summary

        return summary(self)

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Dict[str, Any]:
        """In Jupyter, the web player if it can be shown, else the thumbnail and the facts."""
        bundle: Dict[str, Any] = {"text/plain": repr(self), "text/html": self._repr_html_()}
        try:
            shown = self.widget()._repr_mimebundle_()
        except RunError:
            return bundle
        # Depending on its version, a widget also returns metadata.
        return {**bundle, **(shown[0] if isinstance(shown, tuple) else shown or {})}

    def widget(self, height: int = 480) -> Any:
        """The web player as a widget for notebooks; needs the package anywidget."""
        from .notebook import widget

        return widget(self, height)

    def publish(self, output: Path, title: Optional[str] = None, overwrite: bool = False) -> Any:
        """Writes the scene with the web player: as one HTML file, which opens from disk, if the name of `output` ends in .html, else as a
        folder for any web server. `overwrite` replaces only the file, or the files in the folder that an earlier call wrote. Returns the
        page's path."""
        from .publish import publish

        return publish(self, output, title, overwrite)

    def __eq__(self, other: object) -> bool:
        return self.dumps() == other.dumps() if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.dumps())

    def __reduce__(self) -> Tuple[Any, ...]:
        return Scene.loads, (self.dumps(),)


def _in_dataset(space: str) -> bool:
    if space not in ("dataset", "model"):
        raise ValueError(f'space must be "dataset" or "model"; found {space!r}')
    return space == "dataset"


def _dtype(name: str) -> str:
    """The type of the numbers of the array `name`."""
    if name == "occupancy":
        return "bool"
    return {"cells": "uint32", "centers": "float64"}.get(name.rsplit("_", 1)[-1], "float32")


def _matrix(quaternion: Sequence[float]) -> NDArray[Any]:
    """The rotation matrix of a unit quaternion (x, y, z, w)."""
    import numpy as np

    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
