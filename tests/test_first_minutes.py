"""`doctor`, `demo` and `completion`: what a newcomer types first."""

import json
import os
import subprocess
import sys
from importlib import metadata

import pytest
from click.testing import CliRunner

from snakegen.cli import cli, diagnosis


def test_doctor_names_every_required_package_and_extra() -> None:
    run = CliRunner().invoke(cli, ["doctor", "--json"])
    assert run.exit_code == 0, run.output
    checks = {c["name"]: c for c in json.loads(run.stdout)["checks"]}
    assert {"mujoco", "pin", "rerun-sdk", "rendering", "viewer", "kernel cache"} <= checks.keys()
    assert checks["mujoco"]["detail"] == metadata.version("mujoco")
    assert {f"[{extra}]" for extra in diagnosis.EXTRAS} <= checks.keys()


def test_doctor_calls_a_package_that_is_gone_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        metadata, "requires", lambda _: ["numpy>=2", "no-such-thing>=1", "x; extra == 'dev'"]
    )
    run = CliRunner().invoke(cli, ["doctor"], standalone_mode=False)
    assert run.return_value == 3
    assert "broken    no-such-thing" in run.output and "pip install 'no-such-thing'" in run.output
    assert "\nbroken    x" not in run.output


def test_every_extra_that_doctor_names_is_declared() -> None:
    declared = set(metadata.metadata("snakegen").get_all("Provides-Extra") or [])
    assert set(diagnosis.EXTRAS) <= declared


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts_call_snakegen(shell: str) -> None:
    run = CliRunner().invoke(cli, ["completion", shell])
    assert run.exit_code == 0 and f"_SNAKEGEN_COMPLETE={shell}_complete" in run.stdout


def test_a_shell_completes_commands_and_presets() -> None:
    asked = {
        "_SNAKEGEN_COMPLETE": "bash_complete",
        "COMP_WORDS": "snakegen build dra",
        "COMP_CWORD": "2",
    }
    run = subprocess.run(
        [sys.executable, "-m", "snakegen"], env=os.environ | asked, capture_output=True, text=True
    )
    assert "plain,dragon4" in run.stdout.splitlines()
