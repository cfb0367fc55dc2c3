"""`build`: whole or not at all, the same bytes each time, and a gate that catches what it must."""

import errno
import filecmp
import os
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.base.geometry import wxyz_from_xyzw
from snakegen.description.mjcf import decorate
from snakegen.errors import SnakegenError
from snakegen.pipeline import build
from snakegen.pipeline.equivalence import BOUND, compare
from snakegen.spec.loading import load_spec, presets

SHAPES = {
    "floating": ("dragon4", {}),
    "fixed": ("dragon4", {"overrides": ["base=fixed"]}),
    "one link": ("dragon4", {"links": 1}),
    "two links": ("dragon4", {"links": 2}),
    "16 links": ("dragon4", {"links": 16}),
    "subset": ("dragon4", {"apparatus": "1,3"}),
    "ends": ("dragon4", {"apparatus": "1@0,4@1"}),
    "two on one link": ("dragon4", {"apparatus": "2@0.2,2@0.8"}),
    "one rotor": ("dragon4", {"overrides": ["vectoring_apparatus.rotors=1"]}),
    "mixed rotors": ("dragon4", {"overrides": ["vectoring_apparatus.rotors=[1,2,1,2]"]}),
    "unequal links": ("dragon4", {"overrides": ["chain.length=[0.2,0.5,0.3,0.7]"]}),
    "every axis": (
        "dragon4",
        {"overrides": ["joint.axes=[[roll],[yaw,pitch],[pitch,roll]]", "joint.gap=[0,0.03,0.1]"]},
    ),
    "payload": ("dragon3", {"overrides": ["payload={at: ['1@0.3', 3], mass: [0.5, 1]}"]}),
    **{name: (name, {}) for name in sorted(presets())},
}


@pytest.fixture(scope="module")
def dragon(tmp_path_factory: pytest.TempPathFactory) -> build.Build:
    """dragon4, built without a picture."""
    return snakegen.build("dragon4", tmp_path_factory.mktemp("b") / "dragon4", picture=False)


def _files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_what_a_build_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """URDF, MJCF, scene, spec, meshes and picture, under generated/<robot> by default."""
    monkeypatch.chdir(tmp_path)
    made = snakegen.build("dragon4")
    expected = {"dragon4.urdf", "dragon4.xml", "scene.xml", "dragon4.spec.yaml", "dragon4.png"}
    found = _files(tmp_path / "generated" / "dragon4")
    assert {n for n in found if "/" not in n} == expected
    assert {n for n in found if "/" in n} == {"meshes/ducted_fan.stl", "meshes/joint_cross.stl"}
    for path in (made.urdf, made.mjcf, made.scene, made.spec, made.picture):
        assert path is not None and path.is_file()
    assert found["dragon4.png"].startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [tmp_path / "generated"]
    assert str(tmp_path).encode() not in b"".join(found.values())


@pytest.mark.parametrize("name", ["dragon4", "screw4"])
def test_the_same_bytes_each_time(name: str, tmp_path: Path) -> None:
    """Two builds into different folders give the same files, byte for byte."""
    snakegen.build(name, tmp_path / "a", picture=False)
    snakegen.build(name, tmp_path / "deeper" / "b", picture=False)
    assert _files(tmp_path / "a") == _files(tmp_path / "deeper" / "b")


@pytest.mark.parametrize("shape", SHAPES)
def test_the_gate_passes(shape: str, tmp_path: Path) -> None:
    """Floating and fixed, any subset and place of apparatuses, uneven links: equal to 1e-9."""
    name, changes = SHAPES[shape]
    made = snakegen.build(load_spec(name, **changes), tmp_path / "r", picture=False)
    assert 0 < made.equivalence.worst <= BOUND
    assert made.equivalence.states >= 5


