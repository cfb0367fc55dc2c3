"""The README tells the truth: its commands run, its tables name what there is."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from snakegen.analysis import catalogue
from snakegen.simulation.missions import missions
from snakegen.spec.loading import presets

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
OVERVIEW = (ROOT / "docs" / "overview.md").read_text(encoding="utf-8")
COMMAND = re.compile(r"^\$ (snakegen .*?)(?:\s+# exit (\d))?$", re.M)


def commands() -> list[tuple[str, int, str]]:
    """Returns the commands of the console blocks, the exit code of each and what it prints."""
    blocks = re.findall(r"```console\n(.*?)```", README, re.S)
    found = []
    for block in blocks:
        marks = list(COMMAND.finditer(block))
        ends = [*(m.start() for m in marks[1:]), len(block)]
        for mark, end in zip(marks, ends, strict=True):
            found.append((mark[1], int(mark[2] or 0), block[mark.end() : end].strip()))
    assert sum(block.count("$ ") for block in blocks) == len(found)
    return found


def words(text: str) -> str:
    """Returns `text` with its numbers and line breaks made alike."""
    return " ".join(re.sub(r"(?<![\w.])[-+]?\d[\d.]*(e[-+]?\d+)?", "#", text).split())


def table(first: str) -> set[str]:
    """Returns the names in the first column of the table whose header begins with `first`."""
    body = (README + OVERVIEW).split(f"| {first}")[1].split("\n\n")[0]
    return set(re.findall(r"^\| `([\w-]+)` \|", body, re.M))


def test_every_command_runs(tmp_path: Path, run) -> None:
    """In one empty folder, from the first to the last, each exits and prints as the README says.

    They run in this process, which imports libraries once; `> FILE` is done as a shell does it.
    """
    found = commands()
    assert len(found) >= 6
    for line, expected, shown in found:
        command, _, file = line.partition(" > ")
        assert not set(command + file) & set("|>&;$*`"), f"{line}: only a shell can run it"
        ran = run(*shlex.split(command)[1:])
        if file:
            (tmp_path / file.strip()).write_text(ran.out)
        assert ran.code == expected, f"{line}\n{ran.out}{ran.err}"
        if shown and expected == 0:  # a report goes on
            assert words(ran.out).startswith(words(shown)), line


def test_the_refusal_is_the_printed_one(tmp_path: Path) -> None:
    """The error that the README shows is the one that comes."""
    shown = re.findall(r"^\$ (snakegen .*?)\s+# exit 1\n(Error: .*)$", README, re.M)
    assert shown
    for line, message in shown:
        command = [sys.executable, "-m", *shlex.split(line)]
        ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert ran.stderr.strip() == message


@pytest.mark.parametrize(
    ("first", "names"),
    [
        ("preset |", lambda: set(presets())),
        ("`snakegen analyze …`", lambda: {*catalogue(), "sweep", "flight"}),
        ("`snakegen analyze flight …", lambda: set(missions())),
    ],
)
def test_tables_are_complete(first: str, names) -> None:
    """Presets, analyses and missions: all that there are, and none that there is not."""
    assert table(first) == names()


def test_links_exist_and_pictures_are_small() -> None:
    """Every relative link of the README leads somewhere (docs/: see test_docs)."""
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target
    for picture in (ROOT / "docs").rglob("*.png"):
        assert picture.stat().st_size < 300_000, picture


def test_the_python_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The block under "From Python" runs as it stands and prints two numbers and their bounds."""
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(.*?)```", README, re.S)
    assert code is not None
    exec(compile(code.group(1), "README.md", "exec"), {"__name__": "example"})
    printed = capsys.readouterr().out.split()
    assert (tmp_path / "hover.rrd").stat().st_size > 100_000
    assert float(printed[0]) > 1 and float(printed[1]) > 1
