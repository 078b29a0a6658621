"""The examples of README.md, in the order of the page."""

import os
import re
import tempfile
import unittest

from common import FIXTURES, ROOT, strivec, with_less_work


class Readme(unittest.TestCase):
    def test_the_examples_run(self):
        text = (ROOT / "tools" / "python" / "README.md").read_text(encoding="utf-8")
        examples = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        self.assertEqual(len(examples), 2)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)
        strivec.Scene.load(FIXTURES / "everything.strivec").save("lego.strivec")
        strivec.command("synth", "lego", views=8, test_views=2, size="32x32")
        names = {}
        exec(examples[0], names)
        self.assertEqual(names["picture"].color.shape, (400, 400, 3))
        self.assertEqual(names["sigma"].shape, (1,))
        # Over the file that is there.
        example = with_less_work(examples[1]).replace("steps=200", "steps=200, force=True")
        exec(example, names)
        self.assertEqual(strivec.Scene.load("small.strivec").info()["steps"], 200)


if __name__ == "__main__":
    unittest.main()
