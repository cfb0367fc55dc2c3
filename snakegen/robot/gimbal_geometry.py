"""Gimbals seen from the CoG frame, in NumPy: where a thrust points, and which angles point it.

The readable twins of kernels in `kernels/allocation/gimbals.py`, which names the rows of a
geometry. Thrust direction and point of an apparatus are ``A exp(w1 x1) exp(w2 x2) u`` and
``o + A exp(w1 x1) (t + exp(w2 x2) f)``; joint 1 is nearer to the link, absent axes are zero.
"""

import numpy as np

from snakegen.base.geometry import Floats, rotation_about
from snakegen.kernels.allocation.gimbals import AXIS, EXTRA, FIRST, LEVER, ORIGIN, POINT, SECOND
from snakegen.kernels.core.types import Gimbals, Rotors, Tree

LOST = 1e-12  # of 1 - cos²: a thrust this near to joint 1's axis does not turn with it
OFF = 1e4  # weight of a direction missed against angles travelled, rad²


def mounts(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    rotation: Floats,
    position: Floats,
    cog: Floats,
    axes: Floats,
) -> tuple[Floats, Floats]:
    """Returns the gimbals' geometry in the CoG frame, free of the gimbal angles.

    Args:
        tree, rotors, gimbals: the robot.
        rotation: (n, 3, 3) world attitudes of the bodies.
        position: (n, 3) m, world origins of the bodies.
        cog: (3,) m, world; held fixed while the gimbals turn.
        axes: (3, 3) attitude of the CoG frame in the world.

    Returns:
        mounts (Ñ, 10, 3), and per rotor (n_rotors, 3, 3): its point, its axis (both like f, u),
        and [torque ratio, apparatus, 0].
    """
    n = len(gimbals.link_body)
    m, turned = np.zeros((n, 10, 3)), np.tile(np.eye(3), (n, 1, 1))
    for j in range(n):
        near, far = sorted((gimbals.roll_body[j], gimbals.pitch_body[j]))
        if far >= 0:
            turned[j] = tree.rotation[far]
            m[j, LEVER], m[j, SECOND] = tree.translation[far], turned[j] @ tree.axis[far]
        if near >= 0:
            body, frame = near, rotation[tree.parent[near]] @ tree.rotation[near]
            m[j, FIRST] = tree.axis[near]
        else:
            body = tree.parent[far] if far >= 0 else gimbals.thrust_body[j]
            frame = rotation[body]
        m[j, :3], m[j, ORIGIN] = axes.T @ frame, axes.T @ (position[body] - cog)
        m[j, POINT] = turned[j] @ gimbals.thrust_point[j]
        m[j, AXIS] = turned[j] @ gimbals.thrust_axis[j]
        drag = rotors.torque_ratio[rotors.apparatus == j]
        m[j, EXTRA, :2] = (
            drag.sum() / max(drag.size, 1),
            gimbals.pitch_body[j] < gimbals.roll_body[j],
        )
    own = turned[rotors.apparatus]
    extra = np.column_stack([rotors.torque_ratio, rotors.apparatus, np.zeros(len(rotors.body))])
    rows = [np.einsum("rij,rj->ri", own, x) for x in (rotors.position, rotors.axis)]
    return m, np.stack([*rows, extra], axis=1)


def thrust_line(m: Floats, j: int, x: Floats, u: Floats, p: Floats) -> None:
    """Writes the thrust direction u (3,) and point p (3,) [m] of apparatus j at angles x (2,)."""
    once, twice = turned(m, j, x)
    u[:], p[:] = twice @ m[j, AXIS], m[j, ORIGIN] + once @ m[j, LEVER] + twice @ m[j, POINT]


def turned(m: Floats, j: int, x: Floats) -> tuple[Floats, Floats]:
    """Returns ``A exp(w1 x1)`` and ``A exp(w1 x1) exp(w2 x2)``."""
    once = m[j, :3] @ rotation_about(m[j, FIRST], x[0])
    return once, once @ rotation_about(m[j, SECOND], x[1])


def point_thrust(
    m: Floats, j: int, direction: Floats, last: Floats, lower: Floats, upper: Floats, out: Floats
) -> None:
    """Writes the angles (x1, x2) that turn apparatus j's thrust along `direction`.

    With p = exp(w2 x2) u the thrust before joint 1 turns it onto q: ``w1·p = w1·q`` and
    ``w2·p = w2·u`` give ``p = a w1 + b w2 ± h w1 × w2``. Of the two solutions and their whole
    turns, the one within limits nearest to `last`. Where joint 1 has no effect (ZN23's θ = ±90°)
    it keeps its last angle. An axis that is absent, or a limit, leaves the nearest direction.

    Args:
        m: (Ñ, 10, 3) from `mounts`.
        j: the apparatus.
        direction: (3,) unit, CoG axes.
        last: (2,) rad, angles of joints 1 and 2 to stay near.
        lower, upper: (2,) rad, limits of joints 1 and 2.
        out: (2,) rad.
    """
    q, w1, w2, u = m[j, :3].T @ direction, m[j, FIRST], m[j, SECOND], m[j, AXIS]
    axes = [(k, w) for k, w in enumerate((w1, w2)) if w @ w > 0.5]
    out[:] = last
    if len(axes) < 2:
        for k, w in axes:
            out[k] = _within(_angle_about(w, u, q), last[k], lower[k], upper[k])
        return
    skewed, along1, along2, twist = w1 @ w2, w1 @ q, w2 @ u, _cross(w1, w2)
    bulk = twist @ twist
    a, b = (along1 - skewed * along2) / bulk, (along2 - skewed * along1) / bulk
    rest = 1.0 - a * a - b * b - 2.0 * a * b * skewed
    height, lost, best = np.sqrt(max(rest, 0.0) / bulk), 1.0 - along1 * along1 < LOST, np.inf
    for sign in (1.0, -1.0):
        middle, x = a * w1 + b * w2 + sign * height * twist, np.array(last)
        if not lost:
            x[0] = _within(_angle_about(w1, middle, q), last[0], lower[0], upper[0])
        x[1] = _within(_angle_about(w2, u, middle), last[1], lower[1], upper[1])
        distance = float((x - last) @ (x - last))
        if rest < 0.0 or lost or not ((lower < x) & (x < upper)).all():  # else it is met
            distance += OFF * (1.0 - float(turned(m, j, x)[1] @ u @ direction))
        if distance < best:
            best, out[:] = distance, x


def joint_order(m: Floats, angles: Floats) -> Floats:
    """Returns (Ñ, 2) angles reordered between [roll, pitch] and [joint 1, joint 2]."""
    pitch_first = m[:, EXTRA, 1] > 0.5
    return np.where(pitch_first[:, None], angles[:, ::-1], angles)


def _cross(a: Floats, b: Floats) -> Floats:
    """Returns a × b of two vectors (3,), in a tenth of the time that `np.cross` takes."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _angle_about(w: Floats, a: Floats, b: Floats) -> float:
    """Returns the angle [rad] about unit w that turns a's part across w onto b's."""
    return float(np.arctan2(w @ _cross(a, b), a @ b - (w @ a) * (w @ b)))


def _within(x: float, last: float, lower: float, upper: float) -> float:
    """Returns the angle equal to x modulo 2π nearest to `last` within limits, else the nearest."""
    x += 2.0 * np.pi * round((last - x) / (2.0 * np.pi))
    for turned in (x, x - 2.0 * np.pi, x + 2.0 * np.pi):
        if lower <= turned <= upper:
            return turned
    return float(np.clip(x, lower, upper))
