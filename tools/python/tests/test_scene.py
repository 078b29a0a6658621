"""Scenes: files, arrays, queries and pictures."""

import multiprocessing
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import unittest

import numpy as np
from common import FIXTURES, ROOT, fixture, points_in, rays_to, strivec

import strivec_reader


class Files(unittest.TestCase):
    def test_a_scene_that_was_loaded_has_the_bytes_of_its_file(self):
        for path in sorted(FIXTURES.glob("*.strivec")):
            with self.subTest(path.name):
                scene = strivec.Scene.load(path)
                self.assertEqual(scene.dumps(), path.read_bytes())
                self.assertEqual(strivec.Scene.loads(scene.dumps()), scene)
                self.assertEqual(pickle.loads(pickle.dumps(scene)), scene)

    def test_hostile_files_are_refused_with_the_file_s_name(self):
        hostile = sorted((ROOT / "fixtures" / "hostile").glob("*.strivec"))
        self.assertGreater(len(hostile), 50)
        for path in hostile:
            with self.subTest(path.name):
                with self.assertRaises(strivec.Error) as caught:
                    strivec.Scene.load(path, max_memory=64 << 20)
                self.assertIsInstance(caught.exception, (strivec.MalformedError, strivec.UnsupportedError))
                self.assertIn(path.name, str(caught.exception))

    def test_saving_replaces_only_when_told(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.strivec"
            scene = fixture("smallest")
            scene.save(path)
            with self.assertRaises(strivec.UsageError):
                scene.save(path)
            fixture("f32").save(path, overwrite=True)
            self.assertEqual(strivec.Scene.load(path), fixture("f32"))
            self.assertEqual([file.name for file in path.parent.iterdir()], ["scene.strivec"])
            with self.assertRaises(strivec.InputError) as caught:
                strivec.Scene.load(pathlib.Path(folder) / "absent.strivec")
            self.assertIn("absent.strivec", str(caught.exception))
            self.assertIsInstance(caught.exception, OSError)

    def test_a_full_disk_leaves_no_file(self):
        with self.assertRaises(strivec.InputError):
            fixture("smallest").save("/dev/full/scene.strivec")

    def test_notes_and_license_change_and_nothing_else(self):
        scene = fixture("everything")
        changed = scene.with_parts(notes={"who": "a test"}, license="CC0-1.0")
        self.assertEqual((changed.notes, changed.license), ({"who": "a test"}, "CC0-1.0"))
        self.assertEqual(changed.views, scene.views)
        for name, array in scene.to_arrays().items():
            if name != "description":
                np.testing.assert_array_equal(changed.to_arrays()[name], array)
        again = changed.with_parts(notes=scene.notes, license=scene.license)
        self.assertEqual((again.description, again.thumbnail), (scene.description, scene.thumbnail))
        self.assertEqual(scene.with_parts(), scene)
        with self.assertRaisesRegex(TypeError, "no author"):
            scene.with_parts(author="me")

    def test_a_file_that_is_replaced_while_it_is_read_is_one_of_the_two(self):
        versions = [fixture(name) for name in ("f32", "vm")]
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.strivec"
            versions[0].save(path)
            ended = threading.Event()

            def replace():
                while not ended.is_set():
                    for scene in versions:
                        scene.save(path, overwrite=True)

            thread = threading.Thread(target=replace)
            thread.start()
            try:
                for _ in range(100):
                    self.assertIn(strivec.Scene.load(path), versions)
            finally:
                ended.set()
                thread.join()


class Arrays(unittest.TestCase):
    def test_arrays_make_the_scene_again(self):
        for name in ("f32", "explicit", "everything", "vm", "ragged-f32", "contracted-sky", "occupancy"):
            with self.subTest(name):
                scene = fixture(name)
                again = strivec.Scene.from_arrays(scene.to_arrays())
                arrays, others = scene.to_arrays(), again.to_arrays()
                self.assertEqual(arrays["description"], others["description"])
                self.assertEqual(set(arrays), set(others))
                for key in set(arrays) - {"description"}:
                    self.assertEqual(arrays[key].dtype, others[key].dtype)
                    np.testing.assert_array_equal(arrays[key], others[key])

    def test_factors_show_the_scene_s_memory(self):
        scene = fixture("f32")
        first, second = (scene.to_arrays()["scale0_density"] for _ in range(2))
        self.assertTrue(np.shares_memory(first, second))
        with self.assertRaises(ValueError):
            first[0] = 0.0
        # The memory outlives the scene.
        copy = first.copy()
        del scene
        np.testing.assert_array_equal(first, copy)

    def test_wrong_arrays_are_refused_by_name(self):
        arrays = fixture("f32").to_arrays()
        for name, wrong in (
            ("scale0_density", arrays["scale0_density"][:-1]),
            ("scale0_density", np.full_like(arrays["scale0_density"], np.nan)),
            ("decoder0_bias", arrays["decoder0_bias"][None]),
            ("scale0_matrix", None),
        ):
            with self.subTest(name), self.assertRaises(strivec.MalformedError) as caught:
                others = {key: value for key, value in {**arrays, name: wrong}.items() if value is not None}
                strivec.Scene.from_arrays(others)
            self.assertRegex(str(caught.exception), "scale0_density|scale 0|decoder0_bias|scale0_matrix")
        with self.assertRaisesRegex(TypeError, "description"):
            strivec.Scene.from_arrays({})


class Queries(unittest.TestCase):
    def test_the_field_is_that_of_the_independent_reader(self):
        for name in ("f32", "explicit", "vm", "aggregation-clamped", "coverage-any", "reductions-mean"):
            with self.subTest(name):
                scene, other = fixture(name), strivec_reader.open(FIXTURES / f"{name}.strivec")
                points = points_in(scene)
                tensors = [np.arange(len(scale.centers)) for scale in other.scales]
                field = strivec_reader.field.evaluate(other, points, tensors)
                low, high = (np.array(corner) for corner in other.rules.bounds)
                counts = field.inside & ((low <= points) & (points <= high)).all(1)
                expected = np.where(counts, np.logaddexp(0.0, field.densities + other.rules.density_shift), 0.0)
                self.assertGreater(counts.sum(), 5)
                density, features = scene.density(points, space="model"), scene.features(points, space="model")
                np.testing.assert_allclose(density, expected, rtol=1e-4, atol=1e-5)
                np.testing.assert_allclose(features, field.features * counts[:, None], rtol=1e-4, atol=1e-4)
                with self.assertRaises(AssertionError):
                    np.testing.assert_allclose(density, 1.01 * expected, rtol=1e-4, atol=1e-5)

    def test_rays_are_those_of_the_independent_reader(self):
        for name in ("f32", "vm", "occupancy", "per-ray", "residual", "sky"):
            with self.subTest(name):
                scene, other = fixture(name), strivec_reader.open(FIXTURES / f"{name}.strivec")
                origins, directions = rays_to(scene)
                pixels = scene.trace(origins, directions, backend="reference", space="model")
                rays = strivec_reader.trace(other, origins, directions)
                np.testing.assert_allclose(pixels.color, rays.colors, atol=1e-5)
                np.testing.assert_allclose(pixels.opacity, rays.opacities, atol=1e-5)
                fast = scene.trace(origins, directions, space="model")
                # A sample at a border may fall on either side.
                close = np.abs(fast.color - rays.colors).max(1) < 1e-3
                self.assertGreater(close.mean(), 0.9)

    def test_spaces_differ_by_the_frame(self):
        scene = fixture("everything")
        camera = strivec.Camera.look_at((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), size=(7, 5))
        frame = scene.description["frame"]["model_from_dataset"]
        self.assertNotEqual(frame["scale"], 1.0)
        with self.assertRaisesRegex(ValueError, "space"):
            scene.render(camera, space="world")
        self.assertEqual(scene.render(camera).color.shape, (5, 7, 3))
        self.assertEqual(scene.render(camera, size=(14, 10)).depth.shape, (10, 14))

    def test_backgrounds_show_where_nothing_is(self):
        scene = fixture("f32")
        away = np.array([[1.0, 0.0, 0.0]])
        pixel = scene.trace(away * 1e6, away, background=(1.0, 0.5, 0.0), space="model")
        np.testing.assert_allclose(pixel.color, [[1.0, 0.5, 0.0]], atol=1e-6)

    def test_wrong_arguments_are_refused(self):
        scene = fixture("f32")
        camera = strivec.Camera.look_at((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), size=(4, 4))
        for call in (
            lambda: scene.density([[0.0, 0.0]]),
            lambda: scene.trace([[0.0, 0.0, 0.0]], [[0.0, 0.0, 2.0]]),
            lambda: scene.trace([[0.0, 0.0, 0.0]], np.zeros((0, 3))),
            lambda: scene.render(camera, backend="tpu"),
            lambda: scene.render(camera, approximation={"step_scale": -1.0}),
            lambda: scene.render(camera, approximation={"speed": 2.0}),
            lambda: scene.render(camera, size=(0, 4)),
            lambda: scene.render(strivec.Camera.from_pose(2 * np.eye(4), (4, 4), focal=4.0)),
        ):
            with self.assertRaises((strivec.UsageError, ZeroDivisionError)):
                call()

    def test_a_picture_beyond_the_memory_is_refused_before_it_is_taken(self):
        camera = strivec.Camera.look_at((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), size=(4, 4))
        with self.assertRaisesRegex(MemoryError, "1000000x1000000 pixels") as caught:
            fixture("f32").render(camera, size=(1000000, 1000000))
        self.assertIsInstance(caught.exception, strivec.MemoryLimitError)

    def test_a_scene_beyond_its_memory_is_refused_before_it_is_taken(self):
        with self.assertRaisesRegex(MemoryError, "f32.strivec"):
            strivec.Scene.load(FIXTURES / "f32.strivec", max_memory=1000)
        # Enough for what is decoded, but not for what evaluates it.
        scene = next(filter(None, (loaded(FIXTURES / "f32.strivec", 1 << bits) for bits in range(10, 30))))
        for call in (lambda: scene.density([[0.0, 0.0, 0.0]]), lambda: scene.trace([[0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]])):
            with self.assertRaises(strivec.MemoryLimitError):
                call()

    def test_other_threads_go_on(self):
        scene = fixture("everything")
        camera = strivec.Camera.look_at((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), size=(480, 480))
        ticks = []
        ended = threading.Event()

        def tick():
            while not ended.is_set():
                ticks.append(time.perf_counter())
                time.sleep(0.001)

        thread = threading.Thread(target=tick)
        thread.start()
        begin = time.perf_counter()
        scene.render(camera, backend="reference")
        end = time.perf_counter()
        ended.set()
        thread.join()
        self.assertGreater(sum(begin < at < end for at in ticks), 3)


def loaded(path, max_memory):
    """The scene in the file `path`, or None if it takes more memory."""
    try:
        return strivec.Scene.load(path, max_memory)
    except strivec.MemoryLimitError:
        return None


def in_fork(call):
    """The RuntimeError of `call` in a forked process, or "done"; empty if it does not end within 30 seconds."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        try:
            call()
            os.write(writer, b"done")
        except RuntimeError as error:
            os.write(writer, str(error).encode())
        finally:
            os._exit(0)
    os.close(writer)
    with open(reader, encoding="utf-8") as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return text


def density_at_origin(path):
    """The density of the scene in the file `path`."""
    return float(strivec.Scene.load(path).density(np.zeros((1, 3)), space="model")[0])


@unittest.skipUnless(hasattr(os, "fork"), "this system has no fork")
class Processes(unittest.TestCase):
    def test_a_process_that_was_forked_after_the_first_use_raises_at_once(self):
        scene, points, path = fixture("f32"), np.zeros((3000, 3)), FIXTURES / "f32.strivec"
        camera = strivec.Camera.look_at((3.0, 2.0, 1.0), (0.0, 0.0, 0.0), size=(4, 4))
        scene.density(points)
        scene.render(camera)
        for name, call in (
            ("density", lambda: scene.density(points)),
            ("features", lambda: scene.features(points)),
            ("render", lambda: scene.render(camera)),
            ("load", lambda: strivec.Scene.load(path)),
            ("loads", lambda: strivec.Scene.loads(path.read_bytes())),
            ("command", lambda: strivec.command("info", path)),
        ):
            with self.subTest(name):
                self.assertRegex(in_fork(call), f'forked from process {os.getpid()} after .*"spawn"')
        # Facts and bytes need no threads.
        self.assertEqual(in_fork(lambda: (scene.info(), scene.dumps(), scene.description)), "done")
        scene.density(points)

    def test_a_process_that_was_forked_before_the_first_use_works(self):
        code = f"""
            import os, sys
            import numpy as np
            import strivec
            child = os.fork()
            strivec.Scene.load({str(FIXTURES / "f32.strivec")!r}).density(np.zeros((3000, 3)))
            if child:
                sys.exit(os.waitpid(child, 0)[1])
        """
        done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=False, timeout=120)
        self.assertEqual(done.returncode, 0)

    def test_spawned_processes_work(self):
        path = str(FIXTURES / "f32.strivec")
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            self.assertEqual(pool.apply_async(density_at_origin, (path,)).get(timeout=120), density_at_origin(path))


class Import(unittest.TestCase):
    def test_importing_imports_no_numpy(self):
        code = "import sys, strivec; sys.exit('numpy' in sys.modules)"
        self.assertEqual(subprocess.run([sys.executable, "-c", code], check=False).returncode, 0)


if __name__ == "__main__":
    unittest.main()
