"""The contents of a file as plain records, named as in the format. Lengths are in model units unless noted."""

import math
from dataclasses import dataclass, field
from typing import Dict, List, Optional, Tuple

import numpy as np

Vector = Tuple[float, float, float]
Quaternion = Tuple[float, float, float, float]  # x, y, z, w


@dataclass
class Frame:
    """Section 3.1: the map from dataset space to model space, and where rays begin and end."""

    scale: float
    rotation: Quaternion
    translation: Vector
    meters_per_unit: Optional[float]
    near: float
    far: float
    background: Vector  # red, green, blue in [0, 1]
    up: str
    color_space: str


@dataclass
class Rules:
    """Section 3.2: how the field is computed."""

    scales: int
    coverage: str  # all, any
    aggregation: str  # normalized, clamped
    density_reduction: str  # sum, mean
    appearance_reduction: str  # sum, mean
    bounds: Tuple[Vector, Vector]  # minimum and maximum corner
    density_shift: float
    distance_scale: float
    step: float
    min_transmittance: float
    min_weight: float
    shell: Optional[float] = None  # b of the contraction L∞; None without contraction
    sky: Optional[np.ndarray] = None  # float64[3][(L + 1)²], coefficients by channel (4.11); None without a sky

    @property
    def most_steps(self):
        """The steps on the longest ray (section 5), not rounded."""
        return (math.dist(*self.bounds) if self.shell is None else 4.0 * math.sqrt(3.0)) / self.step


@dataclass
class Provenance:
    """Section 3.4."""

    steps: int = 0
    seed: int = 0
    dataset: str = ""
    preset: str = ""
    tool: str = ""


@dataclass
class Quality:
    """Section 3.12: PSNR in dB, None if it was not measured."""

    encoding_psnr: Optional[float]
    test_psnr: Optional[float]
    original_test_psnr: Optional[float]
    prefix_psnr: List[Optional[float]]
    dataset: str


@dataclass
class Pose:
    """A camera's position, and its rotation from the camera's axes to those of model space."""

    position: Vector
    rotation: Quaternion


@dataclass
class Views:
    """Section 3.13: angle in radians, duration in seconds."""

    vertical_angle: float
    initial: Pose
    target: Vector
    duration: float
    closed: bool
    path: List[Pose]


@dataclass
class Thumbnail:
    """Section 3.14: an image file, never decoded here. Width and height in pixels are advisory."""

    format: str
    width: int
    height: int
    data: bytes


@dataclass
class Layer:
    """weights float32[outputs][inputs], bias float32[outputs]."""

    weights: np.ndarray
    bias: np.ndarray


@dataclass
class Decoder:
    """Section 3.5: the network from features and direction to color."""

    mode: str  # per sample, per ray, residual
    features: int  # P
    feature_frequencies: int
    direction_frequencies: int
    layers: List[Layer]


@dataclass
class Occupancy:
    """Section 3.6: bits uint8[ceil(XYZ/8)], packed as in the file."""

    corners: Tuple[Vector, Vector]
    vertices: Tuple[int, int, int]
    bits: np.ndarray


@dataclass
class Block:
    """Section 3.10: the components of one form of a scale's N tensors, zeros for a component that is not stored.

    Of three vectors, `axis` is None and `factors` has for each axis a the vectors float32[N][rank][D_a + 1]. Else the
    vectors lie along `axis`, and `factors` has them and the matrices over the axes b < c, float32[N][rank][D_c + 1][D_b + 1].
    """

    axis: Optional[int]
    factors: List[np.ndarray]

    @property
    def rank(self):
        return self.factors[0].shape[1]


@dataclass
class Scale:
    """Sections 3.7 to 3.10: the N tensors of one scale, in the canonical order of their centers over all chunks.

    centers float64[N][3], matrix float32[P][R].
    """

    top_k: int
    half_edges: np.ndarray  # float64[3]
    resolution: Tuple[int, int, int]
    chunks: int
    centers: np.ndarray
    density: List[Block]
    appearance: List[Block]
    matrix: np.ndarray


@dataclass
class Prefix:
    """Section 3.11: the correction of a scene of scales 0 to this one; matrix float32[P][sum of R]."""

    gain: float
    offset: float
    matrix: np.ndarray


@dataclass
class Probes:
    """Section 3.16: tolerances, and float64 arrays with one row for each probe."""

    color_tolerance: float
    depth_tolerance: float
    density_tolerance: float  # relative to max(1, |f|)
    origins: np.ndarray  # [n][3]
    directions: np.ndarray  # [n][3]
    colors: np.ndarray  # [n][3]
    opacities: np.ndarray  # [n]
    depths: np.ndarray  # [n]
    points: np.ndarray  # [n][3]
    densities: np.ndarray  # [n], the density feature at the point
    margins: np.ndarray  # [n], the decision margin


@dataclass
class Camera:
    """Section 3.17: focal length and principal point (x, y) and size (width, height) in pixels; a projection and the
    coefficients of its distortion."""

    pose: Pose
    focal_length: Tuple[float, float]
    principal_point: Tuple[float, float]
    size: Tuple[int, int]
    projection: str  # perspective, fisheye, equirectangular
    radial: Tuple[float, float, float, float]  # a
    divisor: Tuple[float, float, float]  # b
    tangential: Tuple[float, float]  # t
    prism: Tuple[float, float]  # s


@dataclass
class SkippedSection:
    """An ancillary section that was taken as absent, and the `StrivecError` for which it cannot be used."""

    name: str
    error: Exception

    def __str__(self):
        return f"section {self.name} is skipped: {self.error}"


@dataclass
class UnknownSection:
    """An ancillary section of a kind that version 1.0 does not define; `payload` as it is in the file."""

    kind: str
    scale: int
    chunk: int
    codec: int
    decoded_length: int
    payload: bytes


@dataclass
class Scene:
    """All that a file holds."""

    minor_version: int
    frame: Frame
    rules: Rules
    provenance: Provenance
    license: Optional[str]
    quality: Optional[Quality]
    views: Optional[Views]
    thumbnail: Optional[Thumbnail]
    decoder: Decoder
    occupancy: Optional[Occupancy]
    scales: List[Scale]
    prefixes: Dict[int, Prefix]  # by the last scale of the prefix
    probes: Optional[Probes]
    cameras: List[Camera]
    notes: Dict[str, str]
    unknown: List[UnknownSection] = field(default_factory=list)
    skipped: List[SkippedSection] = field(default_factory=list)
