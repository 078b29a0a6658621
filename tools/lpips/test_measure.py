"""Tests of measure.py against the original package's distances (reference.json). Needs NumPy; one test needs Pillow.

    python3 -m unittest discover tools/lpips
"""

import json
import tempfile
import unittest
from pathlib import Path

import measure
import numpy as np
import reference

TOLERANCE = 1e-6
ROWS = json.loads(Path(reference.__file__).with_name("reference.json").read_text())


class Distances(unittest.TestCase):
    def test_distances_with_made_up_weights_are_the_original_packages(self):
        pairs = reference.pairs(None)
        for network in measure.NETWORKS:
            weights = reference.made_up(network)
            rows = [row for row in ROWS if (row["weights"], row["network"]) == ("made up", network) and row["pair"] in pairs]
            self.assertEqual(len(rows), 5)
            for row in rows:
                found = measure.distance(network, weights, pairs[row["pair"]])
                self.assertLess(abs(found - row["original"]), TOLERANCE, row)

    def test_planted_differences_are_seen(self):
        a, b = reference.pairs(None)["smooth and noisy 53x37"]
        sound = reference.made_up("alex")
        expected = measure.distance("alex", sound, (a, b))
        changes = {
            "alex.conv.2.bias": lambda bias: 0 * bias,
            "alex.linear.4": lambda linear: linear[::-1],
            "alex.conv.1.kernel": lambda kernel: kernel.transpose(1, 0, 2, 3),
        }
        found = [measure.distance("alex", {**sound, name: change(sound[name])}, (a, b)) for name, change in changes.items()]
        found.append(measure.distance("alex", sound, (a[..., ::-1], b[..., ::-1])))
        self.assertTrue(all(abs(one - expected) > 20 * TOLERANCE for one in found), found)

    def test_identical_pictures_are_at_no_distance_and_small_ones_are_refused(self):
        for network, smallest in measure.SMALLEST.items():
            flat = np.full((smallest, smallest, 3), 0.5)
            weights = reference.made_up(network)
            self.assertEqual(measure.distance(network, weights, (flat, flat)), 0.0)
            with self.assertRaisesRegex(ValueError, f"at least {smallest} pixels"):
                measure.distance(network, weights, (flat[1:], flat[1:]))

    def test_sheets_are_split_into_photograph_and_rendering(self):
        try:
            from PIL import Image
        except ImportError:
            self.skipTest("no Pillow")
        with tempfile.TemporaryDirectory() as folder:
            # Photograph, gap, rendering, gap, error.
            columns = np.array([[[0, 51, 102], [7, 7, 7], [255, 0, 0], [7, 7, 7], [9, 9, 9]]], np.uint8)
            Image.fromarray(np.repeat(np.repeat(columns, 4, axis=1), 3, axis=0)).save(Path(folder, "r_0.png"))
            ((name, (photograph, rendering)),) = measure.views(folder)
        self.assertEqual((name, photograph.shape), ("r_0", (3, 4, 3)))
        self.assertTrue(np.allclose(photograph, [0, 0.2, 0.4]) and np.allclose(rendering, [1, 0, 0]))


if __name__ == "__main__":
    unittest.main()
