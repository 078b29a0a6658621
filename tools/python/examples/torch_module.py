"""A scene as a module of PyTorch, made from its arrays: it renders rays, trains on, and becomes a scene again.

    python torch_module.py lego.strivec tuned.strivec

The formulas are those of section 4 of the format. For bounded scenes without a sky; tensors are searched by brute force, so this is
for reading and for trying ideas, not for speed.
"""

from __future__ import annotations

import argparse
import math
from typing import Any, Dict, Tuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

import strivec


class Scale(nn.Module):
    """The tensors of one scale."""

    centers: Tensor
    half_edge: Tensor
    cells: Tensor

    def __init__(self, arrays: Dict[str, Any], s: int, dtype: torch.dtype) -> None:
        super().__init__()
        facts = arrays["description"]["scales"][s]
        if facts["lattice"] is not None:
            lattice = facts["lattice"]
            cells = arrays[f"scale{s}_cells"].astype("float64")
            centers = np.array(lattice["origin"]) + (cells + 0.5) * np.array(lattice["pitch"])
        else:
            centers = arrays[f"scale{s}_centers"]
        self.top_k = facts["top_k"]
        self.resolution = tuple(facts["resolution"])
        self.register_buffer("centers", torch.tensor(centers, dtype=dtype))
        self.register_buffer("half_edge", torch.tensor(facts["half"], dtype=dtype))
        self.register_buffer("cells", torch.tensor(self.resolution, dtype=dtype))

        # A component has three vectors (no suffix), or a vector along an axis and a matrix over the others.
        self.names = [f"scale{s}_{part}{axis}" for part in ("density", "appearance") for axis in ("", "_x", "_y", "_z")]
        self.names = [name for name in self.names if name in arrays]
        for name in [*self.names, f"scale{s}_matrix"]:
            self.register_parameter(name, nn.Parameter(torch.tensor(arrays[name], dtype=dtype)))
        self.s = s

    def neighbors(self, points: Tensor) -> Tuple[Tensor, Tensor]:
        """The nearest covering tensors of points [n][3] and their distances, [n][k]; infinite for missing ones (4.2)."""
        offsets = points[:, None] - self.centers
        covers = (offsets.abs() <= self.half_edge).all(-1)
        distances = torch.where(covers, offsets.square().sum(-1).sqrt(), torch.inf)
        # Of equally near tensors the first: the sort is stable.
        nearest = distances.sort(dim=1, stable=True)
        return nearest.indices[:, : self.top_k], nearest.values[:, : self.top_k]

    def components(self, part: str, tensors: Tensor, local: Tensor) -> Tensor:
        """The components of `tensors` [m] at places relative to their centers, [m][3] (4.3)."""
        places = (local + self.half_edge) / (2.0 * self.half_edge) * self.cells
        lower = places.floor().long().clamp(min=0)
        lower = torch.minimum(lower, self.cells.long() - 1)
        fractions = (places - lower)[..., None]
        x, y, z = (cells + 1 for cells in self.resolution)

        def vector(values: Tensor, axis: int, first: Any = 0) -> Tensor:
            """The vector along `axis` whose vertices begin at the row `first`."""
            low, high = (values[tensors, first + lower[:, axis] + n] for n in (0, 1))
            return low + fractions[:, axis] * (high - low)

        parts = []
        for name in self.names:
            if not name.startswith(f"scale{self.s}_{part}"):
                continue
            values = self.get_parameter(name)
            if name[-2] != "_":
                parts.append(vector(values, 0) * vector(values, 1, x) * vector(values, 2, x + y))
                continue
            axis = "xyz".index(name[-1])
            along = (x, y, z)[axis]
            first, second = (other for other in range(3) if other != axis)
            width = self.resolution[first] + 1
            rows = [vector(values, first, along + width * (lower[:, second] + n)) for n in (0, 1)]
            parts.append(vector(values, axis) * (rows[0] + fractions[:, second] * (rows[1] - rows[0])))
        return torch.cat(parts, dim=1)

    @property
    def matrix(self) -> Tensor:
        """[feature][component]"""
        return self.get_parameter(f"scale{self.s}_matrix")


