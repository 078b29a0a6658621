#!/usr/bin/env python3
"""Drives strivec-player by input events of the X server: opens a scene, drags, presses keys, drops files, resizes the window,
and then sends 1000 random events.

    tools/player/drive.py target/release/strivec-player SCENE [--renderer gpu|cpu|memory] [--pictures FOLDER] [--events N]

Starts its own display (Xvfb). Needs python3-xlib and Xvfb; for pictures also ImageMagick's `import`. Fails at the first missing
reaction: the player prints its pictures and messages with --timing.
"""

import argparse
import os
import queue
import random
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from Xlib import X, XK, display
from Xlib.ext import xtest
from Xlib.protocol import event

PATIENCE = 120.0


class Xvfb:
    """A display, and this process's connection to it."""

    def __init__(self):
        read, write = os.pipe()
        self.process = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "1000x760x24"], pass_fds=[write], stderr=subprocess.DEVNULL
        )
        os.close(write)
        with os.fdopen(read) as pipe:
            self.name = f":{int(pipe.readline())}"
        self.display = display.Display(self.name)
        self.root = self.display.screen().root

    def close(self):
        self.display.close()
        self.process.terminate()
        self.process.wait()


class Player:
    def __init__(self, xvfb, command, folder):
        self.xvfb, self.display = xvfb, xvfb.display
        environment = dict(os.environ, DISPLAY=xvfb.name, XDG_RUNTIME_DIR=folder, XDG_CONFIG_HOME=folder)
        environment.pop("WAYLAND_DISPLAY", None)
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment, cwd=folder
        )
        self.lines, self.printed = queue.Queue(), []
        threading.Thread(target=lambda: [self.lines.put(line) for line in self.process.stdout], daemon=True).start()

    def expect(self, text):
        """Waits for a line with `text` in it."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            self.check()
            try:
                line = self.lines.get(timeout=0.2)
            except queue.Empty:
                continue
            self.printed.append(line)
            if text in line:
                return line
        sys.exit(f"drive: the player did not print {text!r}, but:\n{''.join(self.printed)}")

    def skip_output(self):
        """Skips the output so far."""
        while not self.lines.empty():
            self.printed.append(self.lines.get())

    def check(self):
        if self.process.poll() is not None:
            rest = "".join(self.printed) + "".join(iter(self.lines.get_nowait, None) if not self.lines.empty() else [])
            sys.exit(f"drive: the player ended with {self.process.returncode}:\n{rest}")

    def window(self):
        """Its window, once it is open."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            self.check()
            for window in self.xvfb.root.query_tree().children:
                if (window.get_wm_name() or "").endswith("Strivec"):
                    return window
            time.sleep(0.1)
        sys.exit("drive: no window")

    def move(self, x, y):
        xtest.fake_input(self.display, X.MotionNotify, x=x, y=y)
        self.display.sync()

    def button(self, number, is_down):
        xtest.fake_input(self.display, X.ButtonPress if is_down else X.ButtonRelease, number)
        self.display.sync()

    def key(self, name, is_down=None):
        code = self.display.keysym_to_keycode(XK.string_to_keysym(name))
        for kind in [X.KeyPress, X.KeyRelease] if is_down is None else [X.KeyPress if is_down else X.KeyRelease]:
            xtest.fake_input(self.display, kind, code)
        self.display.sync()

    def drag(self, number, start, end, steps=8):
        self.move(*start)
        self.button(number, True)
        for n in range(1, steps + 1):
            self.move(*(round(a + (b - a) * n / steps) for a, b in zip(start, end)))
            time.sleep(0.02)
        self.button(number, False)

    def drop(self, path):
        """Drops the file `path` on the window, as a file manager would (XDND, version 5)."""
        d, target = self.display, self.window()
        atom = d.intern_atom
        source = self.xvfb.root.create_window(0, 0, 1, 1, 0, X.CopyFromParent)
        kind = atom("text/uri-list")
        source.set_selection_owner(atom("XdndSelection"), X.CurrentTime)

        def send(name, *values):
            message = event.ClientMessage(window=target, client_type=atom(name), data=(32, [source.id, *values]))
            target.send_event(message, event_mask=0)
            d.sync()

        def serve(is_done):
            """Answers requests for the file's name until `is_done(event)`."""
            until = time.monotonic() + PATIENCE
            while time.monotonic() < until:
                while d.pending_events():
                    request = d.next_event()
                    if request.type == X.SelectionRequest:
                        name = f"file://{path}\r\n".encode()
                        request.requestor.change_property(request.property, request.target, 8, name)
                        answer = event.SelectionNotify(
                            time=request.time,
                            requestor=request.requestor,
                            selection=request.selection,
                            target=request.target,
                            property=request.property,
                        )
                        request.requestor.send_event(answer, event_mask=0)
                        d.sync()
                    if is_done(request):
                        return
                self.check()
                time.sleep(0.02)
            sys.exit("drive: the drop was not taken")

        send("XdndEnter", 5 << 24, kind, 0, 0)
        send("XdndPosition", 0, 200 << 16 | 200, X.CurrentTime, atom("XdndActionCopy"))
        serve(lambda request: request.type == X.SelectionRequest)
        time.sleep(0.2)
        send("XdndDrop", 0, X.CurrentTime, 0, 0)
        serve(lambda request: request.type == X.ClientMessage and request.client_type == atom("XdndFinished"))
        source.destroy()

    def picture(self, path):
        if path:
            subprocess.run(["import", "-display", self.xvfb.name, "-window", "root", str(path)], check=True)


