"""What a batch has made: a table in Parquet, a gallery in HTML, and progress in a terminal."""

from __future__ import annotations

import collections
import html
import io
import sys
import time
from typing import Any, Dict, List

from ..notebook import printable, safe
from .schedule import Progress
from .stages import summary
from .store import Store

_POLICY = "script-src 'none'; connect-src 'none'; frame-src 'none'; object-src 'none'; base-uri 'none'; form-action 'none'"
"""The gallery's Content-Security-Policy: pictures and links, but nothing that runs."""
_STYLE = """
body { font: 15px/1.4 system-ui, sans-serif; margin: 2rem; background: #16161a; color: #e6e6ea; }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 1rem; }
article { background: #222228; border-radius: 6px; padding: .8rem; overflow-wrap: anywhere; }
article.failed { outline: 1px solid #c8553d; }
img { width: 100%; image-rendering: auto; border-radius: 4px; background: #fff; }
h2 { font-size: 1rem; margin: .5rem 0 .2rem; }
pre { white-space: pre-wrap; font-size: .75rem; color: #f0b8a8; }
a { color: #9ecbff; }
"""


class Terminal:
    """Progress on standard error: a table that is drawn again on a terminal, else a line when a scene ends."""

    def __init__(self) -> None:
        self.start = time.time()
        self.ended: set = set()
        self.drawn = 0
        self.is_terminal = sys.stderr.isatty()

    def told(self, jobs: List[Progress]) -> None:
        """Shows where `jobs` are."""
        lines = []
        for one in jobs:
            if one.state in ("done", "failed") and one.job.name not in self.ended:
                self.ended.add(one.job.name)
                lines.append(f"{one.job.name}: {one.error or 'done'}")
        states = collections.Counter(one.state for one in jobs)
        counts = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
        if self.is_terminal:
            up = f"\x1b[{self.drawn}A\x1b[J" if self.drawn else ""
            running = [f"  {one.job.name:<24} {one.state}" for one in jobs if one.state not in ("done", "failed", "waiting")]
            table = [f"{time.time() - self.start:.0f} s: {counts}", *running[:20]]
            print(up + "\n".join([*map(printable, lines), *table]), file=sys.stderr)
            self.drawn = len(table)
        else:
            for line in lines:
                print(f"{printable(line)} ({counts})", file=sys.stderr, flush=True)


def write(store: Store, jobs: List[Progress]) -> None:
    """Writes `results.parquet` and `index.html`."""
    import pyarrow
    import pyarrow.parquet

    rows = [_row(one) for one in jobs]
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(table, buffer)
    store.write("results.parquet", buffer.getvalue())
    store.write("index.html", _gallery(jobs, rows).encode())


def _row(one: Progress) -> Dict[str, Any]:
    row = summary(one.job, one.done) if one.state == "done" else {"scene": one.job.name, "dataset": one.job.dataset}
    wall = one.ended - one.begun if one.ended and one.begun else None
    return {**row, "state": one.state, "error": one.error, "wall_minutes": wall and wall / 60.0}


def _gallery(jobs: List[Progress], rows: List[Dict[str, Any]]) -> str:
    made = sum(row["state"] == "done" for row in rows)
    articles = "\n".join(_article(one, row) for one, row in zip(jobs, rows))
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{made} of {len(rows)} scenes</title><style>{_STYLE}</style></head>
<body><h1>{made} of {len(rows)} scenes</h1><main>
{articles}
</main></body></html>
"""


def _article(one: Progress, row: Dict[str, Any]) -> str:
    name = safe(one.job.name)
    if one.state != "done":
        return f'<article class="failed"><h2>{name}</h2><pre>{safe(one.error or one.state)}</pre></article>'
    picture = f'<img alt="" loading="lazy" src="{html.escape(row["picture"], quote=True)}">'
    psnr = "" if row["psnr"] is None else f"{row['psnr']:.2f} dB · "
    facts = f"{psnr}{row['bytes'] / 1e6:.2f} MB · {row['parameters']:,} parameters · {row['minutes']:.1f} min"
    address = html.escape(row["file"], quote=True)
    warnings = "".join(f"<pre>{safe(line)}</pre>" for line in row["warnings"].splitlines())
    return f'<article>{picture}<h2><a href="{address}">{name}</a></h2>{facts}{warnings}</article>'
