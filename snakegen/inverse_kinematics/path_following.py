"""Inverse kinematics of a robot's tip: reach a point, follow a path, enter through a port."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.kinematics.chain import forward
from snakegen.kernels.kinematics.inverse_kinematics import Flags, damped_right_inverse, limited_step
from snakegen.kernels.kinematics.jacobians import tip_jacobian
from snakegen.robot.robot import Robot
from snakegen.statics.tip import Tip


@dataclass(frozen=True)
class Port:
    """A round opening that the body must pass: centre (3,) m, unit axis (3,), radius m."""

    centre: Floats
    axis: Floats
    radius: float


@dataclass(frozen=True)
class Chain:
    """The joints that move a tip, on plain arrays.

    Attributes:
        robot: whose joints.
        tip: the point that follows.
        base: (3, 3) attitude of the held base.
        joints: (k,) indices of the moving joints in the tree's angles.
        lower, upper: (k,) rad.
        scale: m, length against which singular values are judged.
    """

    robot: Robot
    tip: Tip
    base: Floats
    joints: Floats
    lower: Floats
    upper: Floats
    scale: float


@dataclass(frozen=True)
class Options:
    """How a path is followed.

    Attributes:
        dt: s, between samples of the path.
        gain: 1/s of the closed loop; 0 integrates open loop as ZS24 eq 5 does, and drifts.
        corrections: Newton steps after each sample at most; 0 is the pure rate loop.
        tolerance: m, tip error at which corrections stop.
        give_up: m, tip error at which the path counts as lost.
        posture: (k,) rad, preferred angles in the null space; mid-range if absent.
        pull: 1/s, how fast the preferred motion is followed.
        floor: σ_min / scale below which the inverse is damped.
        damping: λ / scale at σ_min = 0.
        port: opening to pass.
        port_rate: rad/s, largest joint rate on the port's behalf.
    """

    dt: float = 0.01
    gain: float = 10.0
    corrections: int = 1
    tolerance: float = 1e-6
    give_up: float = 1e-3
    posture: Floats | None = None
    pull: float = 1.0
    floor: float = 0.02
    damping: float = 0.02
    port: Port | None = None
    port_rate: float = 2.0


@dataclass(frozen=True)
class Track:
    """What became of a path.

    Attributes:
        angles: (m, k) rad, joints that move, up to the last sample reached.
        tip: (m, 3) m, the tip's places.
        error: (m,) m, distance to the path's samples.
        rank: (m,) of the task Jacobian.
        sigma: (m, 3) singular values of the tip's position Jacobian / scale.
        reached: samples reached before the path was lost; all of them if it was not.
        length: m, arc length reached; `whole` m, of the path.
        whole: see above.
        held: names of joints at a limit where it was lost.
        clearance: m, least room between backbone and port rim; inf without a port.
    """

    angles: Floats
    tip: Floats
    error: Floats
    rank: Floats
    sigma: Floats
    reached: int
    length: float
    whole: float
    held: tuple[str, ...]
    clearance: float

    @property
    def complete(self) -> bool:
        """Tells whether the whole path was followed."""
        return self.length >= self.whole


def chain_of(robot: Robot, q: Floats, tip: Tip) -> Chain:
    """Returns the chain joints between base and `tip`; the base is held as in q."""
    above, body = set(), tip.body
    while body > 0:
        above.add(body)
        body = int(robot.tree.parent[body])
    names = [n for n in robot.chain_joints if robot.body_of_joint(n) in above]
    if not names:
        raise AnalysisError(f"{robot.name}: no joint moves the tip on '{tip.link}'.")
    lower, upper, _ = robot.limits(names)
    index = np.array([robot.body_of_joint(n) - 1 for n in names], int)
    reach = float(np.sum(np.linalg.norm(robot.tree.translation[sorted(above)], axis=1)))
    scale = max(reach + float(np.linalg.norm(tip.point)), 1e-9)
    return Chain(robot, tip, robot.base_pose(q)[0], index, lower, upper, scale)


def place(chain: Chain, full: Floats) -> tuple[Floats, Floats]:
    """Returns the tip's position (3,) m from the base origin and its Jacobian (3, k)."""
    tip = chain.tip
    position, _, J = tip_jacobian(chain.robot.tree, chain.base, full, tip.body, tip.point)
    return position, J[:3, chain.joints]


