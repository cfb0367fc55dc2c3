"""No body starts in contact that it does not mean, and no pair touches that geometry keeps apart.

Contacts of MuJoCo are held against coal's distances between the URDF's own collision shapes, and
neighbours are read off the URDF's joints.
"""

import os
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.description.mjcf.base_mount import floor_height, supports
from snakegen.description.mjcf.decorate import decorate, scene
from snakegen.description.mjcf.files import load_model
from snakegen.errors import PostureError
from snakegen.pipeline.start_contacts import contact_warnings, start_contacts
from snakegen.robot.base_mount import mounted
from snakegen.robot.robot import from_urdf_text
from snakegen.spec.loading import load_spec, presets
from snakegen.spec.urdf import urdf_text
from snakegen.statics.joint_torques import joint_torques

CHAINS = int(os.environ.get("SNAKEGEN_CHAINS", "30"))
POSTURES = 10


def scene_of(spec):
    """Returns robot and scene of a spec, without files; drums as balls and wheels as they are."""
    robot = from_urdf_text(urdf_text(spec), None)
    made = decorate(robot.urdf, robot.modules, {}, visuals=False)
    model = made.compile()
    held = supports(model, robot.modules, "link1")
    text = scene("robot.xml", robot.name, floor_height(model, robot.modules), held)
    assets = {"robot.xml": made.to_xml().encode()}
    return robot, mujoco.MjModel.from_xml_string(text, assets)


def random_chain(rng, k):
    """Returns the spec of a chain of any kind: floating or fixed, one or two axes, with modules."""
    n = int(rng.integers(2, 7))
    axes = [
        list(rng.choice(["roll", "pitch", "yaw"], size=rng.integers(1, 3), replace=False))
        for _ in range(n - 1)
    ]
    pose = ["stand", "wall", "ceiling", "vertical"][int(rng.integers(4))]
    attitude = {"pose": "any", "rpy": rng.uniform(-3, 3, 3).tolist()}
    fixed = attitude if rng.random() < 0.2 else {"pose": pose}
    spec = {
        "name": f"chain{k}",
        "base": "floating" if rng.random() < 0.4 else fixed,
        "chain": {
            "links": n,
            "length": rng.uniform(0.15, 0.5, n).tolist(),
            "mass": rng.uniform(0.2, 1.0, n).tolist(),
            "radius": rng.uniform(0.01, 0.04, n).tolist(),
        },
        "joint": {
            "axes": [[str(a) for a in pair] for pair in axes],
            "gap": float(rng.uniform(0, 0.06)),
            "upper": float(rng.uniform(0.3, 2.5)),
        },
    }
    if rng.random() < 0.5:
        at = sorted(rng.choice(n, size=int(rng.integers(1, n + 1)), replace=False) + 1)
        spec["vectoring_apparatus"] = {
            "at": [f"{link}@{rng.uniform(0.3, 0.7):.3f}" for link in at],
            "separation": float(rng.uniform(0.15, 0.3)),
            "rotor_diameter": float(rng.uniform(0.05, 0.1)),
        }
    elif rng.random() < 0.05:
        drum = {"at": "all", "radius": 0.075, "blades": 3, "wheels_per_blade": 2}
        spec |= {"screw_drive": drum, "caster": {"at": "1@0"}}
    if rng.random() < 0.3:
        spec["payload"] = {"at": int(rng.integers(1, n + 1)), "mass": 0.3, "radius": 0.03}
    return spec


def neighbours(robot):
    """Returns pairs of links whose bodies share a joint, links fixed to each other as one."""
    joints = ET.fromstring(robot.urdf).findall("joint")
    group = {}

    def find(link):
        while group.get(link, link) != link:
            link = group[link]
        return link

    ends = [(j.find("parent").get("link"), j.find("child").get("link"), j) for j in joints]
    for parent, child, joint in ends:
        if joint.get("type") == "fixed":
            group[find(child)] = find(parent)
    return {frozenset((find(p), find(c))) for p, c, _ in ends if find(p) != find(c)}, find


