"""The notebook, if Jupyter's client is installed."""

import unittest

from common import ROOT, fixture, optional, skip, web_player, with_less_work

nbclient, nbformat, _ = optional("nbclient", "nbformat", "anywidget")


class Notebook(unittest.TestCase):
    def test_the_notebook_runs(self):
        notebook = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
        nbformat.validate(notebook)
        for cell in notebook.cells:
            cell.source = with_less_work(cell.source)
        nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
        shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        bundles = [output["data"] for output in shown if output.output_type == "execute_result"]
        self.assertTrue(any("tensors" in bundle.get("text/html", "") for bundle in bundles))

    def test_the_widget_holds_the_scene(self):
        scene = fixture("everything")
        if not web_player():
            with self.assertRaisesRegex(RuntimeError, "tools/web/build.sh"):
                scene.widget()
            skip("the web player is not built")
        widget = scene.widget(height=300)
        self.assertEqual((widget.data, widget.height), (scene.dumps(), 300))
        self.assertIn("application/vnd.jupyter.widget-view+json", scene._repr_mimebundle_())


if __name__ == "__main__":
    unittest.main()
