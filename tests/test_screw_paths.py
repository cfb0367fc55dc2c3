"""Paths of a screw drive: joints that follow the leader, headings, waypoints, the law of time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from snakegen.analysis.screw_drive import (
    follow_the_leader,
)
from snakegen.errors import AnalysisError
from snakegen.kernels.screw.constraints import follow
from snakegen.screw_drive.ground_paths import (
    TimeLaw,
    l_crank,
    path_length,
    path_pieces,
    path_points,
    s_curve,
    waypoints,
)


def turn(x, y, angle):
    """Rotates a planar vector; works on complex numbers, for complex-step derivatives."""
    return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


PATHS = [
    l_crank(),
    s_curve(0.5, 1.0),
    [("arc", 2 * math.pi, 0.4), ("line", 0.1), ("arc", -4.0, 0.3)],
    [("line", 0.05)] + [("arc", 0.3, 0.5), ("line", 0.03), ("arc", -0.4, 0.6)] * 4,
]


@pytest.mark.parametrize("path", PATHS)
def test_every_joint_lies_on_the_path_behind_the_one_before(path):
    links = np.array([0.226, 0.3, 0.15, 0.2])
    dense = np.linspace(-1.5, path_length(path) + 0.5, 60_001)
    on_path = path_points(path, dense)[:, :2]
    for s in np.linspace(-0.3, path_length(path) + 0.4, 5):
        w = follow_the_leader(path, s, links)
        psi = np.cumsum(w[2:])
        nodes = w[:2] + np.vstack(
            [
                [0, 0],
                np.cumsum(links[:, None] * np.column_stack([np.cos(psi), np.sin(psi)]), axis=0),
            ]
        )
        at = s
        for node, chord in zip(nodes[1:], links, strict=True):
            # The first sample, going back along the path, that is a chord away from the last node.
            k = int(np.searchsorted(dense, at)) - 1
            origin = path_points(path, [at])[0, :2]
            while math.dist(on_path[k], origin) < chord:
                k -= 1
            at = dense[k] + (math.dist(on_path[k], origin) - chord)
            assert math.dist(path_points(path, [at])[0, :2], node) < 5e-5


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.5, 4.0), st.integers(0, len(PATHS) - 1))
def test_reference_rate_is_its_derivative(s, which):
    pieces, links, h = path_pieces(PATHS[which]), np.full(5, 0.226), 1e-6
    w, rate = follow(pieces, s, links)
    ahead, behind = follow(pieces, s + h, links)[0], follow(pieces, s - h, links)[0]
    # Where a node passes from piece to piece the one-sided slopes differ: either may be it.
    slopes = np.stack([(ahead - w) / h, (w - behind) / h])
    assert (np.abs(slopes - rate).min(axis=0) < 1e-4).all()


def test_follow_the_leader_at_rest_and_on_the_arc():
    assert np.allclose(follow_the_leader([("line", 1)], 0.4, [0.2, 0.3]), [0.4, 0, -math.pi, 0])
    left = follow_the_leader([("arc", 6.0, 0.6)], 3.0, np.full(4, 0.226))
    assert np.allclose(np.degrees(left[3:]), -21.71, atol=5e-3)  # THEORY B: -21.7°
    right = follow_the_leader([("arc", -6.0, 0.6)], 3.0, np.full(4, 0.226))
    assert np.allclose(right[3:], -left[3:]) and np.isclose(right[1], -left[1])


def test_heading_runs_on_through_whole_turns():
    loop = [("arc", 2 * math.pi, 0.5)] * 3
    w = follow_the_leader(loop, path_length(loop) + 2.0, np.full(4, 0.226))
    assert np.isclose(w[2], 6 * math.pi - math.pi) and np.abs(w[3:]).max() < 1e-9


@pytest.mark.parametrize(
    "path", [[("arc", 1.0, -0.2)], [("line", -1.0)], [("bend", 1.0)], [("line", math.nan)], [7]]
)
def test_a_bad_piece_is_named(path):
    with pytest.raises(AnalysisError, match="path piece 1"):
        follow_the_leader([("line", 1.0), *path], 0.0, [0.2, 0.2])


def test_waypoints_pass_their_legs_and_refuse_a_radius_that_does_not_fit():
    points = np.array([[0.5, 0.2], [1.5, 0.2], [1.5, 1.4], [0.2, 2.0]])
    path, (x, y, heading) = waypoints(points, 0.3)
    end = path_points(path, [path_length(path)])[0]
    assert np.allclose(np.add((x, y), turn(*end[:2], heading)), points[-1], atol=1e-12)
    assert np.isclose(end[2] + heading, math.atan2(0.6, -1.3))
    with pytest.raises(AnalysisError, match=r"at most (\S+) m fits") as refusal:
        waypoints(points, 5.0)
    fits = float(str(refusal.value).split("at most ")[1].split()[0])
    waypoints(points, fits * 0.999)
    with pytest.raises(AnalysisError):
        waypoints(points, fits * 1.001)


@pytest.mark.parametrize("acceleration", [0.4, 0.05, math.inf])
def test_time_law_keeps_its_limits_and_rests_between_stretches(acceleration):
    law = TimeLaw((1.2, 0.3, 1.2), 0.2, acceleration)
    t = np.linspace(0, law.duration, 20_001)
    s, v = np.array([law.at(x) for x in t]).T
    assert np.isclose(s[-1], 2.7) and v.max() <= 0.2 + 1e-12 and v.min() >= 0
    assert np.abs(np.gradient(s, t)[1:-1] - v[1:-1]).max() < (1e-3 if acceleration < 1 else 0.11)
    if acceleration < 1:
        assert np.abs(np.diff(v) / np.diff(t)).max() <= acceleration * (1 + 1e-6)
        assert abs(v[np.searchsorted(s, 1.2)]) < 0.02
