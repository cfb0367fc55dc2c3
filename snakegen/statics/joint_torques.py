"""Joint torques and twist matrix of a `Robot`: the general law of THEORY C on its flat arrays.

One law for the arm and for the aerial snake in hover (ZN23 eq 6, ZS24 eq 11): thrust is a wrench
on a rotor's body like any other.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats, move_wrench
from snakegen.base.plain_first import plain_first
from snakegen.errors import AnalysisError
from snakegen.kernels.core.types import Ints
from snakegen.kernels.dynamics import torque_terms as dynamics
from snakegen.kernels.dynamics.inverse_dynamics import NO_LOADS, Loads
from snakegen.robot.kinematics import forward, twist_columns
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.statics import torque_terms as plain

Depth = Literal["full", "quasi_static", "static"]
Wrenches = Mapping[str, ArrayLike] | str | None
DOWN = (0.0, 0.0, -GRAVITY)
_terms = plain_first(dynamics.torque_terms, calls=1000)(plain.torque_terms)  # kernel: 9 s
_CHAIN_JOINT = re.compile(r"(joint\d+)_(?:pitch|yaw|roll)")


def twist_matrix(robot: Robot, q: ArrayLike) -> Floats:
    """Returns the twist matrix S (6, n) at the base origin, world axes (ZS24 eqs 12, 13, 20).

    Column i is ``[r_i × e_i; e_i]`` ([linear; angular]; the paper has angular first), r_i from the
    root link's origin to joint i, e_i its axis; one column per joint in Pinocchio's order.

    Args:
        robot: any robot, fixed or floating.
        q: (nq,) configuration.

    Raises:
        PostureError: q has the wrong size or holds NaN.
    """
    q = robot.validate_configuration(q)
    return np.asarray(twist_columns(robot.tree, robot.base_pose(q)[0], robot.angles(q)))


def joint_torques(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    *,
    wrenches: Wrenches = None,
    terms: Depth = "full",
    gravity: ArrayLike = DOWN,
    thrust: ArrayLike | None = None,
) -> Floats:
    """Returns the generalised forces (nv,) that balance a motion under external wrenches.

    ``τ_i = S_iᵀ Σ_{distal} [m a; Iα + ω×Iω + r_c×m a] - S_iᵀ w_ext`` (ZS24 eqs 11 and 25 mended;
    ZN23 eq 6). N for the base's linear rows, N·m for its angular rows and the joints.

    Args:
        robot: any robot, fixed or floating.
        q: (nq,) configuration.
        v, a: (nv,) velocity and acceleration in Pinocchio's order, zero if absent; the base's rows
            (linear, angular) are in its own axes.
        wrenches: by link name, [force; torque] at that link's origin, world axes.
        terms: ``static`` gravity and wrenches; ``quasi_static`` and the paper's J β (eq 24);
            ``full`` all inertia and armature.
        gravity: (3,) m/s², world.
        thrust: (n_rotors,) N, put on as wrenches at the rotors; none if absent.

    Raises:
        AnalysisError: an unknown depth, wrong shapes, NaN.
        DescriptionError: a wrench on a link that does not exist; the near ones are named.
        PostureError: q has the wrong size or holds NaN.
    """
    if terms not in dynamics.DEPTHS:
        raise AnalysisError(f"terms must be one of {', '.join(dynamics.DEPTHS)} (got '{terms}').")
    rows = torque_terms(robot, q, v, a, wrenches=wrenches, gravity=gravity, thrust=thrust)
    return np.asarray(rows[list(dynamics.DEPTHS[terms])].sum(axis=0))


def torque_terms(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    *,
    wrenches: Wrenches = None,
    gravity: ArrayLike = DOWN,
    thrust: ArrayLike | None = None,
    body_wrenches: Floats | None = None,
) -> Floats:
    """Returns the terms of `joint_torques`, (8, nv), rows as `kernels.dynamics.TERMS`.

    `body_wrenches` (bodies, 6), world axes at body origins, is added to the other wrenches.
    """
    q = robot.validate_configuration(q)
    first = 0 if robot.floating else 6
    n = len(robot.joint_names)
    v6, a6 = np.zeros(6 + n), np.zeros(6 + n)
    if v is not None:
        v6[first:] = finite(v, (robot.model.nv,), "v")
    if a is not None:
        a6[first:] = finite(a, (robot.model.nv,), "a")
    external = link_wrenches(robot, q, wrenches)
    if thrust is not None:
        external += rotor_wrenches(robot, q, thrust)
    if body_wrenches is not None:
        external += body_wrenches
    rows = _terms(
        robot.tree,
        armature(robot),
        segments(robot),
        finite(gravity, (3,), "gravity"),
        robot.base_pose(q)[0],
        robot.angles(q),
        v6,
        a6,
        external,
    )
    return np.asarray(rows[:, first:])


def named_wrenches(wrenches: Wrenches) -> Mapping[str, ArrayLike]:
    """Returns wrenches by link name; reads text such as ``link4=0,0,-5,0,0,0; link2=1,0,0,0,0,0``.

    Raises:
        AnalysisError: text that does not read so.
    """
    if wrenches is None or not isinstance(wrenches, str):
        return wrenches or {}
    out: dict[str, ArrayLike] = {}
    for item in filter(None, (part.strip() for part in wrenches.split(";"))):
        link, equals, numbers = item.partition("=")
        if not equals:
            raise AnalysisError(f"wrench '{item}': write link=fx,fy,fz,tx,ty,tz.")
        out[link.strip()] = numbers
    return out


def link_wrenches(robot: Robot, q: Floats, wrenches: Wrenches) -> Floats:
    """Returns wrenches given at link origins as (bodies, 6) at body origins, world axes.

    Raises:
        DescriptionError: a link that does not exist; the near ones are named.
        AnalysisError: wrong shape, NaN.
    """
    out = np.zeros((len(robot.tree.parent), 6))
    given = named_wrenches(wrenches)
    if not given:
        return out
    rotation, _ = _poses(robot, q)
    for link, wrench in given.items():
        w = finite(wrench, (6,), f"wrench on '{link}'")
        body, _, origin = robot.body_of_link(link)
        out[body] += move_wrench(w, rotation[body] @ origin)
    return out


def link_loads(robot: Robot, wrenches: Wrenches) -> Loads:
    """Returns wrenches given at link origins for `torques_batch`, where bodies move under them.

    Raises:
        DescriptionError: a link that does not exist; the near ones are named.
        AnalysisError: wrong shape, NaN.
    """
    given = named_wrenches(wrenches)
    if not given:
        return NO_LOADS
    rows = [finite(w, (6,), f"wrench on '{link}'") for link, w in given.items()]
    placed = [robot.body_of_link(link) for link in given]
    bodies = np.array([p[0] for p in placed], np.int64)
    return Loads(bodies, np.array([p[2] for p in placed]), np.array(rows))


def rotor_wrenches(robot: Robot, q: Floats, thrust: ArrayLike) -> Floats:
    """Returns thrusts (n_rotors,) [N] as wrenches (bodies, 6): force and drag torque (eqs 7-9)."""
    rotors = robot.rotors
    shares = finite(thrust, (len(rotors.body),), "thrust")
    rotation, _ = _poses(robot, q)
    out = np.zeros((len(robot.tree.parent), 6))
    for k, body in enumerate(rotors.body):
        axis = rotation[body] @ rotors.axis[k]
        w = shares[k] * np.concatenate([axis, rotors.torque_ratio[k] * axis])
        out[body] += move_wrench(w, rotation[body] @ rotors.position[k])
    return out


def armature(robot: Robot) -> Floats:
    """Returns each joint's armature (n,) [kg·m²]."""
    return np.array(robot.model.armature, float)[6 if robot.floating else 0 :]


