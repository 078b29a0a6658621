"""The notebook, if Jupyter's client is installed."""

import unittest

from common import ROOT, fixture

try:
    import nbformat
    from nbclient import NotebookClient
except ImportError:
    NotebookClient = None


@unittest.skipIf(NotebookClient is None, "nbclient is not installed")
class Notebook(unittest.TestCase):
    def test_the_notebook_runs(self):
        notebook = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
        nbformat.validate(notebook)
        NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
        shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        bundles = [output["data"] for output in shown if output.output_type == "execute_result"]
        self.assertTrue(any("tensors" in bundle.get("text/html", "") for bundle in bundles))

    def test_the_widget_holds_the_scene(self):
        try:
            import anywidget  # noqa: F401
        except ImportError:
            self.skipTest("anywidget is not installed")
        scene = fixture("everything")
        try:
            widget = scene.widget(height=300)
        except RuntimeError as error:
            self.assertIn("tools/web/build.sh", str(error))
            self.skipTest("the web player is not built")
        self.assertEqual((widget.data, widget.height), (scene.dumps(), 300))
        self.assertIn("application/vnd.jupyter.widget-view+json", scene._repr_mimebundle_())


if __name__ == "__main__":
    unittest.main()
