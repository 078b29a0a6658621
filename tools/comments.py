#!/usr/bin/env python3
"""Lists documentation that needs its neighbor. Documentation is read one item at a time: in an editor or on a page."""

import re
import sys
from pathlib import Path

FOLDERS = ["src", "examples", "tests", "tools"]
DOC = re.compile(r"\s*//[/!] ?(.*)")
NEEDS_NEIGHBOR = re.compile(r"(Those|The same|It|Its|They|Theirs|That of|Of (the|this)|Like|Same|Likewise|Also|And)\b|As [\[`]")


def faults(lines: list[str]) -> list[int]:
    """Numbers of the lines with which a comment, or the text below one of its headings, begins by a pronoun."""
    docs = [DOC.match(line) for line in lines]
    found = []
    for n, doc in enumerate(docs):
        is_below_heading = n > 1 and docs[n - 1] and not docs[n - 1][1] and docs[n - 2] and docs[n - 2][1].startswith("#")
        is_first = n == 0 or not docs[n - 1] or is_below_heading
        if doc and is_first and NEEDS_NEIGHBOR.match(doc[1]):
            end = next((m for m in range(n, len(docs)) if not docs[m]), len(docs))
            # Help texts have no final period. They are shown as lists, where a neighbor is in sight.
            if docs[end - 1][1].endswith("."):
                found.append(n)
    return found


def main() -> int:
    root = Path(__file__).resolve().parent.parent
    places = 0
    for file in sorted(file for folder in FOLDERS for file in (root / folder).rglob("*.rs")):
        lines = file.read_text(encoding="utf-8").splitlines()
        for n in faults(lines):
            print(f"{file.relative_to(root)}:{n + 1}: name the subject: {lines[n].strip()}")
            places += 1
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
