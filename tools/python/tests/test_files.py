"""Names from outside, and files that appear whole."""

import os
import pathlib
import tempfile
import unittest
from unittest import mock

from common import strivec

from strivec._files import inside, replacing

PLACE = "https://server/kitchen"


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="strivec-test-")
        self.addCleanup(folder.cleanup)
        self.outer = pathlib.Path(folder.name).resolve()
        self.path = self.outer / "kitchen"
        self.path.mkdir()

    def test_names_in_the_folder_are_its_paths(self):
        for name in ("a", "train/r_0.png", "a/../b", "..a/b..", "100%.png", "%2e", "a b\n", "12:30.jpg", "frame-1:2.png", "back\\slash"):
            with self.subTest(name):
                self.assertEqual(inside(self.path, name, PLACE), (self.path / name).resolve())

    def test_names_that_lead_out_of_the_folder_are_refused_with_their_place(self):
        for name in (
            "..",
            "../kitchen-2/a",
            "../../../a",
            "a/../../b",
            "/etc/passwd",
            "//other/a",
            "..\\a",
            "a\\..\\..\\b",
            "\\\\other\\a",
            "C:\\a",
            "c:a",
            "https://other/a",
            "file:///etc/passwd",
            "%2e%2e/a",
            "..%2fa",
            "%2Fetc",
            "..%5Ca",
        ):
            with self.subTest(name), self.assertRaises(strivec.MalformedError) as caught:
                inside(self.path, name, PLACE)
            for part in (PLACE, repr(name), "leads out of the folder", str(self.path)):
                self.assertIn(part, str(caught.exception))

    def test_names_of_no_file_are_refused(self):
        for name in ("", ".", "a/..", "a\0b", "\ud800"):
            with self.subTest(name), self.assertRaisesRegex(strivec.MalformedError, "not the name of a file"):
                inside(self.path, name, PLACE)

    def test_links_are_followed_before_a_name_is_accepted(self):
        (self.path / "in").mkdir()
        (self.path / "to-in").symlink_to("in")
        (self.path / "to-out").symlink_to(self.outer)
        (self.path / "file").symlink_to("../absent")
        self.assertEqual(inside(self.path, "to-in/a", PLACE), self.path / "in" / "a")
        for name in ("to-out/a", "to-in/../../a", "file"):
            with self.subTest(name), self.assertRaisesRegex(strivec.MalformedError, "leads out of the folder"):
                inside(self.path, name, PLACE)

    def test_a_folder_behind_a_link_is_a_folder(self):
        (self.outer / "link").symlink_to("kitchen")
        self.assertEqual(inside(self.outer / "link", "a", PLACE), self.path / "a")

    def test_a_file_is_on_the_disk_before_it_gets_its_name(self):
        order = []
        with mock.patch.object(os, "fsync", lambda handle: order.append("sync")):
            replace = os.replace
            with mock.patch.object(os, "replace", lambda *paths: (order.append("replace"), replace(*paths))):
                with replacing(self.path / "a") as partial:
                    partial.write_bytes(b"after")
        self.assertEqual(order, ["sync", "replace", "sync"])
        self.assertEqual((self.path / "a").read_bytes(), b"after")

    def test_a_failed_replacement_leaves_the_file(self):
        (self.path / "a").write_bytes(b"before")
        with self.assertRaises(KeyError), replacing(self.path / "a") as partial:
            partial.write_bytes(b"after")
            raise KeyError
        self.assertEqual([(path.name, path.read_bytes()) for path in self.path.iterdir()], [("a", b"before")])


if __name__ == "__main__":
    unittest.main()
