"""A whole body follows its tip into a hole: by feeding the base, by folding, by servos."""

import numpy as np
import pinocchio as pin
import pytest

import snakegen
from snakegen.analysis import tunnel
from snakegen.errors import AnalysisError, MissionError
from snakegen.inverse_kinematics.body_line import Body
from snakegen.inverse_kinematics.hole import Hole
from snakegen.inverse_kinematics.path_following import chain_of
from snakegen.simulation.flight.run import run
from snakegen.statics.tip import find_tip

MOUTH = (1.25, 0.08, 0.08)


@pytest.fixture(scope="module")
def arm():
    return snakegen.load("arm6")


def line_by_pinocchio(arm, angles, count=50):
    """Returns points of the body's line, and how far they are behind the tip, by Pinocchio."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, np.asarray(angles, float))
    places = [np.zeros(3)]
    for i in range(2, 8):
        places.append(data.oMf[arm.model.getFrameId(f"link{i}")].translation.copy())
    last = data.oMf[arm.model.getFrameId("link7")]
    places.append(last.act(np.array([arm.modules.lengths["link7"], 0, 0])))
    nodes = np.array(places[1:] if np.allclose(places[0], places[1]) else places)
    points, behind, far = [], [], 0.0
    for a, b in zip(nodes[:0:-1], nodes[-2::-1], strict=True):
        size = np.linalg.norm(b - a)
        for t in np.linspace(0, 1, count):
            points.append(a + t * (b - a))
            behind.append(far + t * size)
        far += size
    return np.array(points), np.array(behind)


def off_by_pinocchio(arm, hole, depth, angles, feed):
    """Returns how far the line inside is off the centreline, by brute force over its points."""
    points, behind = line_by_pinocchio(arm, angles)
    points = points + feed * hole.inwards
    inside = (behind < depth) & ((points - hole.points[0]) @ hole.inwards > 0)
    dense = np.array([hole.at(s) for s in np.linspace(0, hole.arcs[-1], 4000)])
    far = [np.linalg.norm(dense - x, axis=1).min() for x in points[inside]]
    return max(far, default=0.0)


def curve(count=60, radius=0.45):
    """A line in space from the straight arm's tip: bent sideways and, more and more, up."""
    s = np.linspace(0, 0.6, count)
    bent = [radius * np.sin(s / radius), radius * (1 - np.cos(s / radius)), 0.1 * s**2]
    return np.array([1.602, 0, 0]) + np.stack(bent, axis=1)


def test_straight_feed_is_exact_and_says_where_the_chain_ends(arm):
    q = arm.configuration()
    found = tunnel.analyze(arm, q, mouth=(1.602, 0, 0), depth=0.5, feed=1.0)
    assert found.complete and found.entry.off.max() < 1e-9
    np.testing.assert_allclose(found.entry.feed, found.entry.depth, atol=1e-6)
    short = tunnel.analyze(arm, q, mouth=(1.602, 0, 0), depth=0.5, feed=0.3)
    assert not short.complete and "beyond the stretched chain" in short.why
    assert short.entry.depth[-1] == pytest.approx(0.3, abs=0.006)


def test_body_follows_a_line_in_space_behind_a_fed_base(arm):
    """Checked by Pinocchio; a chord's sagitta is what straight links cannot do without."""
    found = tunnel.analyze(arm, arm.configuration(), path=curve(), room=0.02, feed=1.0)
    assert found.complete, found.why
    e = found.entry
    for k in (20, 80, len(e.depth) - 1):
        off = off_by_pinocchio(arm, found.hole, e.depth[k], e.angles[k], e.feed[k])
        assert off == pytest.approx(e.off[k], abs=3e-4)
        points, _ = line_by_pinocchio(arm, e.angles[k])
        tip = points[0] + e.feed[k] * found.hole.inwards
        assert np.linalg.norm(tip - found.hole.at(e.depth[k])) == pytest.approx(
            e.tip_error[k], abs=1e-9
        )
    sagitta = 0.218**2 / (8 * 0.45)
    assert 0.5 * sagitta < e.off.max() < 1.5 * sagitta


def test_a_held_arm_folds_outside_and_goes_in_straight(arm):
    found = tunnel.analyze(arm, arm.configuration(), mouth=MOUTH)
    e = found.entry
    assert found.complete and e.off.max() < 2e-3 and e.tip_error.max() < 1e-4
    lower, upper, _ = arm.limits(arm.chain_joints)
    assert np.all(e.angles >= lower - 1e-9) and np.all(e.angles <= upper + 1e-9)
    assert np.abs(np.diff(e.angles, axis=0)).max() < 0.1  # no leap from fold to fold
    for k in (0, 30, len(e.depth) - 1):
        off = off_by_pinocchio(arm, found.hole, e.depth[k], e.angles[k], 0.0)
        assert off == pytest.approx(e.off[k], abs=3e-4)
        points, behind = line_by_pinocchio(arm, e.angles[k])
        outside = points[behind > e.depth[k] + 1e-3]
        assert (outside[:, 0] - MOUTH[0]).max() < 1e-3  # nothing reaches through the wall


