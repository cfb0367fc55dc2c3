"""Screw drives in the grammar: presets, bad input, URDF and MJCF, the gate, rollers, hybrids."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.analysis import statics
from snakegen.description.mjcf.decorate import decorate
from snakegen.errors import SpecError
from snakegen.pipeline.equivalence import BOUND, compare
from snakegen.robot.modules import from_urdf
from snakegen.robot.robot import load
from snakegen.screw_drive.constraints import constraint_matrices
from snakegen.screw_drive.geometry import drive_geometry
from snakegen.spec.loading import load_spec
from snakegen.spec.urdf import urdf_text
from snakegen.spec.warnings import warnings
from snakegen.spec.wheel_layout import wheel_layout

FEW = ("screw_drive.blades=4", "screw_drive.wheels_per_blade=1", "screw_drive.rollers=ring_sphere")


@pytest.fixture(scope="module")
def screw4():
    return load("screw4")


def few(*more, links=None):
    """Returns a drive with few wheels, which is quick to build."""
    return load_spec("screw4", links=links, overrides=(*FEW, *more))


def test_preset_is_haras_robot(screw4):
    g = drive_geometry(screw4)
    assert np.allclose(np.degrees(g.alpha), [-45, 45, -45, 45])
    assert g.r == 0.075 and np.allclose(g.offset, 0.103) and np.allclose(g.lengths, 0.226)
    assert screw4.mass == pytest.approx(8.0, abs=1e-9)
    rng = np.random.default_rng(1)
    for _ in range(10):
        w = rng.normal(size=6)
        A, _ = constraint_matrices(w, g.alpha, 0.075, 0.0, 0.103, 0.123)
        assert np.abs(g.no_slip(w) - A[:4]).max() < 1e-12


def test_only_shape_joints_shape_the_body(screw4):
    axes = ("pitch", "yaw")
    assert screw4.chain_joints == tuple(f"joint{i}_{a}" for i in (1, 2, 3) for a in axes)
    assert len(screw4.rolling_names) == 4 + 4 * 32
    assert screw4.rolling_names.isdisjoint(screw4.chain_joints)


def test_wheels_stand_where_the_layout_says(screw4):
    for unit, alpha in ((1, -math.pi / 4), (2, math.pi / 4)):
        layout = wheel_layout(alpha, 0.075, 8, 4, "helix_capsule", 0.012)
        for k in (0, 7, 31):
            joint = f"wheel{unit}_{layout.blade[k]}_{layout.wheel[k]}"
            body = screw4.body_of_joint(joint)
            assert screw4.tree.parent[body] == screw4.body_of_joint(f"screw{unit}")
            assert np.allclose(screw4.tree.translation[body], layout.position[k], atol=1e-9)
            axle = screw4.tree.rotation[body] @ screw4.tree.axis[body]
            assert np.allclose(axle, layout.rotation[k][:, 2], atol=1e-9)


@pytest.mark.parametrize("links", [2, 3, 7])
def test_any_number_of_units(links):
    robot = load(few(links=links))
    alpha = drive_geometry(robot).alpha
    assert len(alpha) == links and np.allclose(np.sign(alpha), (-1.0) ** (1 + np.arange(links)))


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("screw_drive.helix_angle=0", "helix angle 0°: the screw drives nothing"),
        ("screw_drive.helix_angle=-0.6", "-0.6 rad; its sign is the hand's"),
        ("screw_drive.at=2", "1 drum cannot drive a body; 2 at least"),
        ("screw_drive.wheel_radius=0.08", "0.08 m does not fit a drum of radius 0.075 m"),
        ("screw_drive.offset=0.3", "0.3 m lies off link 1, 0.226 m long"),
        ("screw_drive.hand=[left, right]", "2 entries for 4 drums"),
        ("screw_drive.rollers=cube", "'helix_capsule', 'ring_sphere'"),
        ("screw_drive.colour=red", "no field 'screw_drive.colour'"),
        ("caster.at=9", "link 9 does not exist"),
    ],
)
def test_bad_input_is_one_clear_line(given, says):
    with pytest.raises(SpecError) as caught:
        load_spec("screw4", overrides=[given])
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_warnings_for_what_drives_badly():
    assert warnings(few()) == ()
    (one,) = warnings(few("screw_drive.hand=left"))
    assert "one hand" in one and "45°, 45°, 45°, 45°" in one and "cannot steer straight" in one
    assert "2 drums leave a turn free" in warnings(few(links=2))[0]
    assert "MJCF alone" in warnings(few("screw_drive.rollers=ball"))[0]
    assert warnings(load_spec("dragon4")) == ()
    bolted = load_spec("arm6", overrides=["screw_drive.at=[2,3]", "base=fixed"])
    assert warnings(bolted) == ()  # it does not drive


def test_hands_and_angles_of_each_drum():
    given = (
        "screw_drive.hand=[left, left, right, left]",
        "screw_drive.helix_angle=[0.5,0.6,0.7,1]",
    )
    assert np.allclose(drive_geometry(load(few(*given))).alpha, [0.5, 0.6, -0.7, 1.0])
    # places out of order: lists go with their places, drums count from the root
    resolved = few("screw_drive.at=4,1,2", "screw_drive.hand=[left,right,left]").resolved()
    part = resolved["screw_drive"]
    assert [p["link"] for p in part["at"]] == [1, 2, 4]
    assert part["hand"] == ["right", "left", "left"]


def test_resolved_is_a_spec_and_stable():
    once = load_spec("screw4").resolved()
    assert load_spec(once).resolved() == once


@pytest.mark.parametrize("rollers", ["helix_capsule", "ring_sphere", "ellipsoid", "ball"])
def test_the_mjcf_rolls_and_agrees(rollers):
    """The gate of every build, on the full body; and a push of the drums moves it on the floor."""
    robot = load(load_spec("screw4", overrides=[f"screw_drive.rollers={rollers}"]))
    spec = decorate(robot.urdf, robot.modules, {}, visuals=False)
    on_wheels = None
    if rollers == "ball":
        model = spec.compile()
        assert model.nv == 6 + 6 + 4 * 3 and model.body_mass.sum() == pytest.approx(8.0)
        spec = decorate(
            robot.urdf, robot.modules, {}, visuals=False, rollers=(on_wheels := "ring_sphere")
        )
    assert compare(robot, spec.compile(), states=2, rollers=on_wheels).worst <= BOUND


def test_a_planted_fault_fails_the_gate(screw4):
    spec = decorate(screw4.urdf, screw4.modules, {}, visuals=False)
    spec.joint("screw2").armature *= 1.001
    assert compare(screw4, spec.compile(), states=1).worst > BOUND


def test_build_writes_a_scene_that_stands_and_drives(tmp_path: Path):
    built = snakegen.build(load_spec("screw4"), tmp_path, picture=False)
    model = mujoco.MjModel.from_xml_path(str(built.scene))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    for i, sign in enumerate((1, -1, 1, -1), 1):
        data.actuator(f"screw{i}").ctrl = sign * 2.0
    mujoco.mj_step(model, data, 1000)
    assert data.qpos[2] == pytest.approx(0.075, abs=0.002)
    assert data.qpos[0] == pytest.approx(2.0 * 2.0 * 0.075, rel=0.02)  # r θ̇ t tan 45°
    assert abs(data.qpos[1]) < 0.01
    assert data.sensor("screw1_rate").data[0] == pytest.approx(2.0, abs=0.05)
    assert {"screw_drum_1.stl", "screw_drum_2.stl"} <= {p.name for p in tmp_path.rglob("*.stl")}


def test_ball_build_keeps_the_urdfs_wheels(tmp_path: Path):
    built = snakegen.build(few("screw_drive.rollers=ball"), tmp_path, picture=False)
    assert any("MJCF alone" in w for w in built.warnings)
    assert "wheel1_1_1" in built.urdf.read_text(encoding="utf-8")
    assert "wheel1_1_1" not in built.mjcf.read_text(encoding="utf-8")
    assert built.equivalence.passed


def test_hybrid_carries_both():
    modules = from_urdf(urdf_text("hybrid4"))
    assert len(modules.screws) == 4 and len(modules.apparatuses) == 4 and len(modules.casters) == 1
    tags = [e.tag for e in ET.fromstring(urdf_text("hybrid4")).find("snakegen")]
    assert tags.count("screw_drive") == 4 and tags.count("vectoring_apparatus") == 4
    robot = load("hybrid4")
    model = decorate(robot.urdf, robot.modules, {}, visuals=False).compile()
    assert compare(robot, model, states=2).worst <= BOUND
    assert robot.rotors.thrust_max.sum() > 2 * 9.81 * robot.mass


def test_statics_of_a_body_on_the_ground_has_no_tip():
    """A drive hangs from nothing: no payload at its tail, and free wheels are not its joints."""
    robot, arm = load("screw4"), load("arm6")
    found = statics.analyze(robot, robot.configuration())
    assert found.rolls and found.tip_load is None and found.to_json()["tip_load"] is None
    rows = dict(found.rows())
    assert rows["no load"] == "7 joints"  # three yaw joints and four screws
    assert len(found.free) == 128 and "no declared effort" not in rows  # 4 drums of 32 wheels
    assert not [label for label in rows if label.startswith("tip")]
    assert statics.analyze(arm, arm.configuration()).tip_load is not None


@pytest.mark.parametrize(
    ("change", "words", "value"),
    [
        ("screw_drive.wheel_radius=0.03", "leave a hub of", "0.015 m"),
        ("screw_drive.blades=20", "wheels of 20 blades", "0.014 m"),  # 2π 0.063 cos 45° / 20
        ("screw_drive.offset=0.01", "beyond link 1", "0.0325 m"),
        ("screw_drive.length=0.2", "drums 1 and 2 meet", "20.2°"),
    ],
)
def test_drums_that_do_not_fit_are_named(change, words, value):
    found = warnings(load_spec("screw4", overrides=[change]))
    assert any(words in text and value in text for text in found), found
    assert not warnings(load_spec("screw4")) and not warnings(load_spec("hybrid4"))
    with pytest.raises(SpecError, match="reach the drum's axis"):
        load_spec("screw4", overrides=["screw_drive.wheel_radius=0.05"]).resolved()


def test_drums_collide():
    """Bent past what its limits allow, a body's drums touch; within them nothing does."""
    robot = load("screw4")
    model = decorate(robot.urdf, robot.modules, {}, visuals=False).compile()
    data = mujoco.MjData(model)
    envelopes = {model.geom(f"screw{i}_envelope").id for i in range(1, 5)}
    for bend, touches in ((0.0, False), (1.74, False), (1.84, True)):
        mujoco.mj_resetData(model, data)
        data.qpos[2] = 1.0
        data.qpos[model.joint("joint2_yaw").qposadr[0]] = bend
        mujoco.mj_forward(model, data)
        pairs = [set(data.contact.geom[i]) for i in range(data.ncon)]
        assert any(pair <= envelopes for pair in pairs) is touches
