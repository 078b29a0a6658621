#!/usr/bin/env python3
"""Writes a software bill of materials (CycloneDX 1.5, JSON): the crates of a program, with checksums and what uses what.

    python3 tools/sbom.py --package strivec --features player --output strivec.cdx.json

Crates that only the build uses have the scope `excluded`. The output has no date and no random number: the same sources
give the same bytes.
"""

import argparse
import json
import sys

from dependencies import Crate, add_arguments, crates, write


def reference(crate: Crate) -> str:
    """Package URL of a crate; it identifies the crate in the file, too."""
    return f"pkg:cargo/{crate.name}@{crate.version}"


def component(crate: Crate, kind: str, is_shipped: bool) -> dict:
    """The description of a crate of this or another project."""
    entry = {"type": kind, "bom-ref": reference(crate), "name": crate.name, "version": crate.version}
    if crate.description:
        entry["description"] = crate.description
    entry["scope"] = "required" if is_shipped else "excluded"
    if crate.checksum:
        entry["hashes"] = [{"alg": "SHA-256", "content": crate.checksum}]
    if crate.license:
        entry["licenses"] = [{"expression": crate.license}]
    entry["purl"] = reference(crate)
    if crate.repository:
        entry["externalReferences"] = [{"type": "vcs", "url": crate.repository}]
    return entry


def bill(all_crates: dict[str, Crate], shipped: set[str], target: str) -> dict:
    """The bill as JSON: `all_crates` with the program first, and the keys of those that are in the program."""
    program, *others = all_crates.values()
    others.sort(key=lambda crate: crate.key)
    head = component(program, "application", True)
    head["properties"] = [{"name": "target", "value": target}]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": head},
        "components": [component(crate, "library", crate.key in shipped) for crate in others],
        "dependencies": [
            {"ref": reference(crate), "dependsOn": sorted(reference(all_crates[key]) for key in crate.needs)}
            for crate in [program, *others]
        ],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description="Write a software bill of materials for a program")
    add_arguments(parser)
    args = parser.parse_args()
    everything = crates(args, "normal,build")
    shipped = set(crates(args, "normal,no-proc-macro"))
    write(json.dumps(bill(everything, shipped, args.target), indent=2, ensure_ascii=False) + "\n", args.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
