"""Equivalence check of every build: MJCF and URDF must describe the same robot.

Compared over random states of MuJoCo and Pinocchio: mass, centre of mass, body frames, mass matrix,
bias forces; then actuators, joints, sites and contact geometry against what the URDF and its
modules declare. Error is ``|a - b| / max(|a|, |b|, largest entry of that quantity)``.
"""

from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, skew, wxyz_from_xyzw
from snakegen.pipeline.equivalence_actuators import Actuation, constants, missing
from snakegen.pipeline.equivalence_contacts import contacts
from snakegen.pipeline.equivalence_pairs import SMALLEST, Difference, worst_differences
from snakegen.pipeline.equivalence_responses import Bodies, responses
from snakegen.robot.robot import GRAVITY, Robot

BOUND = 1e-9
_BALANCED = 1e-6  # of the weight: bias forces below are rounding of a balanced body's zero
_PINOCCHIO_UP_TO = 200  # degrees of freedom: beyond, pin.Data's memory (nv³) is out of reach


@dataclass(frozen=True)
class Equivalence:
    """Worst relative errors over `states` random states.

    Attributes:
        states: how many.
        oracle: what MuJoCo was compared with.
        mass, centre_of_mass, frames, mass_matrix, bias: of the rigid bodies.
        actuators: of actuators, joints, sites and contact geometry.
        differences: those of `actuators` above the bound, the largest first.
    """

    states: int
    oracle: str
    mass: float
    centre_of_mass: float
    frames: float
    mass_matrix: float
    bias: float
    actuators: float = 0.0
    differences: tuple[Difference, ...] = ()

    @property
    def worst(self) -> float:
        """The largest of the six errors."""
        return max(getattr(self, name) for name in _ERRORS)

    @property
    def passed(self) -> bool:
        """Whether every error is below 1e-9."""
        return bool(self.worst <= BOUND)

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return asdict(self) | {"worst": self.worst, "passed": self.passed}

    def __str__(self) -> str:
        """Names what differs and by how much, at most four differences of actuators."""
        found = [
            f"{name.replace('_', ' ')} by {getattr(self, name):.2e}"
            for name in _ERRORS[:-1]
            if getattr(self, name) > BOUND
        ]
        found += [f"{d} (error {d.error:.2e})" for d in self.differences[:4]]
        more = len(self.differences) - 4
        return "; ".join([*found, f"and {more} more"] if more > 0 else found)


_ERRORS = ("mass", "centre_of_mass", "frames", "mass_matrix", "bias", "actuators")


def compare(
    robot: Robot,
    model: mujoco.MjModel,
    *,
    states: int = 5,
    seed: int = 0,
    rollers: str | None = None,
    motors: tuple[str, ...] = (),
) -> Equivalence:
    """Runs random states through both descriptions of `robot`.

    Args:
        robot: read from the URDF.
        model: the compiled MJCF, without scenery.
        states: how many random states.
        seed: of the states.
        rollers: how the drums of `model` touch the ground, in place of the modules' own.
        motors: joints that `model` drives by torque, up to their effort.
    """
    at = Actuation(robot, model, motors)
    oracle = _Pinocchio(robot) if robot.model.nv <= _PINOCCHIO_UP_TO else _Own(robot)
    if surplus := missing(at):
        found = _above(worst_differences([surplus]))
        return Equivalence(0, oracle.name, 0.0, 0.0, 0.0, 0.0, 0.0, np.inf, found)
    rng = np.random.default_rng(seed)
    mapping = _StateMap(robot, model, at.joints)
    data = mujoco.MjData(model)
    bodily = len(at.joints) == len(robot.joint_names)
    worst, together = np.zeros(5), [*constants(at), *contacts(at, rollers)]
    floors = (0.0, SMALLEST, 0.0, 0.0, _BALANCED * robot.force_scale)  # rounding of zeros
    for _ in range(states):
        q, v = mapping.random(rng)
        mapping.set_state(data, q, v)
        ours = oracle.evaluate(q, v)
        if bodily:
            theirs = mapping.evaluate(data, q, v)
            errors = [_error(*three) for three in zip(ours, theirs, floors, strict=True)]
            worst = np.maximum(worst, errors)
        together += responses(at, data, oracle.bodies(ours[1]), v)
    differences = worst_differences(together)
    actuators = max((d.error for d in differences), default=0.0)
    mass, centre, frames, mass_matrix, bias = (float(w) for w in worst)
    figures = (mass, centre, frames, mass_matrix, bias, actuators)
    return Equivalence(states, oracle.name, *figures, _above(differences))


