"""Push margins by allocator and limits: closed forms against rays along many directions."""

from dataclasses import replace

import numpy as np
import pytest

from snakegen.analysis import wrench_margin
from snakegen.analysis.allocation import allocation
from snakegen.analysis.push_margins import servo_bounds
from snakegen.errors import AnalysisError
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec
from snakegen.wrench_margins.controller import truncated_controller
from snakegen.wrench_margins.inner_ball import inner_ball, inner_ball_of
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.joint_limited_rotors import truncated_joint_limited
from snakegen.wrench_margins.push_margin import LABELS
from snakegen.wrench_margins.quadric import nearest_exit
from snakegen.wrench_margins.rays import inverse_ray, thrust_ray, vectored_ray

BENT = {f"joint{i}_yaw": 1.0 for i in (1, 2, 3)}
ODD = {
    "joint1_pitch": -0.23, "joint1_yaw": 0.92, "joint2_pitch": 0.22,
    "joint2_yaw": -1.07, "joint3_pitch": -0.22, "joint3_yaw": -0.91,
}  # fmt: skip


@pytest.fixture(scope="module")
def robot():
    return load("dragon4")


def margins(robot, joints, link):
    q = hover_gimbals(robot, robot.configuration(joints))
    return q, wrench_margin.analyze(robot, q, link=link)


def pushes(found, part, count=40):
    """Yields random unit pushes of a part, and the weakest of `found` last."""
    rng = np.random.default_rng(0)
    for e in rng.standard_normal((count, part.stop - part.start)):
        push = np.zeros(6)
        push[part] = e / np.linalg.norm(e)
        yield push
    yield np.array(found.push)


def test_the_figures_of_the_readme_posture(robot):
    """The pseudo-inverse within servo limits is what the default push meets."""
    _, found = margins(robot, BENT, "")
    force = found.push["virtual_single_rotor"].kinds["force"]
    values = {key: round(m.value, 1) for key, m in force.items()}
    assert values == {
        "exact_thrust": 44.5,
        "exact_servo": 34.5,
        "pseudo_inverse_thrust": 44.2,
        "pseudo_inverse_servo": 17.2,
    }
    assert force["pseudo_inverse_servo"].at_limit == ("joint1_yaw",)
    assert abs(force["exact_servo"].push[0]) > 0.95, "along x, not z"
    out = found.to_json()
    assert out["prediction"]["force"]["value"] == force["pseudo_inverse_servo"].value
    assert out["prediction"]["force"]["margin"] == "pseudo_inverse_servo"
    assert out["push"]["virtual_single_rotor"]["force"]["prediction"] == {
        "paper": "pseudo_inverse_servo",
        "constrained": "exact_servo",
    }


def test_the_allocator_chooses_the_prediction(robot):
    q = hover_gimbals(robot, robot.configuration(BENT))
    found = wrench_margin.analyze(robot, q, allocator="constrained").to_json()
    assert found["prediction"]["force"]["value"] == pytest.approx(34.47, abs=0.05)
    with pytest.raises(AnalysisError, match="allocator 'best'"):
        wrench_margin.analyze(robot, q, allocator="best")


@pytest.mark.parametrize(("joints", "link"), [(BENT, "link1"), (ODD, "link4")])
def test_no_direction_is_weaker_and_the_weakest_is_met(robot, joints, link):
    q, found = margins(robot, joints, link)
    a, limit = allocation(robot, q), robot.gimbals.limit
    matrix = force_map(a.thrust_points, a.drag)
    bounds, _ = servo_bounds(robot, q, link, True)
    inverse = np.linalg.pinv(matrix)
    for kind, part in (("force", slice(0, 3)), ("torque", slice(3, 6))):
        kinds = found.push["virtual_single_rotor"].kinds[kind]
        for key, margin in kinds.items():
            kept = bounds if key.endswith("servo") else None
            exact = key.startswith("exact")
            reach = []
            for push in pushes(margin, part, 3 if exact else 300):
                if exact:
                    ray = vectored_ray(matrix, limit, a.hover_wrench, push, kept)
                else:
                    ray = inverse_ray(inverse, a.hover_wrench, push, 0.0, limit, kept, balls=True)
                reach.append(ray.t)
            tolerance = 2e-3 if exact else 1e-6
            assert min(reach) >= margin.value * (1 - 1e-6), (kind, key)
            assert reach[-1] == pytest.approx(margin.value, rel=tolerance), (kind, key)


