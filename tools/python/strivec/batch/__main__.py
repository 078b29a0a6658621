"""`strivec-batch`."""

import argparse
import sys

from ..errors import Error


def main() -> int:
    """Runs the batch in the process's arguments. Returns 0 if all scenes are done, 1 for a usage error, 4 if a scene failed."""
    parser = argparse.ArgumentParser(
        prog="strivec-batch",
        description="Make many scenes on a cluster of Ray",
        epilog="What is done is not done again: run the same command after a failure or a change. `python -m strivec.batch.simulate` "
        "tells how a cluster would do.",
    )
    parser.add_argument("batch", help="TOML file: the scenes and where they go")
    parser.add_argument("--address", help="address of a Ray cluster, or auto (default: start one on this machine)")
    parser.add_argument("--cores", type=int, default=1, help="cores for each training (default: 1)")
    parser.add_argument("--quiet", action="store_true", help="print no progress")
    arguments = parser.parse_args()

    import ray

    from . import report, schedule, specification
    from .store import Store

    try:
        try:
            with open(arguments.batch, encoding="utf-8") as file:
                batch = specification.read(file.read(), arguments.batch)
        except OSError as error:
            print(f"strivec-batch: {arguments.batch}: cannot read it: {error.strerror}", file=sys.stderr)
            return 1
        ray.init(address=arguments.address or "local", log_to_driver=False, logging_level="warning")
        terminal = report.Terminal()
        jobs = schedule.run(batch, arguments.cores, (lambda jobs: None) if arguments.quiet else terminal.told)
        report.write(Store(batch.output), jobs)
    except Error as error:
        print(f"strivec-batch: {error}", file=sys.stderr)
        return 1
    failed = [one for one in jobs if one.state == "failed"]
    print(f"{len(jobs) - len(failed)} of {len(jobs)} scenes are done: {batch.output.rstrip('/')}/index.html")
    return 4 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