def _above(differences: tuple[Difference, ...]) -> tuple[Difference, ...]:
    """Returns those above the bound, the largest first, constants before responses."""
    return tuple(sorted((d for d in differences if d.error > BOUND), key=lambda d: -d.error))


Quantities = tuple[Floats, Floats, Floats, Floats, Floats]


def _error(a: Floats, b: Floats, floor: float) -> float:
    scale = max(float(np.abs(a).max(initial=floor)), float(np.abs(b).max(initial=floor)))
    gap = float(np.abs(a - b).max(initial=0.0))
    if not np.isfinite(gap):
        return float("inf")
    return gap / scale if scale > 0 else 0.0


def _link_names(robot: Robot) -> list[str]:
    return [f.name for f in robot.model.frames if f.type == pin.FrameType.BODY]


class _StateMap:
    """Maps Pinocchio's q, v to MuJoCo's and MuJoCo's matrices back.

    ``v_mj = T v_pin``: base linear velocity turns from base axes to the world's, joints permute.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel, names: tuple[str, ...]) -> None:
        self.robot, self.model = robot, model
        ids = [model.joint(n).id for n in names]
        self.qadr = model.jnt_qposadr[ids]
        self.dof = np.array(model.jnt_dofadr[ids], int)
        pins = [robot.model.joints[robot.model.getJointId(n)] for n in names]
        self.pin_q = np.array([j.idx_q for j in pins], int)
        self.pin_v = np.array([j.idx_v for j in pins], int)
        self.angles = [robot.joint_names.index(n) for n in names]

    def random(self, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Returns a random configuration and velocity in Pinocchio's order."""
        model = self.robot.model
        q = pin.neutral(model)
        if self.robot.floating:
            q[:3] = rng.uniform(-1, 1, 3)
            quaternion = rng.normal(size=4)
            q[3:7] = quaternion / np.linalg.norm(quaternion)
        low, high, _ = self.robot.limits(self.robot.joint_names)
        middle = np.clip(0.0, low, high)
        angles = rng.uniform(np.maximum(low, middle - np.pi), np.minimum(high, middle + np.pi))
        for name, angle in zip(self.robot.joint_names, angles, strict=True):
            joint = model.joints[model.getJointId(name)]
            turn = (np.cos(angle), np.sin(angle))
            q[joint.idx_q : joint.idx_q + joint.nq] = turn if joint.nq == 2 else angle
        return q, rng.normal(size=model.nv)

    def set_state(self, data: mujoco.MjData, q: Floats, v: Floats) -> None:
        """Brings `data` to q and v, its forces computed."""
        if self.robot.floating:
            base, _ = self.robot.base_pose(q)
            data.qpos[:3], data.qpos[3:7] = q[:3], wxyz_from_xyzw(q[3:7])
            data.qvel[:3], data.qvel[3:6] = base @ v[:3], v[3:6]
        data.qpos[self.qadr] = self.robot.angles(q)[self.angles]
        data.qvel[self.dof] = v[self.pin_v]
        mujoco.mj_forward(self.model, data)

    def evaluate(self, data: mujoco.MjData, q: Floats, v: Floats) -> Quantities:
        """Returns mass, CoM, frames, mass matrix and bias as MuJoCo has them, in v_pin's terms."""
        model, floating = self.model, self.robot.floating
        base, _ = self.robot.base_pose(q)
        links = [model.body(n).id for n in _link_names(self.robot)]
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        order = np.arange(model.nv)
        order[self.pin_v] = self.dof
        mass_matrix, bias = full[np.ix_(order, order)], data.qfrc_bias[order]
        if floating:
            turned = base @ skew(v[3:6]) @ v[:3]  # T' v
            bias = bias + mass_matrix[:, :3] @ turned
            mass_matrix[:, :3] = mass_matrix[:, :3] @ base
            mass_matrix[:3] = base.T @ mass_matrix[:3]
            bias[:3] = base.T @ bias[:3]
        moving = _moving_bodies(model)
        mass = model.body_mass[moving]
        centre = _centre(float(mass.sum()), mass @ data.xipos[moving])
        frames = np.hstack([data.xpos[links], data.xmat[links]])
        return np.array([mass.sum()]), centre, frames, mass_matrix, bias


