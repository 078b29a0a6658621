#!/usr/bin/env python3
"""Lists the names of structs, enums and traits that src/ defines more than once, with the files, most frequent first."""

import re
from collections import defaultdict
from pathlib import Path

DEFINITION = re.compile(r"^\s*(?:pub(?:\([^)]*\))?\s+)?(?:unsafe\s+)?(?:struct|enum|trait)\s+(\w+)", re.MULTILINE)


def definitions(folder: Path) -> dict[str, list[str]]:
    """The files of `folder` that define each name; a file stands as often as it defines the name."""
    files = defaultdict(list)
    for file in sorted(folder.rglob("*.rs")):
        for name in DEFINITION.findall(file.read_text(encoding="utf-8")):
            files[name].append(str(file.relative_to(folder)))
    return files


def main() -> None:
    files = definitions(Path(__file__).resolve().parent.parent / "src")
    shared = {name: places for name, places in files.items() if len(places) > 1}
    types, sharing = (sum(map(len, names.values())) for names in (files, shared))
    print(f"{len(shared)} names for {sharing} of {types} types")
    for name, places in sorted(shared.items(), key=lambda item: (-len(item[1]), item[0])):
        print(f"{len(places):4} {name}: {', '.join(places)}")


if __name__ == "__main__":
    main()
