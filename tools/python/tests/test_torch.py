"""The module of PyTorch, if PyTorch is installed."""

import unittest

import numpy as np
from common import fixture, optional, points_in, rays_to, strivec

(torch,) = optional("torch")


class Module(unittest.TestCase):
    def test_the_module_s_numbers_are_those_of_the_scene(self):
        from torch_module import Scene

        for name in ("f32", "explicit", "vm", "ragged-f32", "occupancy", "per-ray", "residual", "aggregation-clamped"):
            with self.subTest(name), torch.no_grad():
                scene = fixture(name)
                module = Scene(scene, dtype=torch.float64)
                points = points_in(scene)
                density = module.density(torch.from_numpy(points))
                np.testing.assert_allclose(scene.density(points, space="model"), density, rtol=1e-5, atol=1e-5)
                origins, directions = rays_to(scene)
                colors = module(torch.from_numpy(origins), torch.from_numpy(directions)).numpy()
                expected = scene.trace(origins, directions, backend="reference", space="model").color
                np.testing.assert_allclose(colors, expected, atol=1e-5)
                with self.assertRaises(AssertionError):
                    np.testing.assert_allclose(colors, expected + 2e-5, atol=1e-5)

    def test_the_module_becomes_the_scene_again_and_trains(self):
        from torch_module import Scene

        scene = fixture("f32")
        module = Scene(scene)
        arrays, again = scene.to_arrays(), module.to_scene().to_arrays()
        for name in set(arrays) - {"description"}:
            np.testing.assert_array_equal(arrays[name], again[name])
        origins, directions = (torch.from_numpy(array).float() for array in rays_to(scene))
        optimizer = torch.optim.Adam(module.parameters(), lr=1e-2)
        losses = []
        for _ in range(5):
            optimizer.zero_grad()
            loss = (module(origins, directions) - 0.5).square().mean()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        self.assertLess(losses[-1], losses[0])
        self.assertNotEqual(module.to_scene(), scene)

    def test_tensors_are_taken_as_arrays(self):
        scene = fixture("f32")
        points = points_in(scene)
        tensor = torch.tensor(points, requires_grad=True)
        np.testing.assert_array_equal(scene.density(tensor), scene.density(points))
        np.testing.assert_array_equal(scene.density(tensor.float()[::2]), scene.density(points.astype("float32")[::2]))

        class Capsule:
            """An array that has nothing but DLPack."""

            def __dlpack__(self, **options):
                return points.__dlpack__(**options)

            def __dlpack_device__(self):
                return points.__dlpack_device__()

        np.testing.assert_array_equal(scene.density(Capsule()), scene.density(points))


if __name__ == "__main__":
    unittest.main()
