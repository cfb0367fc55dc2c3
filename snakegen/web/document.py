"""The HTML document of a page: sections, tables, charts, style and the 3-D engine."""

from __future__ import annotations

import html
import json
import zipfile
from collections.abc import Sequence
from importlib.resources import files
from io import BytesIO
from typing import Any

from snakegen import __version__
from snakegen.report.page import plain


def section(name: str, about: str, rows: Sequence[tuple[str, str]], charts: list[Any]) -> str:
    """Returns a section: its title, a sentence, plotly `charts`, and rows of (label, text)."""
    cells = "\n".join(
        f"<tr><td>{html.escape(label.strip())}</td><td>{html.escape(text)}</td></tr>"
        for label, text in rows
    )
    table = f"<table>{cells}</table>" if rows else ""
    drawn = "".join(f'<div class="chart">{_chart(c)}</div>' for c in charts)
    drawn = f'<div class="charts">{drawn}</div>' if drawn else ""
    title = html.escape(name)
    return (
        f'<section class="analysis" id="{title}"><h2>{title}</h2><p>{html.escape(about)}</p>'
        f"{drawn}{table}</section>"
    )


def verdict_section(summary: str, checks: list[tuple[str, bool]]) -> str:
    """Returns the section of a verdict: its summary, and (line, passed) of each check."""
    rows = "".join(
        f'<tr><td class="{"ok" if good else "bad"}">{"ok" if good else "FAIL"}</td>'
        f"<td>{html.escape(line.split(maxsplit=1)[-1])}</td></tr>"
        for line, good in checks
    )
    return (
        f'<section class="analysis" id="verdict"><h2>verdict</h2><p>{html.escape(summary)}</p>'
        f"<table>{rows}</table></section>"
    )


def _chart(figure: Any) -> str:
    config = {"displaylogo": False, "responsive": True}
    return str(figure.to_html(full_html=False, include_plotlyjs=False, config=config))


def fill_document(
    name: str,
    head: str,
    sections: list[str],
    data: dict[str, Any],
    still: str,
    command: str,
    urdf_hash: str,
) -> str:
    """Returns the whole document.

    Args:
        name: title.
        head: line below it.
        sections: as HTML.
        data: of the robot and its motion, for the viewer.
        still: picture of the posture, as a data URL.
        command: what makes this page again.
        urdf_hash: of the robot.
    """
    from plotly.offline import get_plotlyjs

    assets = files("snakegen.web") / "assets"
    text = (assets / "page.html").read_text(encoding="utf-8")
    again = (
        '<section class="analysis"><h2>again</h2><p>This page is made by</p>'
        f"<pre>{html.escape(command)}</pre></section>"
    )
    parts = {
        "$TITLE": html.escape(name),
        "$HEADING": html.escape(head),
        "$STYLE": (assets / "page.css").read_text(encoding="utf-8"),
        "$STILL": still,
        "$FOOTER": f"snakegen {__version__}, URDF {urdf_hash[:12]}",
        "$VIEWER": (assets / "viewer.js").read_text(encoding="utf-8"),
        "$SECTIONS": "\n".join([f"<script>{get_plotlyjs()}</script>", *sections, again]),
        "$CHARTS": "",
        "$DATA": json.dumps(plain(data), allow_nan=False).replace("</", "<\\/"),
        "$ENGINE": _engine(),
    }
    pieces = []
    while text:  # one pass: what is put in is not searched again
        start = text.find("$")
        mark = next((m for m in parts if start >= 0 and text.startswith(m, start)), None)
        if start < 0:
            pieces.append(text)
            break
        pieces.append(text[:start])
        pieces.append("$" if mark is None else parts[mark])
        text = text[start + (1 if mark is None else len(mark)) :]
    return "".join(pieces)


def _engine() -> str:
    """Returns three.js with its trackball and glTF loader, as trimesh ships them in its viewer."""
    import trimesh.resources as shipped

    packed = shipped.get_bytes("templates/viewer.zip")
    with zipfile.ZipFile(BytesIO(packed)) as archive:
        page = archive.read("viewer.html.template").decode()
    script = page[page.index("<script>") + len("<script>") : page.rindex("</script>")]
    return script[: script.rindex("var camera,controls,scene")]