def reach_point(
    chain: Chain, full: Floats, target: Floats, options: Options, iterations: int = 200
) -> tuple[Floats, float, tuple[str, ...]]:
    """Returns the tree's angles that bring the tip to `target`, the distance left [m], and the
    joints held at a limit there.

    A straight arm cannot start along its own axis: where the first step is lost to a singular
    posture, the joints are bent by a fixed small amount first.
    """
    best, left, held = _approach(chain, full, target, options, iterations)
    bend = np.where(np.arange(len(chain.joints)) % 4 < 2, 0.2, -0.2)
    for amount in (1.0, -1.0, 2.0):
        if left <= options.tolerance:
            break
        bent = full.copy()
        start = bent[chain.joints] + amount * bend
        bent[chain.joints] = np.clip(start, chain.lower, chain.upper)
        found = _approach(chain, bent, target, options, iterations)
        if found[1] < left:
            best, left, held = found
    return best, left, held


def _approach(
    chain: Chain, full: Floats, target: Floats, options: Options, iterations: int
) -> tuple[Floats, float, tuple[str, ...]]:
    """Returns where damped Newton steps of at most a tenth of the reach end."""
    full = full.copy()
    left, held = np.inf, np.zeros(len(chain.joints), bool)
    best = full.copy(), left, held
    for _ in range(iterations):
        position, J = place(chain, full)
        e = target - position
        left = float(np.linalg.norm(e))
        if left < best[1]:
            best = full.copy(), left, held
        if left <= options.tolerance:
            break
        e *= min(1.0, 0.1 * chain.scale / left)
        # Far away the preferred posture keeps the arm off its limits; near by only the tip counts.
        ease = 0.05 if left > 1e-3 * chain.scale else 0.0
        drift = ease * (_preferred(chain, options) - full[chain.joints])
        held = _move(chain, full, J, e, drift, options)
    return best[0], best[1], _names(chain, best[2])


def follow(chain: Chain, full: Floats, path: Floats, options: Options) -> Track:
    """Follows a path by resolved rates: ``q̇ = J⁺(ẋ_d + K e) + (E - J⁺J) q̇_0``, step by step.

    Args:
        chain: from `chain_of`.
        full: (n-1,) the tree's angles at the start, tip on the path's first sample.
        path: (m, 3) m from the base origin, world axes; a sample every `options.dt`.
        options: the loop.
    """
    full = full.copy()
    preferred = _preferred(chain, options)
    arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    rows, held, clearance = [], np.zeros(len(chain.joints), bool), np.inf
    lost = False
    for i, target in enumerate(path):
        position, J = place(chain, full)
        if i > 0:
            feed = path[i] - path[i - 1]
            e = feed + options.gain * options.dt * (path[i - 1] - position)
            drift = options.pull * options.dt * (preferred - full[chain.joints])
            held = _move(chain, full, J, e, drift, options, options.port)
            for _ in range(options.corrections):
                position, J = place(chain, full)
                if np.linalg.norm(target - position) <= options.tolerance:
                    break
                none = np.zeros(len(chain.joints))
                held = _move(chain, full, J, target - position, none, options)
        position, J = place(chain, full)
        error = float(np.linalg.norm(target - position))
        lost = error > options.give_up
        if lost:
            break
        if options.port is not None:
            clearance = min(clearance, _clearance(chain, full, options.port))
        sigma = np.linalg.svd(J, compute_uv=False) / chain.scale
        rank = int(np.sum(sigma > 1e-6 * sigma[0]))
        rows.append((full[chain.joints].copy(), position, error, rank, sigma))
    reached = len(rows)
    if reached == 0:
        raise AnalysisError(
            f"the path starts {error * 1e3:.3g} mm from the tip; reach its first point first."
        )
    columns = [np.array(c) for c in zip(*rows, strict=True)]
    at_limit = _names(chain, held) if lost else ()
    return Track(
        columns[0], columns[1], columns[2], columns[3], columns[4],
        reached, float(arcs[reached - 1]), float(arcs[-1]), at_limit, clearance,
    )  # fmt: skip


