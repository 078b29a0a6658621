"""A scene in a notebook: its facts, and the web player as a widget, through anywidget."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING, Any

from .errors import RunError
from .publish import player_file

if TYPE_CHECKING:
    from .scene import Scene

_RENDER = """
export default {
  async render({ model, el }) {
    const viewer = document.createElement("strivec-viewer");
    viewer.setAttribute("controls", "");
    viewer.style.height = `${model.get("height")}px`;
    viewer.style.display = "block";
    el.append(viewer);
    const show = () => viewer.open(new File([model.get("data")], "scene.strivec"));
    const send = () => { model.set("camera", viewer.camera ?? []); model.save_changes(); };
    viewer.addEventListener("pointerup", send);
    model.on("change:data", show);
    await show();
    send();
    return () => viewer.remove();
  },
};
"""


def widget(scene: Scene, height: int = 480) -> Any:
    """A widget with the web player that shows `scene`. Its `camera` is that of the viewer: a row-major camera-to-world matrix, and the
    vertical angle of view in degrees."""
    try:
        import anywidget
        import traitlets
    except ImportError as error:
        raise RunError("a widget needs the package anywidget: pip install anywidget") from error

    class Viewer(anywidget.AnyWidget):
        _esm = player_file("strivec-viewer-whole.js").read_text(encoding="utf-8") + _RENDER
        data = traitlets.Bytes().tag(sync=True)
        height = traitlets.Int(480).tag(sync=True)
        camera = traitlets.List(traitlets.Float()).tag(sync=True)

    return Viewer(data=scene.dumps(), height=height)


def summary(scene: Scene) -> str:
    """The thumbnail and the facts of `scene` as HTML."""
    facts = scene.info()
    rows = [
        ("dataset", facts["dataset"]),
        ("made by", f"{facts['tool']}, preset {facts['preset']}, {facts['steps']:,} steps"),
        ("tensors", " + ".join(f"{scale['tensors']:,}" for scale in facts["scales"])),
        ("parameters", f"{facts['nonzero_parameters']:,}"),
        ("bytes", f"{facts['bytes']:,}"),
        ("license", scene.license or ""),
    ]
    table = "".join(f"<tr><th>{name}</th><td>{safe(str(text))}</td></tr>" for name, text in rows if text)
    picture = ""
    if scene.thumbnail is not None:
        format, data = scene.thumbnail
        picture = f'<img alt="" src="data:image/{format};base64,{base64.b64encode(data).decode()}">'
    return f'<div style="display: flex; gap: 1em; align-items: center">{picture}<table>{table}</table></div>'


def printable(text: str) -> str:
    """Text of an untrusted file without characters that move a cursor, or hide or reorder others."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def safe(text: str) -> str:
    """Text of an untrusted file, for HTML."""
    return html.escape(printable(text))
