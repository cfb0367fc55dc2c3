"""Conversion of foreign URDFs: the same robot, whatever their meshes, frames and settings."""

import json
import struct
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh

import snakegen
from snakegen.cli import main
from snakegen.errors import DescriptionError, SnakegenError
from snakegen.pipeline.build import GateError

BODY = (
    '<inertial><origin xyz="{x} 0 0" rpy="0.3 0 0"/><mass value="{m}"/>'
    '<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial>'
)
ARM = f"""<?xml version="1.0"?>
<robot name="arm">
  <mujoco><compiler meshdir="parts" balanceinertia="true"/><option timestep="0.01"/></mujoco>
  <link name="base">{BODY.format(x=0, m=2)}
    <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="upper">{BODY.format(x=0.2, m=1)}
    <visual><geometry><mesh filename="package://arm_description/meshes/gone.dae"/></geometry></visual>
    <collision><geometry><mesh filename="text.stl" scale="0.001 0.001 0.001"/></geometry></collision>
    <collision><geometry><sphere radius="0"/></geometry></collision></link>
  <link name="camera"><inertial><mass value="0.01"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>
    <collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <link name="hand"><collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision></link>
  <link name="left">{BODY.format(x=0.05, m=0.3)}</link>
  <link name="right">{BODY.format(x=0.05, m=0.3)}</link>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.2" rpy="0 0.1 0"/>
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="20" velocity="2"/>
    <dynamics damping="0.4" friction="0.1"/></joint>
  <joint name="eye" type="fixed"><origin xyz="0.1 0.02 0.3" rpy="0.1 0.2 0.3"/>
    <parent link="upper"/><child link="camera"/></joint>
  <joint name="wrist" type="fixed"><origin xyz="0.5 0 0"/>
    <parent link="upper"/><child link="hand"/></joint>
  <joint name="lead" type="prismatic"><origin xyz="0 0.05 0"/>
    <parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="30" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><origin xyz="0 -0.05 0"/>
    <parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="30" velocity="1"/>
    <mimic joint="lead"/></joint>
</robot>
"""  # noqa: E501


def text_stl() -> str:
    facet = (
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 100 0 0\nvertex 0 100 {}\n"
        "endloop\nendfacet\n"
    )
    return "solid part\n" + "".join(facet.format(z) for z in (0, 50, 100)) + "endsolid part\n"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    (tmp_path / "text.stl").write_text(text_stl(), encoding="utf-8")
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    return path


def test_a_foreign_arm_becomes_the_same_robot(arm: Path, tmp_path: Path) -> None:
    made = snakegen.convert(arm, tmp_path / "out")
    assert made.equivalence.worst < 1e-9
    model = mujoco.MjModel.from_xml_path(str(made.scene))
    reference = pin.buildModelFromUrdf(str(arm))
    assert model.body_mass.sum() == pytest.approx(2 + 1 + 0.01 + 0.6)
    assert {model.joint(i).name for i in range(model.njnt)} == set(list(reference.names)[1:])
    mass = np.zeros((model.nv, model.nv))
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, 0.01, 0.01]
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    order = [reference.joints[reference.getJointId(model.joint(i).name)].idx_q for i in range(3)]
    q = np.zeros(3)
    q[order] = data.qpos
    ours = pin.crba(reference, reference.createData(), q)[np.ix_(order, order)]
    assert np.allclose(mass, ours, rtol=1e-9, atol=1e-12)


