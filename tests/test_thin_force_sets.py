"""Discs and segments, whose wrenches have hardly any extent some way where rotors do not drag.

Bounds against linear programs: discs are polygons within them, or about them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.analysis.allocation import allocation
from snakegen.kernels.core.inverse import invert
from snakegen.kernels.margins.convex_pieces import pieces_into
from snakegen.kernels.margins.inner_radius import insert, simplex
from snakegen.kernels.margins.limited_margins import empty_pieces
from snakegen.kernels.margins.section_radius import section
from snakegen.kernels.margins.slice_program import maximise, new_basis, refresh, start
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.inputs import force_map
from snakegen.wrench_margins.vectored import set_margins

DATA = Path(__file__).parent / "data"
SIDES = 64
FORCE, TORQUE = slice(0, 3), slice(3, 6)
WHOLE = [-np.pi, np.pi]
POLYGON = 1.0 / np.cos(np.pi / SIDES) - 1.0  # by which a polygon about a disc passes it


def corners(sets, stretch):
    """Returns wrenches (6, k) whose mixtures, one for each apparatus, are polygons; (n, k) whose.

    Angles of an arc are no farther apart than those of a polygon of `SIDES`; `stretch` lengthens
    what is not a fixed rotor's.
    """
    columns, owner = [], []
    for j, (least, most) in enumerate(sets.phi):
        fixed = least == most
        count = 1 if fixed else int(np.ceil((most - least) / (2 * np.pi) * SIDES)) + 1
        thrusts = sets.high[j] * (1.0 if fixed else stretch), sets.low[j]
        for angle in np.linspace(least, most, count):
            for thrust in thrusts:
                force = np.zeros((len(sets), 3))
                force[j] = thrust * sets.frames[j] @ [0.0, -np.sin(angle), np.cos(angle)]
                columns.append(force_map(sets.points, sets.drag) @ force.ravel())
                owner.append(j)
    return np.array(columns).T, np.eye(len(sets))[owner].T


def program(sets, hover, part, stretch, first, rng):
    """Returns the radius of a slice: from a few directions to the facets that they hit."""
    wrenches, share = corners(sets, stretch)
    best = np.inf
    for e in [first, *rng.normal(size=(3, 3))]:
        before = np.inf
        for _ in range(8):
            push = np.zeros(6)
            push[part] = e / np.linalg.norm(e)
            found = linprog(
                np.r_[np.zeros(wrenches.shape[1]), -1.0],
                A_eq=np.block([[wrenches, -push[:, None]], [share, np.zeros((len(share), 1))]]),
                b_eq=np.r_[hover, np.ones(len(share))],
            )
            best, e = min(best, found.x[-1]), found.eqlin.marginals[:6][part]
            if found.x[-1] >= before * (1.0 - 1e-6) or not e.any():
                break
            before = found.x[-1]
    return best


def check(sets, hover, force_scale, torque_scale, parts=(FORCE, TORQUE)):
    """Compares bounds with linear programs; they are a thousandth apart, whatever the drag."""
    scale = {"force_scale": force_scale, "torque_scale": torque_scale}
    m, rng = set_margins(sets, hover, wrench_starts=0, **scale), np.random.default_rng(0)
    assert m.feasible and not m.hull and m.closed
    for part in parts:
        k = 1 + part.start // 3
        low, high = m.bounds[k]
        least = program(sets, hover, part, 1.0, m.twists[k, part], rng)
        most = program(sets, hover, part, 1.0 + POLYGON, m.twists[k, part], rng)
        assert low <= most * (1.0 + 1e-6)
        assert least * (1.0 - 1e-6) <= high <= most * (1.0 + 1.1e-3)
        assert high - low <= 1e-3 * high and high > 0.0
    return m


@pytest.fixture(scope="module")
def tilting():
    """Returns four arms with one tilt axis each, and their hover and scales."""
    robot = snakegen.load(DATA / "one_axis_tilt.urdf", modules=DATA / "one_axis_tilt.modules.yaml")
    q = robot.configuration()
    given = allocation(robot, q).hover_wrench, robot.force_scale, robot.torque_scale
    return robot.force_sets(q), given


@pytest.mark.parametrize("drag", [0.0, 1e-5, 1e-3, 0.016, (1e-3, 1e-3, -1e-3, 0.0)])
def test_one_tilt_axis_each_at_any_drag(tilting, drag):
    sets, given = tilting
    signs = np.sign(sets.drag) if np.ndim(drag) == 0 else np.ones(4)
    m = check(replace(sets, drag=drag * signs), *given)
    assert 19.9 < m.force <= 20.0 and 3.76 < m.torque < 3.78


@pytest.mark.parametrize("limit", [0.8, 1.5])
def test_one_limited_tilt_axis_each_without_drag(tilting, limit):
    sets, given = tilting
    phi = np.tile([-limit, limit], (4, 1))
    check(replace(sets, drag=np.zeros(4), phi=phi), *given)


def test_reversible_rotors_without_drag():
    robot = snakegen.load(DATA / "reversible.urdf", modules=DATA / "reversible.modules.yaml")
    q = robot.configuration()
    sets = replace(robot.force_sets(q), drag=np.zeros(8))
    check(sets, allocation(robot, q).hover_wrench, robot.force_scale, robot.torque_scale)


def test_three_arms_of_which_one_tilts_without_drag():
    turns = 2.0 * np.pi / 3.0 * np.arange(3)
    points = 0.25 * np.stack([np.cos(turns), np.sin(turns), np.zeros(3)], axis=1)
    phi = np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, 1.0]])
    sets = ForceSets.checked(points, ring(3, 0.0), 0.0, 8.0, phi, [0.0, 0.0])
    m = set_margins(sets, [0, 0, 12, 0, 0, 0], force_scale=12, torque_scale=3, wrench_starts=0)
    assert m.rank == 4 and m.feasible and m.closed and m.force == m.torque == 0.0


def ring(count, turn):
    """Returns frames (n, 3, 3) of discs round z; `turn`, rad, 0 for tilt axes along the arms."""
    angles = 2.0 * np.pi / count * np.arange(count) + turn
    return Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()


def test_held_torques_that_little_drag_alone_gives():
    """A newton along costs thousands of held torque units: more than artificial columns cost."""
    turns, height = 2.0 * np.pi / 5.0 * np.arange(5), [-0.078, -0.076, 0.080, -0.009, 0.083]
    points = np.stack([0.25 * np.cos(turns), 0.25 * np.sin(turns), height], axis=1)
    drag = [1e-4, 1e-4, 1e-4, -1e-4, 1e-4]
    limits = [-0.8, 0.8]
    sets = ForceSets.checked(points, ring(5, np.pi / 2), 0.0, 10.0, limits, [0.0, 0.0], drag)
    m = check(sets, np.array([0, 0, 13.4843, 0, 0, 0]), 13.4843, 3.3711, (FORCE,))
    assert 0.4 < m.force < 0.6


def test_a_body_of_rotation_closes():
    """Every direction round the axis is the worst one: hundreds of supports."""
    points = 0.25 * ring(7, 0.0)[:, :, 0]
    sets = ForceSets.checked(points, ring(7, np.pi / 2), 0.0, 10.0, WHOLE, [0.0, 0.0])
    m = check(sets, np.array([0, 0, 30.0, 0, 0, 0]), 30.0, 7.5, (FORCE,))
    assert m.rank == 5 and m.torque == 0.0


def test_flat_faces_do_not_tear_the_polytope():
    """Many points lie in one face, but for the rounding of their forces."""
    drag = 1e-3 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    points, frames = 0.25 * ring(6, 0.0)[:, :, 0], ring(6, np.pi / 2)
    sets = ForceSets.checked(points, frames, 0.0, 10.0, [-0.8, 0.8], [0.0, 0.0], drag)
    m = check(sets, np.array([0, 0, 20.9, 0, 0, 0]), 20.9, 5.225)
    assert m.calls[0] < 100


def test_a_spoilt_inverse_is_repaired(tilting):
    sets, (hover, force, torque) = tilting
    hull, unit = sets.hull((force, torque)), hover / np.repeat([force, torque], 3)
    held, basis, twist, forces = section(False), new_basis(3, 4), np.empty(6), np.empty((4, 3))
    start(held, hull, unit, basis)
    cost = np.array([0.6, 0.0, 0.8, 0, 0, 0])
    exact = maximise(cost, held, unit, hull, 1e-4, basis, forces, twist)
    for spoilt in (1e-7, 1e-3, 3.0):
        noise = np.random.default_rng(0).normal(size=basis.inverse.shape)
        basis.inverse[:] += spoilt * np.abs(basis.inverse).max() * noise
        low, high = maximise(cost, held, unit, hull, 1e-4, basis, forces, twist)
        assert exact[0] * (1 - 1e-4) <= low <= high <= exact[1] * (1 + 1e-4)
        wrench = force_map(hull.points[:, :3], hull.points[:, 3]) @ forces.ravel()
        assert np.abs((wrench - unit)[3:]).max() < 1e-7
        assert low == pytest.approx(cost @ (wrench - unit), abs=1e-9)
        assert np.linalg.norm(forces, axis=1).max() <= hull.high[0] * (1 + 1e-8)


def test_a_basis_is_inverted_or_called_singular():
    rng, out = np.random.default_rng(1), np.empty((7, 7))
    for _ in range(20):
        a = rng.normal(size=(7, 7))
        a[0, 0] = 0.0
        assert invert(a.copy(), out)
        np.testing.assert_allclose(out, np.linalg.inv(a), rtol=1e-8, atol=1e-9)
    a[:, 3] = a[:, 5]
    assert not invert(a, out)
    basis = new_basis(3, 4)
    basis.owner[:] = [0, 0, 0, 0, 1, 2, 3]  # a force of the first in four columns
    assert not refresh(section(False), basis)


def test_the_piece_of_a_disc_is_the_stronger_way_of_its_rotor():
    hull = ForceSets.checked([[0, 0, 0]], [np.eye(3)], -10.0, 5.0, WHOLE, [0.0, 0.0]).hull()
    convex = empty_pieces(hull)
    pieces_into(np.array([[0.0, 0.0, 1.0]]), hull, convex)
    assert convex.high[0] == 10.0


def test_a_torn_polytope_is_called_so():
    """A fan that outgrows its arrays is not written beside them."""
    points = np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 2.0)])
    facets, planes = np.empty((8, 3), np.int64), np.empty((8, 4))
    edges, count = np.empty((60, 2), np.int64), simplex(points, 6, facets, planes)[0]
    assert count == 4
    facets, planes = facets[:4].copy(), planes[:4].copy()
    assert insert(points, 6, facets, planes, count, edges, 1e-9)[0] == 0
