#!/usr/bin/env python3
"""Writes THIRD-PARTY-NOTICES.txt: the crates in a program or a page, and the texts of their licenses.

    python3 tools/notices.py --package strivec --features player --output THIRD-PARTY-NOTICES.txt

Crates that only the build uses are left out. A crate without a license file gets the standard text of its license, if it
is MIT or Apache-2.0. The Boost license asks for no text. Any other crate without a text is an error.
"""

import argparse
import re
import sys
from pathlib import Path

from dependencies import ROOT, Crate, add_arguments, crates, run, rustc, write

# Names of license files. `COPYING` beside a `LICENSE` is another choice of license.
NAME = re.compile(r"(un)?licen[cs]es?\b|copying|notice|copyright", re.IGNORECASE)
NOT_TEXT = {".c", ".cc", ".h", ".rs", ".py", ".js", ".json", ".sh", ".toml", ".yml", ".yaml", ".tpl", ".hbs"}
# Licenses that ask for no text beside compiled programs.
SILENT = {"BSL-1.0"}
# Folders whose files get into no program.
SKIPPED = {"test", "tests", "testdata", "examples", "benches", "fuzz", "target"}
RULE = "=" * 80


def license_files(folder: Path) -> list[Path]:
    """License files of a package, those of bundled sources and fonts included."""
    found = []
    for file in sorted(folder.rglob("*")):
        parents = file.relative_to(folder).parts[:-1]
        if any(part in SKIPPED or part.startswith(".") for part in parents) or not file.is_file():
            continue
        is_of_font = "fonts" in parents and file.suffix == ".txt"
        if is_of_font or NAME.match(file.name) and file.suffix.lower() not in NOT_TEXT:
            found.append(file)
    licensed = {file.parent for file in found if file.name.lower().startswith("licen")}
    return [file for file in found if not (file.name.upper().startswith("COPYING") and file.parent in licensed)]


def standard_texts(crate: Crate) -> list[str]:
    """Texts for a crate without a license file; empty if no text of its license is at hand."""
    terms = re.findall(r"[\w.-]+", crate.license)
    if "MIT" in terms:
        text = (ROOT / "LICENSE-MIT").read_text(encoding="utf-8")
        holder = ", ".join(crate.authors) or f"the authors of {crate.name}"
        return [re.sub("Copyright.*", lambda _: f"Copyright (c) {holder}", text, count=1)]
    if "Apache-2.0" in terms:
        return [(ROOT / "LICENSE-APACHE").read_text(encoding="utf-8")]
    return []


def texts(crate: Crate) -> list[str]:
    """License texts of a crate of another project."""
    read = (file.read_text(encoding="utf-8", errors="replace").strip("\ufeff") for file in license_files(crate.folder))
    return [text for text in read if text.strip()] or standard_texts(crate)


def standard_library() -> str:
    """Notice of Rust's standard library, which is a part of each program."""
    version = run([rustc(), "--version"]).split()[1]
    return f"Rust standard library {version}: MIT OR Apache-2.0, https://github.com/rust-lang/rust"


def notices(all_crates: list[Crate]) -> str:
    """The whole file. Equal texts stand there once.

    Raises ValueError for crates without any text.
    """
    others = sorted((crate for crate in all_crates if not crate.is_own), key=lambda crate: crate.key)
    by_text: dict[str, tuple[str, list[str]]] = {}
    missing = []
    for crate in others:
        found = texts(crate)
        if not found and crate.license not in SILENT:
            missing.append(f"{crate.key} ({crate.license or 'no license'})")
        for text in found:
            _, users = by_text.setdefault(" ".join(text.split()), (text, []))
            if crate.key not in users:
                users.append(crate.key)
    if missing:
        raise ValueError(f"no license text: {', '.join(missing)}; add the text to tools/notices.py")

    parts = [f"{all_crates[0].name} {all_crates[0].version} is licensed under MIT OR Apache-2.0:\n"]
    parts += [f"{RULE}\n\n{(ROOT / name).read_text(encoding='utf-8').strip()}\n" for name in ("LICENSE-MIT", "LICENSE-APACHE")]
    listed = [f"{crate.key}: {crate.license}{f', {crate.repository}' if crate.repository else ''}" for crate in others]
    parts.append(f"{RULE}\n\nIt contains software of third parties:\n\n" + "\n".join([standard_library(), *listed]) + "\n")
    for text, users in by_text.values():
        lines = "\n".join(line.rstrip() for line in text.strip().splitlines())
        parts.append(f"{RULE}\n\n{', '.join(users)}:\n\n{lines}\n")
    return "\n".join(parts)


def main() -> int:
    parser = argparse.ArgumentParser(description="Write the notices of third parties for a program")
    add_arguments(parser)
    args = parser.parse_args()
    try:
        write(notices(list(crates(args, "normal,no-proc-macro").values())), args.output)
    except ValueError as error:
        print(f"notices: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
