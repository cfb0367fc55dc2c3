"""`--explain`: every row that a report shows has its sentence, and the pages exist."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from snakegen.analysis import catalogue
from snakegen.cli import cli
from snakegen.report.explanations import EXPLANATIONS, explain, explained

REPORTS = sorted(Path("generated").glob("*/report.md"))


def _labels() -> set[tuple[str, str]]:
    """Returns (analysis, label) of every row in the presets' reports."""
    found = set()
    for report in REPORTS:
        for part in report.read_text(encoding="utf-8").split("\n## ")[1:]:
            command = part.split("\n", 1)[0].strip()
            for label in re.findall(r"^\| ([^|]*?) \|", part, re.M):
                if label.strip() and not set(label) <= {"-"}:
                    found.add((command, label))
    return found


def test_every_row_of_the_presets_reports_is_explained() -> None:
    labels = _labels()
    assert len(labels) > 60
    assert [pair for pair in labels if explain(*pair) is None] == []


@pytest.mark.parametrize("analysis", sorted(EXPLANATIONS))
def test_analyses_and_pages_exist(analysis: str) -> None:
    assert analysis in catalogue()
    for _, sentence, page in EXPLANATIONS[analysis]:
        file, _, anchor = page.partition("#")
        text = Path(file).read_text(encoding="utf-8")
        heads = [re.sub(r"[^a-z0-9 -]", "", h.lower()).replace(" ", "-")
                 for h in re.findall(r"^#+ (.*)$", text, re.M)]  # fmt: skip
        assert not anchor or anchor in heads, page
        assert sentence.endswith(".")


def test_a_sentence_is_said_once() -> None:
    rows = explained("statics", [("joint1_yaw", "1 N·m"), ("joint2_yaw", "2 N·m")])
    assert [label for label, _ in rows] == ["joint1_yaw", "", "joint2_yaw"]
    rows = explained("margin", [("dual-rotor", "a"), ("", "b"), ("within servo limits", "c")])
    assert [text[0] for _, text in rows] == ["a", "b", "?", "c", "?"]


def test_the_command_explains(capsys: pytest.CaptureFixture[str]) -> None:
    run = CliRunner().invoke(cli, ["analyze", "mass", "dragon4", "--explain"])
    assert run.exit_code == 0 and "? Where the body balances" in run.output
    assert "?" not in CliRunner().invoke(cli, ["analyze", "mass", "dragon4"]).output
