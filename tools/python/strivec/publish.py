"""Scenes for the web: a folder for any server, or one HTML file."""

from __future__ import annotations

import base64
import html
import os
import shutil
import tempfile
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Optional, Union

from .errors import RunError, UsageError

if TYPE_CHECKING:
    from .scene import Scene

_WEB = FilePath(__file__).parent / "web"
_VIEWER = "<strivec-viewer controls></strivec-viewer>"
_SCENE = "scene.strivec"
_PAGE = """\
<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
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
    <script type="module">
      const viewer = document.querySelector("strivec-viewer");
      const data = await fetch("data:application/octet-stream;base64," + document.querySelector("#scene").textContent.trim());
      await viewer.open(new File([await data.blob()], {name}));
    </script>
    <script type="text/plain" id="scene">{scene}</script>
  </body>
</html>
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

    The file opens in any browser with WebGPU, also from disk; the folder needs a server. Returns the page's path.
    """
    path = FilePath(output)
    if path.exists() and not overwrite:
        raise UsageError(f"{path}: exists; give another name, or overwrite=True")
    title = title or scene.description["provenance"]["dataset"] or "Strivec"
    if path.suffix.lower() in (".html", ".htm"):
        _write_atomically(path, _page(scene, title).encode())
        return path
    # The folder is made under another name and then renamed, so that it is complete.
    index = player_file("index.html").read_text(encoding="utf-8")
    assert _VIEWER in index
    partial = FilePath(tempfile.mkdtemp(dir=path.parent or ".", prefix=f".{path.name}-"))
    try:
        shutil.copytree(_WEB, partial, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*-whole.js"))
        viewer = _VIEWER.replace("controls", f'controls src="{_SCENE}"')
        page = index.replace(_VIEWER, viewer).replace("<title>Strivec</title>", f"<title>{html.escape(title)}</title>")
        (partial / "index.html").write_text(page, encoding="utf-8")
        (partial / _SCENE).write_bytes(scene.dumps())
        partial.chmod(0o755)
        if path.is_dir():
            shutil.rmtree(path)
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    return path / "index.html"


def _page(scene: Scene, title: str) -> str:
    script = player_file("strivec-viewer-whole.js").read_text(encoding="utf-8")
    # In a page, these would end the script, or begin a comment.
    script = script.replace("</script", "<\\/script").replace("<!--", "<\\!--")
    data = base64.b64encode(scene.dumps()).decode()
    return _PAGE.format(title=html.escape(title), script=script, scene=data, name=_SCENE.join('""'))


def _write_atomically(path: FilePath, data: bytes) -> None:
    with tempfile.NamedTemporaryFile(dir=path.parent or ".", prefix=f".{path.name}-", delete=False) as file:
        try:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise
