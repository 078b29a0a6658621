"""Batches, if the extra `ray` is installed."""

import errno
import http.server
import io
import json
import os
import pathlib
import sys
import tarfile
import tempfile
import threading
import unittest
import zipfile
from unittest import mock

from common import ROOT, optional, strivec

fsspec, pyarrow, _, _ = optional("fsspec", "pyarrow", "pyarrow.parquet", "ray")

from fsspec.implementations.memory import MemoryFileSystem  # noqa: E402
from strivec.batch import report, schedule, specification, stages, store  # noqa: E402

sys.path.append(str(ROOT / "tools" / "measure"))
import batch as measured  # noqa: E402


class FlakyFileSystem(MemoryFileSystem):
    """A store in memory that fails every third request."""

    protocol = "flaky"
    requests = 0
    cachable = False

    def _counted(self):
        FlakyFileSystem.requests += 1
        if FlakyFileSystem.requests % 3 == 0:
            raise ConnectionError("the connection was reset")

    def cat_file(self, path, *arguments, **options):
        self._counted()
        return super().cat_file(path, *arguments, **options)

    def pipe_file(self, path, value, *arguments, **options):
        self._counted()
        return super().pipe_file(path, value, *arguments, **options)

    def put_file(self, *arguments, **options):
        self._counted()
        return super().put_file(*arguments, **options)

    def get_file(self, *arguments, **options):
        self._counted()
        return super().get_file(*arguments, **options)


class FullFileSystem(MemoryFileSystem):
    """A store in memory that is full."""

    protocol = "full"
    tries = 0
    cachable = False

    def pipe_file(self, path, value, *arguments, **options):
        FullFileSystem.tries += 1
        raise OSError(errno.ENOSPC, "No space left on device")


class ListingFileSystem(fsspec.AbstractFileSystem):
    """A store of objects, whose keys are any text; all have the content `b"data"`."""

    protocol = "listing"
    keys = []
    cachable = False

    @classmethod
    def _strip_protocol(cls, path):
        return path.split("://", 1)[-1]

    def find(self, path, maxdepth=None, withdirs=False, detail=False, **options):
        return {key: {"name": key, "size": 4, "type": "file"} for key in self.keys}

    def get_file(self, remote, local, **options):
        if remote not in self.keys:
            raise FileNotFoundError(remote)
        pathlib.Path(local).write_bytes(b"data")


class Pages(http.server.BaseHTTPRequestHandler):
    """A web server whose index links to a file outside of its folder."""

    index = b'<a href="transforms.json">a</a> <a href="../../../outside">b</a>'

    def do_HEAD(self):
        self.do_GET()

    def do_GET(self):
        is_index = self.path.rstrip("/") == "/kitchen"
        self.send_response(200)
        self.send_header("Content-Type", "text/html" if is_index else "text/plain")
        self.send_header("Content-Length", str(len(self.index if is_index else b"data")))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(self.index if is_index else b"data")

    def log_message(self, *arguments):
        pass


fsspec.register_implementation("listing", ListingFileSystem, clobber=True)
fsspec.register_implementation("flaky", FlakyFileSystem, clobber=True)
fsspec.register_implementation("full", FullFileSystem, clobber=True)


