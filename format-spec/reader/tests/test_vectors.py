"""The reader against the test vectors of the format: it opens `fixtures/v1` with all probes within tolerance, and refuses
`fixtures/hostile` with the right class of error.

    PYTHONPATH=format-spec/reader python -m unittest discover format-spec/reader/tests
"""

import contextlib
import dataclasses
import io
import unittest
from pathlib import Path

import numpy as np

import strivec_reader
from strivec_reader.__main__ import main

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"
VALID = sorted((FIXTURES / "v1").glob("*.strivec"))
HOSTILE = FIXTURES / "hostile"
SKIPPED = FIXTURES / "skipped"
HOSTILE_BUDGET = 64 << 20  # bytes
MADE_UP_PROBES = {"everything"}
WITHOUT_PROBES = {"smallest"}


def refusal(data, budget=HOSTILE_BUDGET):
    """The error with which a file is refused, or None if it opens."""
    try:
        strivec_reader.read(data, budget)
    except strivec_reader.StrivecError as error:
        return error
    return None


class ValidVectors(unittest.TestCase):
    def test_there_are_some(self):
        self.assertGreaterEqual(len(VALID), 28)

    def test_open_and_probes_hold(self):
        for path in VALID:
            with self.subTest(path.stem):
                scene = strivec_reader.open(path)
                self.assertEqual(bool(scene.skipped), path.stem == "newer-codes")
                self.assertEqual(scene.probes is None, path.stem in WITHOUT_PROBES)
                if scene.probes is None or path.stem in MADE_UP_PROBES:
                    continue
                report = strivec_reader.check_probes(scene)
                self.assertGreater(report.compared, 0)
                self.assertEqual(report.failed, [])

    def test_changed_scene_fails(self):
        for path in VALID:
            if path.stem in MADE_UP_PROBES | WITHOUT_PROBES:
                continue
            with self.subTest(path.stem):
                scene = strivec_reader.open(path)
                rules = dataclasses.replace(scene.rules, density_shift=scene.rules.density_shift + 0.01)
                self.assertTrue(strivec_reader.check_probes(dataclasses.replace(scene, rules=rules)).failed)

    def test_same_numbers_however_written(self):
        def numbers(stem):
            scene = strivec_reader.open(FIXTURES / "v1" / f"{stem}.strivec")
            return np.concatenate(
                [
                    array.ravel()
                    for scale in scene.scales
                    for block in (*scale.density, *scale.appearance)
                    for array in block.factors
                ]
            )

        for one, other in (
            ("f32", "f32-planes"),
            ("f32", "zstd"),
            ("f32", "explicit"),
            ("f16", "f16-planes"),
            ("grid-16", "integers-adaptive-finest"),
            ("grid-3", "integers-adaptive-3"),
        ):
            with self.subTest(f"{one}, {other}"):
                np.testing.assert_array_equal(numbers(one), numbers(other))

    def test_extras(self):
        scene = strivec_reader.open(FIXTURES / "v1" / "everything.strivec")
        self.assertEqual(scene.license, "CC-BY-4.0, © somebody")
        self.assertEqual(scene.provenance.preset, "48 – künstlich")
        self.assertEqual(scene.quality.encoding_psnr, 54.5)
        self.assertIsNone(scene.quality.test_psnr)
        self.assertEqual(scene.quality.prefix_psnr, [21.5, None])
        self.assertEqual(len(scene.views.path), 3)
        self.assertEqual(scene.thumbnail.data, b"not a picture")
        self.assertEqual(len(scene.probes.margins), 2)
        self.assertEqual(scene.cameras[0].size, (64, 48))
        self.assertEqual([camera.projection for camera in scene.cameras], ["perspective", "fisheye"])
        self.assertEqual((scene.cameras[0].radial, scene.cameras[1].prism), ((-0.3, 0.1, 0.0, 0.0), (5e-4, -5e-4)))
        self.assertEqual(scene.notes, {"author": "somebody", "place": "Zürich"})
        self.assertEqual(list(scene.prefixes), [0])
        self.assertIsNotNone(scene.occupancy)
        self.assertEqual(scene.decoder.mode, "per ray")

    def test_sky(self):
        scene = strivec_reader.open(FIXTURES / "v1" / "sky.strivec")
        self.assertEqual(scene.rules.sky.shape, (3, 25))
        rays = strivec_reader.trace(scene, np.full((1, 3), 100.0), np.ones((1, 3)) / np.sqrt(3.0))
        self.assertEqual((rays.opacities[0], rays.depths[0]), (1.0, 0.0))
        self.assertFalse(np.allclose(rays.colors[0], scene.frame.background))
        # The probes see another sky.
        sky = scene.rules.sky + np.eye(3, 25)
        rules = dataclasses.replace(scene.rules, sky=sky)
        self.assertTrue(strivec_reader.check_probes(dataclasses.replace(scene, rules=rules)).failed)
        self.assertIsNone(strivec_reader.open(FIXTURES / "v1" / "f32.strivec").rules.sky)

    def test_newer_minor_version(self):
        scene = strivec_reader.open(FIXTURES / "v1" / "newer-minor.strivec")
        self.assertGreater(scene.minor_version, 0)
        self.assertTrue(scene.unknown)

    def test_codes_of_a_later_version_in_ancillary_sections(self):
        scene = strivec_reader.open(FIXTURES / "v1" / "newer-codes.strivec")
        self.assertEqual(scene.provenance, strivec_reader.open(FIXTURES / "v1" / "smallest.strivec").provenance)
        self.assertIsNone(scene.thumbnail)
        self.assertEqual((scene.prefixes, scene.notes), ({}, {}))
        self.assertEqual(len(scene.cameras), 2)
        self.assertEqual(
            [str(skipped.error) for skipped in scene.skipped],
            [
                "PROVENANCE: codec 3 is not supported",
                "PREFIX of scale 0 encoding: code 9 is not supported",
                "THUMBNAIL format: code 7 is not supported",
                "NOTES: codec 3 is not supported",
            ],
        )


