"""Commands at the edges of their process: closed streams, locales, Ctrl-C."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from snakegen.base import atomic_io


def snakegen(*words: str, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "snakegen", *words]
    return subprocess.run(command, capture_output=True, text=True, **options)


def test_closed_streams_are_quiet(tmp_path: Path) -> None:
    shell = f"'{sys.executable}' -m snakegen presets"
    for closed in (">&-", ">&- 2>&-", "<&- >&- 2>&-"):
        done = subprocess.run(f"{shell} {closed}", shell=True, capture_output=True, cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_an_ascii_locale_reads_and_writes_utf_8(tmp_path: Path) -> None:
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ("build", "arm6", "--set", "about=θ", "--no-picture", "-o", "ö")
    done = snakegen(*words, env=os.environ | plain, cwd=tmp_path, encoding="utf-8")
    assert done.returncode == 0 and "ö/arm6.urdf" in done.stdout, done.stderr
    assert "θ" in (tmp_path / "ö/arm6.spec.yaml").read_text(encoding="utf-8")


def test_an_error_without_a_name_is_not_blamed_on_stdout(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from snakegen.cli import cli, main

    def fails(*args: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cli, "main", fails)
    with pytest.raises(SystemExit) as left:
        main(["presets"])
    assert left.value.code == 1 and capsys.readouterr().err == "Error: No space left on device.\n"


@pytest.mark.parametrize("after", [0.05, 0.12, 0.2, 0.35])
def test_ctrl_c_during_imports_is_130_or_the_result(after: float, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "snakegen", "schema"]
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    time.sleep(after)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=60)
    if "snakegen" not in err and "Traceback" in err:
        return  # Python itself was starting: nothing of this package ran yet
    assert (child.returncode, err.strip()) in [
        (0, ""),
        (130, "Error: interrupted; files are as they were."),
    ]


def test_ctrl_c_turned_into_another_error_is_130(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An extension module that is being imported reports an interruption as its own fault."""
    from snakegen.cli import cli, main

    def fails(*args: object, **options: object) -> None:
        atomic_io.INTERRUPTED.set()
        raise ImportError("initialization failed")

    monkeypatch.setattr(cli, "main", fails)
    with pytest.raises(SystemExit) as left:
        main(["presets"])
    atomic_io.INTERRUPTED.clear()
    assert left.value.code == 130 and "interrupted" in capsys.readouterr().err
