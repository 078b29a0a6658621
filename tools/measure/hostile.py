#!/usr/bin/env python3
"""Gives hostile inputs to the programs that read them, and prints the exit code, the seconds and the memory of each command.

    tools/measure/hostile.py FOLDER [--programs target/release] [--scenes FILE...] [--python PYTHON] [--player]

Each command must end within 5 s and 500 MB, refused or right, not by a signal; if one does not, this ends with 1. FOLDER takes the
inputs, which are made here: scenes of expensive.py whose tensors overlap or whose rays are long, files of other programs, endless
files. --scenes adds scene files. With --python, an interpreter with the package, attacks on it follow, each in a process of its own:
0 says that the attack failed. With --player, for which there must be a display, the player opens the first scene, those of
--scenes and an endless answer of a server. Needs zstandard and /usr/bin/time; attacks by the links of a web page also aiohttp.
"""

import argparse
import http.server
import math
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
import zlib
from pathlib import Path

SECONDS, MEBIBYTES = 5.0, 500e6 / 2**20
ROOT = Path(__file__).resolve().parents[2]


def scenes(folder):
    """Small scene files that are dear to draw."""
    from expensive import Scale, Scene

    fine = 2 * math.sqrt(3) / 1_000_000
    for name, scene in (
        ("overlap-2^18", Scene([Scale((64, 64, 64), 0.03, 0.3, rank=1)])),
        ("overlap-2^20", Scene([Scale((128, 128, 64), 1e-3, 1.0)])),
        ("overlap-2^22", Scene([Scale((256, 128, 128), 1e-3, 1.0)])),
        ("long-rays", Scene([Scale((4, 4, 2), 0.01, 1.0, rank=256, value=0.1) for _ in range(16)], step=fine)),
    ):
        path = folder / f"{name}.strivec"
        path.write_bytes(scene.bytes())
        yield path


def png(size):
    """A black, gray PNG file."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    packer, row = zlib.compressobj(9), bytes(1 + size)
    data = b"".join(packer.compress(row) for _ in range(size)) + packer.flush()
    head = struct.pack(">2I5B", size, size, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def blender(folder, frames, picture):
    """A dataset of Blender's layout whose test split has `frames` frames of one picture."""
    (folder / "test").mkdir(parents=True)
    (folder / "test" / "a.png").write_bytes(picture)
    frame = '{"file_path":"./test/a","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}'
    text = '{"camera_angle_x":0.6,"frames":[%s]}' % ",".join([frame] * frames)
    (folder / "transforms_test.json").write_text(text)
    (folder / "transforms_train.json").write_text(text)
    return folder


def metashape(folder, attributes="", others=20_000, cameras=5_000):
    """A scene of Metashape: many cameras of a sensor with many other elements."""
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "a.png").write_bytes(png(16))
    size, more = '<resolution width="16" height="16"/>', "<x/>" * others
    adjusted = f'<calibration class="adjusted">{size}{more}<f>20</f></calibration>'
    pose = "<transform>1 0 0 0 0 1 0 0 0 0 1 4 0 0 0 1</transform>"
    camera = '<camera id="%d" sensor_id="0" label="a.png">' + pose + "</camera>"
    (folder / "cameras.xml").write_text(
        f'<document{attributes}><chunk><sensors><sensor id="0" type="frame">{size}{more}{adjusted}</sensor></sensors>'
        f"<cameras>{''.join(camera % n for n in range(cameras))}</cameras></chunk></document>"
    )
    return folder


