"""Clearance of arms from themselves, the floor and obstacles; MuJoCo's distance as the oracle."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import snakegen
import snakegen.robot
from snakegen.analysis import reach, tunnel
from snakegen.base.geometry import rotation_from_rpy
from snakegen.description.mjcf.decorate import decorate
from snakegen.errors import AnalysisError, SceneError
from snakegen.inverse_kinematics.collisions import Collisions, obstacles_of
from snakegen.scene.solids import Solid
from snakegen.spec.loading import load_spec


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


def test_distances_are_mujocos(arm):
    """Random postures, self and obstacle: the least distance over the same pairs."""
    rpy = np.array([0.3, 0.2, 0.1])
    middle, size = np.array([0.9, 0.3, 0.1]), (0.1, 0.05, 0.2)
    box = Solid("box", "box", middle, rotation_from_rpy(rpy), size)
    world = Collisions(arm, (box,))
    spec = decorate(arm.urdf, arm.modules, {}, visuals=False)
    made = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=box.centre, size=box.size)
    made.quat = Rotation.from_euler("xyz", rpy).as_quat(scalar_first=True)
    model = spec.compile()
    data = mujoco.MjData(model)
    shapes = {
        model.body(model.geom_bodyid[g]).name: g for g in range(model.ngeom) if model.geom_bodyid[g]
    }
    shapes["box"] = next(g for g in range(model.ngeom) if model.geom_bodyid[g] == 0)
    rng = np.random.default_rng(3)
    pairs = [(world.links[p.first], world.links[p.second]) for p in world.geometry.collisionPairs]
    assert ("link1", "link2") not in pairs and ("link1", "link3") in pairs
    for _ in range(10):
        angles = rng.uniform(-0.7, 0.7, (1, 12))
        found = world.nearest(angles, arm.joint_names)
        for name, angle in zip(arm.joint_names, angles[0], strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        least = min(
            mujoco.mj_geomDistance(model, data, shapes[a], shapes[b], 3.0, None)
            for a, b in pairs
            if "floor" not in (a, b)
        )
        if found.distance > 0 and "floor" not in found.pair:
            assert found.distance == pytest.approx(least, abs=2e-4)


def test_a_straight_arm_over_a_box_and_the_floor(arm):
    """30 mm below the rod; and the floor, 1.4 m below the base, where there is no box."""
    still = np.zeros((1, 12))
    box = Solid("box", "box", np.array([1.0, 0.0, -0.04 - 0.03 - 0.02]), size=(0.1, 0.1, 0.02))
    found = Collisions(arm, (box,)).nearest(still, arm.joint_names)
    assert found.distance == pytest.approx(0.03, abs=1e-6)
    assert set(found.pair) == {"box", found.pair[0]} and found.pair[1] == "box"
    low = snakegen.load(load_spec("arm6", overrides=["base={pose: stand, height: 0.1}"]))
    found = Collisions(low).nearest(still, low.joint_names)
    assert found.distance == pytest.approx(0.06, abs=1e-6) and found.pair[1] == "floor"


def test_reach_goes_round_an_obstacle(arm):
    """A box where the first resting posture has its body: another posture keeps clear."""
    port = "1.25,0.08,0.08,1,0,0,0.1"
    q = arm.configuration()
    plain = reach.analyze(arm, q, port=port, depth=0.1, duration=1.0)
    assert plain.complete and plain.nearest.free
    middle = plain.track.angles[len(plain.track.angles) // 2]
    place = tip_of(arm, middle, "link4")
    box = Solid("box", "box", np.array(place), size=(0.03, 0.03, 0.03))
    one = reach.analyze(arm, q, port=port, depth=0.1, duration=1.0, obstacles=[box], tries=1)
    assert not one.complete and one.nearest.distance < 0 and "box" in one.nearest.pair
    many = reach.analyze(arm, q, port=port, depth=0.1, duration=1.0, obstacles=[box], tries=30)
    assert many.complete and many.nearest.free and many.tries > 1
    assert many.to_json()["collision_free"] is True


def tip_of(arm, angles, link):
    """Returns the origin of a link (3,) m."""
    import pinocchio as pin

    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, np.asarray(angles))
    return data.oMf[arm.model.getFrameId(link)].translation


def test_a_tunnel_under_the_floor_is_a_collision():
    low = snakegen.load(load_spec("arm6", overrides=["base={pose: stand, height: 0.05}"]))
    way = {"mouth": "1.25,0.08,0.08", "depth": 0.05}
    found = tunnel.analyze(low, low.configuration(), **way)
    assert not found.entry.why and not found.complete
    assert found.nearest.pair[1] == "floor" and found.nearest.distance < 0
    high = snakegen.load("arm6")
    assert tunnel.analyze(high, high.configuration(), **way).complete


@pytest.mark.parametrize(
    "text",
    ["a: 1", "obstacles: [1]", "obstacles: [{centre: [0, 0, 0], half: [1, 1, 0]}]",
     "obstacles: [{centre: [0, 0], half: [1, 1, 1]}]", "obstacles: [{center: [0, 0, 0]}]"],
)  # fmt: skip
def test_scenes_that_are_none_are_refused(text, tmp_path):
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(SceneError, match=r"s\.yaml"):
        obstacles_of(tmp_path / "s.yaml")


def test_meshes_that_cannot_be_read_are_said_to_be_left_out(arm, tmp_path):
    text = arm.urdf.replace(
        "<collision>", '<collision name="c"><geometry><mesh filename="lost.stl"/></geometry>'
        "</collision>\n<collision>", 1
    )  # fmt: skip
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    robot = snakegen.robot.robot.from_urdf_text(text, path, checked=True)
    found = Collisions(robot).nearest(np.zeros((1, 12)), robot.joint_names)
    assert found.note.startswith("not checked") and found.to_json()["collision_free"] is None


SCENE = """
obstacles:
  - {name: pipe, kind: pipe, points: [[1.4, 0.08, 0.08], [1.5, 0.08, 0.08]], radius: 0.06}
  - {name: post, kind: cylinder, from: [0.6, 0.9, -1], to: [0.6, 0.9, 1], radius: 0.05}
"""


def test_a_tunnel_is_a_bore_of_the_scene_that_planners_read(arm, tmp_path):
    """The hole is the pipe's centre line; its staves and the post are kept clear of."""
    (tmp_path / "s.yaml").write_text(SCENE)
    scene = {"obstacles": tmp_path / "s.yaml"}
    assert {s.kind for s in obstacles_of(tmp_path / "s.yaml")} == {"box", "cylinder"}
    found = tunnel.analyze(arm, arm.configuration(), opening="pipe", room=0.02, **scene)
    assert np.allclose(found.hole.points[:, 1:], 0.08) and found.hole.points[0, 0] < 1.4
    assert 0.0 < found.nearest.distance < 0.06 and found.nearest.pair[1].startswith("pipe")
    assert found.entry.depth[-1] > 0.25
    with pytest.raises(AnalysisError, match="no opening 'post'"):
        tunnel.analyze(arm, arm.configuration(), opening="post", **scene)
    with pytest.raises(AnalysisError, match="--obstacles"):
        tunnel.analyze(arm, arm.configuration(), opening="pipe")