def changed(player, what):
    """Runs `what` and waits for a picture that was drawn since."""
    player.skip_output()
    what()
    player.expect(" ms")


def wander(player, count):
    """Random events, the same each time."""
    chance = random.Random(1)
    keys = "w a s d q e f r v b h c 1 2 3 i Tab space Shift_L Control_L Escape".split()
    for n in range(count):
        kind = chance.randrange(6)
        if kind < 2:
            player.move(chance.randrange(1000), chance.randrange(760))
        elif kind == 2:
            player.button(chance.choice([1, 1, 2, 3, 4, 5]), chance.random() < 0.5)
        elif kind == 3:
            player.key(chance.choice(keys), chance.random() < 0.5)
        elif kind == 4:
            player.key(chance.choice(keys))
        elif n % 20 == 0:
            player.window().configure(width=chance.randrange(64, 1000), height=chance.randrange(64, 760))
        time.sleep(0.01)
        if n % 50 == 0:
            player.check()
    for button in range(1, 6):
        player.button(button, False)
    for key in keys:
        player.key(key, False)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("player")
    parser.add_argument("scene", type=Path)
    parser.add_argument("--renderer", default="gpu")
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--events", type=int, default=1000)
    arguments = parser.parse_args()
    picture = lambda name: arguments.pictures and arguments.pictures / f"{name}.png"
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    xvfb = Xvfb()
    with tempfile.TemporaryDirectory() as folder:
        command = [Path(arguments.player).resolve(), arguments.scene.resolve(), "--timing", "--size", "480x240"]
        player = Player(xvfb, [*command, "--renderer", arguments.renderer], folder)
        try:
            player.window().set_input_focus(X.RevertToParent, X.CurrentTime)
            player.expect("first picture")
            picture_at = (80, 120)
            player.move(*picture_at)
            changed(player, lambda: player.drag(1, picture_at, (120, 100)))
            changed(player, lambda: player.drag(3, picture_at, (90, 125)))
            changed(player, lambda: player.button(4, True) or player.button(4, False))
            player.move(*picture_at)
            changed(player, lambda: player.key("f"))
            changed(player, lambda: player.key("w", True) or time.sleep(0.2) or player.key("w", False))
            changed(player, lambda: player.key("r"))
            player.key("h")
            time.sleep(0.5)
            picture("help") and player.picture(picture("help"))
            player.key("h")
            broken = Path(folder) / "broken.strivec"
            broken.write_bytes(arguments.scene.read_bytes()[:5000])
            player.skip_output()
            player.drop(broken)
            player.expect("broken.strivec")
            time.sleep(0.5)
            picture("broken") and player.picture(picture("broken"))
            player.skip_output()
            player.key("p")
            player.expect("wrote ")
            assert len(list(Path(folder).glob("*-001.png"))) == 1
            player.key("c")
            changed(player, lambda: player.drag(1, picture_at, (100, 110)))
            time.sleep(0.6)
            player.key("c")
            player.expect("path-001.json")
            changed(player, lambda: player.drop(next(Path(folder).glob("*-path-001.json"))))
            changed(player, lambda: player.drop(arguments.scene.resolve()))
            changed(player, lambda: player.window().configure(width=400, height=300) or player.display.sync())
            wander(player, arguments.events)
            player.window().configure(width=480, height=240)
            changed(player, lambda: player.key("r"))
            picture("end") and player.picture(picture("end"))
            player.check()
            print(f"drive: {arguments.renderer}: everything happened, {arguments.events} random events included")
        finally:
            player.process.kill()
            player.process.wait()
            xvfb.close()


if __name__ == "__main__":
    main()
