"""Fields of rotors that modules files give: positions, wrong values, names, the schema."""

import json
from dataclasses import fields
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.base import yaml_file
from snakegen.cli import main
from snakegen.errors import DescriptionError
from snakegen.robot.modules import Rotor, Servo
from snakegen.robot.modules_file import FIELDS
from snakegen.robot.modules_schema import MEANINGS, schema

PAGE = Path(__file__).parent.parent / "docs/modules.md"


def _run(arguments: list[str]) -> int:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


HEXA = """<robot name="solid"><link name="body"><inertial><mass value="1.3"/>
<inertia ixx="0.0016" ixy="0" ixz="0" iyy="0.0016" iyz="0" izz="0.003"/></inertial></link>
</robot>"""


def test_rotors_without_links_stand_at_their_positions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hexa.urdf").write_text(HEXA)
    places = [[0.2 * np.cos(a), 0.2 * np.sin(a), 0.02] for a in np.arange(6) * pi / 3]
    data = {"floating_root": "body", "link_length": 0.3, "apparatuses": [
        {"rotors": [{"link": "body", "position": [float(x) for x in p], "axis": [0, 0, 2],
                     "thrust_max": 8, "drag_ratio": 0.016 * (-1) ** k}]}
        for k, p in enumerate(places)]}  # fmt: skip
    robot = snakegen.load(tmp_path / "hexa.urdf", modules=data)
    a = allocation(robot, robot.configuration())
    expected = [np.r_[0, 0, 1, p[1], -p[0], 0.016 * (-1) ** k] for k, p in enumerate(places)]
    assert np.allclose(a.dual, np.array(expected).T, atol=1e-12)
    modules = tmp_path / "modules.yaml"
    modules.write_text(yaml_file.dump(data))
    made = snakegen.convert(tmp_path / "hexa.urdf", tmp_path / "out", modules=modules)
    assert snakegen.compare(made.urdf, made.mjcf, modules=modules).same
    log = ["--mission", "hover", "--duration", "3", "-o", str(tmp_path / "f.rrd"), "--json"]
    urdf = str(tmp_path / "hexa.urdf")
    assert _run(["analyze", "flight", urdf, "--modules", str(modules), *log]) == 0
    assert json.loads(capsys.readouterr().out)["passed"]


@pytest.mark.parametrize("field, value, words", [
    ("position", [1, 2], "no point"), ("position", [1, 2, "x"], "not a number"),
    ("axis", [0, 0, 0], "no direction"), ("name", 3, "no name"),
])  # fmt: skip
def test_a_wrong_rotor_field_is_named(tmp_path: Path, field: str, value: Any, words: str) -> None:
    (tmp_path / "hexa.urdf").write_text(HEXA)
    rotor = {"link": "body", "thrust_max": 20, field: value}
    data = {"floating_root": "body", "apparatuses": [{"rotors": [rotor]}]}
    with pytest.raises(DescriptionError, match=rf"rotors\[1\]\.{field}.*{words}"):
        snakegen.load(tmp_path / "hexa.urdf", modules=data)


def test_two_rotors_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "hexa.urdf").write_text(HEXA)
    rotor = {"link": "body", "thrust_max": 20, "position": [0, 0, 1], "name": "twin"}
    data = {"floating_root": "body", "apparatuses": [{"rotors": [rotor]}, {"rotors": [rotor]}]}
    with pytest.raises(DescriptionError, match=r"apparatuses\[2\] names 'twin', as"):
        snakegen.load(tmp_path / "hexa.urdf", modules=data)


def test_schema_and_page_name_every_field(capsys: pytest.CaptureFixture[str]) -> None:
    assert _run(["schema", "--modules"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(schema()))
    assert tuple(schema()["properties"]) == FIELDS
    rotor = schema()["properties"]["apparatuses"]["items"]["properties"]["rotors"]["items"]
    assert set(rotor["properties"]) == {f.name for f in fields(Rotor)}
    page = PAGE.read_text(encoding="utf-8")
    names = {*FIELDS, *(f.name for f in fields(Rotor)), *(f.name for f in fields(Servo))}
    for name in names:
        assert f"| `{name}` |" in page, name
        assert MEANINGS[name]
