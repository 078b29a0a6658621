#!/usr/bin/env python3
"""Runs a reader over the conformance suite: see README.md."""

import argparse
import json
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
FIXTURES = HERE.parent.parent / "fixtures"
GROUPS = {
    "foreign": ["foreign"],
    "damaged": ["text-transfer", "truncated", "corrupt"],
    "unsupported": ["version", "kind", "code"],
    "invalid": ["missing", "limit", "value", "malformed"],
    "over budget": ["budget"],
}
GROUP_OF = {name: group for group, names in GROUPS.items() for name in names}
# Files of a call.
BATCH = 32


def main():
    parser = argparse.ArgumentParser(description="Run a reader over the conformance suite (README.md)")
    parser.add_argument("--tolerance", type=float, default=1e-4, help="difference of traced rays (default: 1e-4)")
    parser.add_argument("reader", nargs=argparse.REMAINDER, help="command of the reader, without files")
    options = parser.parse_args()
    if not options.reader:
        parser.error("name the command of a reader")
    expected = json.loads((HERE / "expected.json").read_text())
    failures, classes, left_out = [], 0, set()
    for first in range(0, len(expected), BATCH):
        batch = expected[first : first + BATCH]
        rows = read(options.reader, [FIXTURES / row["file"] for row in batch])
        for want, found in zip(batch, rows):
            wrong = compare(want, found, options.tolerance, left_out)
            failures += [f"{want['file']}: {text}" for text in wrong]
            classes += want["class"] != found.get("class") and not wrong
    for failure in failures:
        print(failure)
    if left_out:
        print(f"not compared: {', '.join(sorted(left_out))}")
    print(f"{len(expected)} files, {len(failures)} failures, {classes} other classes of the same group")
    return 1 if failures else 0


def read(reader, paths):
    """The rows that `reader` prints for the files."""
    run = subprocess.run([*reader, *map(str, paths)], stdout=subprocess.PIPE, check=False)
    try:
        rows = json.loads(run.stdout)
    except ValueError:
        sys.exit(f"the reader printed no JSON (exit code {run.returncode})")
    if not isinstance(rows, list) or len(rows) != len(paths):
        sys.exit(f"the reader must print an array of {len(paths)} objects")
    return rows


def compare(want, found, tolerance, left_out):
    """What is wrong with `found`, as texts. Adds the fields that it lacks to `left_out`."""
    of_want, of_found = (GROUP_OF.get(row.get("class")) for row in (want, found))
    if (want["class"] is None) != (found.get("class") is None) or of_want != of_found:
        return [f"must be {of_want or 'accepted'}, is {found.get('class') or 'accepted'}"]
    if want["class"] is not None:
        return []
    wrong = []
    skipped = [sorted((name, GROUP_OF.get(cls, cls)) for name, cls in row.get("skipped") or []) for row in (want, found)]
    if skipped[0] != skipped[1]:
        wrong.append(f"must skip {skipped[0]}, skips {skipped[1]}")
    numbers = found.get("numbers") or {}
    for name, value in want["numbers"].items():
        if name not in numbers or (numbers[name] is None and value is not None):
            left_out.add(name)
        elif name == "probes":
            wrong += compare_probes(value, numbers[name], tolerance, left_out)
        elif name == "scales":
            wrong += compare_scales(value, numbers[name], left_out)
        elif value != numbers[name]:
            wrong.append(f"{name} must be {value}, is {numbers[name]}")
    return wrong


def compare_scales(want, found, left_out):
    if len(want) != len(found):
        return [f"must have {len(want)} scales, has {len(found)}"]
    wrong = []
    for s, (scale, other) in enumerate(zip(want, found)):
        for name, value in scale.items():
            if other.get(name) is None:
                left_out.add(f"{name} of scales")
            elif value != other[name]:
                wrong.append(f"{name} of scale {s} must be {value}, is {other[name]}")
    return wrong


def compare_probes(want, found, tolerance, left_out):
    others = {probe["probe"]: probe for probe in found}
    wrong = []
    for probe in want:
        other = others.get(probe["probe"])
        if other is None:
            left_out.add("some probes")
            continue
        for name in ("color", "opacity", "depth", "feature"):
            values, others_values = (row[name] if name == "color" else [row[name]] for row in (probe, other))
            for value, found_value in zip(values, others_values):
                allowed = tolerance * (max(1.0, abs(value)) if name in ("depth", "feature") else 1.0)
                if not abs(value - found_value) <= allowed:
                    wrong.append(f"{name} of probe {probe['probe']} must be {value}, is {found_value}")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
