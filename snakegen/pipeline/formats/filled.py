"""Text files of a format from `templates/formats/`, with their names filled in."""

from pathlib import Path
from string import Template
from typing import Any

from snakegen.spec.loading import templates_folder


def fill(template: str, target: Path, **values: Any) -> None:
    """Writes `target` from a template, whose ``$names`` are all in `values`."""
    text = (templates_folder() / "formats" / template).read_text(encoding="utf-8")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(Template(text).substitute(values), encoding="utf-8")


def xml_text(text: str) -> str:
    """Returns `text` as it may stand between XML tags."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
