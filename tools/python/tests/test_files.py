"""Names from outside, and files that appear whole."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

from common import strivec

from strivec._files import inside, replacing, scratch

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

    def test_what_a_process_that_died_left_is_removed_and_what_another_writes_is_not(self):
        with replacing(self.path / "a") as first:
            with replacing(self.path / "a") as second:
                self.assertNotEqual(first, second)
                second.write_bytes(b"second")
            first.write_bytes(b"first")
        self.assertEqual([(path.name, path.read_bytes()) for path in self.path.iterdir()], [("a", b"first")])
        first.write_bytes(b"left")
        os.utime(first, (0, 0))
        with replacing(self.path / "a") as third:
            third.write_bytes(b"third")
        self.assertEqual([(path.name, path.read_bytes()) for path in self.path.iterdir()], [("a", b"third")])

    def test_folders_for_temporary_files_of_processes_that_died_are_removed(self):
        code = "import os\nfrom strivec._files import scratch\nwith scratch() as folder: (folder / 'a').touch(); print(folder); os._exit(9)"
        with mock.patch.object(tempfile, "tempdir", str(self.path)), scratch() as own:
            environment = {**os.environ, "TMPDIR": str(self.path)}
            left = subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True, check=False)
            self.assertEqual(left.returncode, 9)
            self.assertEqual(len(list(self.path.iterdir())), 2)
            with scratch() as other:
                self.assertEqual({path for path in self.path.iterdir()}, {own.parent, other.parent})
        self.assertEqual(list(self.path.iterdir()), [])


if __name__ == "__main__":
    unittest.main()