class HostileVectors(unittest.TestCase):
    def test_all_are_listed(self):
        self.assertEqual(set(self.classes()), {path.stem for path in HOSTILE.glob("*.strivec")})

    def test_refused_with_the_right_class(self):
        for name, expected in self.classes().items():
            with self.subTest(name):
                with self.assertRaises(strivec_reader.StrivecError) as caught:
                    strivec_reader.open(HOSTILE / f"{name}.strivec", HOSTILE_BUDGET)
                self.assertEqual(caught.exception.name, expected, caught.exception)

    def classes(self):
        lines = (HOSTILE / "errors.tsv").read_text(encoding="utf-8").splitlines()
        return dict(line.split("\t")[:2] for line in lines)


class SkippedSections(unittest.TestCase):
    def test_files_open_without_them(self):
        lines = (SKIPPED / "skipped.tsv").read_text(encoding="utf-8").splitlines()
        rows = [line.split("\t") for line in lines]
        names = {name for name, *_ in rows}
        self.assertEqual(names, {path.stem for path in SKIPPED.glob("*.strivec")})
        for name in sorted(names):
            with self.subTest(name):
                scene = strivec_reader.open(SKIPPED / f"{name}.strivec")
                found = sorted((skipped.name, skipped.error.name) for skipped in scene.skipped)
                self.assertEqual(found, sorted((row[1], row[2]) for row in rows if row[0] == name))


class DamagedFiles(unittest.TestCase):
    smallest = (FIXTURES / "v1" / "smallest.strivec").read_bytes()

    def test_every_flip_is_refused(self):
        data = bytearray(self.smallest)
        for offset in range(len(data)):
            for flip in (0x01, 0xFF):
                data[offset] ^= flip
                is_seen = refusal(data) is not None or strivec_reader.read(data).skipped
                self.assertTrue(is_seen, f"byte {offset} ^ {flip:#04x}")
                data[offset] ^= flip
        self.assertIsNone(refusal(data))

    def test_every_truncation_is_refused(self):
        for length in range(len(self.smallest)):
            self.assertIsInstance(refusal(self.smallest[:length]), strivec_reader.Truncated, f"{length} bytes")

    def test_transfers_as_text(self):
        data = self.smallest
        for damaged in (
            data.replace(b"\n", b"\r\n"),
            data.replace(b"\r\n", b"\n"),
            data.replace(b"\r", b""),
            data.replace(b"\r\n", b""),
            bytes(byte & 0x7F for byte in data),
            data.decode("latin-1").encode("utf-8"),
            data.decode("utf-8", "replace").encode("utf-8"),
        ):
            self.assertIsInstance(refusal(damaged), strivec_reader.LineEndingDamage, str(damaged[:12]))


class Command(unittest.TestCase):
    def run_command(self, *arguments):
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            try:
                return main([str(argument) for argument in arguments])
            except SystemExit as exit:
                return exit.code

    def test_exit_codes(self):
        fine = FIXTURES / "v1" / "f32.strivec"
        self.assertEqual(self.run_command("info", FIXTURES / "v1" / "everything.strivec"), 0)
        self.assertEqual(self.run_command("info", fine), 0)
        self.assertEqual(self.run_command("verify", fine, FIXTURES / "v1" / "smallest.strivec"), 0)
        self.assertEqual(self.run_command("verify", HOSTILE / "corrupt-table.strivec", fine), 3)
        self.assertEqual(self.run_command("verify", FIXTURES / "v1" / "everything.strivec"), 3)
        self.assertEqual(self.run_command("verify", fine, HOSTILE / "major-2.strivec"), 5)
        self.assertEqual(self.run_command("info", SKIPPED / "damaged-thumbnail.strivec"), 0)
        self.assertEqual(self.run_command("verify", SKIPPED / "damaged-thumbnail.strivec"), 3)
        self.assertEqual(self.run_command("verify", FIXTURES / "v1" / "newer-codes.strivec"), 0)
        self.assertEqual(self.run_command("verify", FIXTURES / "absent.strivec"), 2)
        self.assertEqual(self.run_command("verify"), 2)
        self.assertEqual(self.run_command("repair", fine), 2)


if __name__ == "__main__":
    unittest.main()
