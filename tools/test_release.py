"""Tests of the programs that make a release: dependencies, notices, bill of materials, archive.

    python3 -m unittest discover tools
"""

import io
import tarfile
import tempfile
import unittest
import zipfile
from pathlib import Path

import archive
import dependencies
import notices
import sbom
from dependencies import Crate

TREE = """\
0strivec v0.1.0 (/some where/strivec)
1half v2.7.1
2cfg-if v1.0.5
2zerocopy v0.8.63
1zstd v0.13.3
2zstd-sys v2.1.2+zstd.1.5.7
1half v2.7.1 (*)
1syn v2.0.119 (proc-macro)
"""


def crate(name, folder, license="MIT", checksum="00", needs=()):
    """A crate whose version is 1.0.0."""
    return Crate(name, "1.0.0", license, ["A. Author"], "https://example.org", "A crate", folder, checksum, list(needs))


class TestDependencies(unittest.TestCase):
    def test_a_tree_becomes_a_graph(self):
        graph = dependencies.parse_tree(TREE)
        self.assertEqual(next(iter(graph)), "strivec 0.1.0")
        self.assertEqual(graph["strivec 0.1.0"], ["half 2.7.1", "zstd 0.13.3", "syn 2.0.119"])
        self.assertEqual(graph["half 2.7.1"], ["cfg-if 1.0.5", "zerocopy 0.8.63"])
        self.assertEqual(graph["zstd 0.13.3"], ["zstd-sys 2.1.2+zstd.1.5.7"])


class TestNotices(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.root = Path(temporary.name)

    def crate(self, name, files=None, **options):
        """A crate with the texts `files` by path."""
        for file, text in (files or {}).items():
            path = self.root / name / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return crate(name, self.root / name, **options)

    def notices(self, *crates):
        return notices.notices([self.crate("program", checksum=None), *crates])

    def test_license_files_are_found_in_bundled_sources_and_fonts(self):
        files = ["LICENSE-MIT", "COPYING", "vendored/COPYING", "fonts/OFL.txt"]
        files += ["src/license.rs", "tests/LICENSE", ".git/NOTICE"]
        found = notices.license_files(self.crate("a", dict.fromkeys(files, "text")).folder)
        names = [file.relative_to(self.root / "a").as_posix() for file in found]
        self.assertEqual(names, ["LICENSE-MIT", "fonts/OFL.txt", "vendored/COPYING"])

    def test_equal_texts_stand_there_once(self):
        text = self.notices(self.crate("b", {"LICENSE": "singular words\n"}), self.crate("a", {"LICENSE": "singular  words"}))
        self.assertEqual(text.count("singular"), 1)
        self.assertIn("a 1.0.0, b 1.0.0:\n\nsingular  words\n", text)
        self.assertNotIn("program 1.0.0:", text)

    def test_a_crate_without_a_file_gets_the_standard_text(self):
        self.assertIn("Copyright (c) A. Author", self.notices(self.crate("a", {"README.md": ""})))
        self.assertEqual(self.notices(self.crate("a", license="Apache-2.0")).count("Apache License"), 2)

    def test_a_crate_without_any_text_is_an_error(self):
        with self.assertRaisesRegex(ValueError, "a 1.0.0 .ISC."):
            self.notices(self.crate("a", license="ISC"))
        self.assertIn("a 1.0.0: BSL-1.0", self.notices(self.crate("a", license="BSL-1.0")))


class TestBill(unittest.TestCase):
    def test_components_have_checksums_and_uses(self):
        program = crate("program", Path(), checksum=None, needs=["used 1.0.0", "builder 1.0.0"])
        used, builder = crate("used", Path(), checksum="ab"), crate("builder", Path())
        result = sbom.bill({c.key: c for c in (program, used, builder)}, {program.key, used.key}, "some-target")
        self.assertEqual(result["metadata"]["component"]["purl"], "pkg:cargo/program@1.0.0")
        scopes = [(component["name"], component["scope"]) for component in result["components"]]
        self.assertEqual(scopes, [("builder", "excluded"), ("used", "required")])
        self.assertEqual(result["components"][1]["hashes"], [{"alg": "SHA-256", "content": "ab"}])
        uses = ["pkg:cargo/builder@1.0.0", "pkg:cargo/used@1.0.0"]
        self.assertEqual(result["dependencies"][0], {"ref": "pkg:cargo/program@1.0.0", "dependsOn": uses})


class TestArchive(unittest.TestCase):
    def test_bytes_depend_on_names_and_contents(self):
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / name for name in ("strivec", "LICENSE-MIT", "README.md")]
            for ending in archive.ENDINGS:
                output = Path(folder) / f"strivec-1{ending}"
                for file in files:
                    file.write_text(file.name)
                self.assertEqual(archive.main(output, files), 0)
                first = output.read_bytes()
                for file in files:
                    file.chmod(0o600)
                    file.touch()
                archive.main(output, files[::-1])
                self.assertEqual(output.read_bytes(), first)
                files[0].write_text("changed")
                archive.main(output, files)
                self.assertNotEqual(output.read_bytes(), first)

    def test_programs_are_executable(self):
        expected = [("a/LICENSE-MIT", 0o644), ("a/README.md", 0o644), ("a/strivec", 0o755), ("a/strivec.exe", 0o755)]
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / Path(name).name for name, _ in expected]
            for file in files:
                file.write_bytes(b"x")
            with tarfile.open(fileobj=io.BytesIO(archive.tar_gz("a", files))) as packed:
                self.assertEqual([(entry.name, entry.mode) for entry in packed], expected)
            with zipfile.ZipFile(io.BytesIO(archive.zipped("a", files))) as packed:
                self.assertEqual([(e.filename, e.external_attr >> 16 & 0o777) for e in packed.infolist()], expected)


if __name__ == "__main__":
    unittest.main()
