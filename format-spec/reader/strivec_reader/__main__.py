"""The command: `python -m strivec_reader info FILE` and `python -m strivec_reader verify FILE...`.

Exit codes: 0 success; 2 usage error, or a file that cannot be read; 3 a damaged or invalid file, or probes out of
tolerance; 4 the time did not suffice; 5 a file that this reader does not support or that exceeds the memory budget. Of
several files, the largest code is returned.
"""

import argparse
import json
import os
import re
import sys

import numpy as np

from . import limits, reader
from .conform import conform
from .errors import StrivecError, Unsupported
from .probes import MIN_MARGIN, check_probes

USAGE_ERROR, INVALID_FILE, UNFINISHED = 2, 3, 4
# The characters of `src/escape.rs`.
UNSAFE = re.compile(
    "[\0-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\U000e0000-\U000e007f]"
)


def main(arguments=None):
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(prog="strivec_reader", description="Read .strivec scenes")
    parser.add_argument(
        "--budget",
        type=int,
        metavar="BYTES",
        help="maximum memory in bytes (default: 512 MiB and 64 bytes for each of the file's, at most 4 GiB)",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    command = commands.add_parser("info", help="print a summary of a scene")
    command.add_argument("files", nargs=1, metavar="FILE")
    command.set_defaults(run=info, time=None)
    command = commands.add_parser("verify", help="check structure, checksums, values and probes")
    command.add_argument("files", nargs="+", metavar="FILE")
    command.add_argument(
        "--time",
        type=float,
        metavar="SECONDS",
        help="time limit for a file's probes in seconds (default: none)",
    )
    command.set_defaults(run=verify)
    command = commands.add_parser("conform", help="print what the format's conformance suite asks for, as JSON")
    command.add_argument("files", nargs="+", metavar="FILE")
    command.set_defaults(run=None)
    options = parser.parse_args(arguments)
    if options.run is None:
        print(json.dumps(conform(options.files, options.budget)))
        return 0
    return max(_run(options, path) for path in options.files)


def escaped(text):
    """`text` with control characters, and those that reorder text or are invisible, in Python's escapes (section 10)."""
    return UNSAFE.sub(lambda match: match[0].encode("unicode_escape").decode(), str(text))


def _run(options, path):
    name = escaped(path)
    try:
        budget = limits.default_budget(os.path.getsize(path)) if options.budget is None else options.budget
        return options.run(name, reader.open(path, budget), budget, options.time)
    except StrivecError as error:
        print(f"{name}: {escaped(error)}", file=sys.stderr)
        return error.exit_code
    except OSError as error:
        print(f"{name}: {error.strerror}", file=sys.stderr)
        return USAGE_ERROR


def info(path, scene, *_):
    """Prints a summary of a scene."""
    rules, decoder = scene.rules, scene.decoder
    print(f"{path}: version 1.{scene.minor_version}")
    print(f"bounds {list(rules.bounds[0])} to {list(rules.bounds[1])}, step {rules.step}, up {scene.frame.up}")
    print(f"coverage {rules.coverage}, aggregation {rules.aggregation}")
    if rules.sky is not None:
        print(f"sky of degree {int(np.sqrt(rules.sky.shape[1])) - 1}")
    for index, scale in enumerate(scene.scales):
        density, appearance = (sum(block.rank for block in blocks) for blocks in (scale.density, scale.appearance))
        ranks = f"density rank {density}, appearance rank {appearance}"
        chunks = _count(scale.chunks, "chunk", "chunks")
        print(f"scale {index}: {len(scale.centers)} tensors in {chunks}, resolution {scale.resolution}, {ranks}")
    widths = [decoder.layers[0].weights.shape[1]] + [len(layer.bias) for layer in decoder.layers]
    print(f"decoder {decoder.mode}, {decoder.features} features, widths {widths}")
    if scene.occupancy is not None:
        print(f"occupancy {scene.occupancy.vertices}")
    for name in ("dataset", "preset", "tool"):
        if getattr(scene.provenance, name):
            print(f'{name} "{escaped(getattr(scene.provenance, name))}"')
    if scene.license is not None:
        print(f'license "{escaped(scene.license)}"')
    metadata = {
        "quality": scene.quality is not None,
        "views": scene.views is not None,
        "thumbnail": scene.thumbnail is not None,
        _count(len(scene.prefixes), "prefix", "prefixes"): bool(scene.prefixes),
        _count(len(scene.probes.margins) if scene.probes else 0, "probe", "probes"): scene.probes is not None,
        _count(len(scene.cameras), "camera", "cameras"): bool(scene.cameras),
        _count(len(scene.notes), "note", "notes"): bool(scene.notes),
        "unknown " + " ".join(section.kind for section in scene.unknown): bool(scene.unknown),
    }
    for skipped in scene.skipped:
        print(f"{path}: warning: {escaped(skipped)}", file=sys.stderr)
    print("with " + (", ".join(name for name, there in metadata.items() if there) or "no metadata"))
    return 0


def _count(number, singular, plural):
    return f"{number} {singular if number == 1 else plural}"


def verify(path, scene, budget, seconds):
    """Checks the ancillary sections and the probes of a scene that was read, and prints the largest differences."""
    wrong = [skipped for skipped in scene.skipped if not isinstance(skipped.error, Unsupported)]
    for skipped in scene.skipped:
        print(f"{path}: {'' if skipped in wrong else 'warning: '}{escaped(skipped)}", file=sys.stderr)
    if wrong:
        return INVALID_FILE
    report = check_probes(scene, budget, seconds)
    if report is None:
        print(f"{path}: valid, without probes")
        return 0
    differences = (
        f"largest difference in color {report.color:.1e}, opacity {report.opacity:.1e}, "
        f"depth {report.depth:.1e}, density feature {report.density:.1e}"
    )
    compared = f"{report.compared} of {report.probes} probes compared (decision margin above {MIN_MARGIN})"
    if report.failed:
        print(f"{path}: probes {report.failed} are out of tolerance; {compared}; {differences}", file=sys.stderr)
        return INVALID_FILE
    if report.traced < report.probes:
        print(f"{path}: {report.traced} of {report.probes} probes checked in {seconds} s; {compared}", file=sys.stderr)
        return UNFINISHED
    print(f"{path}: valid; {compared}; {differences}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
