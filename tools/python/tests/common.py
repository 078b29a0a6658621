"""What the tests share."""

import importlib
import os
import pathlib
import sys
import unittest

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[3]
FIXTURES = ROOT / "fixtures" / "v1"
sys.path[:0] = [str(ROOT / "format-spec" / "reader"), str(ROOT / "tools" / "python" / "examples")]

import strivec  # noqa: E402


def skip(reason):
    """Skips a test, which fails instead if the environment has STRIVEC_ALL_TESTS."""
    if os.environ.get("STRIVEC_ALL_TESTS"):
        raise AssertionError(f"not tested: {reason}")
    raise unittest.SkipTest(reason)


def optional(*names):
    """The modules `names`; without one of them, the file's tests are skipped."""
    try:
        return [importlib.import_module(name) for name in names]
    except ImportError as error:
        skip(str(error))


def web_player():
    """Whether the package has the web player."""
    return (pathlib.Path(strivec.__file__).parent / "web").is_dir()


def with_less_work(example):
    """The code of an example for users with a smaller model, which is hardly measured."""
    for words, less in (
        ('settings("24")', 'settings("preview")'),
        ('["batch_rays"] = 1024', '["batch_rays"] = 64'),
        ('["batch_rays"] = 512', '["batch_rays"] = 64'),
        ("steps=3000", "steps=200, max_params=100_000"),
        ("steps=600", "steps=200, max_params=100_000"),
        ('target_size="1MB"', 'target_size="1MB", effort=0.1'),
        ('quality="balanced"', 'quality="balanced", effort=0.1'),
    ):
        example = example.replace(words, less)
    return example


def fixture(name):
    """A scene of the format's test vectors."""
    return strivec.Scene.load(FIXTURES / f"{name}.strivec")


def points_in(scene, count=200, seed=0):
    """Points in and around the bounds of `scene`, in model space."""
    bounds = scene.description["bounds"]
    low, high = np.array(bounds["min"]), np.array(bounds["max"])
    return np.random.default_rng(seed).uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (count, 3))


def rays_to(scene, count=60, seed=0):
    """Rays in model space from around the scene to points in it, origins and directions."""
    bounds = scene.description["bounds"]
    low, high = np.array(bounds["min"]), np.array(bounds["max"])
    random = np.random.default_rng(seed)
    outward = random.normal(size=(count, 3))
    origins = (low + high) / 2 + 1.2 * np.linalg.norm(high - low) * outward / np.linalg.norm(outward, axis=1)[:, None]
    toward = random.uniform(low, high, (count, 3)) - origins
    return origins, toward / np.linalg.norm(toward, axis=1)[:, None]
