#!/usr/bin/env python3
"""Kills commands at random moments and runs them on full disks, and prints what was lost and what was left.

    tools/measure/failures.py FOLDER [--programs target/release] [--python PYTHON] [--kills 30] [--small DISK] [--full 10] [--only NAME...]

The commands train, pack, export and, with --python, an interpreter with the package, the stages of a batch, write over whole files of
an earlier run. After each failure those must be whole, old or new; the next run, an hour later by the times of the files, must make
the same bytes as a run without failures and leave nothing else. DISK is a folder on a small file system, such as a tmpfs of 48 MB: all but a
random part of what a command writes is filled, and a result that has no room must be where the message says. Ends with 1 if anything
is lost or left. FOLDER takes the files and must not exist.
"""

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

HIDDEN = re.compile(r"\..*(partial|reserved)$")
OLD = b"of an earlier run"
FIXTURE = Path(__file__).resolve().parents[2] / "fixtures" / "v1" / "f32.strivec"
SMALL = []
"""Options of a training of seconds."""


class Case:
    """A command, the files that it writes to a folder, and how it goes on after a failure."""

    def __init__(self, name, words, outputs, state=None):
        self.name, self.words, self.outputs, self.state = name, words, outputs, state

    def command(self, folder):
        """The command that writes to `folder`."""
        resumed = self.state is not None and (folder / self.state).exists()
        return [str(word) for word in self.words(folder, resumed)]

    def found(self, folder):
        """The outputs in `folder`."""
        return {name: (folder / name).read_bytes() for name in self.outputs if (folder / name).exists()}

    def left(self, folder):
        """Files in `folder` that are no outputs; records of begun stages are one for each run."""
        names = (str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
        return sorted(name for name in names if name not in self.outputs and not name.startswith(("runs/", "inputs/")))


def cases(arguments, toy, scene):
    """The commands, which take some seconds each."""
    strivec, pack = arguments.programs / "strivec", arguments.programs / "strivec-pack"

    def train(folder, resumed):
        settings = ["--resume", "--keep-dead"] if resumed else SMALL
        return [strivec, "--force", "train", toy, "-o", folder / "a.strivec", "--checkpoint-every", "2", *settings]

    yield Case("train", train, ["a.strivec"], "a.strivec.state")
    yield Case("pack", lambda folder, _: [pack, "--force", "pack", scene, "--effort", "0.1", "-o", folder / "a.strivec"], ["a.strivec"])
    surface = ["--resolution", "100", "--alpha", "0.001"]
    yield Case("export", lambda folder, _: [strivec, "--force", "export", FIXTURE, "-o", folder / "a.ply", *surface], ["a.ply"])
    if arguments.python:
        outputs = [f"scenes/a.{end}" for end in ("strivec", "png")]
        yield Case("batch", lambda folder, _: [arguments.python, __file__, folder, "--stages", toy], outputs)


def stages(url, toy):
    """Does the stages of a batch of one scene, without Ray, in the store at `url`. Ends with 2 if that cannot be written."""
    from strivec import InputError
    from strivec.batch import stages
    from strivec.batch.specification import Job

    settings = ["sampling.batch_rays=64", "schedule.occupancy_at=[]"]
    options = {"train": {"preset": "preview", "steps": 10, "max_params": 60_000, "keep_dead": True, "set": settings}, "pack": {"effort": 0.1}}
    job, done = Job("a", str(toy), (str(toy / "occupancy.npz"),), options), []
    try:
        for name in stages.wanted(job):
            done.append(stages.run(str(url), job, name, {one.stage: one.key for one in done}, 1))
        stages.publish(str(url), job, done)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)


