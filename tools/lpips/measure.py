#!/usr/bin/env python3
"""LPIPS of rendered views and their photographs, from the pictures that `strivec eval --sheets FOLDER` writes.

    strivec eval lego.strivec lego --split test --sheets sheets
    python3 tools/lpips/measure.py sheets --weights lpips.safetensors [--networks alex,vgg]

A sheet has the photograph, the rendering and the error side by side, in 8 bits, which change distances by about 0.0003. Masks
of photographs are not applied. Prints the mean of each network and the distance of each view as JSON. `convert.py` makes the
file of weights; STRIVEC_LPIPS may name it. Needs NumPy and Pillow.

LPIPS (Zhang et al., "The unreasonable effectiveness of deep features as a perceptual metric", CVPR 2018) in version 0.1 with
linear layers: a network turns each picture into five maps of features. At every position features are divided by their norm;
the squared differences, weighted by channel, are averaged over each map and summed over the maps.
"""

import argparse
import json
import os
import struct
import sys
from pathlib import Path

import numpy as np

SHIFT, SCALE = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])
# Convolutions as (edge, stride, padding, inputs, outputs); "tap": features are compared here; (edge, stride): pooling.
NETWORKS = {
    "alex": [
        (11, 4, 2, 3, 64), "tap", (3, 2),
        (5, 1, 2, 64, 192), "tap", (3, 2),
        (3, 1, 1, 192, 384), "tap",
        (3, 1, 1, 384, 256), "tap",
        (3, 1, 1, 256, 256), "tap",
    ],
    "vgg": [
        (3, 1, 1, 3, 64), (3, 1, 1, 64, 64), "tap", (2, 2),
        (3, 1, 1, 64, 128), (3, 1, 1, 128, 128), "tap", (2, 2),
        (3, 1, 1, 128, 256), (3, 1, 1, 256, 256), (3, 1, 1, 256, 256), "tap", (2, 2),
        (3, 1, 1, 256, 512), (3, 1, 1, 512, 512), (3, 1, 1, 512, 512), "tap", (2, 2),
        (3, 1, 1, 512, 512), (3, 1, 1, 512, 512), (3, 1, 1, 512, 512), "tap",
    ],
}  # fmt: skip
# Columns between two pictures of a sheet (src/measure/sheet.rs).
GAP = 4
# Smaller pictures leave no features.
SMALLEST = {"alex": 31, "vgg": 16}


def read_weights(path):
    """[name] the arrays of a file of convert.py."""
    data = Path(path).read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    body = data[8 + length :]
    found = {}
    for name, entry in json.loads(data[8 : 8 + length]).items():
        if name != "__metadata__":
            begin, end = entry["data_offsets"]
            found[name] = np.frombuffer(body[begin:end], "<f4").reshape(entry["shape"])
    return found


def windows(x, edge, stride):
    """The values of `x` [picture, row, column, channel] under each element of a square that moves over it."""
    rows, columns = [(extent - edge) // stride + 1 for extent in x.shape[1:3]]
    for i in range(edge):
        for j in range(edge):
            yield (i, j), x[:, i : i + stride * (rows - 1) + 1 : stride, j : j + stride * (columns - 1) + 1 : stride]


def distance(network, weights, pair, kind=np.float32):
    """The distance of a pair of pictures [row, column, channel], sRGB in [0, 1], with numbers of this kind."""
    if min(pair[0].shape[:2]) < SMALLEST[network] or pair[0].shape != pair[1].shape:
        raise ValueError(f"{network} needs two pictures of one size of at least {SMALLEST[network]} pixels a side")
    x = ((2 * np.stack(pair).astype(np.float64) - 1 - SHIFT) / SCALE).astype(kind)
    total, convolution, linear = 0.0, 0, 0
    for layer in NETWORKS[network]:
        if layer == "tap":
            normal = x / (np.sqrt((x.astype(np.float64) ** 2).sum(-1, keepdims=True)) + 1e-10)
            total += ((normal[0] - normal[1]) ** 2 @ weights[f"{network}.linear.{linear}"].astype(np.float64)).mean()
            linear += 1
        elif len(layer) == 2:
            x = np.maximum.reduce([part for _, part in windows(x, *layer)])
        else:
            edge, stride, padding, _, _ = layer
            kernel = weights[f"{network}.conv.{convolution}.kernel"].astype(kind)
            padded = np.pad(x, ((0, 0), (padding, padding), (padding, padding), (0, 0)))
            x = 0
            for at, part in windows(padded, edge, stride):
                x = x + part @ kernel[at]
            x = np.maximum(x + weights[f"{network}.conv.{convolution}.bias"].astype(kind), 0)
            convolution += 1
    return float(total)


def views(folder):
    """[view] photograph and rendering of each sheet in `folder`."""
    from PIL import Image

    for path in sorted(Path(folder).glob("*.png")):
        sheet = np.asarray(Image.open(path).convert("RGB")) / 255
        width = (sheet.shape[1] - 2 * GAP) // 3
        yield path.stem, (sheet[:, :width], sheet[:, width + GAP : 2 * width + GAP])


def measured(folder, networks, path):
    """[network] the mean over the sheets in `folder`, and [network][view] the distances; `path`: the file of weights."""
    weights, distances = read_weights(path), {network: {} for network in networks}
    for name, pair in views(folder):
        for network in networks:
            distances[network][name] = distance(network, weights, pair)
    means = {network: sum(of.values()) / len(of) for network, of in distances.items() if of}
    return means, distances


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sheets", type=Path, help="folder that strivec eval --sheets wrote")
    parser.add_argument("--networks", default="alex,vgg", help="comma-separated [default: alex,vgg]")
    parser.add_argument("--weights", default=os.environ.get("STRIVEC_LPIPS"), help="file of convert.py [default: STRIVEC_LPIPS]")
    options = parser.parse_args()
    if not options.weights:
        sys.exit("measure.py: pass --weights; `python3 tools/lpips/convert.py lpips.safetensors` makes the file (69 MB)")
    networks = options.networks.split(",")
    if unknown := [network for network in networks if network not in NETWORKS]:
        sys.exit(f"measure.py: the network {unknown[0]} is unknown; there are {', '.join(NETWORKS)}")
    means, distances = measured(options.sheets, networks, options.weights)
    if not means:
        sys.exit(f"measure.py: {options.sheets}: no sheets; strivec eval --sheets writes them")
    of_network = {f"lpips_{network}": {"mean": mean, "views": distances[network]} for network, mean in means.items()}
    print(json.dumps(of_network, indent=1))


if __name__ == "__main__":
    main()