def test_dual_rotor_margins_are_those_of_its_four_rows():
    robot = load("dragon3")
    q, found = margins(robot, {"joint1_yaw": 0.8, "joint2_yaw": -0.7, "joint1_pitch": 0.3}, "link3")
    a, rotors = allocation(robot, q), robot.rotors
    given = (a.dual, rotors.thrust_min, rotors.thrust_max, a.hover_wrench)
    kinds = found.push["dual_rotor"].kinds["attitude_altitude"]
    assert set(kinds) == set(LABELS)
    push = np.array(kinds["exact_thrust"].push)
    ray = thrust_ray(*given, push, part=slice(2, 6))
    assert ray.t == pytest.approx(kinds["exact_thrust"].value, rel=1e-6)
    # servos so weak that they limit it
    bounds, _ = servo_bounds(robot, q, "link3", False)
    held = np.abs(bounds.bias + bounds.rows @ np.linalg.pinv(a.dual[2:]) @ a.hover_wrench[2:])
    bounds = replace(bounds, limit=held + 0.05)
    scale = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    unit = np.repeat([robot.force_scale, robot.torque_scale], 3)
    (low, high), e, joints = truncated_joint_limited(*given, bounds, **scale)
    pseudo = truncated_controller(*given, bounds=bounds, **scale)
    inverse = np.linalg.pinv(a.dual[2:])
    assert joints and 0 < low <= high < 0.9 * kinds["exact_thrust"].value
    assert 0 < pseudo.value <= low * (1 + 1e-6) and pseudo.limiting >= 4
    limits = (rotors.thrust_min, rotors.thrust_max)
    for i, d in enumerate([-e, *np.random.default_rng(1).standard_normal((40, 4))]):
        push = np.r_[0.0, 0.0, d / np.linalg.norm(d)] * unit
        ray = thrust_ray(*given, push, bounds, part=slice(2, 6))
        assert ray.t >= low * (1 - 1e-6)
        assert i or ray.t == pytest.approx(high, rel=1e-6)
        mine = inverse_ray(inverse, a.hover_wrench[2:], push[2:], *limits, bounds, joint_push=push)
        assert mine.t >= pseudo.value * (1 - 1e-9)
    push = pseudo.push
    mine = inverse_ray(inverse, a.hover_wrench[2:], push[2:], *limits, bounds, joint_push=push)
    assert mine.t == pytest.approx(pseudo.value, rel=1e-9)


def test_a_quadric_is_left_at_the_nearest_point():
    rng = np.random.default_rng(4)
    for _ in range(40):
        size = int(rng.integers(1, 5))
        square = rng.standard_normal((size, size))
        square = square + square.T
        linear, constant = rng.standard_normal(size), -rng.uniform(0.1, 2.0)
        d = nearest_exit(square, linear, constant)
        e = rng.standard_normal((4000, size))
        e /= np.linalg.norm(e, axis=1)[:, None]
        a, b = np.einsum("ki,ij,kj->k", e, square, e), e @ linear
        root = b * b - a * constant
        t = np.where(root >= 0, -constant / (b + np.sqrt(np.maximum(root, 0.0))), np.inf)
        t = np.where(t > 0, t, np.inf)
        if not np.isfinite(d).all():
            assert not np.isfinite(t).any()
            continue
        assert d @ square @ d + 2 * linear @ d + constant == pytest.approx(0.0, abs=1e-8)
        assert np.linalg.norm(d) <= t.min() * (1 + 1e-9)
    # hard case: centred, the steepest axis decides
    assert np.linalg.norm(nearest_exit(np.diag([4.0, 1.0]), np.zeros(2), -9.0)) == pytest.approx(
        1.5
    )


def test_the_ball_in_a_body_of_four_dimensions():
    """A box and an ellipsoid off the origin; in three dimensions both searches agree."""

    def ellipsoid(axes, centre):
        def support(e):
            size = np.linalg.norm(axes * e)
            return size + centre @ e, axes * axes * e / size + centre

        return support

    axes, centre = np.array([1.0, 0.4, 2.0, 0.9]), np.array([0.2, 0.05, 0.0, -0.1])
    square = axes**-2.0
    nearest = nearest_exit(np.diag(square), -square * centre, centre @ (square * centre) - 1.0)
    low, high, e = inner_ball_of(ellipsoid(axes, centre), 4, 1e-3, 2000)
    radius = np.linalg.norm(nearest)
    assert low <= radius <= high * (1 + 1e-9) and high - low <= 1e-3 * high
    assert e @ nearest == pytest.approx(radius, rel=0.02)
    support = ellipsoid(axes[:3], centre[:3])
    assert inner_ball_of(support, 3, 1e-3)[1] == pytest.approx(
        inner_ball(support, 1e-3)[1], rel=1e-3
    )


