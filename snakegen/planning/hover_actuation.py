"""What hover asks of the actuators along a motion: thrusts, gimbal angles and their rates.

The forces of the n apparatuses are the pseudo-inverse's (ZN23 eq 36): least ``Σ ‖f_j / L_j‖²`` with
``Σ f_j = m (g ẑ + a)`` and ``Σ p_j × f_j = 0``. With ``G = Q D² Qᵀ``, D the limits, that is
``f = D² Qᵀ G⁻¹ w``. An apparatus' first gimbal turns about its link's axis a, so that its angle is
that of f across a; beside a vertical link that angle is any, and turns as fast as it likes.
"""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats, skew
from snakegen.control.power import battery_joules, power_factors
from snakegen.planning.body import PlannedBody
from snakegen.planning.mounts import STEEP
from snakegen.planning.trajectory import Trajectory
from snakegen.robot.posture import turning_rates
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.scene.schema import Demands

HELD = 2.0  # s, of hover before and after a plan
FEWEST, MOST, EVERY = 6, 60, 0.15  # instants of each interval that are looked at; s, between them


@dataclass(frozen=True, eq=False)
class Actuation:
    """Thrusts and gimbals of m hovering poses, n apparatuses.

    Attributes:
        forces: (m, n, 3) N, world axes.
        thrust: (m, n) N.
        angles: (m, n, 2) rad, of the gimbal axis nearer to the link and of the other; continuous.
        across: (m, n) sine of the angle between thrust and the first gimbal axis: 0 where that
            gimbal does nothing.
    """

    forces: Floats
    thrust: Floats
    angles: Floats
    across: Floats


def hover_forces(points: Floats, limits: Floats, wrench: Floats) -> Floats:
    """Returns the pseudo-inverse's forces (m, n, 3) [N].

    Args:
        points: (m, n, 3) m, thrust points from the CoG.
        limits: (n,) N.
        wrench: (m, 6) or (6,) N, N·m, about the CoG.
    """
    m, n, _ = points.shape
    blocks = np.zeros((m, 6, n, 3))
    blocks[:, :3] = np.eye(3)[None, :, None, :]
    blocks[:, 3:] = skew_all(points).transpose(0, 2, 1, 3)
    q = blocks.reshape(m, 6, 3 * n)
    weight = np.repeat(np.asarray(limits, float) ** 2, 3)
    gram = (q * weight) @ q.transpose(0, 2, 1)
    answer = np.linalg.pinv(gram, rcond=1e-12, hermitian=True) @ np.broadcast_to(
        wrench, (m, 6)
    )[..., None]  # fmt: skip
    return np.asarray((weight[None, :, None] * q.transpose(0, 2, 1)) @ answer).reshape(m, n, 3)


def skew_all(points: Floats) -> Floats:
    """Returns (…, 3, 3) matrices of ``p ×``."""
    basis = np.array([skew(e) for e in np.eye(3)])
    return np.einsum("...k,kab->...ab", points, basis)


def actuation(body: PlannedBody, poses: Floats, acceleration: Floats | None = None) -> Actuation:
    """Returns what poses (m, 6 + k) ask of the actuators.

    Args:
        body: that hovers.
        poses: in order along a motion, so near to each other that angles are continuous.
        acceleration: (m, 3) m/s², of the CoG; 0 if absent.
    """
    mounts = body.mounts
    points, turns = [], []
    for pose in poses:
        points.append(body.at_pose(pose).points)
        turns.append(np.array([body.data.oMi[j].rotation for j in mounts.joint]))
    wrench = np.zeros((len(poses), 6))
    wrench[:, 2] = body.mass * GRAVITY
    if acceleration is not None:
        wrench[:, :3] += body.mass * acceleration
    forces = hover_forces(np.array(points), np.asarray(body.sets.high), wrench)
    thrust = np.linalg.norm(forces, axis=2)
    unit = forces / np.maximum(thrust, 1e-9)[..., None]
    turn = np.array(turns)
    along, side, zero = (
        np.einsum("mnij,nj,mni->mn", turn, axes, unit)
        for axes in (mounts.axis, body.sides, body.zero_thrusts)
    )
    first = np.unwrap(np.arctan2(side, zero), axis=0)
    across = np.hypot(side, zero)
    return Actuation(forces, thrust, np.stack([first, np.arctan2(along, across)], axis=2), across)


def actuator_use(body: PlannedBody, path: Trajectory, demands: Demands) -> Floats:
    """Returns the largest share (m - 1,) of a rate limit that each interval of a path takes.

    Limits are those demanded, and half of what the gimbals' servos turn at: the other half is for
    the control. Beside a vertical link (`STEEP`) the first gimbal's rate does not count.

    Args:
        body: that hovers along it.
        path: over time.
        demands: with `gimbal_rate` and `thrust_rate`.
    """
    count = int(np.clip(np.ceil(np.diff(path.times).max() / EVERY), FEWEST, MOST))
    share = np.linspace(0.0, 1.0, count + 1)
    times = (path.times[:-1, None] + share[:-1] * np.diff(path.times)[:, None]).ravel()
    times = np.append(times, path.times[-1])
    found = actuation(body, path.at(times), path.at(times, 2)[:, :3])
    step = np.diff(times)
    turned = np.abs(np.diff(found.angles, axis=0)) / step[:, None, None]
    beside = np.minimum(found.across[1:], found.across[:-1]) < STEEP
    turned[..., 0] = np.where(beside, 0.0, turned[..., 0])
    servos = gimbal_rates(body.robot)
    limit = np.minimum(demands.gimbal_rate, 0.5 * servos)
    changed = np.abs(np.diff(found.thrust, axis=0)) / step[:, None] / demands.thrust_rate
    use = np.concatenate([(turned / limit).reshape(len(step), -1), changed], axis=1).max(axis=1)
    return np.asarray(use.reshape(-1, count).max(axis=1))


def battery_share(body: PlannedBody, path: Trajectory) -> float:
    """Returns the share of the battery's energy that hover along a path takes; 0 if it is endless.

    With 2 s of hover before and after, as plans are flown. Rotors of an apparatus share its thrust.
    """
    robot = body.robot
    energy = battery_joules(float(robot.modules.plant.get("battery_energy", 0.0)))
    if not np.isfinite(energy):
        return 0.0
    times = np.linspace(0.0, path.times[-1], 60)
    thrust = actuation(body, path.at(times)).thrust
    owner = robot.rotors.apparatus
    each = thrust[:, owner] / np.bincount(owner)[owner]
    power = each**1.5 @ power_factors(robot)
    held = 2.0 * HELD * 0.5 * (power[0] + power[-1])
    return float((np.trapezoid(power, times) + held) / energy)


def gimbal_rates(robot: Robot) -> Floats:
    """Returns how fast gimbals turn, (n, 2) rad/s: the one nearer to the link, the other."""
    rows = []
    for j, apparatus in enumerate(robot.modules.apparatuses):
        names = [apparatus.roll, apparatus.pitch]
        if robot.gimbals.pitch_body[j] < robot.gimbals.roll_body[j]:
            names = names[::-1]
        rows.append(turning_rates(robot, [n for n in names if n]))
    return np.array(rows)
