"""Chain kernels against Pinocchio models built joint by joint, and against finite differences."""

import numpy as np
import pinocchio as pin
import pytest
from flat_robots import random_rotation, random_tree

from snakegen.base.geometry import quaternion_xyzw, skew
from snakegen.kernels.kinematics import chain


def pinocchio_model(tree):
    """The same robot in Pinocchio: free-flyer base, unaligned joints, random inertias."""
    model = pin.Model()
    ids = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")]
    for i in range(len(tree.parent)):
        if i > 0:
            kind = pin.JointModelPrismaticUnaligned if tree.prismatic[i] else None
            kind = kind or pin.JointModelRevoluteUnaligned
            place = pin.SE3(tree.rotation[i], tree.translation[i])
            ids.append(model.addJoint(ids[tree.parent[i]], kind(tree.axis[i]), place, f"j{i}"))
        body = pin.Inertia(tree.mass[i], tree.com[i], tree.inertia[i])
        model.appendBodyToJoint(ids[i], body, pin.SE3.Identity())
    return model, ids


def random_state(rng, tree):
    n = len(tree.parent) - 1
    return (
        random_rotation(rng),
        rng.normal(size=3),
        rng.uniform(-2, 2, n),
        rng.normal(size=3),
        rng.normal(size=3),
        rng.normal(size=n),
    )


def in_pinocchio_order(model, ids, base_r, base_p, angles, base_v, base_w, rates):
    """q and v; joint indices follow the order of insertion, which is the tree's."""
    q, v = pin.neutral(model), np.zeros(model.nv)
    q[:7] = np.concatenate([base_p, quaternion_xyzw(base_r)])
    v[:6] = np.concatenate([base_r.T @ base_v, base_r.T @ base_w])
    for i in range(1, len(ids)):
        q[model.joints[ids[i]].idx_q] = angles[i - 1]
        v[model.joints[ids[i]].idx_v] = rates[i - 1]
    return q, v


@pytest.mark.parametrize("seed", range(6))
def test_poses_and_mass_properties_equal_pinocchio(seed):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng)
    state = random_state(rng, tree)
    model, ids = pinocchio_model(tree)
    data = model.createData()
    q, v = in_pinocchio_order(model, ids, *state)
    pin.centerOfMass(model, data, q, v)
    pin.ccrba(model, data, q, v)

    rotation, position = chain.forward(tree, *state[:3])
    for i, j in enumerate(ids):
        np.testing.assert_allclose(rotation[i], data.oMi[j].rotation, atol=1e-12)
        np.testing.assert_allclose(position[i], data.oMi[j].translation, atol=1e-12)
    mass, cog, inertia = chain.mass_properties(tree, rotation, position)
    assert mass == pytest.approx(pin.computeTotalMass(model), rel=1e-14)
    np.testing.assert_allclose(cog, data.com[0], atol=1e-12)
    np.testing.assert_allclose(inertia, data.Ig.inertia, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_velocities_and_momentum_equal_pinocchio(seed):
    rng = np.random.default_rng(100 + seed)
    tree = random_tree(rng)
    state = random_state(rng, tree)
    model, ids = pinocchio_model(tree)
    data = model.createData()
    q, v = in_pinocchio_order(model, ids, *state)
    pin.forwardKinematics(model, data, q, v)
    momentum = pin.computeCentroidalMomentum(model, data, q, v)

    rotation, position = chain.forward(tree, *state[:3])
    linear, angular = chain.body_twists(tree, rotation, position, *state[3:])
    for i, j in enumerate(ids):
        twist = pin.getVelocity(model, data, j, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(linear[i], twist.linear, atol=1e-11)
        np.testing.assert_allclose(angular[i], twist.angular, atol=1e-11)
    speed, h, omega = chain.centroidal_motion(tree, rotation, position, *state[3:])
    mass, _, inertia = chain.mass_properties(tree, rotation, position)
    np.testing.assert_allclose(mass * speed, momentum.linear, atol=1e-10)
    np.testing.assert_allclose(h, momentum.angular, atol=1e-10)
    np.testing.assert_allclose(inertia @ omega, h, atol=1e-10)


def test_cog_velocity_is_the_derivative_of_the_cog_along_a_motion():
    rng = np.random.default_rng(7)
    tree = random_tree(rng)
    base_r, base_p, angles, base_v, base_w, rates = random_state(rng, tree)

    def cog_at(t):
        turned = pin.exp3(base_w * t) @ base_r
        pose = chain.forward(tree, turned, base_p + base_v * t, angles + rates * t)
        return chain.centre_of_gravity(tree, *pose)[1]

    h = 1e-5
    poses = chain.forward(tree, base_r, base_p, angles)
    speed, _, _ = chain.centroidal_motion(tree, *poses, base_v, base_w, rates)
    np.testing.assert_allclose((cog_at(h) - cog_at(-h)) / (2 * h), speed, atol=1e-8)


def test_rigid_motion_has_the_base_rotation_as_its_mean():
    rng = np.random.default_rng(8)
    tree = random_tree(rng)
    base_r, base_p, angles, base_v, base_w, rates = random_state(rng, tree)
    poses = chain.forward(tree, base_r, base_p, angles)
    speed, _, omega = chain.centroidal_motion(tree, *poses, base_v, base_w, 0 * rates)
    cog = chain.centre_of_gravity(tree, *poses)[1]
    np.testing.assert_allclose(omega, base_w, atol=1e-12)
    np.testing.assert_allclose(speed, base_v + skew(base_w) @ (cog - base_p), atol=1e-12)
