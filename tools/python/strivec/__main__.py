"""`python -m strivec publish SCENE OUTPUT`, and `python -m strivec COMMAND …` for the commands of `strivec`."""

import argparse
import json
import sys

from .commands import Message, command
from .errors import Error
from .scene import Scene


def main() -> int:
    """Runs the command in the process's arguments and returns its exit code."""
    words = sys.argv[1:]
    try:
        if words[:1] == ["publish"]:
            return _publish(words[1:])
        result = command(*words, callback=_tell)
    except Error as error:
        print(f"strivec: {error}", file=sys.stderr)
        return 1
    if result is not None:
        print(result if isinstance(result, str) else json.dumps(result, indent=2))
    return 0


def _publish(words: "list[str]") -> int:
    parser = argparse.ArgumentParser(
        prog="python -m strivec publish", description="Write a scene with the web player, as a folder or as one HTML file"
    )
    parser.add_argument("scene", help="scene file")
    parser.add_argument("output", help="folder, or file that ends in .html")
    parser.add_argument("--title", help="title of the page (default: the dataset's name)")
    parser.add_argument("--force", action="store_true", help="replace the file, or the files in the folder that publish wrote")
    arguments = parser.parse_args(words)
    from .publish import publish

    print(publish(Scene.load(arguments.scene), arguments.output, arguments.title, arguments.force))
    return 0


def _tell(event: object) -> None:
    if isinstance(event, Message):
        print(event.text, file=sys.stderr)
    else:
        print(f"{event.task}: {event.done}/{event.total}, {event.detail}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
