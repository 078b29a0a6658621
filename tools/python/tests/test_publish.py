"""Pages and folders for the web, with a player of a few lines in place of the built one."""

import base64
import hashlib
import html.parser
import json
import os
import pathlib
import tempfile
import unittest
from unittest import mock

from common import strivec

from strivec import publish as published

SCRIPT = 'export const text = "</SCRIPT><!-- é";\n'


class FakeScene:
    """What `publish` uses of a scene."""

    def __init__(self, data=b"scene"):
        self.data = data
        self.description = {"provenance": {"dataset": "<lego>"}}

    def dumps(self):
        return self.data


class Page(html.parser.HTMLParser):
    """The policy and the scripts of a page."""

    def __init__(self, text):
        super().__init__()
        self.policy, self.scripts, self.tags, self.inline = None, [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append(tag)
        if attributes.get("http-equiv") == "Content-Security-Policy":
            rules = (rule.split() for rule in attributes["content"].split(";"))
            self.policy = {name: set(sources) for name, *sources in rules}
            self.tags_before_policy = list(self.tags)
        if tag == "script" and attributes.get("type") == "module" and "src" not in attributes:
            self.scripts.append("")
            self.inline = True

    def handle_endtag(self, tag):
        if tag == "script":
            self.inline = False

    def handle_data(self, data):
        if self.inline:
            self.scripts[-1] += data


class Publishing(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="strivec-test-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)
        self.web = self.path / "web"
        (self.web / "assets").mkdir(parents=True)
        (self.web / "index.html").write_text(
            "<!doctype html><html><head><title>Strivec</title></head><body><strivec-viewer controls></strivec-viewer></body></html>"
        )
        (self.web / "strivec-viewer.js").write_text("viewer 1")
        (self.web / "strivec-viewer-whole.js").write_text(SCRIPT, encoding="utf-8")
        (self.web / "assets" / "page-1.js").write_text("page 1")
        patch = mock.patch.object(published, "_WEB", self.web)
        patch.start()
        self.addCleanup(patch.stop)
        self.site = self.path / "site"

    def publish(self, output, data=b"scene", **options):
        return published.publish(FakeScene(data), output, **options)

    def renew_player(self):
        """Makes the player another version, in which a file has another name."""
        (self.web / "assets" / "page-1.js").unlink()
        (self.web / "assets" / "page-2.js").write_text("page 2")
        (self.web / "strivec-viewer.js").write_text("viewer 2")

    def contents(self, folder):
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    def test_files_of_users_are_never_removed(self):
        home = self.path / "home"
        (home / "photos").mkdir(parents=True)
        (home / "thesis.txt").write_text("years of work")
        (home / "photos" / "a.jpg").write_text("photo")
        before = self.contents(home)
        with self.assertRaises(strivec.UsageError) as caught:
            self.publish(home, overwrite=True)
        for part in (str(home), "published.json", "a new folder"):
            self.assertIn(part, str(caught.exception))
        (self.path / "link").symlink_to("home")
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(home)
        for output in (".", "", self.path / "link", home / "photos"):
            with self.subTest(output), self.assertRaises(strivec.UsageError):
                self.publish(output, overwrite=True)
        self.assertEqual(self.contents(home), before)

    def test_a_published_folder_is_replaced_and_other_files_in_it_stay(self):
        index = self.publish(self.site, b"before")
        self.assertEqual(index, self.site / "index.html")
        with self.assertRaisesRegex(strivec.UsageError, "exists"):
            self.publish(self.site)
        (self.site / "robots.txt").write_text("mine")
        (self.site / "assets" / "logo.svg").write_text("mine too")
        self.renew_player()
        self.publish(self.site, b"after", overwrite=True)
        files = self.contents(self.site)
        names = {"assets/logo.svg", "assets/page-2.js", "index.html", "published.json", "robots.txt", "scene.strivec", "strivec-viewer.js"}
        self.assertEqual(set(files), names)
        self.assertEqual((files["scene.strivec"], files["strivec-viewer.js"]), (b"after", b"viewer 2"))
        self.assertEqual((files["robots.txt"], files["assets/logo.svg"]), (b"mine", b"mine too"))
        listed = json.loads(files["published.json"])["files"]
        self.assertEqual(set(listed), names - {"published.json", "robots.txt", "assets/logo.svg"})
        self.assertEqual(listed["scene.strivec"], [hashlib.sha256(b"after").hexdigest()])

    def test_folders_without_files_are_removed(self):
        self.publish(self.site)
        (self.web / "assets" / "page-1.js").rename(self.web / "page-1.js")
        self.publish(self.site, overwrite=True)
        self.assertFalse((self.site / "assets").exists())
        self.assertTrue((self.site / "page-1.js").is_file())

    def test_the_working_folder_is_replaced_in_place(self):
        self.publish(self.site)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.site)
        self.publish(".", b"after", overwrite=True)
        self.assertEqual(pathlib.Path("scene.strivec").read_bytes(), b"after")

    def test_an_empty_folder_is_filled(self):
        self.site.mkdir()
        self.publish(self.site, overwrite=True)
        self.assertIn("index.html", self.contents(self.site))

    def test_files_that_a_user_changed_or_added_are_not_replaced(self):
        self.publish(self.site)
        for name in ("index.html", "assets/page-2.js"):
            (self.site / name).write_text("mine")
        before = self.contents(self.site)
        self.renew_player()
        with self.assertRaises(strivec.UsageError) as caught:
            self.publish(self.site, b"after", overwrite=True)
        self.assertRegex(str(caught.exception), r"assets/page-2\.js, index\.html; move them away")
        self.assertEqual(self.contents(self.site), before)

    def test_a_list_that_names_files_elsewhere_is_refused(self):
        self.publish(self.site)
        manifest = self.site / "published.json"
        document = json.loads(manifest.read_bytes())
        outside = self.path / "thesis.txt"
        outside.write_text("mine")
        digest = hashlib.sha256(b"mine").hexdigest()
        for name in ("../thesis.txt", str(outside), "assets/../../thesis.txt"):
            manifest.write_text(json.dumps({**document, "files": {**document["files"], name: [digest]}}))
            before = self.contents(self.site)
            with self.subTest(name), self.assertRaisesRegex(strivec.MalformedError, "published.json.*leads out of the folder"):
                self.publish(self.site, b"after", overwrite=True)
            self.assertEqual((self.contents(self.site), outside.read_text()), (before, "mine"))
        for text in ("", "[]", "{}", '{"tool": "another", "files": {}}', '{"tool": "strivec publish", "files": {"a": 1}}'):
            manifest.write_text(text)
            with self.subTest(text), self.assertRaisesRegex(strivec.MalformedError, "published.json: expected the list"):
                self.publish(self.site, overwrite=True)

    def test_a_link_out_of_the_folder_is_not_followed(self):
        self.publish(self.site)
        elsewhere = self.path / "elsewhere"
        (self.site / "assets").rename(elsewhere)
        (self.site / "assets").symlink_to(elsewhere)
        with self.assertRaisesRegex(strivec.MalformedError, "leads out of the folder"):
            self.publish(self.site, b"after", overwrite=True)
        self.assertEqual((self.site / "scene.strivec").read_bytes(), b"scene")

    def test_a_full_disk_leaves_the_folder_as_it_was(self):
        self.publish(self.site)
        before = self.contents(self.site)
        full = mock.patch.object(published, "sync", side_effect=OSError(28, "No space left on device"))
        for output in (self.site, self.path / "new"):
            with full, self.assertRaisesRegex(strivec.InputError, f"{output.name}: cannot write it: No space left"):
                self.publish(output, b"after", overwrite=True)
        self.assertEqual(self.contents(self.site), before)
        self.assertEqual({path.name for path in self.path.iterdir()}, {"site", "web"})

    def test_an_interrupted_replacement_is_completed_by_the_next(self):
        self.publish(self.site)
        replace, calls = os.replace, []

        def dying(*paths):
            calls.append(paths)
            if len(calls) == 4:
                raise KeyboardInterrupt
            replace(*paths)

        self.renew_player()
        with mock.patch.object(os, "replace", dying), self.assertRaises(KeyboardInterrupt):
            self.publish(self.site, b"after", overwrite=True)
        self.publish(self.site, b"third", overwrite=True)
        self.assertEqual((self.site / "scene.strivec").read_bytes(), b"third")
        self.assertEqual(
            set(self.contents(self.site)),
            {"assets/page-2.js", "index.html", "published.json", "scene.strivec", "strivec-viewer.js"},
        )

    def test_a_file_and_a_folder_do_not_replace_each_other(self):
        (self.path / "file").write_text("mine")
        (self.path / "folder.html").mkdir()
        for name in ("file", "folder.html"):
            with self.subTest(name), self.assertRaisesRegex(strivec.UsageError, f"{name}: expected .*; found"):
                self.publish(self.path / name, overwrite=True)
        with self.assertRaisesRegex(strivec.InputError, "absent/page.html: cannot write it"):
            self.publish(self.path / "absent" / "page.html")

    def test_the_page_of_a_folder_runs_and_loads_only_what_is_beside_it(self):
        text = self.publish(self.site, title="<b>").read_text(encoding="utf-8")
        self.assertIn("<title>&lt;b&gt;</title>", text)
        page = Page(text)
        self.assertEqual(page.policy["default-src"], {"'none'"})
        self.assertEqual(page.policy["script-src"], {"'self'", "'wasm-unsafe-eval'"})
        self.assertEqual(page.policy["connect-src"], {"'self'"})
        self.assertEqual(page.tags_before_policy, ["html", "head", "meta"])

    def test_one_page_runs_its_own_scripts_alone(self):
        page = Page(self.publish(self.path / "page.html").read_text(encoding="utf-8"))
        self.assertEqual(len(page.scripts), 2)
        digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in page.scripts)
        self.assertEqual(page.policy["script-src"], {"'wasm-unsafe-eval'", *(f"'sha256-{digest}'" for digest in digests)})
        self.assertEqual(page.policy["default-src"], {"'none'"})
        self.assertEqual(page.policy["connect-src"], {"data:"})
        self.assertNotIn("script", page.tags_before_policy)

    def test_the_player_s_text_does_not_end_its_script(self):
        page = Page(self.publish(self.path / "page.html").read_text(encoding="utf-8"))
        self.assertEqual(page.scripts[0], 'export const text = "<\\/SCRIPT><\\!-- é";\n')


if __name__ == "__main__":
    unittest.main()