class Decoder(nn.Module):
    """From features and direction to color (4.7)."""

    def __init__(self, arrays: Dict[str, Any], dtype: torch.dtype) -> None:
        super().__init__()
        facts = arrays["description"]["decoder"]
        self.frequencies = facts["feature_frequencies"], facts["direction_frequencies"]
        self.layers = nn.ModuleList()
        for layer in range(facts["layers"]):
            weights, bias = arrays[f"decoder{layer}_weights"], arrays[f"decoder{layer}_bias"]
            linear = nn.Linear(weights.shape[1], weights.shape[0], dtype=dtype)
            linear.weight.data = torch.tensor(weights, dtype=dtype)
            linear.bias.data = torch.tensor(bias, dtype=dtype)
            self.layers.append(linear)

    def forward(self, features: Tensor, directions: Tensor) -> Tensor:
        """The outputs before the sigmoid, [n][3]."""
        encoded = [self.encode(v, k) for v, k in zip((features, directions), self.frequencies)]
        values = torch.cat([features, directions, *encoded], dim=1)
        for layer in self.layers[:-1]:
            values = torch.relu(layer(values))
        return self.layers[-1](values)

    @staticmethod
    def encode(values: Tensor, frequencies: int) -> Tensor:
        """Sines of all frequencies, then cosines."""
        angles = (values[:, :, None] * 2.0 ** torch.arange(frequencies, dtype=values.dtype)).flatten(1)
        return torch.cat([angles.sin(), angles.cos()], dim=1)


class Scene(nn.Module):
    """A scene whose parameters can be trained."""

    def __init__(self, scene: strivec.Scene, dtype: torch.dtype = torch.float32) -> None:
        super().__init__()
        self.arrays = scene.to_arrays()
        description = self.arrays["description"]
        self.rules = description["rules"]
        if self.rules.get("contraction") is not None or self.rules.get("sky") is not None:
            raise NotImplementedError("this example is for bounded scenes without a sky")
        self.dtype = dtype
        self.scales = nn.ModuleList(Scale(self.arrays, s, dtype) for s in range(len(description["scales"])))
        self.decoder = Decoder(self.arrays, dtype)
        self.mode = description["decoder"]["mode"]
        self.frame = description["frame"]
        self.bounds = [torch.tensor(description["bounds"][end], dtype=dtype) for end in ("min", "max")]

    def evaluate(self, points: Tensor) -> Tuple[Tensor, Tensor, Tensor]:
        """At points [n][3] in model space: whether they are in the model, the density feature, the appearance features (4.1 to
        4.6)."""
        n = len(points)
        covering = torch.zeros(n, dtype=torch.long)
        density = torch.zeros(n, dtype=self.dtype)
        features = torch.zeros(n, len(self.scales[0].matrix), dtype=self.dtype)
        for scale in self.scales:
            tensors, distances = scale.neighbors(points)
            found = distances.isfinite()
            weights = self.weights(distances)[found]
            point, _ = found.nonzero(as_tuple=True)
            local = points[point] - scale.centers[tensors[found]]
            at = lambda part: weights[:, None] * scale.components(part, tensors[found], local)
            covering += found.any(1)
            density = density.index_add(0, point, at("density").sum(1))
            components = torch.zeros(n, scale.matrix.shape[1], dtype=self.dtype).index_add(0, point, at("appearance"))
            features = features + components @ scale.matrix.T
        number = covering.clamp(min=1)
        if self.rules["density_reduction"] == "mean":
            density = density / number
        if self.rules["appearance_reduction"] == "mean":
            features = features / number[:, None]
        inside = covering == len(self.scales) if self.rules["coverage"] == "all" else covering > 0
        return inside, density, features

    def weights(self, distances: Tensor) -> Tensor:
        """The weights of neighbors at these distances (4.4)."""
        if self.rules["aggregation"] == "clamped":
            inverse = 1.0 / (distances + 1e-6)
            return inverse / inverse.sum(1, keepdim=True).clamp(min=1.0)
        at_center = distances == 0.0
        inverse = 1.0 / torch.where(at_center, 1.0, distances)
        total = inverse.sum(1, keepdim=True)
        weights = inverse / torch.where(total > 0.0, total, 1.0)
        return torch.where(at_center.any(1, keepdim=True), at_center.to(self.dtype), weights)

    def occupied(self, points: Tensor) -> Tensor:
        """Whether points are occupied (4.8)."""
        grid = self.arrays.get("occupancy")
        if grid is None:
            return torch.ones(len(points), dtype=torch.bool)
        bounds = self.arrays["description"]["occupancy"]
        low, high = (torch.tensor(bounds[end], dtype=self.dtype) for end in ("min", "max"))
        cells = torch.tensor(grid.shape[::-1]) - 1
        places = (points - low) / (high - low) * cells
        lower = torch.minimum(places.floor().long().clamp(min=0), cells - 1)
        values = torch.zeros(len(points), dtype=self.dtype)
        bits = torch.tensor(grid)
        for corner in np.ndindex(2, 2, 2):
            x, y, z = (lower + torch.tensor(corner)).T
            share = torch.where(torch.tensor(corner) > 0, places - lower, 1.0 - (places - lower)).prod(1)
            values += share * bits[z, y, x]
        return ((low <= points) & (points <= high)).all(1) & (values > 0.0)

    def density(self, points: Tensor) -> Tensor:
        """σ at points [n][3] in model space, 0 outside of the scene."""
        inside, density, _ = self.evaluate(points)
        within = ((self.bounds[0] <= points) & (points <= self.bounds[1])).all(1)
        counts = inside & within & self.occupied(points)
        return torch.where(counts, functional.softplus(density + self.rules["density_shift"]), 0.0)

    def forward(self, origins: Tensor, directions: Tensor) -> Tensor:
        """The colors of rays [n][3] in model space, [n][3]."""
        return torch.stack([self.ray(origin, direction) for origin, direction in zip(origins, directions)])

    def ray(self, origin: Tensor, direction: Tensor) -> Tensor:
        """The color of a ray (4.8)."""
        background = torch.tensor(self.frame["background"], dtype=self.dtype)
        step = self.rules["step"]
        ends = torch.stack([(corner - origin) / direction for corner in self.bounds])
        enter = max(ends.amin(0).max().item(), self.frame["near"])
        leave = min(ends.amax(0).min().item(), self.frame["far"])
        count = max(0, math.ceil((leave - enter) / step))
        distances = enter + step * torch.arange(count, dtype=self.dtype)
        points = origin + distances[:, None] * direction
        points = points[self.occupied(points)]
        inside, density, features = self.evaluate(points)
        density, features = density[inside], features[inside]
        if not len(density):
            return background
        sigma = functional.softplus(density + self.rules["density_shift"])
        left = torch.exp(-(sigma * step * self.rules["distance_scale"]).cumsum(0))
        before = torch.cat([torch.ones(1, dtype=self.dtype), left[:-1]])
        # The march ends after the sample that leaves too little.
        marched = before >= self.rules["min_transmittance"]
        weights, features, left = (before - left)[marched], features[marched], left[marched]
        behind = left[-1] * background
        shaded = weights > self.rules["min_weight"]
        weights, features = weights[shaded], features[shaded]
        if not len(weights):
            return behind
        if self.mode == "per-sample":
            colors = torch.sigmoid(self.decoder(features, direction.expand(len(features), 3)))
            return behind + weights @ colors
        total = weights.sum()
        of_ray = self.decoder((weights @ features / total)[None], direction[None])
        if self.mode == "per-ray":
            return behind + total * torch.sigmoid(of_ray)[0]
        return behind + weights @ torch.sigmoid(features[:, :3] + of_ray)

    def to_scene(self) -> strivec.Scene:
        """The scene with the parameters as they are now."""
        arrays = dict(self.arrays)
        for scale in self.scales:
            arrays.update(scale.named_parameters())
        for number, layer in enumerate(self.decoder.layers):
            arrays[f"decoder{number}_weights"], arrays[f"decoder{number}_bias"] = layer.weight, layer.bias
        return strivec.Scene.from_arrays(arrays)