def checkpoint(path, pickle):
    """A file of PyTorch with this pickle."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", pickle)
        archive.writestr("archive/version", "3\n")
    return path


def commands(folder, given):
    """Programs with their arguments, and a file for standard input."""
    crafted = list(scenes(folder))
    for path in [*crafted, *given]:
        render = ["render", path, "--orbit", "1", "--size", "16x16", "--out", folder / "out"]
        yield "strivec", ["info", path]
        yield "strivec", render
        yield "strivec", [*render, "--quality", "fast"]
        yield "strivec", ["export", path, "-o", folder / "out.ply", "--resolution", "16"]
        yield "strivec-pack", ["verify", path]
        yield "strivec-pack", ["verify", "--render", "--time", "3", path]
        if path in crafted:
            yield "strivec-pack", ["pack", path, "-o", folder / "out.strivec"]
        if path.name.startswith("overlap-2^2"):
            # The others take the reference little memory, but time, which is not limited.
            yield "strivec", [*render, "--backend", "reference"]
    whole = ROOT / "fixtures" / "v1" / "f32.strivec"
    yield "strivec", ["render", whole, "--orbit", "1", "--size", "100000x100000", "--out", folder / "out"]
    endless = Path("/dev/zero")
    os.mkfifo(folder / "pipe.strivec")
    for path in (endless, folder / "pipe.strivec"):
        yield "strivec", ["info", path]
        yield "strivec", ["prior", path, "-o", folder / "out.npz"]
    yield "strivec-pack", ["verify", "-", endless]
    # A list of 100 000 items whose state is set 100 000 times.
    pickle = b"\x80\x02Nq\x000](" + b"h\x00" * 100_000 + b"e" + b"h\x00b" * 100_000 + b"."
    built = checkpoint(folder / "build.th", pickle)
    yield "strivec", ["prior", built, "-o", folder / "out.npz"]
    yield "strivec", ["import", built, "-o", folder / "out.strivec"]
    yield "strivec", ["dataset", "info", metashape(folder / "metashape")]
    attributes = "".join(f" a{n}='1'" for n in range(100_000))
    yield "strivec", ["dataset", "info", metashape(folder / "attributes", attributes, 0, 1)]
    yield "strivec", ["dataset", "info", blender(folder / "frames", 1_000_000, png(16))]
    toy = folder / "toy"
    yield "strivec", ["synth", toy, "--views", "6", "--test-views", "2", "--size", "16x16"]
    for setting in ("sampling.batch_rays=4000000000", "decoder.hidden=[1000000000]", "decoder.features=4000000000"):
        yield "strivec", ["train", toy, "-o", folder / "out.strivec", "--preset", "fast", "--set", setting]


def run(command, standard_input=os.devnull):
    """Exit code, last message, seconds and peak MiB of a command, which is killed after twice the time that it has."""
    with tempfile.NamedTemporaryFile("r") as peak, open(standard_input, "rb") as source:
        # Through time, as the peak of a child begins with that of this program.
        timed = ["/usr/bin/time", "--quiet", "-f", "%M", "-o", peak.name, *map(str, command)]
        start = time.monotonic()
        output = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "errors": "replace"}
        process = subprocess.Popen(timed, stdin=source, **output)
        try:
            text, _ = process.communicate(timeout=2 * SECONDS)
        except subprocess.TimeoutExpired:
            for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
                os.kill(int(child), signal.SIGKILL)
            text, _ = process.communicate()
        seconds = time.monotonic() - start
        messages = text.strip().splitlines()
        return process.returncode, messages[-1] if messages else "", seconds, int(peak.read().split()[-1]) / 1024


class Table:
    """The rows, and whether all are as they should be."""

    def __init__(self):
        self.is_right = True
        print("| command | exit code | s | peak MiB | last message |\n|---|---|---|---|---|", flush=True)

    def add(self, name, code, message, seconds, peak, codes):
        is_right = code in codes and seconds <= SECONDS and peak <= MEBIBYTES
        self.is_right &= is_right
        short = lambda text: re.sub(r"(?<=[` ])/\S*/(?=\S)", "", f" {text}").strip().replace("|", "\\|")
        note = "" if is_right else "**no:** "
        print(f"| {short(name)} | {code} | {seconds:.1f} | {peak:.0f} | {note}{short(message)[:160]} |", flush=True)


def outside(folder):
    """The files in `folder`."""
    return sorted(str(path) for path in Path(folder).rglob("*") if path.is_file())


def keys_of_objects(folder):
    """A store lists a name that leads out of its folder."""
    import fsspec
    import strivec
    from strivec.batch.store import Input

    class Objects(fsspec.AbstractFileSystem):
        protocol = "objects"
        keys = ("bucket/kitchen/transforms.json", "bucket/kitchen/../../outside")

        def find(self, path, **options):
            return {key: {"name": key, "size": 5, "type": "file"} for key in self.keys}

        def get_file(self, remote, local, **options):
            Path(local).write_bytes(b"owned")

    fsspec.register_implementation("objects", Objects)
    try:
        with Input("objects://bucket/kitchen").local():
            pass
    except strivec.MalformedError as error:
        print(error)
    assert outside(folder) == [], outside(folder)


class Pages(http.server.BaseHTTPRequestHandler):
    """A web page with a link that leads out of its folder, and an answer without end."""

    def do_GET(self):
        is_page = self.path.rstrip("/") == "/kitchen"
        data = b'<a href="transforms.json">a</a> <a href="../../../outside">b</a>' if is_page else b"owned"
        self.send_response(200)
        self.send_header("Content-Type", "text/html" if is_page else "text/plain")
        if self.path == "/endless.strivec":
            self.end_headers()
            try:
                while self.command == "GET":
                    self.wfile.write(bytes(1 << 16))
            except OSError:
                return
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(data)

    do_HEAD = do_GET

    def log_message(self, *arguments):
        pass


def served():
    """The address of a server of `Pages`."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Pages)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_port}"


