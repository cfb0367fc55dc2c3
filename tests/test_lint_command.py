"""The command lint: exit codes, output, fixes in place."""

import json
import struct
from pathlib import Path

import pytest
from clean_urdf import GOOD

from snakegen.cli import main
from tests.test_lint import mutate

LIMIT = 'lower="-1" upper="1" effort="7" velocity="0.5"'


def changed(*pairs: tuple[str, str]) -> str:
    """Returns the clean URDF with texts replaced, once each; they have to be there."""
    text = GOOD
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def stl(points: list[tuple[float, float, float]]) -> bytes:
    triangles = b"".join(
        struct.pack("<12fH", 0, 0, 1, *points[i], *points[i + 1], *points[i + 2], 0)
        for i in range(0, len(points), 3)
    )
    return b" " * 80 + struct.pack("<I", len(points) // 3) + triangles


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rod.stl").write_bytes(b"mesh")
    (tmp_path / "rod.dae").write_bytes(b"mesh")
    (tmp_path / "empty.stl").write_bytes(stl([]))
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/rod.stl").write_bytes(b"mesh")
    (tmp_path / "millimetres.stl").write_bytes(stl([(0, 0, 0), (420, 0, 0), (0, 25, 0)]))
    return tmp_path


def run(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as stopped:
        main(["lint", *arguments])
    return int(stopped.value.code or 0)


def test_command(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "robot.urdf"
    path.write_text(GOOD.replace(LIMIT, LIMIT.replace('"7"', '"0"')), encoding="utf-8")
    assert run([str(path)]) == 0
    assert "0 errors, 1 warning, 0 notes" in capsys.readouterr().out
    assert run([str(path), "--strict"]) == 3
    path.write_text(mutate("negative mass"), encoding="utf-8")
    assert run([str(path)]) == 3
    capsys.readouterr()
    assert run([str(path), "--json"]) == 3
    said = json.loads(capsys.readouterr().out)
    assert said["counts"] == {"error": 1, "warning": 0, "note": 0}
    assert said["findings"][0]["code"] == "negative_mass"
    assert run([str(path), "--sarif"]) == 3
    log = json.loads(capsys.readouterr().out)
    assert log["version"] == "2.1.0"
    result = log["runs"][0]["results"][0]
    assert result["level"] == "error"
    assert result["locations"][0]["physicalLocation"]["region"]["startLine"] == 8
    assert run([str(path), "--json", "--sarif"]) == 1
    assert run([str(folder / "gone.urdf")]) == 1
    assert run([str(folder)]) == 1


def test_command_fixes_in_place(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "robot.urdf"
    path.write_text(changed((' xyz="0 0 1"', ' xyz="0 0 2"')), encoding="utf-8")
    assert run([str(path), "--fix"]) == 0
    assert "normalised the axis of joint 'joint1'" in capsys.readouterr().out
    assert 'xyz="0 0 1"' in path.read_text(encoding="utf-8")
    broken = mutate("tag not closed")
    path.write_text(broken, encoding="utf-8")
    assert run([str(path), "--fix"]) == 3
    assert path.read_text(encoding="utf-8") == broken
