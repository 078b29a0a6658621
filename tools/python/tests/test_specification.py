"""The numbers of section 12 of the format: the example file, and the values that the text gives for its field."""

import re
import unittest
from pathlib import Path

import numpy as np

import strivec
from strivec import field
from strivec.scales import _ascends, _total_order

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "format-spec" / "v1.md").read_text(encoding="utf-8")
EXAMPLE = TEXT.split("\n## 12. Example\n")[1].split("\n## 13.")[0]
DIRECTION = np.array([-2.0, -1.0, -2.0]) / 3.0


def row(name):
    """The numbers of the row of this name in the tables of section 12."""
    cells = re.search(rf"^\| {re.escape(name)} \|(.*)\|$", EXAMPLE, re.MULTILINE).group(1)
    return np.array([float(number) for number in re.split(r"[,|]", cells.replace("−", "-"))])


class Example(unittest.TestCase):
    lines = EXAMPLE.split("```hexdump\n")[1].split("```")[0].splitlines()
    scene = strivec.read(b"".join(bytes.fromhex(line[4:]) for line in lines))

    def assert_close(self, name, found):
        np.testing.assert_allclose(row(name), found, rtol=1e-8, err_msg=name)

    def test_values_at_a_point(self):
        scene, rules = self.scene, self.scene.rules
        (scale,) = scene.scales
        points = np.array([[0.25, -0.125, 0.5]])
        u = (points - scale.centers + scale.half_edges) / (2.0 * scale.half_edges) * scale.resolution
        self.assert_close("u", u[0])
        for name, factors in (("density", scale.density), ("appearance", scale.appearance)):
            vectors = np.array([vector[0, 0] for vector in factors], np.float64)
            self.assert_close(f"{name} vector at x", (1.0 - u[0]) * vectors[:, 0] + u[0] * vectors[:, 1])
        at = field.evaluate(scene, points, [np.array([0])])
        self.assertTrue(at.inside[0])
        self.assert_close("density feature f", at.densities)
        density = np.log1p(np.exp(at.densities + rules.density_shift))
        self.assert_close("density σ", density)
        self.assert_close("α", 1.0 - np.exp(-density * rules.step * rules.distance_scale))
        self.assert_close("appearance features F", at.features[0])
        output = field.decode(scene.decoder, at.features, DIRECTION)[0]
        self.assert_close("y(F, d)", output)
        self.assert_close("sigmoid(y)", 1.0 / (1.0 + np.exp(-output)))

    def test_values_of_a_ray(self):
        rays = strivec.trace(self.scene, np.array([[2.001, 1.1, 2.203]]), DIRECTION[None])
        np.testing.assert_allclose(row("color"), rays.colors[0], atol=1e-9)
        np.testing.assert_allclose(row("opacity"), rays.opacities, atol=1e-9)
        np.testing.assert_allclose(row("depth"), rays.depths, atol=1e-9)


class OrderOfCenters(unittest.TestCase):
    def test_both_orders_of_zeros_count(self):
        centers = np.array([[-1.0, 0.0, 0.0], [1.0, -0.0, 0.0]])
        self.assertTrue(_ascends(centers).all())
        self.assertFalse(_ascends(_total_order(centers)).all())
        centers[1, 1] = 0.0
        self.assertTrue(_ascends(_total_order(centers)).all())


if __name__ == "__main__":
    unittest.main()