def links_of_pages(folder):
    """A web page links to a file outside of its folder."""
    import strivec
    from strivec.batch.store import Input

    try:
        with Input(f"{served()}/kitchen").local():
            pass
    except strivec.MalformedError as error:
        print(error)
    assert outside(folder) == [], outside(folder)


def publish(folder):
    """A folder of a user is published to, with overwrite."""
    import strivec
    from strivec import publish as module

    web, home = Path(folder, "web"), Path(folder, "home")
    web.mkdir()
    home.mkdir()
    (web / "index.html").write_text("<html><head><title>Strivec</title></head><strivec-viewer controls></strivec-viewer></html>")
    (home / "thesis.txt").write_text("years of work")
    module._WEB = web
    os.chdir(home)
    scene = strivec.Scene.load(ROOT / "fixtures" / "v1" / "f32.strivec")
    for output in (".", home):
        try:
            scene.publish(output, overwrite=True)
        except strivec.UsageError as error:
            print(error)
    assert outside(home) == [str(home / "thesis.txt")], outside(home)


def fork(folder):
    """A scene is used before and after a fork."""
    import numpy as np
    import strivec

    scene = strivec.Scene.load(ROOT / "fixtures" / "v1" / "f32.strivec")
    points = np.zeros((3000, 3))
    scene.density(points)
    child = os.fork()
    if child == 0:
        signal.alarm(int(SECONDS))
        try:
            scene.density(points)
        except strivec.RunError as error:
            print(error, flush=True)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0


def large_picture(folder):
    """A picture of 10^10 pixels is rendered."""
    import strivec

    camera = strivec.Camera.look_at((2.5, 2.5, 2.0), (0.0, 0.0, 0.0), size=(8, 8))
    try:
        strivec.Scene.load(ROOT / "fixtures" / "v1" / "f32.strivec").render(camera, size=(100_000, 100_000))
    except MemoryError as error:
        print(error)
    else:
        raise AssertionError("it is rendered")


def dear_scene(folder):
    """A small scene whose index takes gigabytes is asked for a density."""
    import strivec

    scene = strivec.Scene.load(Path(folder).parent / "overlap-2^18.strivec")
    try:
        scene.density([[0.0, 0.0, 0.0]])
    except MemoryError as error:
        print(error)
    else:
        raise AssertionError("it is evaluated")


ATTACKS = {attack.__name__: attack for attack in (keys_of_objects, links_of_pages, publish, fork, large_picture, dear_scene)}


def player(program, address):
    """The row of the player that opens `address`: it ends by itself, or is ended after the time that a command has."""
    process = subprocess.Popen([program, address], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    start = time.monotonic()
    peak = 0.0
    while time.monotonic() - start < SECONDS - 0.5 and process.poll() is None:
        status = Path(f"/proc/{process.pid}/status").read_text()
        peaks = (line for line in status.splitlines() if line.startswith("VmHWM"))
        peak = max([peak, *(int(line.split()[1]) / 1024 for line in peaks)])
        time.sleep(0.02)
    seconds, code = time.monotonic() - start, process.poll()
    process.kill()
    messages = process.communicate()[1].strip().splitlines() if code is not None else []
    return code, messages[-1] if messages else "is shown, and ended here", seconds, peak


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="new folder for the inputs")
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--scenes", type=Path, nargs="*", default=[])
    parser.add_argument("--python", help="interpreter that imports the package")
    parser.add_argument("--player", action="store_true")
    parser.add_argument("--attack", choices=ATTACKS, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    folder.mkdir()
    if arguments.attack:
        tempfile.tempdir = str(folder / "temporary" / "files")
        os.makedirs(tempfile.tempdir)
        ATTACKS[arguments.attack](folder)
        return
    table = Table()
    for program, words in commands(folder, arguments.scenes):
        source = words.pop() if "-" in words else os.devnull
        result = run([arguments.programs / program, "--force", "--quiet", *words], source)
        # Refused, or right.
        table.add(f"`{program} {' '.join(map(str, words))}`", *result, codes=range(6))
    for name, attack in ATTACKS.items() if arguments.python else ():
        result = run([arguments.python, __file__, folder / name, "--attack", name])
        table.add(attack.__doc__, *result, codes=[0])
    opened = [folder / "overlap-2^18.strivec", *arguments.scenes, f"{served()}/endless.strivec"]
    for address in opened if arguments.player else ():
        table.add(f"`strivec-player {address}`", *player(arguments.programs / "strivec-player", str(address)), codes=[None, 3, 5])
    sys.exit(not table.is_right)


if __name__ == "__main__":
    main()
