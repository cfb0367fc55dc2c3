"""The MJCF as a simulator meets it: names, rest, hover, sensors, split files, other readers."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import snakegen
from snakegen.description.mjcf.files import load_model, split
from snakegen.simulation.flight.world import make_world
from snakegen.spec.loading import load_spec

FIELDS = """body_mass body_inertia body_pos body_quat jnt_range dof_armature geom_size geom_rgba
geom_contype actuator_gainprm actuator_forcerange actuator_trnid exclude_signature key_qpos key_ctrl
key_act sensor_objid mesh_vert"""


@pytest.fixture(scope="module")
def dragon4(tmp_path_factory):
    return snakegen.build("dragon4", tmp_path_factory.mktemp("dragon4"), picture=False)


@pytest.fixture(scope="module")
def chain40(tmp_path_factory):
    spec = load_spec("dragon4", links=40, apparatus="1,2,39@0.4,40")
    return snakegen.build(spec, tmp_path_factory.mktemp("chain40"), picture=False)


def at_key(model, name):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
    return data


def names(model, kind, count):
    return [mujoco.mj_id2name(model, kind, i) for i in range(count)]


def test_bodies_and_joints_are_named_as_in_the_urdf(dragon4):
    urdf, model = ET.parse(dragon4.urdf).getroot(), load_model(dragon4.mjcf)
    links = {e.get("name") for e in urdf.iterfind("link")}
    joints = {e.get("name") for e in urdf.iterfind("joint") if e.get("type") != "fixed"}
    assert set(names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody)) == links | {"world"}
    assert set(names(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt)) == joints | {"root"}
    driven = set(names(model, mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu))
    assert driven == joints | {f"rotor{j}_{k}" for j in range(1, 5) for k in (1, 2)}


@pytest.mark.parametrize("name", ["dragon3", "dragon4", "hybrid4"])
def test_home_is_a_hover(name, tmp_path):
    """With the keyframe's controls held, the CoG stays where it is: unequal thrusts as well."""
    model = load_model(snakegen.build(name, tmp_path, picture=False).scene)
    data = at_key(model, "home")
    mujoco.mj_forward(model, data)
    before = data.subtree_com[1].copy()
    while data.time < 1.0:
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.subtree_com[1] - before) < 5e-3
    assert np.abs(data.qvel).max() < 0.02


def test_a_body_without_geometry_becomes_a_model(tmp_path):
    """Links with mass alone, as a foreign URDF may have them."""
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/><inertia ixx="1e-3"'
        ' iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for i in (1, 2)
    )
    joint = (
        '<joint name="j" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.2 0 0"'
        '/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="2" velocity="3"/></joint>'
    )
    (tmp_path / "bare.urdf").write_text(f'<robot name="bare">{links}{joint}</robot>')
    world = make_world(snakegen.load(tmp_path / "bare.urdf"))
    assert world.model.body_subtreemass[0] == pytest.approx(1.0)


def test_readers_agree_on_the_mass(dragon4):
    text = dragon4.urdf.read_text()
    model = load_model(dragon4.mjcf)
    seen = yourdfpy.URDF.load(str(dragon4.urdf))
    masses = [link.inertial.mass for link in seen.robot.links if link.inertial is not None]
    assert pin.computeTotalMass(pin.buildModelFromXML(text, pin.JointModelFreeFlyer())) == (
        pytest.approx(8.0, abs=1e-9)
    )
    assert sum(masses) == pytest.approx(8.0, abs=1e-9)
    assert model.body_subtreemass[0] == pytest.approx(8.0, abs=1e-9)
    assert len(seen.scene.geometry) > 20  # meshes and primitives were found


def test_what_is_seen_does_not_collide(dragon4):
    model = load_model(dragon4.mjcf)
    seen = model.geom_group == 2
    assert seen.sum() > 10
    assert not model.geom_contype[seen].any()
    assert not model.geom_conaffinity[seen].any()
    solid = model.geom_group == 3
    assert solid.sum() == (~seen).sum()
    assert model.geom_contype[solid].all()


def test_robot_rests_on_the_floor(dragon4):
    model = load_model(dragon4.scene)
    data = at_key(model, "floor")
    start = data.qpos.copy()
    mujoco.mj_forward(model, data)
    assert all(contact.dist > -1e-4 for contact in data.contact)  # set down, not pressed in
    fastest = 0.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
        fastest = max(fastest, float(np.abs(data.qvel[:3]).max()))
    assert fastest < 1.0
    assert np.abs(data.qvel).max() < 0.05
    assert np.linalg.norm(data.qpos[:3] - start[:3]) < 0.15
    assert not data.warning.number.any()


