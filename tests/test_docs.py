"""The documentation is true: its Python runs, its formulas are the code's, links lead on."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path("docs")
PAGES = sorted(p for p in DOCS.rglob("*.md"))
MADE = {f"reference/{name}.md" for name in ("spec", "commands", "missions", "keys")}
PYTHON = re.compile(r"```python\n(.*?)```", re.S)


CONSOLE = re.compile(r"```console\n(.*?)```", re.S)
FILE = re.compile(r"`([\w-]+\.(?:yaml|urdf))`[^`]*?:\n\n```(?:yaml|xml)\n(.*?)```", re.S)
SITE = Path("out/site")  # as `make docs` builds it
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
SKIPPED = ("pip install", "snakegen demo")  # the one needs a network, `make demo` runs the other


def _commands(text: str) -> list[tuple[str, int]]:
    """Returns the commands of a page's console boxes, and the exit code that it states."""
    found = []
    for box in CONSOLE.findall(text):
        for line in re.findall(r"^\$ (.*)$", box, re.M):
            command, _, remark = line.partition("#")
            code = re.search(r"exit (\d+)", remark)
            if not command.startswith(SKIPPED):
                found.append((command.strip(), int(code[1]) if code else 0))
    return found


def _with_commands() -> list[Path]:
    return [page for page in PAGES if _commands(page.read_text(encoding="utf-8"))]


@pytest.mark.slow
@pytest.mark.parametrize("page", _with_commands(), ids=lambda p: p.relative_to(DOCS).as_posix())
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    """In one empty folder, from the first to the last, with the files that the page writes out."""
    text = page.read_text(encoding="utf-8")
    for name, content in FILE.findall(text):
        (tmp_path / name).write_text(content, encoding="utf-8")
    for command, code in _commands(text):
        words = shlex.split(command)
        assert words[0] == "snakegen", command
        run = subprocess.run(
            [sys.executable, "-m", "snakegen", *words[1:]],
            capture_output=True, text=True, cwd=tmp_path,
        )  # fmt: skip
        assert run.returncode == code, f"{command}\n{run.stdout}{run.stderr}"


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_search_finds_pages_without_a_server() -> None:
    page = (SITE / "how-to/files.html").resolve().as_uri() + "?q=singularity"
    command = [
        str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=8000",
        "--dump-dom", page,
    ]  # fmt: skip
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = re.search(r"(\d+) matching documents", run.stdout)
    assert found and int(found[1]) >= 2


def _with_python() -> list[Path]:
    return [page for page in PAGES if PYTHON.search(page.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("page", _with_python(), ids=lambda p: p.relative_to(DOCS).as_posix())
def test_the_python_of_a_page_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All boxes of a page are one program, in a folder of its own."""
    boxes = PYTHON.findall(page.read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(boxes), str(page), "exec"), {"__name__": "docs"})


def test_a_wrong_formula_would_be_noticed(tmp_path: Path) -> None:
    text = (DOCS / "theory.md").read_text(encoding="utf-8")
    boxes = PYTHON.findall(text)
    wrong = "\n".join(boxes[:3]).replace("np.cross(p, u) + drag", "np.cross(p, u) - drag")
    with pytest.raises(AssertionError):
        exec(compile(wrong, "wrong", "exec"), {"__name__": "docs"})


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).as_posix())
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if not re.match(r"[a-z]+:", target):
            found = (page.parent / target).resolve().relative_to(DOCS.resolve()).as_posix()
            assert (DOCS / found).is_file() or found in MADE or found.startswith("pictures/"), found


def test_every_command_option_and_field_is_on_a_page() -> None:
    """The reference pages are made from the program; nothing is left out of them."""
    import importlib.util

    import click

    from snakegen.cli import cli
    from snakegen.spec.robot_spec import RobotSpec

    made = importlib.util.spec_from_file_location("hooks", DOCS / "hooks.py")
    assert made is not None and made.loader is not None
    hooks = importlib.util.module_from_spec(made)
    made.loader.exec_module(hooks)
    pages = hooks.pages()
    assert set(pages) == MADE
    commands = pages["reference/commands.md"]
    root = click.Context(cli, info_name="snakegen")
    for name in cli.list_commands(root):
        assert f"## snakegen {name}\n" in commands
        command = cli.get_command(root, name)
        assert command is not None
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                assert max(parameter.opts, key=len) in commands, parameter.name
    for field in RobotSpec.model_fields:
        assert f"| `{field}` |" in pages["reference/spec.md"]
    assert "| `position_rate` |" in pages["reference/spec.md"]
    from snakegen.sweep.worker import NUMBERS

    assert {name for name, _, _ in hooks.COLUMNS} == set(NUMBERS)
    assert "## transform" in pages["reference/missions.md"]


def test_the_notebook_runs_from_top_to_bottom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import json

    book = json.loads((DOCS / "examples" / "first_minutes.ipynb").read_text(encoding="utf-8"))
    assert book["nbformat"] == 4 and all(not cell.get("outputs") for cell in book["cells"])
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert names["torque"][0] < 1e-6 < names["torque"][-1]  # type: ignore[index]
    assert "passed" in capsys.readouterr().out
