"""Exact derivatives of a robot's margins: `snakegen.margin_gradient` (THEORY A9)."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.kernels.allocation.wrench_map import dual_map, rotor_frames
from snakegen.robot.robot import GRAVITY, Robot
from snakegen.sensitivity.chain_rule import BodyPoses, TreeGradient, tree_gradient
from snakegen.wrench_margins.facet_optima import thrust_optima
from snakegen.wrench_margins.gradients import KINDS, Optimum, vectored_optima
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

VIRTUAL, DUAL = "virtual_single_rotor", "dual_rotor"
MODES = {VIRTUAL: VIRTUAL, DUAL: DUAL, "virtual": VIRTUAL, "dual": DUAL}
APART = 0.01  # relative gap of bounds above which a derivative may be that of another direction
BY = (
    "joints", "attitude", "thrust_points", "thrust_limits", "thrust_minimums", "drag",
    "masses", "centres_of_mass",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class MarginGradient:
    """A margin of one posture and its derivatives; at a kink those of one piece.

    Attributes:
        robot, angles: whose, and its joint angles (n-1,).
        up: (3,) the world's z in the root link's axes.
        kind, mode: which margin.
        pieces: optima whose values tie, one where the margin is smooth; none where it is 0 for
            lack of rank.
        bodies: (k,) body that carries each force, (k,) body that turns it, or its set.
        apart: relative gap of the margin's bounds, where they do not meet.
    """

    robot: Robot
    angles: Floats
    up: Floats
    kind: str
    mode: str
    pieces: tuple[Optimum, ...]
    bodies: tuple[Any, Any]
    apart: float = 0.0

    @property
    def value(self) -> float:
        """The exact margin: N, N·m, or scaled."""
        return self.pieces[0].value if self.pieces else 0.0

    @property
    def kink(self) -> str:
        """Why the margin has no derivative here; empty where it has one."""
        if not self.pieces:
            return "a direction is lost: the margin is 0 and cannot fall, so 0 is a subgradient"
        if len(self.pieces) > 1:
            return f"{len(self.pieces)} directions tie: the derivative is that of the first piece"
        if self.apart > APART:
            return (
                f"the margin's bounds are {100.0 * self.apart:.1f} % apart: the derivative is that "
                "of the weakest direction known"
            )
        return ""

    @cached_property
    def poses(self) -> BodyPoses:
        """Poses of the bodies."""
        return BodyPoses.of(self.robot.tree, self.angles)

    def by(self, wrt: str, piece: int = 0) -> Floats:
        """Returns the derivative by one of `BY`, a subgradient where `kink` says so.

        "joints" (n-1,) per rad, gimbals included, in the order of `robot.joint_names`;
        "attitude" (3,) per rad, a rotation vector of the root link in its own axes;
        "thrust_points" (k, 3) per m, CoG held; "thrust_limits", "thrust_minimums" (k,) per N;
        "drag" (k,) per m of torque ratio, k apparatuses or, in dual-rotor mode, rotors;
        "masses" (n,) per kg of each body; "centres_of_mass" (n, 3) per m, body axes.
        """
        if wrt not in BY:
            raise AnalysisError(f"no derivative by '{wrt}'.{near(wrt, BY)}")
        if not self.pieces:
            return np.zeros(self._shape(wrt))
        o = self.pieces[piece]
        if wrt == "thrust_points":
            return o.by_points
        if wrt == "thrust_limits":
            return o.by_high
        if wrt == "thrust_minimums":
            return o.by_low
        if wrt == "drag":
            return o.by_drag
        weight = self.poses.mass * GRAVITY
        if wrt == "attitude":
            return np.asarray(-weight * np.cross(o.twist[:3], self.up))
        tree = self.tree(piece)
        if wrt == "joints":
            return tree.joints
        if wrt == "centres_of_mass":
            return tree.com
        force, torque = o.by_scale
        scales = GRAVITY * (force + torque * self.robot.link_length)
        return tree.mass + scales - GRAVITY * float(o.twist[:3] @ self.up)

    def tree(self, piece: int = 0) -> TreeGradient:
        """Returns the derivatives by the kinematic tree's numbers; see `TreeGradient`."""
        o = self.pieces[piece]
        return tree_gradient(
            self.robot.tree, self.poses, self.bodies, o.points, o.by_points, o.by_turning
        )

    def _shape(self, wrt: str) -> tuple[int, ...]:
        n, k = self.robot.tree.mass.size, len(self.bodies[0])
        return {
            "joints": (n - 1,), "attitude": (3,), "thrust_points": (k, 3), "masses": (n,),
            "centres_of_mass": (n, 3),
        }.get(wrt, (k,))  # fmt: skip