FAULTS = {
    "mass": ("body_mass", "link2", 1.001),
    "inertia": ("body_inertia", "link3", 1.01),
    "centre of mass": ("body_ipos", "link2", 1.001),
    "joint origin": ("body_pos", "link3", 1.0001),
    "armature": ("dof_armature", None, 1.1),
    "gravity": ("opt.gravity", None, 1.001),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_gate_catches(fault: str, dragon: build.Build) -> None:
    """A small change of the MJCF alone is far above the bound."""
    robot = snakegen.load(dragon.urdf)
    model = mujoco.MjModel.from_xml_path(str(dragon.mjcf))
    assert compare(robot, model).passed
    field, body, factor = FAULTS[fault]
    owner: Any = model.opt if field.startswith("opt.") else model
    values = getattr(owner, field.removeprefix("opt."))
    if body is None:
        values[:] = values * factor
    else:
        values[model.body(body).id] *= factor
    found = compare(robot, model)
    assert not found.passed and found.worst > 1e-6


def test_a_failed_gate_fails_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An MJCF with another joint axis is not delivered; what stood there before stays."""
    target = tmp_path / "r"
    snakegen.build("dragon4", target, picture=False)
    before = _files(target)
    from snakegen.description.mjcf import decorate

    right = decorate.decorate

    def wrong(*args: Any, **kwargs: Any) -> mujoco.MjSpec:
        spec = right(*args, **kwargs)
        spec.joint("joint2_yaw").axis = [0.0, 0.1, 1.0]
        return spec

    monkeypatch.setattr(decorate, "decorate", wrong)
    with pytest.raises(build.GateError, match=r"URDF and MJCF disagree by") as caught:
        snakegen.build("dragon4", target, picture=False)
    assert caught.value.exit_code == 3
    assert _files(target) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r"]


@pytest.mark.parametrize(
    "failure", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()]
)
def test_half_way_leaves_the_old(
    failure: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk or Ctrl-C in the middle: no file changes, and no half-made folder stays."""
    target = tmp_path / "r"
    snakegen.build("dragon4", target, picture=False)
    before = _files(target)

    def stop(*_: Any, **__: Any) -> None:
        raise failure

    monkeypatch.setattr(decorate, "decorate", stop)  # the URDF is written, the MJCF is not
    expected = SnakegenError if isinstance(failure, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as caught:
        snakegen.build(load_spec("dragon4", links=2), target, picture=False)
    if isinstance(failure, OSError):
        assert "r: cannot be written (No space left on device)" in str(caught.value)
    assert _files(target) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r"]


def test_other_files_stay(tmp_path: Path) -> None:
    """A build replaces its own files; a report or a log beside them stays."""
    target = tmp_path / "r"
    snakegen.build("dragon4", target, picture=False)
    (target / "notes").mkdir()
    (target / "notes" / "mine.txt").write_text("keep")
    old = (target / "dragon4.urdf").read_bytes()
    snakegen.build(load_spec("dragon4", links=2), target, picture=False)
    assert (target / "notes" / "mine.txt").read_text() == "keep"
    assert (target / "dragon4.urdf").read_bytes() != old
    assert filecmp.cmp(target / "dragon4.urdf", target / "dragon4.urdf")


def test_folders_that_cannot_be(tmp_path: Path) -> None:
    """A file in the way, or a folder that cannot be made: one line with the path."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(SnakegenError, match=r"file: is a file; -o needs a folder"):
        snakegen.build("dragon4", tmp_path / "file", picture=False)
    with pytest.raises(SnakegenError, match=r"below: cannot be written \("):
        snakegen.build("dragon4", tmp_path / "file" / "below", picture=False)
    if os.path.isdir("/proc"):
        with pytest.raises(SnakegenError, match=r"/proc/r: cannot be written"):
            snakegen.build("dragon4", "/proc/r", picture=False)


def test_mesh_uri(tmp_path: Path) -> None:
    """package:// is for ROS: in the URDF alone, and nothing else is known."""
    made = snakegen.build("dragon4", tmp_path / "r", picture=False, mesh_uri="package")
    assert 'filename="package://dragon4/meshes/ducted_fan.stl"' in made.urdf.read_text()
    assert "package://" not in made.mjcf.read_text()
    with pytest.raises(SnakegenError, match=r"'relative' or 'package'"):
        snakegen.build("dragon4", tmp_path / "r", picture=False, mesh_uri="http")


def test_the_mjcf_is_ready_to_simulate(dragon: build.Build) -> None:
    """Free joint, sites, rotors with drag in the gear, servos with limits, sensors, keyframes …"""
    model = mujoco.MjModel.from_xml_path(str(dragon.scene))
    robot = snakegen.load(dragon.urdf)
    assert model.joint("root").type[0] == mujoco.mjtJoint.mjJNT_FREE
    for apparatus in robot.modules.apparatuses:
        for rotor in apparatus.rotors:
            actuator = model.actuator(rotor.link)
            assert model.site(rotor.link).bodyid[0] == model.body(rotor.link).id
            np.testing.assert_array_equal(actuator.gear, [0, 0, 1, 0, 0, rotor.drag_ratio])
            np.testing.assert_array_equal(actuator.ctrlrange, [0, 16])
            assert actuator.ctrllimited[0]
    assert {abs(r.drag_ratio) for a in robot.modules.apparatuses for r in a.rotors} == {0.0125}
    for name in robot.joint_names:
        servo = model.actuator(name)
        effort = 3.0 if name.startswith("gimbal") else 7.0
        np.testing.assert_array_equal(servo.forcerange, [-effort, effort])
        assert model.dof_armature[model.joint(name).dofadr[0]] == 0.005
        assert model.sensor(f"{name}_position").dim[0] == 1
    for name in ("imu_gyro", "imu_accelerometer", "root_position", "cog_position"):
        assert model.sensor(name).dim[0] == 3
    assert [model.key(i).name for i in range(model.nkey)] == ["home", "floor"]
    assert model.ncam >= 1 and model.nlight >= 1 and model.nexclude >= 3
    assert set(model.geom_group[model.geom_contype == 0]) == {2}
    for name in (f.name for f in robot.model.frames if f.type.name == "BODY"):
        assert model.body(name).id > 0


def test_nothing_touches_at_home(dragon: build.Build) -> None:
    """In both keyframes no pair of bodies collides but for the robot standing on the floor."""
    model = mujoco.MjModel.from_xml_path(str(dragon.scene))
    data = mujoco.MjData(model)
    floor = model.geom("floor").id
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        assert all(floor in contact.geom for contact in data.contact)


@pytest.mark.parametrize("shape", ["floating", "two on one link", "one rotor", "dragon3"])
def test_thrust_in_mujoco_is_the_dual_map(shape: str, tmp_path: Path) -> None:
    """The wrench that MuJoCo's rotors put on the body is allocation().dual, column by column.

    From generalised forces: base rows of `qfrc_actuator` (force in world axes at the base origin,
    torque in base axes), carried to the CoG and turned into root-link axes.
    """
    name, changes = SHAPES[shape]
    made = snakegen.build(load_spec(name, **changes), tmp_path / "r", picture=False)
    robot = snakegen.load(made.urdf)
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(3)
    low, high, _ = robot.limits(robot.joint_names)
    posture = dict(zip(robot.joint_names, rng.uniform(0.8 * low, 0.8 * high), strict=True))
    q = robot.configuration(posture, base_rpy=(0.3, -0.5, 1.1), base_position=(0.4, 0.1, 1.0))
    found = allocation(robot, q)
    data.qpos[:3], data.qpos[3:7] = q[:3], wxyz_from_xyzw(q[3:7])
    for joint, angle in posture.items():
        data.qpos[model.joint(joint).qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    base, origin = robot.base_pose(q)
    cog = data.subtree_com[model.body(robot.root_link).id]
    rotors = [r.link for a in robot.modules.apparatuses for r in a.rotors]
    for column, rotor in enumerate(rotors):
        data.act[:] = 0.0
        data.act[model.actuator(rotor).actadr[0]] = 7.0
        mujoco.mj_fwdActuation(model, data)
        force = base.T @ data.qfrc_actuator[:3]
        torque = data.qfrc_actuator[3:6] - np.cross(base.T @ (cog - origin), force)
        wrench = np.concatenate([force, torque]) / 7.0
        np.testing.assert_allclose(wrench, found.dual[:, column], atol=1e-9)
    assert np.linalg.norm(found.dual) > 1