def main() -> None:
    """Trains a scene on a few rays of its own picture, made brighter: a stand-in for your loss."""
    parser = argparse.ArgumentParser(description="Train a scene on in PyTorch")
    parser.add_argument("scene")
    parser.add_argument("output")
    parser.add_argument("--steps", type=int, default=20)
    arguments = parser.parse_args()
    scene = strivec.Scene.load(arguments.scene)
    module = Scene(scene)
    origins, directions = rays_of(scene, 256)
    target = torch.from_numpy(scene.trace(origins, directions, space="model").color) ** 0.8
    optimizer = torch.optim.Adam(module.parameters(), lr=1e-3)
    for step in range(arguments.steps):
        optimizer.zero_grad()
        loss = functional.mse_loss(module(torch.from_numpy(origins).float(), torch.from_numpy(directions).float()), target)
        loss.backward()
        optimizer.step()
        print(f"step {step}: mean squared error {loss.item():.6f}")
    module.to_scene().save(arguments.output)


def rays_of(scene: strivec.Scene, count: int, seed: int = 0) -> Tuple[np.ndarray, np.ndarray]:
    """Rays in model space from around the scene to points in it."""
    random = np.random.default_rng(seed)
    low, high = (np.array(scene.description["bounds"][end]) for end in ("min", "max"))
    center, size = (low + high) / 2, high - low
    outward = random.normal(size=(count, 3))
    origins = center + 1.5 * np.linalg.norm(size) * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    toward = center + size * random.uniform(-0.4, 0.4, (count, 3)) - origins
    return origins, toward / np.linalg.norm(toward, axis=1, keepdims=True)


if __name__ == "__main__":
    main()