def margin_gradients(
    robot: Robot, q: Any, kind: str, mode: str = VIRTUAL, *, ties: bool = True, close: bool = True
) -> MarginGradient:
    """Returns a margin at q, exact, with its derivatives by all of `BY`.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) configuration; gimbals as they are in it.
        kind: "force", "torque" or "wrench"; "attitude_altitude" in dual-rotor mode too.
        mode: "virtual_single_rotor" or "dual_rotor".
        ties: in dual-rotor mode, look for other facets that reach the same value.
        close: of limited gimbals, bring the bounds together and look for other directions first;
            else the derivative is that of the hulls' weakest direction, in milliseconds.

    Raises:
        AnalysisError: a robot without rotors or with a fixed base, an unknown kind or mode, hover
            out of reach, or an optimum that was not found.
    """
    if mode not in MODES:
        raise AnalysisError(f"mode '{mode}' is unknown.{near(mode, (VIRTUAL, DUAL))}")
    if kind not in KINDS:
        raise AnalysisError(f"margin '{kind}' is unknown.{near(kind, KINDS)}")
    if not robot.modules.apparatuses or not robot.floating:
        raise AnalysisError(f"{robot.name} cannot hover: margins need rotors and a free base.")
    q, mode = robot.validate_configuration(q), MODES[mode]
    base, _ = robot.base_pose(q)
    angles = robot.angles(q)
    poses = BodyPoses.of(robot.tree, angles)
    up = np.ascontiguousarray(base[2])
    hover = np.concatenate([poses.mass * GRAVITY * up, np.zeros(3)])
    scale: dict[str, Any] = {
        "force_scale": robot.force_scale,
        "torque_scale": robot.torque_scale,
    }
    if mode == VIRTUAL:
        sets = robot.force_sets(q)
        if close or sets.convex.all():
            found = set_margins(sets, hover, wrench_starts=0, **scale)
        else:  # a batch is not branched
            stack = replace(sets, points=sets.points[None], frames=sets.frames[None])
            found = set_margins(stack, hover[None], wrench_starts=0, **scale)[0]
        pieces, bodies = (
            vectored_optima(found, kind, close),
            (robot.gimbals.thrust_body, _mounts(robot)),
        )
        low, high = found.bounds[KINDS.index(kind)]
        apart = 1.0 - low / high if found.hull and kind != "wrench" and high > 0.0 else 0.0
    else:
        rotors = robot.rotors
        points, axes = rotor_frames(
            rotors, poses.rotation, poses.position, np.ascontiguousarray(poses.cog), np.eye(3)
        )
        dual = dual_map(rotors, points, axes)
        exact = thrust_margins(dual, rotors.thrust_min, rotors.thrust_max, hover, **scale)
        pieces = thrust_optima(exact, kind, points, rotors.torque_ratio, ties)
        bodies, apart = (rotors.body, rotors.body), 0.0
    return MarginGradient(robot, angles, up, kind, mode, pieces, bodies, float(apart))


def _mounts(robot: Robot) -> Any:
    """Returns (k,) the body that carries each apparatus' first gimbal joint, or its rotors."""
    g = robot.gimbals
    joints = np.sort(np.stack([g.roll_body, g.pitch_body], axis=1), axis=1)
    first = np.where(joints[:, 0] >= 0, joints[:, 0], joints[:, 1])
    return np.where(first >= 0, robot.tree.parent[np.maximum(first, 0)], g.thrust_body)


def margin_gradient(
    robot: Robot, q: Any, kind: str, mode: str = VIRTUAL, wrt: str = "joints"
) -> Floats:
    """Returns the exact derivative of a margin at q; a subgradient where the margin has a kink.

    ``dm = Σ f_j · (ω × dp_j) + … - d · dw0`` at the worst direction, forces held (THEORY A9). What
    kinks there are, and their other pieces, `margin_gradients` tells.

    Args:
        robot: floating, with apparatuses.
        q: (nq,) configuration; gimbals as they are in it.
        kind: "force" [N], "torque" [N·m] or "wrench" [1]; "attitude_altitude" in dual-rotor mode.
        mode: "virtual_single_rotor" or "dual_rotor".
        wrt: one of `BY`: "joints", "attitude", "thrust_points", "thrust_limits" …; shapes and
            units as `MarginGradient.by` says.

    Raises:
        AnalysisError: as `margin_gradients`, and an unknown `wrt`.
    """
    if wrt not in BY:
        raise AnalysisError(f"no derivative by '{wrt}'.{near(wrt, BY)}")
    return margin_gradients(robot, q, kind, mode, ties=False).by(wrt)
