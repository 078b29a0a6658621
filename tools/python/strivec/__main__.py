"""The command: `python -m strivec info FILE` and `python -m strivec verify FILE...`.

Exit codes: 0 fine, 2 usage (a file that cannot be read among it), 3 a malformed or damaged file or probes that do not
hold, 5 a file that this reader or its budget does not support. Of several files the largest code counts.
"""

import argparse
import sys

from . import limits, reader
from .errors import StrivecError
from .probes import SMALLEST_MARGIN, check_probes

USAGE, AT_FAULT = 2, 3


def main(arguments=None):
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(prog="strivec", description="Reads .strivec scenes.")
    parser.add_argument("--budget", type=int, default=limits.DEFAULT_BUDGET, metavar="BYTES", help="memory to use")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    command = commands.add_parser("info", help="say what a scene is")
    command.add_argument("files", nargs=1, metavar="FILE")
    command.set_defaults(run=info)
    command = commands.add_parser("verify", help="check structure, checksums, numbers and probes")
    command.add_argument("files", nargs="+", metavar="FILE")
    command.set_defaults(run=verify)
    options = parser.parse_args(arguments)
    return max(_run(options.run, path, options.budget) for path in options.files)


def _run(command, path, budget):
    try:
        return command(path, reader.open(path, budget))
    except StrivecError as error:
        print(f"{path}: {error}", file=sys.stderr)
        return error.exit_code
    except OSError as error:
        print(f"{path}: {error.strerror}", file=sys.stderr)
        return USAGE


def info(path, scene):
    """Prints what a scene is."""
    rules, decoder = scene.rules, scene.decoder
    print(f"{path}: version 1.{scene.minor_version}")
    print(f"bounds {list(rules.bounds[0])} to {list(rules.bounds[1])}, step {rules.step}, up {scene.frame.up}")
    print(f"coverage {rules.coverage}, aggregation {rules.aggregation}")
    for index, scale in enumerate(scene.scales):
        ranks = f"density rank {scale.density[0].shape[1]}, appearance rank {scale.appearance[0].shape[1]}"
        chunks = f"{scale.chunks} chunk" + ("s" if scale.chunks > 1 else "")
        print(f"scale {index}: {len(scale.centres)} tensors in {chunks}, resolution {scale.resolution}, {ranks}")
    widths = [decoder.layers[0].weights.shape[1]] + [len(layer.bias) for layer in decoder.layers]
    print(f"decoder {decoder.mode}, {decoder.features} features, widths {widths}")
    if scene.occupancy is not None:
        print(f"occupancy {scene.occupancy.vertices}")
    for name in ("dataset", "preset", "tool"):
        if getattr(scene.provenance, name):
            print(f"{name} {getattr(scene.provenance, name)!r}")
    if scene.licence is not None:
        print(f"licence {scene.licence!r}")
    extras = {
        "quality": scene.quality is not None,
        "views": scene.views is not None,
        "thumbnail": scene.thumbnail is not None,
        f"{len(scene.prefixes)} prefixes": bool(scene.prefixes),
        f"{len(scene.probes.margins) if scene.probes else 0} probes": scene.probes is not None,
        f"{len(scene.cameras)} cameras": bool(scene.cameras),
        f"{len(scene.notes)} notes": bool(scene.notes),
        "unknown " + " ".join(section.kind for section in scene.unknown): bool(scene.unknown),
    }
    print("with " + (", ".join(name for name, there in extras.items() if there) or "no extras"))
    return 0


def verify(path, scene):
    """Checks the probes of a scene that was read without an error, and prints how far they are off."""
    report = check_probes(scene)
    if report is None:
        print(f"{path}: fine, without probes")
        return 0
    differences = (
        f"largest difference in colour {report.colour:.1e}, opacity {report.opacity:.1e}, "
        f"depth {report.depth:.1e}, density feature {report.density:.1e}"
    )
    compared = f"{report.compared} of {report.probes} probes compared (decision margin above {SMALLEST_MARGIN})"
    if report.failed:
        print(f"{path}: probes {report.failed} are out of tolerance; {compared}; {differences}", file=sys.stderr)
        return AT_FAULT
    print(f"{path}: fine; {compared}; {differences}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