class Batches(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="strivec-test-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name)

    def test_specifications_are_refused_with_the_place(self):
        for text, place in (
            ("", "output"),
            ("output = 1", "output"),
            ('output = "x"', "scene"),
            ('output = "x"\nscene = [1]', "scene 0"),
            ('output = "x"\nother = 1\n[[scene]]', "other"),
            ('output = "x"\n[[scene]]', "name of scene 0"),
            ('output = "x"\n[[scene]]\nname = "../a"\ndataset = "d"', "name of scene 0"),
            ('output = "x"\n[[scene]]\nname = "a"\ndataset = "d"\n[[scene]]\nname = "a"\ndataset = "d"', "scene 1"),
            ('output = "x"\n[[scene]]\nname = "a"\ndataset = "d"\nprior = "p"', "prior of scene 0"),
            ('output = "x"\n[[scene]]\nname = "a"\ndataset = "d"\ntrain = 1', "train of scene 0"),
            ('output = "x"\n[[scene]]\nname = "a"\ndataset = "d"\ntrane = {}', "trane"),
            ("output = ", "batch.toml"),
        ):
            with self.subTest(text), self.assertRaises(strivec.MalformedError) as caught:
                specification.read(text, "batch.toml")
            self.assertIn("batch.toml", str(caught.exception))
            self.assertIn(place, str(caught.exception))
        read = specification.read(
            'output = "x"\ndefaults.train = { steps = 1, seed = 2 }\n[[scene]]\nname = "a"\ndataset = "d"\ntrain = { steps = 3 }',
            "batch.toml",
        )
        self.assertEqual(read.jobs[0].of("train"), {"steps": 3, "seed": 2})

    def test_a_store_that_fails_every_third_request_serves(self):
        flaky = store.Store("flaky://store")
        for number in range(30):
            flaky.write_json(f"values/{number}.json", number)
        self.assertEqual([flaky.read_json(f"values/{number}.json") for number in range(30)], list(range(30)))
        self.assertGreater(FlakyFileSystem.requests, 80)

    def test_a_full_store_is_a_clear_error_at_once(self):
        with self.assertRaisesRegex(strivec.InputError, "full://store/x: No space left on device"):
            store.Store("full://store").write("x", b"data")
        self.assertEqual(FullFileSystem.tries, 1)
        with self.assertRaisesRegex(strivec.InputError, "/dev/full|Not a directory"):
            store.Store("/dev/full/store").write("x", b"data")

    def test_a_failed_write_leaves_what_was_there(self):
        here = store.Store(str(self.path))
        here.write("x", b"before")
        with self.assertRaises(strivec.InputError):
            here.upload(self.path / "absent", "x")
        self.assertEqual(here.read("x"), b"before")
        self.assertEqual([path.name for path in self.path.iterdir()], ["x"])

    def test_an_upload_is_on_the_disk_before_it_counts(self):
        (self.path / "local").write_bytes(b"data")
        synced = []
        with mock.patch.object(os, "fsync", lambda handle: synced.append(os.fstat(handle).st_ino)):
            store.Store(str(self.path / "store")).upload(self.path / "local", "folder/x")
        uploaded = self.path / "store" / "folder" / "x"
        self.assertEqual(uploaded.read_bytes(), b"data")
        self.assertEqual(synced, [uploaded.stat().st_ino, uploaded.parent.stat().st_ino])

    def listed(self, *keys, url="listing://bucket/kitchen"):
        """The names of the files in the local copy of a folder that the store lists as `keys`."""
        with mock.patch.object(ListingFileSystem, "keys", keys), mock.patch.object(tempfile, "tempdir", str(self.path)):
            with store.Input(url).local() as folder:
                return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())

    def test_keys_of_objects_stay_within_their_folder(self):
        own = "bucket/kitchen/transforms.json"
        self.assertEqual(self.listed(own, "bucket/kitchen/train/a.png"), ["train/a.png", "transforms.json"])
        # The folder itself, as some stores list it.
        self.assertEqual(self.listed("bucket/kitchen", "bucket/kitchen/", "bucket/kitchen/train/", own), ["transforms.json"])
        for key in (
            "bucket/kitchen/../outside",
            "bucket/kitchen/../../../outside",
            "bucket/kitchen//etc/outside",
            "bucket/kitchen/..\\..\\outside",
            "bucket/kitchen/C:\\outside",
            "bucket/kitchen/%2e%2e/outside",
            "bucket/kitchen/https://other/outside",
            "bucket/other/outside",
            "https://other/kitchen/outside",
        ):
            with self.subTest(key), self.assertRaises(strivec.MalformedError) as caught:
                self.listed(own, key)
            self.assertRegex(str(caught.exception), "listing://bucket/kitchen: the name .*outside' leads out of the folder ")
            self.assertEqual(list(self.path.iterdir()), [])
        with self.assertRaisesRegex(strivec.MalformedError, "not the name of a file"):
            self.listed(own, "bucket/kitchen/a\0b")

    def test_the_last_part_of_an_address_stays_within_its_folder(self):
        with self.assertRaisesRegex(strivec.MalformedError, "leads out of the folder"):
            self.listed("bucket/..", url="listing://bucket/..")
        self.assertEqual(list(self.path.iterdir()), [])

    def test_links_of_web_pages_stay_within_their_folder(self):
        optional("aiohttp")
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Pages)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        folder = self.path / "a" / "b" / "c"
        folder.mkdir(parents=True)
        with mock.patch.object(tempfile, "tempdir", str(folder)):
            with self.assertRaisesRegex(strivec.MalformedError, f":{server.server_port}/kitchen: .*leads out of the folder"):
                with store.Input(f"http://127.0.0.1:{server.server_port}/kitchen").local():
                    pass
        self.assertEqual([path for path in self.path.rglob("*") if path.is_file()], [])

    def test_identities_are_those_of_contents(self):
        cache = store.Store(str(self.path / "cache"))
        for name in ("a", "b"):
            (self.path / name).mkdir()
            (self.path / name / "file").write_text("text")
        one, other = (store.Input(str(self.path / name)).identity(cache) for name in ("a", "b"))
        self.assertEqual(one, other)
        (self.path / "b" / "file").write_text("texts")
        self.assertNotEqual(store.Input(str(self.path / "b")).identity(cache), one)
        with self.assertRaisesRegex(strivec.InputError, "absent"):
            store.Input(str(self.path / "absent")).identity(cache)

    def test_archives_are_unpacked(self):
        (scene,) = measured.datasets(self.path, 1, 16)
        archive = self.path / "data.zip"
        with zipfile.ZipFile(archive, "w") as packed:
            for file in scene.rglob("*"):
                packed.write(file, f"data/{file.relative_to(scene)}")
        with store.Input(str(archive)).local() as folder:
            self.assertEqual(strivec.dataset(folder)["splits"][0]["photographs"], 12)

    def test_entries_of_archives_stay_within_their_folder(self):
        def unpacked(name):
            with store.Input(str(self.path / name)).local() as folder:
                return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))

        def tar(*members):
            with tarfile.open(self.path / "data.tar", "w") as packed:
                for name, kind, link in members:
                    member = tarfile.TarInfo(name)
                    member.type, member.linkname = kind, link
                    packed.addfile(member, io.BytesIO())

        for name in ("../../outside", "/outside", "a/../../outside", "..\\outside", "C:\\outside"):
            with zipfile.ZipFile(self.path / "data.zip", "w") as packed:
                packed.writestr(name, "x")
            tar((name, tarfile.REGTYPE, ""))
            for archive in ("data.zip", "data.tar"):
                with self.subTest(name, archive=archive), self.assertRaises(strivec.MalformedError) as caught:
                    unpacked(archive)
                self.assertRegex(str(caught.exception), f"{archive}: the name .*outside' leads out of the folder ")
        for kind, link in ((tarfile.SYMTYPE, "../../outside"), (tarfile.SYMTYPE, "/outside"), (tarfile.LNKTYPE, "../outside")):
            tar(("a/link", kind, link))
            with self.subTest(link), self.assertRaisesRegex(strivec.MalformedError, "outside' leads out of the folder "):
                unpacked("data.tar")
        tar((".", tarfile.DIRTYPE, ""), ("./a", tarfile.REGTYPE, ""), ("./b", tarfile.SYMTYPE, "a"))
        self.assertEqual(unpacked("data.tar"), ["a", "b"] if hasattr(tarfile, "data_filter") else ["a"])

    def test_stages_of_one_scene_without_ray(self):
        (scene,) = measured.datasets(self.path, 1, 24)
        batch = measured.batch_of([scene], f"flaky://{self.path.name}", 200, is_quick=True)
        keys, done = {}, []
        for name in stages.wanted(batch.jobs[0]):
            one = stages.run(batch.output, batch.jobs[0], name, keys, 1)
            self.assertTrue(one.is_new)
            again = stages.run(batch.output, batch.jobs[0], name, keys, 1)
            self.assertEqual((again.key, again.facts, again.is_new), (one.key, one.facts, False))
            keys[name] = one.key
            done.append(one)
        row = stages.publish(batch.output, batch.jobs[0], done)
        self.assertGreater(row["psnr"], 5.0)
        data = store.Store(batch.output).read(row["file"])
        self.assertEqual(strivec.Scene.loads(data).info()["steps"], 200)

    def test_a_training_goes_on_from_the_checkpoint_of_another_machine(self):
        (scene,) = measured.datasets(self.path, 1, 24)
        whole, cut = (measured.batch_of([scene], str(self.path / name), 400, is_quick=True) for name in ("whole", "cut"))
        job = whole.jobs[0]
        prior, there = ({"prior": stages.run(batch.output, job, "prior", {}, 1).key} for batch in (whole, cut))
        self.assertEqual(prior, there)
        expected = stages.run(whole.output, job, "train", prior, 1)

        class Death(BaseException):
            """Of a machine, as far as the store knows."""

        told = stages.Work.told

        def dying(work, event):
            told(work, event)
            if work.store.exists(f"checkpoints/{work.key}.state"):
                raise Death

        stages.Work.told = dying
        try:
            with self.assertRaises(Death):
                stages.run(cut.output, job, "train", prior, 1)
        finally:
            stages.Work.told = told
        one = stages.run(cut.output, job, "train", prior, 1)
        files = [
            store.Store(url).read(f"objects/train/{key}/scene.strivec")
            for url, key in ((whole.output, expected.key), (cut.output, one.key))
        ]
        self.assertEqual(*files)
        self.assertFalse(store.Store(cut.output).exists(f"checkpoints/{one.key}.state"))

    def test_a_batch_survives_the_death_of_a_machine(self):
        folders = measured.datasets(self.path, 3, 24)
        output = self.path / "done"
        jobs, _, killed = measured.run(measured.batch_of(folders, output, 300, is_quick=True), kills=(0,))
        self.assertEqual(killed, 1)
        self.assertEqual([one.state for one in jobs], ["done", "done", "done", "failed"], [one.error for one in jobs])
        self.assertEqual(measured.begun_again(output), [])
        letter = json.loads((output / "failed" / "broken.json").read_text())
        self.assertEqual((letter["class"], letter["stage"]), ("MalformedError", "plan"))
        self.assertIn("transforms_train.json", letter["error"])
        table = pyarrow.parquet.read_table(output / "results.parquet").to_pylist()
        self.assertEqual([row["state"] for row in table], ["done", "done", "done", "failed"])
        page = (output / "index.html").read_text(encoding="utf-8")
        self.assertIn("3 of 4 scenes", page)
        self.assertIn('href="scenes/data00.strivec"', page)

    def test_warnings_of_all_stages_are_in_the_gallery(self):
        job = specification.Job("a", "data")
        made = []
        for stage, said in (("train", "warning: <1> photograph"), ("pack", "no warning: of this")):
            work = stages.Work(None, job, "key", 1, {}, self.path)
            work.told(strivec.Message(said))
            facts = {"bytes": 1, "parameters": 1, "steps": 1, "stage_seconds": 1.0, "peak_memory_bytes": 1}
            made.append(stages.Done(stage, "key", {**facts, "warnings": work.warnings}, True))
        report.write(store.Store(str(self.path)), [schedule.Progress(job, [], made, "done")])
        page = (self.path / "index.html").read_text(encoding="utf-8")
        self.assertIn("<pre>&lt;1&gt; photograph</pre>", page)
        self.assertNotIn("of this", page)
        (row,) = pyarrow.parquet.read_table(self.path / "results.parquet").to_pylist()
        self.assertEqual(row["warnings"], "<1> photograph")

    def test_texts_of_files_are_harmless_in_the_gallery(self):
        self.assertEqual(report.safe("<b>\u202e\n"), "&lt;b&gt;\\u202e\\n")
        self.assertEqual(report.printable("\x1b[2J"), "\\x1b[2J")

    def test_the_gallery_runs_no_scripts(self):
        report.write(store.Store(str(self.path)), [schedule.Progress(specification.Job("a", "data"), [], state="failed", error="none")])
        page = (self.path / "index.html").read_text(encoding="utf-8")
        self.assertRegex(page, "<meta http-equiv=\"Content-Security-Policy\" content=\"script-src 'none'; ")


if __name__ == "__main__":
    unittest.main()