@pytest.mark.parametrize("name", sorted(presets()))
@pytest.mark.parametrize("base", ["floating", "fixed"])
def test_presets_start_free_of_unmeant_contact(name, base):
    _, model = scene_of(load_spec(name, overrides=[f"base={base}"]))
    assert start_contacts(model) == ()
    assert contact_warnings(model) == ()


def test_random_chains_start_free_of_unmeant_contact():
    """Where parts overlap in the drawing, the build says which; nothing else touches."""
    rng = np.random.default_rng(5)
    for k in range(CHAINS):
        _, model = scene_of(random_chain(rng, k))
        assert start_contacts(model) == (), k


def touching(robot, model, rng, postures):
    """Yields (posture, pairs of links in contact in MuJoCo) of random postures within limits."""
    data = mujoco.MjData(model)
    low, high, _ = robot.limits(robot.joint_names)
    for _ in range(postures):
        angles = dict(zip(robot.joint_names, rng.uniform(low, high), strict=True))
        mujoco.mj_resetData(model, data)
        if robot.floating:
            data.qpos[2] = 10.0  # far from the floor
        for name, angle in angles.items():
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        pairs = {
            tuple(model.body(model.geom_bodyid[g]).name for g in c.geom)
            for c in data.contact
            if c.dist < -1e-6 and all(model.geom_bodyid[g] for g in c.geom)
        }
        yield angles, pairs


def check_contacts(robot, model, rng, postures):
    """Asserts that no neighbours touch, and that what touches does so by coal too."""
    pairs_of, find = neighbours(robot)
    geometry = pin.buildGeomFromUrdfString(
        robot.model, robot.urdf, pin.GeometryType.COLLISION, package_dirs=[]
    )
    geometry.addAllCollisionPairs()
    names = [robot.model.frames[g.parentFrame].name for g in geometry.geometryObjects]
    seen = 0
    for angles, pairs in touching(robot, model, rng, postures):
        if not pairs:
            continue
        for one, two in pairs:
            assert frozenset((find(one), find(two))) not in pairs_of, (one, two)
        places = pin.GeometryData(geometry)
        q = robot.configuration(angles)
        data = robot.model.createData()
        pin.computeDistances(robot.model, data, geometry, places, q)
        near = {}
        for pair, result in zip(geometry.collisionPairs, places.distanceResults, strict=True):
            key = frozenset((names[pair.first], names[pair.second]))
            near[key] = min(near.get(key, np.inf), result.min_distance)
        for pair in pairs:
            seen += 1
            assert near[frozenset(pair)] < 1e-5, pair
    return seen


@pytest.mark.parametrize("name", ["arm6", "grasper3", "dragon3", "dragon4"])
@pytest.mark.parametrize("base", ["floating", "fixed"])
def test_presets_touch_where_their_geometry_does(name, base):
    robot, model = scene_of(load_spec(name, overrides=[f"base={base}"]))
    check_contacts(robot, model, np.random.default_rng(1), 40)