class Failures:
    """The runs of one command."""

    def __init__(self, case, folder, random):
        self.case, self.folder, self.random = case, folder, random
        self.temporary = folder / "temporary"
        self.temporary.mkdir(parents=True)
        self.environment = {**os.environ, "TMPDIR": str(self.temporary)}
        self.faults = []
        whole = folder / "whole"
        whole.mkdir()
        start = time.monotonic()
        self.run(whole)
        self.seconds = time.monotonic() - start
        self.expected = case.found(whole)
        self.stored = case.left(whole)
        assert set(self.expected) == set(case.outputs), sorted(self.expected)

    def run(self, folder):
        """Runs the command to its end, which must be good."""
        done = subprocess.run(self.case.command(folder), env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode != 0:
            self.faults.append(f"exit code {done.returncode}: {done.stderr[-300:]}")

    def prepared(self, folder):
        """`folder` with whole outputs of an earlier run."""
        for name in self.case.outputs:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(OLD)
        return folder

    def check_whole(self, folder):
        """Notes outputs in `folder` that are neither those of the earlier run nor those of this one."""
        found = self.case.found(folder)
        torn = [name for name in self.case.outputs if found.get(name) not in (OLD, self.expected[name])]
        self.faults += [f"{name} is lost" for name in torn]

    def check_again(self, folder):
        """Runs the command again after an hour; notes what differs from a run without failures, and what is left."""
        for path in [*folder.rglob(".*"), *self.temporary.rglob(".*")]:
            os.utime(path, (time.time() - 3700,) * 2)
        self.run(folder)
        found = self.case.found(folder)
        self.faults += [f"{name} differs" for name in self.case.outputs if found.get(name) != self.expected[name]]
        self.faults += [f"{name} is left" for name in self.case.left(folder) if name not in self.stored]
        self.faults += [f"{path} is left" for path in self.temporary.iterdir()]

    def kill(self, number):
        """Kills the command at a random moment. Returns true if it was at work, and whether files that the next run removes were left."""
        folder = self.folder / f"killed-{number}"
        folder.mkdir()
        self.prepared(folder)
        process = subprocess.Popen(
            self.case.command(folder), env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        time.sleep(self.random.uniform(0.0, 1.05 * self.seconds))
        was_at_work = process.poll() is None
        if was_at_work:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        self.check_whole(folder)
        left = any(HIDDEN.match(path.name) for path in folder.rglob("*")) or any(self.temporary.iterdir())
        self.check_again(folder)
        shutil.rmtree(folder)
        return was_at_work, left

    def fill(self, disk):
        """Runs the command on a full disk. Returns whether it was refused, and whether its result is kept elsewhere."""
        for path in disk.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        folder = disk / "results"
        folder.mkdir()
        self.prepared(folder)
        needed = sum(map(len, self.expected.values()))
        free = shutil.disk_usage(disk).free
        (disk / "filler").write_bytes(bytes(max(free - self.random.randrange(int(1.5 * needed)), 0)))
        done = subprocess.run(self.case.command(folder), env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.check_whole(folder)
        kept = re.search(r"; the result is kept in (.*)$", done.stderr.strip())
        if done.returncode not in (0, 2):
            self.faults.append(f"exit code {done.returncode}: {done.stderr[-300:]}")
        if kept:
            if Path(kept[1]).read_bytes() not in self.expected.values():
                self.faults.append(f"{kept[1]} is not the result")
            Path(kept[1]).unlink()
        elif done.returncode == 2 and self.case.name in ("train", "pack") and "No space" in done.stderr:
            self.faults.append(f"the result is lost: {done.stderr[-300:]}")
        (disk / "filler").unlink()
        self.check_again(folder)
        return done.returncode != 0, bool(kept)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--programs", type=Path, default=Path("target/release"))
    parser.add_argument("--python", help="interpreter that imports the package")
    parser.add_argument("--kills", type=int, default=30, help="kills of all commands together")
    parser.add_argument("--small", type=Path, metavar="DISK", help="empty folder on a small file system")
    parser.add_argument("--full", type=int, default=10, help="runs of all commands together on a full disk")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", help="commands")
    parser.add_argument("--stages", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    if arguments.stages:
        stages(folder, arguments.stages)
        return
    folder.mkdir()
    arguments.programs = arguments.programs.resolve()
    toy, scene = folder / "toy", folder / "scene.strivec"
    strivec = arguments.programs / "strivec"
    subprocess.run([strivec, "--quiet", "synth", toy, "--views", "12", "--test-views", "2", "--size", "32x32"], check=True)
    SMALL[:] = ["--preset", "preview", "--steps", "10", "--prior", toy / "occupancy.npz", "--max-params", "60k", "--keep-dead"]
    SMALL.extend(["--set", "sampling.batch_rays=64", "--set", "schedule.occupancy_at=[]"])
    subprocess.run([strivec, "--quiet", "train", toy, "-o", scene, *SMALL], check=True)
    chance = random.Random(arguments.seed)
    every = [Failures(case, folder / case.name, chance) for case in cases(arguments, toy, scene) if case.name in (arguments.only or [case.name])]
    print("| command | s | kills | at work | files left for the next run to remove | full disks | refused | kept elsewhere | lost or left |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    for index, failures in enumerate(every):
        share = lambda runs: len(range(index, runs, len(every)))
        killed = [failures.kill(number) for number in range(share(arguments.kills))]
        full = [failures.fill(arguments.small) for _ in range(share(arguments.full))] if arguments.small else []
        numbers = [len(killed), *map(sum, zip(*killed)), len(full), *(map(sum, zip(*full)) if full else (0, 0))]
        faults = "; ".join(failures.faults) or "nothing"
        print(f"| {failures.case.name} | {failures.seconds:.1f} | {' | '.join(map(str, numbers))} | {faults} |", flush=True)
    sys.exit(any(failures.faults for failures in every))


if __name__ == "__main__":
    main()