def drift(model, data):
    """Returns how far the centre of mass goes in 0.3 s."""
    mujoco.mj_forward(model, data)
    start = data.sensor("cog_position").data.copy()
    for _ in range(300):
        mujoco.mj_step(model, data)
    return data.sensor("cog_position").data - start


def test_home_hovers_for_a_moment(dragon4):
    model = load_model(dragon4.scene)
    fall = 0.5 * 9.81 * 0.3**2
    assert np.linalg.norm(drift(model, at_key(model, "home"))) < 0.01 * fall
    data = at_key(model, "home")
    data.ctrl[:], data.act[:] = 0.0, 0.0  # without thrust it must fall, or the test sees nothing
    assert drift(model, data)[2] == pytest.approx(-fall, rel=0.02)


def test_rotor_pushes_and_drags_as_the_modules_say(dragon4):
    model = load_model(dragon4.mjcf)
    model.opt.gravity[:] = 0.0
    robot = snakegen.load(dragon4.urdf)
    data = mujoco.MjData(model)
    data.joint("gimbal2_roll").qpos = 0.4
    data.joint("gimbal2_pitch").qpos = -0.7
    rotor = robot.modules.apparatuses[1].rotors[0]
    data.act[model.actuator(rotor.link).actadr[0]] = 5.0
    mujoco.mj_forward(model, data)
    site = data.site(rotor.link)
    axis = site.xmat.reshape(3, 3)[:, 2]
    expected = np.concatenate([5.0 * axis, 5.0 * rotor.drag_ratio * axis])
    expected[3:] += np.cross(site.xpos - data.xpos[1], expected[:3])
    assert np.allclose(data.qfrc_actuator[:3], expected[:3], atol=1e-12)
    assert np.allclose(data.qfrc_actuator[3:6], expected[3:], atol=1e-12)
    assert axis[0] == pytest.approx(np.sin(-0.7))
    assert axis[1] == pytest.approx(-np.sin(0.4) * np.cos(-0.7))


def test_servo_holds_its_joint_and_no_more_than_its_effort(dragon4):
    model = load_model(dragon4.mjcf)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.ctrl[model.actuator("joint2_yaw").id] = 0.5
    for _ in range(2000):
        mujoco.mj_step(model, data)
    assert data.joint("joint2_yaw").qpos[0] == pytest.approx(0.5, abs=1e-3)
    assert data.sensor("joint2_yaw_position").data[0] == data.joint("joint2_yaw").qpos[0]
    data.ctrl[model.actuator("joint2_yaw").id] = -1.6
    mujoco.mj_forward(model, data)
    assert data.sensor("joint2_yaw_torque").data[0] == pytest.approx(-7.0)


@pytest.mark.parametrize("deepest", [7, 20, 33])
def test_split_files_make_the_same_model(chain40, tmp_path, deepest):
    text = chain40.mjcf.read_text()
    files = split(text, "robot.xml", deepest)
    assert len(files) > 79 // (1.2 * deepest)
    for name, content in files.items():
        (tmp_path / name).write_text(content)
        depth, deepest_seen = 0, 0
        for line in content.splitlines():
            depth += line.count("<body ") - line.count("</body>")
            deepest_seen = max(deepest_seen, depth)
        assert deepest_seen <= 1.2 * deepest
    assert split(text, "robot.xml", deepest) == files
    whole = load_model(chain40.mjcf)
    (tmp_path / "meshes").symlink_to(chain40.mjcf.parent / "meshes")
    joined = load_model(tmp_path / "robot.xml")
    for kind, count in (("BODY", "nbody"), ("JOINT", "njnt"), ("GEOM", "ngeom"), ("SITE", "nsite")):
        which = getattr(mujoco.mjtObj, f"mjOBJ_{kind}")
        assert names(joined, which, getattr(joined, count)) == names(
            whole, which, getattr(whole, count)
        )
    for field in FIELDS.split():
        assert np.array_equal(getattr(whole, field), getattr(joined, field)), field


def test_split_files_load_in_silence(chain40, tmp_path, monkeypatch, capfd):
    for name, content in split(chain40.mjcf.read_text(), "robot.xml", 20).items():
        (tmp_path / name).write_text(content)
    (tmp_path / "meshes").symlink_to(chain40.mjcf.parent / "meshes")
    monkeypatch.chdir(tmp_path)  # MuJoCo would leave its log in the current folder
    load_model(tmp_path / "robot.xml")
    assert capfd.readouterr() == ("", "")
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_same_spec_gives_the_same_bytes(dragon4, tmp_path):
    again = snakegen.build("dragon4", tmp_path / "again", picture=False)
    for field in ("urdf", "mjcf", "scene", "spec"):
        assert getattr(again, field).read_bytes() == getattr(dragon4, field).read_bytes()
