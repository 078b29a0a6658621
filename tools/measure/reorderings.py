#!/usr/bin/env python3
"""zstd-compressed size of a scene's factors for every order, layout and filter of their numbers.

    strivec-pack extract lego.strivec -o lego
    tools/measure/reorderings.py lego

prints the table of docs/experiments/2026-11-22-number-order.md: percent of the raw f32 numbers, zstd level 19 over chunks of
1024 tensors, without placement. Needs numpy and zstandard.
"""

import argparse
import itertools
import json
from pathlib import Path

import numpy as np
import zstandard

CHUNK = 1024
ORDERS = ["z, y, x", "Morton", "random"]
LAYOUTS = ["component fastest", "vertex fastest"]
FILTERS = ["none", "planes", "differences"]
ENCODINGS = ["f32", "f16", "grid8"]


def morton(cells):
    """Keys that order cells u32[n][3] along Morton's curve."""
    keys = np.zeros(len(cells), np.uint64)
    for bit, axis in itertools.product(range(16), range(3)):
        keys |= (cells[:, axis].astype(np.uint64) >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return keys


def order(name, cells):
    if name == "Morton":
        return np.argsort(morton(cells))
    if name == "random":
        return np.random.default_rng(0).permutation(len(cells))
    return np.arange(len(cells))


def vectors(factors, resolution):
    """The vectors of f32[tensor][row][component], axis by axis: f32[tensor][component][vertex] each."""
    ends = np.cumsum([d + 1 for d in resolution])[:-1]
    return [part.transpose(0, 2, 1) for part in np.split(factors, ends, axis=1)]


def encode(name, axes):
    """The numbers as integers of their size, [tensor][component][vertex] an axis, and the bytes of the steps."""
    if name != "grid8":
        number, integer = {"f32": (np.float32, np.uint32), "f16": (np.float16, np.uint16)}[name]
        return [np.ascontiguousarray(v, number).view(integer) for v in axes], b""
    steps = [np.abs(v).max(axis=2, keepdims=True) / 127 for v in axes]
    # As the format's step codes: eight to a doubling.
    codes = [np.ceil(8 * np.log2(np.maximum(s, 2.0**-24))) for s in steps]
    grids = [np.round(v / 2.0 ** (c / 8)).astype(np.int8).view(np.uint8) for v, c in zip(axes, codes)]
    return grids, b"".join((c + 192).astype(np.uint8).tobytes() for c in codes)


def arrange(axes, layout, filter_name):
    if filter_name == "differences":
        axes = [np.diff(v, axis=2, prepend=v.dtype.type(0)) for v in axes]
    if layout == "component fastest":
        numbers = np.concatenate([v.transpose(0, 2, 1) for v in axes], axis=1).reshape(-1)
    else:
        numbers = np.concatenate([v.reshape(len(v), v.shape[1], -1) for v in axes], axis=2).reshape(-1)
    if filter_name == "none":
        return numbers.tobytes()
    return numbers.view(np.uint8).reshape(-1, numbers.itemsize).T.tobytes()


def size(scales, encoding, order_name, layout, filter_name):
    compressor = zstandard.ZstdCompressor(level=19)
    total = 0
    for cells, resolution, parts in scales:
        chosen = order(order_name, cells)
        for start in range(0, len(chosen), CHUNK):
            for factors in parts:
                axes = vectors(factors[chosen[start : start + CHUNK]], resolution)
                integers, steps = encode(encoding, axes)
                total += len(compressor.compress(steps + arrange(integers, layout, filter_name)))
    return total


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder made by strivec-pack extract")
    folder = parser.parse_args().folder
    scales = []
    for s, scale in enumerate(json.loads((folder / "scene.json").read_text())["scales"]):
        load = lambda name: np.load(folder / f"scale{s}_{name}.npy")
        scales.append((load("cells"), scale["resolution"], [load("density"), load("appearance")]))
    raw = sum(4 * part.size for _, _, parts in scales for part in parts)
    print("| order of tensors | layout | filter |", " | ".join(ENCODINGS), "|")
    print("|---|---|---|" + "---|" * len(ENCODINGS))
    for order_name, layout, filter_name in itertools.product(ORDERS, LAYOUTS, FILTERS):
        sizes = [size(scales, encoding, order_name, layout, filter_name) for encoding in ENCODINGS]
        print(f"| {order_name} | {layout} | {filter_name} |", " | ".join(f"{100 * n / raw:.2f} %" for n in sizes), "|", flush=True)


if __name__ == "__main__":
    main()
