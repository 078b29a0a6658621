#!/usr/bin/env python3
"""Checks the documents: size of README.md, links, links to experiments, and figures that stand in several places.

    python3 tools/texts.py

A figure that stands in several places is marked with the same name in each of them:

    <!-- figure: lego-psnr -->37.26 dB

The numbers behind all marks of a name must be equal. Prints all problems, one a line, and exits with 1 if there are any.
"""

import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from urllib.parse import unquote

ROOT = Path(__file__).resolve().parent.parent
MAX_WORDS = 600
MAX_SHARE_OF_DIGITS = 0.03
EXPERIMENTS = "docs/experiments/"
# Documents that may link to experiments; any other links to decisions or results.
MAY_LINK_TO_EXPERIMENTS = (EXPERIMENTS, "docs/decisions/", "docs/results.md", "CHANGELOG.md")

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
FENCE = re.compile(r"^(```|~~~).*?^\1[^\n]*$", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"(?:\A|(?<=\n\n))(?: {4}[^\n]*(?:\n|\Z))+")
CODE = re.compile(r"(`+)(?!`).*?(?<!`)\1(?!`)", re.DOTALL)
# Inline links and pictures, links by reference, and attributes of HTML.
LINK = re.compile(r"\]\(\s*<?([^)>\s]+)>?[^)]*\)|^\[[^\]]+\]:\s*(\S+)|(?:href|src)=\"([^\"]+)\"", re.MULTILINE)
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*$", re.MULTILINE)
FIGURE = re.compile(r"<!-- figure: ([a-z0-9-]+) -->\**(\S*?)(?=[\s*|,;:)]|\.?$|\.\s)", re.MULTILINE)


def documents():
    """Paths of all documents, relative to the root, that git has or would add."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted({name for name in names if (ROOT / name).is_file()})


def without_code(text):
    """`text` without blocks of code; lines stay, so that offsets give line numbers."""
    blank = lambda match: re.sub(r"[^\n]", " ", match[0])
    return INDENTED.sub(blank, FENCE.sub(blank, text))


def anchors(text):
    """Names of the headings as GitHub makes them, and explicit ones."""
    found, times = set(re.findall(r"(?:id|name)=\"([^\"]+)\"", text)), defaultdict(int)
    for heading in HEADING.findall(without_code(text)):
        plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        found.add(name if not times[name] else f"{name}-{times[name]}")
        times[name] += 1
    return found


def readme_problems(text):
    """README.md must be short and have few figures."""
    plain = re.sub(r"\]\([^)]*\)", "]", COMMENT.sub("", text))
    words = [word for word in plain.split() if re.search(r"\w", word)]
    digits = [word for word in words if re.search(r"\d", word)]
    if len(words) > MAX_WORDS:
        yield f"README.md: {len(words)} words; expected at most {MAX_WORDS}"
    if len(digits) > MAX_SHARE_OF_DIGITS * len(words):
        yield (f"README.md: {len(digits)} of {len(words)} words have digits; expected at most "
               f"{MAX_SHARE_OF_DIGITS:.0%}: {' '.join(digits)}")


def link_problems(name, text, texts):
    """Relative links must lead to files and headings that exist, and to experiments from few documents only."""
    prose = CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), without_code(COMMENT.sub("", text)))
    for match in LINK.finditer(prose):
        target = next(group for group in match.groups() if group)
        if re.match(r"[a-z][a-z+.-]*:|//", target):
            continue
        path, _, anchor = target.partition("#")
        file = ((ROOT / name).parent / unquote(path)).resolve() if path else ROOT / name
        if not file.exists() or not file.is_relative_to(ROOT):
            yield f"{name}: {target}: no such file in the repository"
            continue
        key = file.relative_to(ROOT).as_posix()
        if anchor and key in texts and unquote(anchor) not in anchors(texts[key]):
            yield f"{name}: {target}: no such heading"
        if (key + "/").startswith(EXPERIMENTS) and not name.startswith(MAY_LINK_TO_EXPERIMENTS):
            yield f"{name}: {target}: link to a decision or to the results instead of an experiment"


def figure_problems(texts):
    """Marks of one name must have the same number and stand in at least two places."""
    places = defaultdict(list)
    for name, text in texts.items():
        for match in FIGURE.finditer(without_code(text)):
            places[match[1]].append((match[2], f"{name}:{text.count(chr(10), 0, match.start()) + 1}"))
    for figure, found in sorted(places.items()):
        if len({value for value, _ in found}) > 1:
            yield f"figure {figure} differs: " + ", ".join(f"{value} in {place}" for value, place in found)
        elif len(found) < 2:
            yield f"figure {figure} stands in {found[0][1]} only; mark it in its source, too"


def main():
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in documents()}
    problems = list(readme_problems(texts["README.md"]))
    for name, text in texts.items():
        problems += link_problems(name, text, texts)
    problems += figure_problems(texts)
    print("\n".join(problems) if problems else f"{len(texts)} documents: no problem found")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
