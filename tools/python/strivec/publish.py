"""Scenes for the web: a folder for any server, or one HTML file."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import html
import json
import os
import re
import shutil
import tempfile
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Dict, Iterable, List, Optional, Union

from ._files import inside, replacing, sync
from .errors import InputError, MalformedError, RunError, UsageError

if TYPE_CHECKING:
    from .scene import Scene

_WEB = FilePath(__file__).parent / "web"
_VIEWER = "<strivec-viewer controls></strivec-viewer>"
_SCENE = "scene.strivec"
_INDEX = "index.html"
_MANIFEST = "published.json"
"""The list of the files that `publish` wrote to a folder."""
Digests = Dict[str, List[str]]
"""Files by name, each with the SHA-256 digests of the contents that it may have."""
_TOOL = "strivec publish"
_MAX_NAMED = 5
"""Most names of files in an error."""
_PAGE = """\
<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    {policy}
    <meta name="viewport" content="width=device-width, initial-scale=1" />
    <title>{title}</title>
    <link rel="icon" href="data:," />
    <style>
      html, body {{ height: 100%; margin: 0; background: #0f0f11; }}
      strivec-viewer {{ height: 100%; }}
    </style>
  </head>
  <body>
    <strivec-viewer controls></strivec-viewer>
    <noscript>This page needs JavaScript and WebGPU.</noscript>
    <script type="module">{script}</script>
    <script type="module">{start}</script>
    <script type="text/plain" id="scene">{scene}</script>
  </body>
</html>
"""
_START = f"""
      const viewer = document.querySelector("strivec-viewer");
      const data = await fetch("data:application/octet-stream;base64," + document.querySelector("#scene").textContent.trim());
      await viewer.open(new File([await data.blob()], "{_SCENE}"));
    """


def player_file(name: str) -> FilePath:
    """A file of the web player, which wheels have if it was built before them."""
    path = _WEB / name
    if not path.is_file():
        raise RunError(
            f"this installation has no web player ({path} is missing): build it by tools/web/build.sh, and install the package again"
        )
    return path


def publish(
    scene: Scene, output: Union[str, "os.PathLike[str]"], title: Optional[str] = None, overwrite: bool = False
) -> FilePath:
    """Writes `scene` with the web player: as one HTML file if the name of `output` ends in .html, else as a folder of static files.

    The file opens in any browser with WebGPU, also from disk; the folder needs a server. Its page loads nothing from other servers.
    With `overwrite`, the file is replaced; in a folder, only files that an earlier call wrote are replaced or removed. Returns the
    page's path.

    Raises a UsageError, and changes nothing, if `output` exists without `overwrite`, if it is a folder with files but none of an
    earlier call, or if a file of another origin is in the way; an InputError if it cannot be written.
    """
    path = FilePath(output)
    is_page = path.suffix.lower() in (".html", ".htm")
    if path.exists() and not overwrite:
        raise UsageError(f"{path}: exists; give another name, or overwrite=True")
    if path.exists() and path.is_dir() == is_page:
        expected, found = ("a file", "a folder") if is_page else ("a folder, or a name that ends in .html", "a file")
        raise UsageError(f"{path}: expected {expected}; found {found}; give another name")
    title = title or scene.description["provenance"]["dataset"] or "Strivec"
    try:
        if is_page:
            page = _page(scene, title)
            with replacing(path) as partial:
                partial.write_bytes(page)
            return path
        _write_folder(path, _site(scene, title))
        return path / _INDEX
    except OSError as error:
        raise InputError(f"{path}: cannot write it: {error.strerror or error}") from error


def _page(scene: Scene, title: str) -> bytes:
    """The page that holds the player and `scene`."""
    script = player_file("strivec-viewer-whole.js").read_text(encoding="utf-8")
    # In a page, these would end the script, or begin a comment.
    script = re.sub("<(/script|!--)", r"<\\\1", script, flags=re.IGNORECASE)
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (script, _START))
    policy = _policy(" ".join(f"'sha256-{digest}'" for digest in digests), "data:")
    data = base64.b64encode(scene.dumps()).decode()
    return _PAGE.format(policy=policy, title=html.escape(title), script=script, start=_START, scene=data).encode()


def _site(scene: Scene, title: str) -> Dict[str, bytes]:
    """The files of a folder with the player and `scene`, by their names. The page is the last, as it names the others."""
    page = player_file(_INDEX).read_text(encoding="utf-8")
    for before, after in (
        ("<head>", "<head>\n    " + _policy("'self'", "'self'")),
        ("<title>Strivec</title>", f"<title>{html.escape(title)}</title>"),
        (_VIEWER, _VIEWER.replace("controls", f'controls src="{_SCENE}"')),
    ):
        assert before in page, before
        page = page.replace(before, after, 1)
    names = (path.relative_to(_WEB).as_posix() for path in sorted(_WEB.rglob("*")) if path.is_file())
    player = {name: (_WEB / name).read_bytes() for name in names if name != _INDEX and not name.endswith("-whole.js")}
    return {**player, _SCENE: scene.dumps(), _INDEX: page.encode()}


def _policy(scripts: str, connections: str) -> str:
    """The element that forbids a page everything but these `scripts` with their WebAssembly, these `connections`, its styles and its
    icon."""
    rules = (
        "default-src 'none'",
        f"script-src {scripts} 'wasm-unsafe-eval'",
        f"connect-src {connections}",
        "style-src 'unsafe-inline'",
        "img-src data:",
        "base-uri 'none'",
        "form-action 'none'",
    )
    return f'<meta http-equiv="Content-Security-Policy" content="{"; ".join(rules)}" />'


def _write_folder(folder: FilePath, files: Dict[str, bytes]) -> None:
    """Writes `files`, by their names, to `folder`, and removes those that an earlier call wrote and this one does not.

    All new files are on the disk before the first is replaced. If `folder` is new, it appears whole.
    """
    is_new = not folder.exists()
    before = {} if is_new else _published(folder)
    _check_free(folder, files, before)
    after = {name: [_digest(data)] for name, data in files.items()}
    partial = FilePath(tempfile.mkdtemp(dir=folder.parent if is_new else folder, prefix=f".{folder.name}-"))
    try:
        for name, data in {**files, _MANIFEST: _manifest(after)}.items():
            path = partial / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            sync(path)
        if is_new:
            partial.chmod(0o755)
            partial.rename(folder)
            sync(folder.parent)
        else:
            _replace(folder, partial, before, after)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _check_free(folder: FilePath, files: Iterable[str], before: Digests) -> None:
    """Raises a UsageError if one of `files` would replace a file that is not as in `before`."""
    taken = [name for name in files if os.path.lexists(folder / name) and not _is_own(folder, name, before)]
    if taken:
        names = ", ".join(taken[:_MAX_NAMED]) + (" and others" if len(taken) > _MAX_NAMED else "")
        raise UsageError(
            f"{folder}: expected files as publish wrote them; found others, or changed ones: {names}; move them away, or give the "
            "name of a new folder"
        )


def _replace(folder: FilePath, partial: FilePath, before: Digests, after: Digests) -> None:
    """Moves the files `after` and their manifest from `partial` to `folder`, and removes the others of `before`."""
    old = [_path(folder, name) for name in before if name not in after and _is_own(folder, name, before)]
    new = {name: _path(folder, name) for name in after}
    for path in new.values():
        path.parent.mkdir(parents=True, exist_ok=True)
    # If the process dies from here on, the next call accepts both versions of each file.
    both = {name: [*before.get(name, []), *after.get(name, [])] for name in {**before, **after}}
    with replacing(folder / _MANIFEST) as manifest:
        manifest.write_bytes(_manifest(both))
    for name, path in new.items():
        os.replace(partial / name, path)
    for path in old:
        path.unlink()
        with contextlib.suppress(OSError):
            # Ends at the first folder that is not empty, at the latest at the one with the page.
            os.removedirs(path.parent)
    os.replace(partial / _MANIFEST, folder / _MANIFEST)


def _published(folder: FilePath) -> Digests:
    """The files that an earlier call wrote to `folder`; none if it is empty."""
    path = folder / _MANIFEST
    if not path.is_file():
        if any(folder.iterdir()):
            raise UsageError(
                f"{folder}: expected a folder that publish wrote, or an empty one; found files, but no {_MANIFEST}; give the name of "
                "a new folder"
            )
        return {}
    try:
        document = json.loads(path.read_bytes())
        if document["tool"] != _TOOL:
            raise ValueError(document["tool"])
        return {name: list(digests) for name, digests in document["files"].items()}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise MalformedError(
            f"{path}: expected the list of files that publish wrote; found something else; give the name of a new folder"
        ) from error


def _manifest(files: Digests) -> bytes:
    """The contents of the list of `files`."""
    return json.dumps({"tool": _TOOL, "files": files}, indent=1).encode()


def _is_own(folder: FilePath, name: str, files: Digests) -> bool:
    """Whether the file `name` in `folder` is as an earlier call wrote it. Raises a MalformedError if it is not in the folder."""
    path = _path(folder, name)
    return path.is_file() and _digest(path.read_bytes()) in files.get(name, [])


def _path(folder: FilePath, name: str) -> FilePath:
    """The path of the file `name`, which the manifest of `folder` may list."""
    return inside(folder, name, str(folder / _MANIFEST))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
