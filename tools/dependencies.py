"""The crates that a package is built from, for one choice of features and one target. Needs cargo and the crates' sources."""

import argparse
import json
import os
import re
import subprocess
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINE = re.compile(r"(?P<depth>\d+)(?P<name>[\w-]+) v(?P<version>[^ ]+)")


@dataclass
class Crate:
    """One version of a crate. `folder` holds its sources, `needs` are the keys of the crates that it uses."""

    name: str
    version: str
    license: str
    authors: list[str]
    repository: str
    description: str
    folder: Path
    # SHA-256 of the package in the registry; none for crates of this repository.
    checksum: str | None
    needs: list[str] = field(default_factory=list)

    @property
    def key(self) -> str:
        return f"{self.name} {self.version}"

    @property
    def is_own(self) -> bool:
        return self.checksum is None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options that choose a package, its features and a target, as in cargo."""
    parser.add_argument("--package", default="strivec", help="package of the program [default: strivec]")
    parser.add_argument("--manifest-path", type=Path, default=ROOT / "Cargo.toml", help="Cargo.toml of its workspace")
    parser.add_argument("--features", default="", help="features beside the default ones, separated by commas")
    parser.add_argument("--target", default=host(), help="target triple [default: the host's]")
    parser.add_argument("--output", type=Path, help="file to write [default: standard output]")


def host() -> str:
    """The triple of this machine."""
    lines = run([rustc(), "-vV"]).splitlines()
    return next(line.removeprefix("host: ") for line in lines if line.startswith("host: "))


def rustc() -> str:
    """The compiler, chosen as cargo chooses it."""
    return os.environ.get("RUSTC", "rustc")


def run(command: list[str]) -> str:
    """Standard output of `command`, whose errors stay visible."""
    return subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True, encoding="utf-8").stdout


def crates(args: argparse.Namespace, edges: str) -> dict[str, Crate]:
    """The chosen package, which comes first, and all crates that it uses, by key; `edges` are those of `cargo tree`."""
    chosen = ["--locked", "--manifest-path", str(args.manifest_path)]
    tree = ["cargo", "tree", *chosen, "--package", args.package, "--target", args.target, "--edges", edges]
    tree += ["--prefix", "depth", "--format", "{p}"]
    if args.features:
        tree += ["--features", args.features]
    graph = parse_tree(run(tree))

    metadata = ["cargo", "metadata", "--format-version", "1", "--all-features", "--filter-platform", args.target, *chosen]
    known = {f"{package['name']} {package['version']}": package for package in json.loads(run(metadata))["packages"]}
    checksums = lock_checksums(args.manifest_path.parent / "Cargo.lock")
    return {key: crate(known[key], checksums.get(key), needs) for key, needs in graph.items()}


def parse_tree(text: str) -> dict[str, list[str]]:
    """Keys of the crates in the output of `cargo tree --prefix depth`, in its order, with the keys that each one needs."""
    graph: dict[str, list[str]] = {}
    path: list[str] = []
    for line in text.splitlines():
        found = LINE.match(line)
        if not found:
            continue
        key = f"{found['name']} {found['version']}"
        graph.setdefault(key, [])
        depth = int(found["depth"])
        del path[depth:]
        if path and key not in graph[path[-1]]:
            graph[path[-1]].append(key)
        path.append(key)
    return graph


def lock_checksums(file: Path) -> dict[str, str]:
    """Checksums of the packages in a Cargo.lock, by key."""
    packages = tomllib.loads(file.read_text(encoding="utf-8"))["package"]
    return {f"{p['name']} {p['version']}": p["checksum"] for p in packages if "checksum" in p}


def crate(package: dict, checksum: str | None, needs: list[str]) -> Crate:
    return Crate(
        name=package["name"],
        version=package["version"],
        # Some old packages write a slash for OR.
        license=(package["license"] or "").replace("/", " OR "),
        authors=package["authors"],
        repository=package["repository"] or "",
        description=" ".join((package["description"] or "").split()),
        folder=Path(package["manifest_path"]).parent,
        checksum=checksum,
        needs=needs,
    )


def write(text: str, output: Path | None) -> None:
    """Writes to a file, or else to standard output."""
    if output is None:
        print(text, end="")
    else:
        output.write_text(text, encoding="utf-8", newline="\n")