def test_what_a_conversion_keeps(arm: Path, tmp_path: Path) -> None:
    made = snakegen.convert(arm, tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    assert [model.actuator(i).name for i in range(model.nu)] == ["shoulder", "lead"]
    assert model.actuator("shoulder").ctrlrange.tolist() == [-20, 20]
    shoulder = model.joint("shoulder")
    assert (float(shoulder.damping[0]), float(shoulder.frictionloss[0])) == (0.4, 0.1)
    assert shoulder.range.tolist() == [-1, 2]
    assert model.neq == 1 and model.eq_data[0][:2].tolist() == [0, 1]
    assert model.nmesh == 1  # the one in the text format, converted
    dropped = "\n".join(made.warnings)
    for part in ("gone.dae", "a <sphere> of no size", "balanceinertia", "<option>"):
        assert part in dropped


def test_the_new_urdf_stands_alone(arm: Path, tmp_path: Path, monkeypatch) -> None:
    made = snakegen.convert(arm, tmp_path / "out")
    monkeypatch.chdir(tmp_path.parent)
    assert [f for f in snakegen.lint(made.urdf) if f.tier == "assets"] == []
    again = snakegen.convert(made.urdf, tmp_path / "again")
    assert again.equivalence.worst < 1e-9
    with made.mjcf.open() as one, again.mjcf.open() as other:
        assert one.read() == other.read()


@pytest.mark.parametrize("second", ["o far\n", "", "g far\n"])
def test_every_object_of_an_obj_is_kept(tmp_path: Path, second: str) -> None:
    """MuJoCo reads the first alone, and of faces with and without texture coordinates some."""
    texts = []
    for number, place in enumerate((0.0, 3.0)):
        box = trimesh.creation.box((1.0, 1.0, 1.0))
        box.apply_translation((place, 0.0, 0.0))
        rows = [f"v {x} {y} {z}" for x, y, z in box.vertices]
        corner = "{}" if number == 0 or second else "{0}/1"
        rows += ["f " + " ".join(corner.format(k + 8 * number + 1) for k in f) for f in box.faces]
        texts.append("\n".join(rows) + "\n")
    (tmp_path / "two.obj").write_text(f"o near\nvt 0 0\n{texts[0]}{second}{texts[1]}")
    urdf = '<robot name="r"><link name="a"><visual><geometry><mesh filename="two.obj"/></geometry>'
    urdf += '</visual><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
    (tmp_path / "r.urdf").write_text(urdf + 'izz="1"/></inertial></link></robot>')
    made = snakegen.convert(tmp_path / "r.urdf", tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    assert list(model.mesh_facenum) == [24]


def test_a_mesh_that_is_too_fine_for_stl_is_written_as_obj(tmp_path: Path) -> None:
    count = 200_001
    corners = np.random.default_rng(1).normal(size=(count, 3, 3)).astype("<f4")
    rows = np.zeros(count, dtype=[("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    rows["p"] = corners
    (tmp_path / "fine.stl").write_bytes(b" " * 80 + struct.pack("<I", count) + rows.tobytes())
    text = ARM.replace("text.stl", "fine.stl")
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    from snakegen.description.mjcf.urdf_import import importable

    assert list(importable(text, tmp_path).assets) == ["meshes/fine.obj"]


def test_an_impossible_robot_is_refused_and_nothing_written(arm: Path, tmp_path: Path) -> None:
    arm.write_text(ARM.replace('mass value="1"', 'mass value="-1"'), encoding="utf-8")
    with pytest.raises(DescriptionError, match="negative"):
        snakegen.convert(arm, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(SnakegenError):
        snakegen.convert("dragon4", tmp_path / "out")


def test_a_planted_difference_fails_with_exit_code_3(
    arm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from snakegen.pipeline import convert as module

    def wrong(spec, robot, names):
        original(spec, robot, names)
        spec.actuator("shoulder").ctrlrange = [-20.0, 19.0]

    original = module.add_motors
    monkeypatch.setattr(module, "add_motors", wrong)
    with pytest.raises(GateError, match="motor range"):
        module.convert(arm, tmp_path / "out")
    with pytest.raises(SystemExit) as stopped:
        main(["convert", str(arm), "-o", str(tmp_path / "out")])
    assert stopped.value.code == 3
    assert not (tmp_path / "out").exists()


def test_command(arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["convert", str(arm), "-o", str(tmp_path / "out"), "--json"])
    assert not stopped.value.code
    said = json.loads(capsys.readouterr().out)
    assert said["equivalence"]["passed"] and Path(said["scene"]).is_file()


def test_thousands_of_frames_are_converted(tmp_path: Path) -> None:
    """MuJoCo's collision stack for 3,000 bodies is larger than the memory that it takes itself."""
    frames = "".join(
        f'<link name="f{i}"/><joint name="w{i}" type="fixed"><parent link="a"/>'
        f'<child link="f{i}"/></joint>'
        for i in range(3000)
    )
    urdf = '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" '
    urdf += f'ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>{frames}</robot>'
    (tmp_path / "r.urdf").write_text(urdf)
    made = snakegen.convert(tmp_path / "r.urdf", tmp_path / "out")
    assert mujoco.MjModel.from_xml_path(str(made.mjcf)).nbody > 3000
