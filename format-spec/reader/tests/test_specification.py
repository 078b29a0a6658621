"""The numbers of section 12 of the format: the example file, and the values that the text gives for its field."""

import re
import unittest
from pathlib import Path

import numpy as np

import strivec_reader
from strivec_reader import field, limits
from strivec_reader.scales import _ascends, _total_order

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
    scene = strivec_reader.read(b"".join(bytes.fromhex(line[4:]) for line in lines))

    def assert_close(self, name, found):
        np.testing.assert_allclose(row(name), found, rtol=1e-8, err_msg=name)

    def test_values_at_a_point(self):
        scene, rules = self.scene, self.scene.rules
        (scale,) = scene.scales
        points = np.array([[0.25, -0.125, 0.5]])
        u = (points - scale.centers + scale.half_edges) / (2.0 * scale.half_edges) * scale.resolution
        self.assert_close("u", u[0])
        for name, (block,) in (("density", scale.density), ("appearance", scale.appearance)):
            vectors = np.array([vector[0, 0] for vector in block.factors], np.float64)
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
        rays = strivec_reader.trace(self.scene, np.array([[2.001, 1.1, 2.203]]), DIRECTION[None])
        np.testing.assert_allclose(row("color"), rays.colors[0], atol=1e-9)
        np.testing.assert_allclose(row("opacity"), rays.opacities, atol=1e-9)
        np.testing.assert_allclose(row("depth"), rays.depths, atol=1e-9)


class Limits(unittest.TestCase):
    def test_they_are_those_of_the_table(self):
        section = TEXT.split("\n## 5. Limits\n")[1].split("\n## 6.")[0]
        rows = re.findall(r"^\| [^|]+ \| ([\d ]+) \| ([\d ]+) \|", section, re.MULTILINE)
        found = sorted(tuple(int(number.replace(" ", "")) for number in row) for row in rows)
        expected = [value for name, value in vars(limits).items() if name.isupper()]
        self.assertEqual(found, sorted(expected))


class Sky(unittest.TestCase):
    def test_the_basis_is_orthonormal(self):
        # Gauss-Legendre nodes in z and equal steps around it integrate these products exactly.
        z, weights = np.polynomial.legendre.leggauss(6)
        angles = 2.0 * np.pi * (np.arange(16) + 0.3) / 16
        radius = np.sqrt(1.0 - z**2)[:, None]
        directions = np.stack(
            np.broadcast_arrays(radius * np.cos(angles), radius * np.sin(angles), z[:, None]), axis=-1
        ).reshape(-1, 3)
        basis = field.harmonics(directions)
        weights = np.repeat(weights * 2.0 * np.pi / 16, 16)
        np.testing.assert_allclose((basis * weights) @ basis.T, np.eye(25), atol=1e-13)

    def test_its_functions_are_those_of_the_table(self):
        section = TEXT.split("\n### 4.11 Sky\n")[1].split("\n## 5.")[0]
        rows = re.findall(r"^\| (\d+) \| (\d) \| (−?\d) \| (\S+) \| (.+) \|$", section, re.MULTILINE)
        self.assertEqual([int(row[0]) for row in rows], list(range(25)))
        x, y, z = 0.48, -0.6, 0.64
        found = field.harmonics(np.array([x, y, z]))
        for k, l, m, factor, polynomial in rows:
            self.assertEqual(int(k), int(l) ** 2 + int(l) + int(m.replace("−", "-")))
            root, rest = re.fullmatch(r"(\d?)√\((.*)\)/(\d+)", factor).group(1, 2), factor.rsplit("/", 1)[1]
            factor = int(root[0] or 1) * np.sqrt(eval(root[1].replace("(2π)", "(2*π)"), {"π": np.pi})) / int(rest)
            terms = polynomial.replace("−", "-").replace("²", "**2").replace("⁴", "**4")
            terms = re.sub(r"(?<=[\dxyz)])(?=[xyz(])", "*", terms)
            value = factor * eval(terms, {"x": x, "y": y, "z": z})
            self.assertAlmostEqual(value, found[int(k)], places=14, msg=k)


class OrderOfCenters(unittest.TestCase):
    def test_both_orders_of_zeros_count(self):
        centers = np.array([[-1.0, 0.0, 0.0], [1.0, -0.0, 0.0]])
        self.assertTrue(_ascends(centers).all())
        self.assertFalse(_ascends(_total_order(centers)).all())
        centers[1, 1] = 0.0
        self.assertTrue(_ascends(_total_order(centers)).all())


if __name__ == "__main__":
    unittest.main()
