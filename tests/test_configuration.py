"""A configuration is q and its kinematics; both are Pinocchio's, and arrays do as well."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.analysis.mass import analyze as mass
from snakegen.errors import DescriptionError, PostureError
from snakegen.robot.configuration import Configuration

POSTURE = {"joint1_yaw": 0.7, "joint2_pitch": -0.4, "gimbal2_roll": 0.3}
BASE = {"base_rpy": (0.3, -0.5, 1.1), "base_position": (0.4, -0.2, 1.5)}


@pytest.fixture(scope="module")
def dragon() -> snakegen.Robot:
    return snakegen.load("dragon4")


@pytest.mark.parametrize("name", ["dragon4", "arm6"])
def test_kinematics_are_pinocchios(name: str) -> None:
    """Poses, CoG and both Jacobians, floating and fixed, against an implementation of others."""
    robot = snakegen.load(name)
    low, high, _ = robot.limits(robot.joint_names)
    rng = np.random.default_rng(4)
    angles = rng.uniform(np.maximum(low, -2.0), np.minimum(high, 2.0))
    base = BASE if robot.floating else {}
    c = robot.configuration(dict(zip(robot.joint_names, angles.tolist(), strict=True)), **base)
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, c)
    pin.updateFramePlacements(model, data)
    for frame in (f for f in model.frames if f.type == pin.FrameType.BODY and f.name != "universe"):
        rotation, position = c.link_poses[frame.name]
        at = data.oMf[model.getFrameId(frame.name, pin.FrameType.BODY)]
        np.testing.assert_allclose(rotation, at.rotation, atol=1e-12)
        np.testing.assert_allclose(position, at.translation, atol=1e-12)
        jacobian = pin.getFrameJacobian(
            model, data, model.getFrameId(frame.name), pin.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(c.jacobian(frame.name), jacobian, atol=1e-12)
    np.testing.assert_allclose(c.cog, pin.centerOfMass(model, data, c), atol=1e-12)
    jacobian = pin.jacobianCenterOfMass(model, data, c)
    np.testing.assert_allclose(c.cog_jacobian, jacobian, atol=1e-12)


def test_it_is_an_array(dragon: snakegen.Robot) -> None:
    """What numpy and Pinocchio make of it is what they make of q; the results are plain arrays."""
    c = dragon.configuration(POSTURE, **BASE)
    q = np.array(c)
    assert type(q) is np.ndarray and type(np.asarray(c)) is np.ndarray
    for made in (c[3:7], c + 0.1, np.concatenate([c, c]), np.sin(c), c * c):
        assert type(made) is np.ndarray
    assert np.array_equal(c + q, 2 * q) and float(c @ c) == float(q @ q)
    v = np.full(dragon.model.nv, 0.1)
    np.testing.assert_array_equal(
        pin.integrate(dragon.model, c, v), pin.integrate(dragon.model, q, v)
    )
    again = pickle.loads(pickle.dumps(c))
    assert isinstance(again, Configuration) and np.array_equal(again, q)
    assert c.copy().robot is dragon and not np.shares_memory(c.copy(), c)


def test_arrays_and_configurations_give_the_same(dragon: snakegen.Robot) -> None:
    """An analysis of q and of its configuration agree bit for bit."""
    c = dragon.configuration(POSTURE, **BASE)
    q = np.array(c)
    one, other = allocation(dragon, c), allocation(dragon, q)
    for part in ("cog", "dual", "virtual", "force", "jacobian", "hover_wrench"):
        assert np.array_equal(getattr(one, part), getattr(other, part)), part
    assert mass(dragon, c).to_json() == mass(dragon, list(q)).to_json()


def test_it_is_validated_and_computed_once(dragon: snakegen.Robot) -> None:
    """The same object comes back; its angles are computed once, and anew when q changes."""
    c = dragon.configuration(POSTURE)
    assert dragon.validate_configuration(c) is c
    assert c.angles is c.angles and c.body_poses is c.body_poses
    with pytest.raises(ValueError, match="read-only"):
        c.angles[0] = 1.0
    before = c.cog.copy()
    at = 7 + dragon.joint_names.index("joint1_yaw")
    c[at] = -0.7
    assert c.angles[at - 7] == -0.7
    mirrored = dragon.configuration(POSTURE | {"joint1_yaw": -0.7})
    assert np.array_equal(c.cog, mirrored.cog) and not np.allclose(c.cog, before)
    c += np.eye(len(c))[at]
    assert isinstance(c, Configuration) and c.angles[at - 7] == pytest.approx(0.3)
    c[at] = np.nan
    with pytest.raises(PostureError, match="NaN"):
        _ = c.angles


def test_another_robots_configuration_is_checked(dragon: snakegen.Robot) -> None:
    """A configuration of a robot of another size is refused as its array would be."""
    other = snakegen.load("dragon3").configuration()
    with pytest.raises(PostureError, match="shape"):
        allocation(dragon, other)
    for wrong in ("no numbers", [0.0], np.zeros(dragon.model.nq)):
        with pytest.raises(PostureError):
            dragon.validate_configuration(wrong)
    with pytest.raises(DescriptionError, match="link9"):
        dragon.configuration().jacobian("link9")


def test_posture_and_repr(dragon: snakegen.Robot) -> None:
    """A posture goes there and back; what is printed is short and names what is not 0."""
    c = dragon.configuration(POSTURE, **BASE)
    np.testing.assert_allclose(dragon.configuration(c.posture()), c, atol=1e-12)
    assert repr(dragon.configuration({"joint1_yaw": 0.5})) == (
        "Configuration(dragon4, joint1_yaw=0.5)"
    )
    full = dragon.configuration(dict.fromkeys(dragon.joint_names, 0.1))
    assert len(repr(full)) < 160 and "more" in repr(full)
    assert "dragon4" in repr(dragon) and len(repr(dragon)) < 160


def test_gimbals_turn_for_hover(dragon: snakegen.Robot) -> None:
    """With hover gimbals every thrust points up, whatever the attitude; given ones stay."""
    turned = {"joint1_yaw": 0.8, "base_rpy": (0.2, 0.1, 0.0)}
    c = dragon.configuration(turned, gimbals="hover")
    a = allocation(dragon, c)
    np.testing.assert_allclose(
        c.base_rotation @ a.rotor_axes.T, np.tile([[0], [0], [1]], 8), atol=1e-9
    )
    assert not any(n.startswith("gimbal") for n in dragon.configuration(turned).posture())
    with pytest.raises(PostureError, match="'given' or 'hover'"):
        dragon.configuration(gimbals="level")
