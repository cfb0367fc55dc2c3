"""Ctrl-C at any instant of the program is one line and exit code 130: imports and callbacks too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from snakegen.sweep import executors

LINE = "Error: interrupted; files are as they were."
# a library whose import sends Ctrl-C to its own process, where an exception would be lost
DURING = {
    "in a module's body": "os.kill(os.getpid(), signal.SIGINT)\n",
    "in a body that catches all": (
        "try:\n    os.kill(os.getpid(), signal.SIGINT); time.sleep(0.01)\n"
        "except BaseException as error:\n    raise ImportError('broken') from error\n"
    ),
    "in a destructor": (
        "class Dying:\n"
        "    def __del__(self): os.kill(os.getpid(), signal.SIGINT); time.sleep(0.01)\n"
        "def work():\n    Dying()\n    time.sleep(30)\n"
    ),
    "at work": "def work():\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(30)\n",
}
MAIN = """
import sys
from snakegen import cli
import snakegen.cli.presets
def presets(**options):
    import library
    getattr(library, "work", lambda: __import__("time").sleep(30))()
snakegen.cli.presets.presets.callback = presets
sys.argv = ["snakegen", "presets"]
cli.main()
"""


@pytest.mark.parametrize("when", DURING)
def test_ctrl_c_is_one_line(when: str, tmp_path: Path) -> None:
    (tmp_path / "library.py").write_text("import os, signal, time\n" + DURING[when])
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parent.parent)])
    done = subprocess.run(
        [sys.executable, "-c", MAIN],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=20,
    )
    assert (done.returncode, done.stderr.strip(), done.stdout) == (130, LINE, "")


def test_workers_start_with_ctrl_c_blocked() -> None:
    """A worker that is still importing when Ctrl-C reaches the whole group prints nothing."""
    asked = "import signal; print(signal.SIGINT in signal.pthread_sigmask(0, ()))"

    def blocked() -> str:
        return subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True).stdout

    with executors.interrupts_blocked():
        assert blocked() == "True\n"
    assert blocked() == "False\n"