def _preferred(chain: Chain, options: Options) -> Floats:
    """Returns the posture (k,) that the null space is spent on."""
    middle = 0.5 * (chain.lower + chain.upper)
    return middle if options.posture is None else options.posture


def _move(
    chain: Chain,
    full: Floats,
    J: Floats,
    e: Floats,
    preferred: Floats,
    options: Options,
    port: Port | None = None,
) -> Flags:
    """Moves `full` by one limited step; the null space serves the port, then `preferred`.

    Returns the joints held at a limit (k,).
    """
    floor, most = options.floor * chain.scale, options.damping * chain.scale
    if port is not None:
        off, rows = _crossing(chain, full, port)
        if len(off):
            inverse = damped_right_inverse(J, floor, most)[0]
            spare = np.eye(J.shape[1]) - inverse @ J
            taken = inverse @ e + spare @ preferred
            pull = damped_right_inverse(rows @ spare, floor, most)[0]
            turn = pull @ (-0.2 * off - rows @ taken)
            # A body far off the port comes in gradually: a long step would lose the path.
            preferred = preferred + turn * min(
                1.0, options.port_rate * options.dt / max(float(np.max(np.abs(turn))), 1e-12)
            )
    at = full[chain.joints]
    below, above = np.minimum(chain.lower - at, 0.0), np.maximum(chain.upper - at, 0.0)
    step = limited_step(J, e, preferred, below, above, floor, most)
    full[chain.joints] = at + step.joints
    return step.held


def _crossing(chain: Chain, full: Floats, port: Port) -> tuple[Floats, Floats]:
    """Returns how far (2,) m the backbone crosses the port's plane off its centre, and the
    Jacobian (2, k) of that crossing; empty where the tip has not passed the plane."""
    tree = chain.robot.tree
    R, p = forward(tree, chain.base, np.zeros(3), full)
    body, beyond = chain.tip.body, p[chain.tip.body] + R[chain.tip.body] @ chain.tip.point
    if (beyond - port.centre) @ port.axis <= 0:
        return np.zeros(0), np.zeros((0, len(chain.joints)))
    while body > 0 and (p[body] - port.centre) @ port.axis > 0:
        beyond, body = p[body], int(tree.parent[body])
    a, b = (p[body] - port.centre) @ port.axis, (beyond - port.centre) @ port.axis
    if a > 0:  # the base itself stands beyond the plane
        return np.zeros(0), np.zeros((0, len(chain.joints)))
    x = p[body] + (beyond - p[body]) * (-a / (b - a))
    plane = np.linalg.svd(port.axis[None])[2][1:]
    local = R[body].T @ (x - p[body])
    J = tip_jacobian(tree, chain.base, full, body, local)[2][:3, chain.joints]
    # The material point slides along the backbone: what leaves the plane is taken out.
    run = (beyond - p[body]) / ((beyond - p[body]) @ port.axis)
    return plane @ (x - port.centre), plane @ (J - np.outer(run, port.axis @ J))


def _clearance(chain: Chain, full: Floats, port: Port) -> float:
    """Returns the room between the backbone and the port's rim [m]; inf before it is reached."""
    off, _ = _crossing(chain, full, port)
    return float(port.radius - np.linalg.norm(off)) if len(off) else np.inf


def _names(chain: Chain, held: Flags) -> tuple[str, ...]:
    names = chain.robot.joint_names
    return tuple(names[j] for j, h in zip(chain.joints, held, strict=True) if h)