def test_the_distance_is_converged_along_the_body_and_between_steps(arm):
    """2,000 points a link by Pinocchio give the same: 0.80 mm with 10 points, 0.83 mm in truth."""
    found = tunnel.analyze(arm, arm.configuration(), mouth=MOUTH)
    e, inwards = found.entry, found.hole.inwards

    def dense(depth, angles):
        points, behind = line_by_pinocchio(arm, angles, 2000)
        points = points - found.hole.points[0]
        inside = (behind < depth) & (points @ inwards > 0)
        across = points[inside] - np.outer(points[inside] @ inwards, inwards)
        return np.linalg.norm(across, axis=1).max(initial=0.0)

    worst = int(np.argmax(e.off))
    assert dense(e.depth[worst], e.angles[worst]) == pytest.approx(e.off.max(), abs=1e-6)
    assert 8.1e-4 < found.to_json()["body_off_max_m"] < 8.5e-4
    instants = [
        dense(*(0.5 * (x[k] + x[k + 1]) for x in (e.depth, e.angles)))
        for k in range(worst - 6, worst + 6)
    ]
    assert max(instants) <= e.between + 1e-6 and e.between < 1.2 * e.off.max()


def test_a_hole_too_tight_for_the_joints_says_how_far_it_gets(arm):
    s = np.linspace(0, 0.4, 60)
    tight = np.array([1.602, 0, 0]) + np.stack(
        [0.2 * np.sin(s / 0.2), 0.2 * (1 - np.cos(s / 0.2)), 0 * s], axis=1
    )
    how = {"feed": 1.0, "step": 0.01}
    found = tunnel.analyze(arm, arm.configuration(), path=tight, room=0.02, **how)
    assert not found.complete and 0.1 < found.entry.depth[-1] < 0.3
    assert "of 400 mm deep" in found.why and "mm" in dict(found.rows())["hole"]
    assert found.to_json()["complete"] is False
    looser = tunnel.analyze(arm, arm.configuration(), path=tight, room=0.03, **how)
    assert looser.entry.depth[-1] > found.entry.depth[-1]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "needs a hole"),
        ({"mouth": (2.5, 0, 0)}, r"misses the hole's mouth by .* beyond the stretched chain"),
        ({"mouth": (1, np.nan, 0)}, "NaN"),
        ({"mouth": MOUTH, "inwards": (0, 0, 0)}, "length 0"),
        ({"mouth": MOUTH, "room": 0.0}, "room = 0 m"),
        ({"mouth": MOUTH, "feed": -1.0}, "feed = -1 m"),
        ({"mouth": MOUTH, "step": 0.0}, "step = 0 m"),
        ({"path": [[1, 0, 0], [1, 0, 0]]}, "points 1 and the next are the same"),
    ],
)
def test_what_is_no_hole_is_refused(arm, given, says):
    with pytest.raises(AnalysisError, match=says):
        tunnel.analyze(arm, arm.configuration(), **given)


def test_nearest_point_of_a_line_by_brute_force():
    hole = Hole(curve(12), 0.01)
    rng = np.random.default_rng(1)
    places = hole.points[5] + 0.1 * rng.normal(size=(20, 3))
    on, along, arc = hole.nearest(places)
    dense = np.linspace(0, hole.arcs[-1], 20001)
    points = np.array([hole.at(s) for s in dense])
    for k, x in enumerate(places):
        far = np.linalg.norm(points - x, axis=1)
        assert far.min() - 3e-5 <= np.linalg.norm(on[k] - x) <= far.min() + 1e-12
        assert np.linalg.norm(hole.at(arc[k]) - on[k]) < 1e-12
        assert np.linalg.norm(along[k]) == pytest.approx(1.0)


def test_body_line_and_its_jacobian_by_differences(arm):
    chain = chain_of(arm, arm.configuration(), find_tip(arm))
    body, rng, h = Body(chain), np.random.default_rng(2), 1e-6
    full = rng.uniform(-0.5, 0.5, 12)
    J, gap = body.jacobians(full), rng.normal(size=12)
    there, back = (body.places(full + s * h * gap, np.zeros(3)) for s in (1, -1))
    np.testing.assert_allclose(J @ gap[chain.joints], (there - back) / (2 * h), atol=1e-8)
    size = np.linalg.norm(np.diff(body.places(0 * full, np.zeros(3)), axis=0), axis=1)
    np.testing.assert_allclose(np.cumsum(size), body.behind[1:], atol=1e-12)


def test_servos_lead_the_body_in(arm):
    recording = run(arm, "tunnel", ideal=True, options={"depth": 0.1, "duration": 4.0})
    found = recording.metrics
    assert recording.verdict.passed, recording.verdict.summary()
    assert found["body_off_max_m"] == pytest.approx(found["planned_body_off_max_m"], abs=2e-4)
    lagging = run(
        arm, "tunnel", ideal=True, options={"depth": 0.1, "duration": 4.0, "lead": "none"}
    )
    assert lagging.metrics["position_max_m"] > 10 * found["position_max_m"]
    with pytest.raises(MissionError, match=r"lost .* of 600 mm deep"):
        run(arm, "tunnel", ideal=True, options={"depth": 0.6})