def test_random_chains_touch_where_their_geometry_does():
    rng, seen = np.random.default_rng(6), 0
    for k in range(CHAINS // 3):
        robot, model = scene_of(random_chain(rng, k))
        if not robot.modules.screws:
            seen += check_contacts(robot, model, rng, POSTURES)
    assert seen > 10  # the check has met contacts to check


def test_a_folded_grasper_touches_itself():
    """link4 folds back on link2: no neighbours, so they collide."""
    _, model = scene_of("grasper3")
    data = mujoco.MjData(model)
    data.joint("joint2_yaw").qpos = np.pi - 0.3
    data.joint("joint3_yaw").qpos = np.pi - 0.3
    mujoco.mj_forward(model, data)
    assert any(
        {model.body(model.geom_bodyid[g]).name for g in c.geom} == {"link2", "link4"}
        for c in data.contact
    )


def test_an_arm_stays_where_it_was_built(tmp_path):
    """Servos at 0 for 2 s: nothing pushes but the weight, which sags 2000 N·m/rad by 13 mrad."""
    model = load_model(snakegen.build("arm6", tmp_path, picture=False).scene)
    data = mujoco.MjData(model)
    while data.time < 2.0:
        mujoco.mj_step(model, data)
        assert data.ncon == 0
    assert np.abs(data.qpos).max() < 0.02
    assert np.abs(data.actuator_force).max() < 39.0


def test_a_build_names_the_pair_that_starts_in_contact(tmp_path):
    """A floor through the arm, and a payload in another link's place."""
    made = snakegen.build(
        load_spec("arm6", overrides=["base={pose: stand, height: 0.02}"]), tmp_path, picture=False
    )
    found = [w for w in made.warnings if "start in contact" in w]
    assert any("floor and link2 start in contact, 20 mm deep" in w for w in found)
    made = snakegen.build(
        load_spec("grasper3", overrides=["payload={at: 4@0, mass: 0.1, offset: [-0.3, 0, 0]}"]),
        tmp_path,
        picture=False,
    )
    assert "link2 and payload1 overlap at rest; contact between them is left out" in made.warnings


@pytest.mark.parametrize(
    ("robot", "override"),
    [("screw4", "base=fixed"), ("arm6", "screw_drive={at: '2,3', blades: 2}")],
)
def test_drums_on_a_fixed_base_build(robot, override, tmp_path):
    made = snakegen.build(load_spec(robot, overrides=[override]), tmp_path, picture=False)
    assert made.equivalence.worst < 1e-9


@pytest.mark.parametrize("pose", ["wall", "ceiling", "vertical", "any"])
def test_a_base_is_mounted_as_its_pose_says(pose, tmp_path):
    """URDF and MJCF agree, link 1 points where the pose says, and weight loads joints by it."""
    rpy = ", rpy: [0.3, 0.4, 0.5]" if pose == "any" else ""
    spec = load_spec("arm6", overrides=[f"base={{pose: {pose}{rpy}}}"])
    made = snakegen.build(spec, tmp_path, picture=False)
    assert made.equivalence.worst < 1e-9 and made.warnings == ()
    data = mujoco.MjData(load_model(made.scene))
    mujoco.mj_forward(load_model(made.scene), data)
    x = data.body("link1").xmat.reshape(3, 3)[:, 0]
    any_x = np.array([np.cos(0.4) * np.cos(0.5), np.cos(0.4) * np.sin(0.5), -np.sin(0.4)])
    wanted = {"wall": [1, 0, 0], "ceiling": [0, 0, -1], "vertical": [0, 0, 1], "any": any_x}
    assert np.allclose(x, wanted[pose], atol=1e-12)
    robot = snakegen.load(made.urdf)
    torque = pin.computeGeneralizedGravity(
        robot.model, robot.model.createData(), robot.configuration()
    )
    level = np.linalg.norm(wanted[pose][:2])  # a straight arm's moments go with how level it is
    flat = snakegen.load("arm6")
    most = pin.computeGeneralizedGravity(flat.model, flat.model.createData(), flat.configuration())
    assert np.linalg.norm(torque) == pytest.approx(level * np.linalg.norm(most), abs=1e-9)


def test_a_base_turned_in_the_urdf_is_the_base_of_a_spec():
    """`--base-rpy` of an arm: torques as on a base of that pose, as of a tilted gravity."""
    rpy = [0.3, -0.5, 0.8]
    turned = mounted(snakegen.load("arm6"), rpy)
    again = mounted(turned, rpy)
    spec = snakegen.load(load_spec("arm6", overrides=[f"base={{pose: any, rpy: {rpy}}}"]))
    level = snakegen.load("arm6")
    q = np.random.default_rng(2).uniform(-0.5, 0.5, level.model.nq)
    down = pin.rpy.rpyToMatrix(np.array(rpy)).T @ np.array([0, 0, -9.81])
    wanted = joint_torques(level, q, gravity=down)
    for robot in (turned, again, spec):
        np.testing.assert_allclose(joint_torques(robot, q), wanted, atol=1e-12)
    with pytest.raises(PostureError, match="three angles"):
        mounted(level, [0, "x", 0])
    with pytest.raises(PostureError, match="floats"):
        mounted(snakegen.load("dragon3"), rpy)
