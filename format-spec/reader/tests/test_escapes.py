"""Names of files, and texts in them, are printed with escapes.

    PYTHONPATH=format-spec/reader python -m unittest discover format-spec/reader/tests
"""

import contextlib
import io
import shutil
import tempfile
import unittest
from pathlib import Path

from strivec_reader.__main__ import escaped, main

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"
NAME = "a\x1b]0;title\x07\r\nforged\u202e.strivec"


class Escapes(unittest.TestCase):
    def test_controls_are_escaped_and_other_characters_are_kept(self):
        self.assertEqual(escaped('Zürich, 東京 "x"'), 'Zürich, 東京 "x"')
        self.assertEqual(escaped("a\x1b\r\n\x9b\u202e\u200b\u2028"), "a\\x1b\\r\\n\\x9b\\u202e\\u200b\\u2028")

    def test_names_reach_no_terminal_raw(self):
        with tempfile.TemporaryDirectory() as folder:
            valid, damaged, missing = (Path(folder) / (prefix + NAME) for prefix in ("", "damaged ", "missing "))
            shutil.copy(FIXTURES / "v1" / "smallest.strivec", valid)
            damaged.write_bytes(valid.read_bytes()[:-1])
            for command, path in (("info", valid), ("verify", valid), ("info", damaged), ("verify", missing)):
                output = io.StringIO()
                with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
                    main([command, str(path)])
                text = output.getvalue()
                self.assertIn(r"a\x1b]0;title\x07\r\nforged\u202e.strivec", text)
                self.assertEqual(escaped(text.replace("\n", "")), text.replace("\n", ""))


if __name__ == "__main__":
    unittest.main()