@pytest.mark.parametrize("flat", [False, True])
def test_the_ball_in_a_parallelepiped_or_a_flat_body(flat):
    """Its corners along the axes may span less than the body does."""
    edges = np.array([[1.0, 1.0, 0, 0], [0, 1.0, 1.0, 0], [0, 0, 1.0, 1.0], [1.0, 0, 0, -1.0]])
    edges = edges @ np.diag([1.0, 0.7, 1.3, 0.9])
    edges[3] = edges[0] if flat else edges[3] + [0, 0.5, 0, 0]

    def support(e):
        along = edges @ e
        return np.abs(along).sum(), np.where(along >= 0, 1.0, -1.0) @ edges

    low, high, _ = inner_ball_of(support, 4, 1e-6)
    if flat:
        assert low == -np.inf
        return
    normals = np.linalg.inv(edges)  # columns: x @ normals is within ±1
    radius = np.min(1.0 / np.linalg.norm(normals, axis=0))
    assert low == pytest.approx(radius, rel=1e-6) and high == pytest.approx(radius, rel=1e-6)


def limited(roll, pitch):
    names = {"roll": roll, "pitch": pitch}
    changes = [f"vectoring_apparatus.{n}_limit={x}" for n, x in names.items()]
    return load(load_spec("dragon4", overrides=changes))


def worst_share(sets, forces):
    """Returns the largest share of a limit of thrust, φ or θ that forces (Ñ, 3) take."""
    local = np.einsum("nji,nj->ni", sets.frames, forces)
    thrust = np.linalg.norm(local, axis=1)
    phi = np.abs(np.arctan2(-local[:, 1], local[:, 2])) / sets.phi[:, 1]
    theta = np.abs(np.arcsin(local[:, 0] / thrust)) / sets.theta[:, 1]
    return max((thrust / sets.high).max(), phi.max(), theta.max())


@pytest.mark.parametrize("limits", [(0.6, 0.6), (1.0, 0.25)])
def test_gimbal_limits_bound_the_pseudo_inverse(limits):
    """Every force is within its set along every direction, up to the margin."""
    robot = limited(*limits)
    q, found = margins(robot, BENT, "")
    a, sets = allocation(robot, q), robot.force_sets(q)
    inverse = np.linalg.pinv(force_map(a.thrust_points, a.drag))

    def share(push, t):
        return worst_share(sets, (inverse @ (a.hover_wrench - t * push)).reshape(-1, 3))

    kinds = found.push["virtual_single_rotor"].kinds
    wide = margins(load("dragon4"), BENT, "")[1].push["virtual_single_rotor"].kinds
    narrower = 0
    for kind, part in (("force", slice(0, 3)), ("torque", slice(3, 6))):
        margin = kinds[kind]["pseudo_inverse_thrust"]
        for push in pushes(margin, part, 300):
            assert share(push, margin.value * (1 - 1e-6)) <= 1.0
        narrower += margin.value < 0.9 * wide[kind]["pseudo_inverse_thrust"].value
    assert narrower >= (limits[1] < 0.5)


def test_gimbal_limits_bound_the_exact_margin_within_servo_limits():
    """dragon4 within 0.05 rad: 4.66 N by a linear program; wide limits leave it as it is."""
    _, found = margins(limited(0.05, 0.05), BENT, "")
    force = found.push["virtual_single_rotor"].kinds["force"]
    assert force["exact_servo"].value == pytest.approx(4.66, abs=0.01)
    assert force["pseudo_inverse_servo"].value < 4.66
    assert found.to_json()["prediction"]["force"]["value"] < 4.66
    _, middle = margins(limited(1.0, 0.25), BENT, "")
    _, wide = margins(limited(1.5, 1.5), BENT, "")
    low, high = (
        m.push["virtual_single_rotor"].kinds["force"]["exact_servo"] for m in (middle, wide)
    )
    assert low.value <= high.value <= high.bounds[1] * (1 + 1e-9)
    assert high.value == pytest.approx(34.48, rel=5e-3)
