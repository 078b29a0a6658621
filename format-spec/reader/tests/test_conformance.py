"""The conformance suite of the format, run with this reader."""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
SUITE = ROOT / "format-spec" / "conformance"


class Conformance(unittest.TestCase):
    def run_suite(self, reader):
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "format-spec" / "reader")}
        command = [sys.executable, str(SUITE / "run.py"), *reader]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)

    def test_this_reader_conforms(self):
        run = self.run_suite([sys.executable, "-m", "strivec_reader", "--budget", str(64 << 20), "conform"])
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        self.assertIn(" 0 failures, 0 other classes", run.stdout)

    def test_a_reader_that_differs_fails(self):
        # It prints what is expected, but for one change.
        rows = json.loads((SUITE / "expected.json").read_text())
        valid = next(row for row in rows if row["numbers"] and row["numbers"]["probes"])

        def number(row):
            row["numbers"]["scales"][0]["density"] ^= 1

        def probe(row):
            row["numbers"]["probes"][0]["color"][1] += 2e-4

        def verdict(row):
            row.update({"class": "malformed", "numbers": None})

        def skipped(row):
            row["skipped"] = [["NOTES", "value"]]

        for change in (number, probe, verdict, skipped):
            changed = json.loads(json.dumps(rows))
            change(next(row for row in changed if row["file"] == valid["file"]))
            with tempfile.TemporaryDirectory() as folder:
                answers, reader = pathlib.Path(folder) / "rows.json", pathlib.Path(folder) / "reader.py"
                answers.write_text(json.dumps({row["file"]: row for row in changed}))
                reader.write_text(
                    "import json, pathlib, sys\n"
                    f"rows = json.loads(pathlib.Path({str(answers)!r}).read_text())\n"
                    "print(json.dumps([rows['/'.join(pathlib.Path(p).parts[-2:])] for p in sys.argv[1:]]))\n"
                )
                run = self.run_suite([sys.executable, str(reader)])
            self.assertEqual(run.returncode, 1, change.__name__)
            self.assertIn(" 1 failures", run.stdout, change.__name__)


class FileType(unittest.TestCase):
    @unittest.skipUnless(shutil.which("file"), "file(1) is missing")
    def test_file_knows_the_format(self):
        scene = ROOT / "fixtures" / "v1" / "smallest.strivec"
        command = ["file", "--brief", "--magic-file", str(ROOT / "format-spec" / "strivec.magic")]
        output = lambda *more: subprocess.run([*command, *more], capture_output=True, text=True, check=True).stdout
        self.assertEqual(output(str(scene)), "Strivec scene, version 1.0, 9 sections, 1880 bytes\n")
        self.assertEqual(output("--mime-type", str(scene)), "model/vnd.strivec\n")
        self.assertNotIn("Strivec", output(str(ROOT / "fixtures" / "hostile" / "line-endings.strivec")))


if __name__ == "__main__":
    unittest.main()
