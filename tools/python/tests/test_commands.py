"""The commands as functions."""

import csv
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import textwrap
import unittest

from common import FIXTURES, fixture, skip, strivec, web_player


class Commands(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)

    def dataset(self):
        """A synthetic dataset."""
        strivec.command("synth", self.path / "spheres", views=8, test_views=2, size="32x32")
        return self.path / "spheres"

    def test_a_scene_is_trained_packed_and_evaluated(self):
        dataset, file = self.dataset(), self.path / "scene.strivec"
        events = []
        settings = strivec.settings("fast")
        settings["sampling"]["batch_rays"] = 64
        result = strivec.train(dataset, file, settings=settings, steps=300, max_params=100_000, prior=[dataset / "mesh.ply"], callback=events.append)
        self.assertEqual(result["steps"], 300)
        self.assertTrue(any(isinstance(event, strivec.Message) for event in events), events)
        progress = [event for event in events if isinstance(event, strivec.Progress) and event.task == "train"]
        self.assertTrue(all(0 <= event.done <= event.total == 300 for event in progress), progress)
        scene = strivec.Scene.load(file)
        self.assertEqual(scene.info()["preset"], "fast")
        report = strivec.evaluate(scene, dataset, split="test")
        self.assertGreater(report["psnr"], 10.0)
        strivec.pack(scene, self.path / "packed.strivec", lossless=True, no_prefixes=True, effort=0.1)
        self.assertLess((self.path / "packed.strivec").stat().st_size, file.stat().st_size)
        self.assertEqual(strivec.dataset(dataset)["splits"][0]["photographs"], 8)

    def test_settings_are_those_of_the_command(self):
        settings = strivec.settings("24")
        text = strivec.command("train", preset="24", print_config=True)
        self.assertEqual(strivec.settings_toml(settings), text)
        settings["loss"]["density_l1"] = "much"
        with self.assertRaises(strivec.UsageError):
            strivec.settings_toml(settings)
        with self.assertRaises(strivec.UsageError):
            strivec.settings("unknown")

    def test_errors_have_the_class_of_their_exit_code(self):
        for call, error in (
            (lambda: strivec.command("info", self.path / "absent.strivec"), strivec.InputError),
            (lambda: strivec.command("render"), strivec.UsageError),
            (lambda: strivec.command("info", FIXTURES.parent / "hostile" / "major-2.strivec"), strivec.UnsupportedError),
            (lambda: strivec.command("info", __file__), strivec.MalformedError),
            (lambda: strivec.command("train", self.path, output=self.path / "x.strivec"), strivec.MalformedError),
        ):
            with self.assertRaises(error):
                call()

    def test_a_file_s_name_is_no_option(self):
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.path)
        fixture("smallest").save("--json")
        self.assertEqual(strivec.command("info", "--json")["tool"], fixture("smallest").info()["tool"])

    def test_names_in_a_csv_report_are_no_formulas(self):
        self.dataset()
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.path)
        fixture("f32").save("=1+2.strivec")
        strivec.evaluate("=1+2.strivec", "spheres", split="test", csv="views.csv")
        with open("views.csv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["file"] for row in rows], ["'=1+2.strivec"] * 2)
        self.assertGreater(float(rows[0]["mse"]), 0.0)

    def test_the_working_folder_is_not_emptied_by_publish(self):
        fixture("smallest").save(self.path / "s.strivec")
        command = [sys.executable, "-m", "strivec", "publish", "s.strivec", ".", "--force"]
        done = subprocess.run(command, cwd=self.path, stderr=subprocess.PIPE, text=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, "a new folder" if web_player() else "no web player")
        self.assertEqual([path.name for path in self.path.iterdir()], ["s.strivec"])

    def test_an_exception_of_the_callback_ends_the_command(self):
        dataset, file = self.dataset(), self.path / "scene.strivec"

        def stop(event):
            if isinstance(event, strivec.Progress) and event.task == "train":
                raise KeyError("enough")

        with self.assertRaises(KeyError):
            strivec.train(dataset, file, preset="fast", steps=100_000, prior=[dataset / "mesh.ply"], callback=stop)
        self.assertFalse(file.exists())
        self.assertTrue((self.path / "scene.strivec.state").exists())

    def test_control_c_keeps_a_checkpoint(self):
        dataset, file = self.dataset(), self.path / "scene.strivec"
        code = f"""
            import strivec
            def told(event):
                print("begun", flush=True) if isinstance(event, strivec.Progress) and event.task == "train" else None
            prior = [{str(dataset / "mesh.ply")!r}]
            strivec.train({str(dataset)!r}, {str(file)!r}, preset="fast", steps=100000, prior=prior, callback=told)
        """
        # What shells start in the background ignores the signal, and so do its children.
        process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(code)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        self.addCleanup(process.kill)
        self.assertEqual(process.stdout.readline(), "begun\n")
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
        self.assertIn("KeyboardInterrupt", errors)
        self.assertFalse(file.exists())
        self.assertTrue((self.path / "scene.strivec.state").exists())

    def test_a_page_holds_the_scene(self):
        scene = fixture("everything").with_parts(notes={"a": "</script><script>alert(1)</script>"})
        if not web_player():
            with self.assertRaisesRegex(strivec.RunError, "tools/web/build.sh"):
                scene.publish(self.path / "scene.html")
            skip("the web player is not built")
        page = scene.publish(self.path / "scene.html", title="<b>A scene</b>")
        text = page.read_text(encoding="utf-8")
        self.assertIn("<title>&lt;b&gt;A scene&lt;/b&gt;</title>", text)
        self.assertNotIn("alert(1)", text)
        with self.assertRaises(strivec.UsageError):
            scene.publish(page)
        index = scene.publish(self.path / "site")
        self.assertIn('src="scene.strivec"', index.read_text(encoding="utf-8"))
        self.assertEqual((index.parent / "scene.strivec").read_bytes(), scene.dumps())
        self.assertEqual(sorted(path.name for path in self.path.iterdir()), ["scene.html", "site"])

    def test_a_notebook_shows_the_facts(self):
        hostile = "<script>\u202e"
        shown = fixture("everything").with_parts(license=hostile)._repr_html_()
        self.assertIn("&lt;script&gt;\\u202e", shown)
        self.assertNotIn("<script>", shown)
        self.assertIn("image/", shown)
        self.assertIn("tensors", repr(fixture("everything")))
        json.dumps(fixture("everything")._repr_mimebundle_()["text/html"])


if __name__ == "__main__":
    unittest.main()