def declared_limits(robot: Robot, names: Sequence[str]) -> Floats:
    """Returns servo limits (k,) [N·m] of joints; inf where the description declares none.

    An effort of 0 declares none: exporters write it where nobody gave a figure.
    """
    effort = robot.limits(names)[2]
    return np.where(effort > 0.0, effort, np.inf)


def segments(robot: Robot) -> Ints:
    """Returns the body whose inertia eq 24 gives to each body's joint, (bodies,).

    Both axes of a universal joint (``joint3_pitch``, ``joint3_yaw``) carry the link beyond it, as
    the paper counts; any other joint carries its own body.
    """
    out = np.arange(len(robot.tree.parent))
    last: dict[str, int] = {}
    for k, name in enumerate(robot.joint_names):
        match = _CHAIN_JOINT.fullmatch(name)
        last[match[1] if match else name] = k + 1
    for k, name in enumerate(robot.joint_names):
        match = _CHAIN_JOINT.fullmatch(name)
        out[k + 1] = last[match[1] if match else name]
    return out


def finite(value: ArrayLike, shape: tuple[int, ...], name: str) -> Floats:
    """Returns `value` (numbers, or text such as "0,0,-9.81") as float64 of `shape`.

    Raises:
        AnalysisError: with `name`: no numbers, another shape, NaN or infinity.
    """
    try:
        listed = value.split(",") if isinstance(value, str) else value
        out = np.array(listed, dtype=float)
    except (TypeError, ValueError):
        raise AnalysisError(f"{name}: {value!r} is no array of numbers.") from None
    if out.shape != shape:
        if out.ndim <= 1 and len(shape) == 1:
            raise AnalysisError(f"{name}: {out.size} numbers given, {shape[0]} needed.")
        raise AnalysisError(f"{name}: shape {out.shape} given, {shape} needed.")
    if not np.all(np.isfinite(out)):
        raise AnalysisError(f"{name}: holds NaN or infinity.")
    return out


def _poses(robot: Robot, q: Floats) -> tuple[Floats, Floats]:
    rotation, position = forward(robot.tree, *robot.base_pose(q), robot.angles(q))
    return rotation, position