def _centre(mass: float, moment: Floats) -> Floats:
    """Returns the centre of mass; the origin where nothing moves (one link on a fixed base)."""
    return moment / mass if mass > 0 else np.zeros(3)


def _moving_bodies(model: mujoco.MjModel) -> Any:
    """Returns the bodies that are not welded to the world: Pinocchio drops a fixed root's mass."""
    return np.flatnonzero(model.body_weldid != 0)


class _Pinocchio:
    name = "Pinocchio"

    def __init__(self, robot: Robot) -> None:
        self.model, self.data = robot.model, robot.model.createData()
        self.count = robot.tree.parent.size
        self.frames = [robot.model.getFrameId(n, pin.FrameType.BODY) for n in _link_names(robot)]

    def evaluate(self, q: Floats, v: Floats) -> Quantities:
        model, data = self.model, self.data
        upper = np.triu(pin.crba(model, data, q))
        mass_matrix = upper + np.triu(upper, 1).T
        bias = np.array(pin.nle(model, data, q, v))
        mass = pin.computeTotalMass(model)
        centre = _centre(mass, mass * np.array(pin.centerOfMass(model, data, q)))
        pin.framesForwardKinematics(model, data, q)
        poses = [data.oMf[f] for f in self.frames]
        frames = np.array([[*p.translation, *p.rotation.ravel()] for p in poses])
        return np.array([mass]), centre, frames, mass_matrix, bias

    def bodies(self, cog: Floats) -> Bodies:
        """Returns the poses of the moving bodies in the state evaluated last."""
        first = len(self.data.oMi) - self.count
        poses = [self.data.oMi[k] for k in range(first, len(self.data.oMi))]
        rotation = np.array([p.rotation for p in poses])
        return Bodies(rotation, np.array([p.translation for p in poses]), cog)


class _Own:
    """snakegen's own kinematics and RNEA, which the tests hold against Pinocchio."""

    name = f"snakegen's own kinematics: more than {_PINOCCHIO_UP_TO} degrees of freedom"

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.places = [robot.body_of_link(n) for n in _link_names(robot)]

    def evaluate(self, q: Floats, v: Floats) -> Quantities:
        from snakegen.robot.kinematics import forward, mass_properties

        robot, tree = self.robot, self.robot.tree
        base, origin = robot.base_pose(q)
        rotation, position = forward(tree, base, origin, robot.angles(q))
        self.poses = rotation, position
        mass, centre, _ = mass_properties(tree, rotation, position)
        frames = np.array(
            [
                [*(position[b] + rotation[b] @ p), *(rotation[b] @ r).ravel()]
                for b, r, p in self.places
            ]
        )
        return np.array([mass]), centre, frames, *self._dynamics(base, robot.angles(q), v)

    def bodies(self, cog: Floats) -> Bodies:
        """Returns the poses of the moving bodies in the state evaluated last."""
        return Bodies(*self.poses, cog)

    def _dynamics(self, base: Floats, angles: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Returns mass matrix (nv, nv) and bias (nv,): torques of unit accelerations, and of none.

        Row k is what moving coordinate k alone from rest takes without gravity; the last row,
        with gravity, what going on at v takes.
        """
        from snakegen.kernels.dynamics.inverse_dynamics import NO_LOADS, torques_batch

        robot, nv = self.robot, v.size
        skip = 0 if robot.floating else 6
        armature = robot.model.armature[6 - skip :].copy()
        rates, accelerations = np.zeros((nv + 1, skip + nv)), np.zeros((nv + 1, skip + nv))
        rates[nv, skip:] = v
        accelerations[:nv, skip:] = np.eye(nv)
        bases, turned = np.repeat(base[None], nv + 1, 0), np.repeat(angles[None], nv + 1, 0)

        def torques(rows: slice, gravity: float) -> Floats:
            weight = np.array([0.0, 0.0, -gravity])
            state = (bases[rows], turned[rows], rates[rows], accelerations[rows])
            return torques_batch(robot.tree, armature, weight, *state, NO_LOADS)[:, skip:]

        return torques(slice(nv), 0.0), torques(slice(nv, nv + 1), GRAVITY)[0]
