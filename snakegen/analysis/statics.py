"""Statics: joint torques of a posture, what they consist of, and what the tip can bear.

THEORY C and A5: ZS24 eqs 11-25 mended and completed, ZN23 eq 6; the law is in `statics`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.kernels.dynamics.torque_terms import DEPTHS, EXTERNAL, TERMS
from snakegen.robot.followers import coupling
from snakegen.robot.robot import Robot
from snakegen.statics.joint_torques import (
    Depth,
    Wrenches,
    declared_limits,
    joint_torques,
    torque_terms,
    twist_matrix,
)
from snakegen.statics.statics_rows import bears, joint_rows
from snakegen.statics.support import hold_up
from snakegen.statics.tip import TipLoad, find_tip, plain, tip_load, tip_pose
from snakegen.statics.worst import worst_posture

__all__ = ["StaticsResult", "analyze", "applies", "joint_torques", "twist_matrix", "worst_posture"]

COMMAND = "statics"
ORDER = 60
EXAMPLE = 'arm6 --joint joint1_pitch=-0.4 --wrenches "link7=0,0,-5,0,0,0"'


@dataclass(frozen=True)
class StaticsResult:
    """Joint torques of a posture.

    Attributes:
        joints: (n,) names.
        terms: depth that `torque` has.
        support: what carries the weight: ``base``, ``hover``, ``dual`` (as in `Support`) or
            ``thrust``.
        torque: (n,) N·m.
        limit: (n,) N·m, servo limits.
        use: (n,) |torque| / limit.
        by_term: (n,) N·m by term name; the terms that the depth sums, and thrust.
        share: by term, its part of the sum over joints and terms of |torque|.
        depths: (n,) N·m by depth: static, quasi_static, full.
        base: (6,) [force; torque] that the base must be given, root-link axes; zero in balance.
        twist_matrix: (6, n).
        twist_singular_values: of the twist matrix, its rank beside them (tolerance 1e-9 σ1).
        twist_rank: see above.
        tip: link and place of the tip (m from the base origin, world axes).
        tip_load: what the tip can bear, for robots with a chain joint.
        worst: the hardest posture at rest by joint name, gimbals included, its support, its largest
            use, a proved bound of the use in any posture (base held), and the joint, if asked.
        flies: whether the robot floats and has rotors.
        gimbals: names of the joints that turn an apparatus.
        rolls: whether it rests on drums: no `tip_load` unless it flies.
        followers: leaders of the joints that follow another (mimic); their torque is 0, for their
            load is in their leader's, through the ratio.
        free: names of the wheels on drums and of spinning rotors without a servo; no rows of text.
    """

    joints: tuple[str, ...]
    terms: Depth
    support: str
    torque: Floats
    limit: Floats
    use: Floats
    by_term: dict[str, Floats]
    share: dict[str, float]
    depths: dict[str, Floats]
    base: Floats
    twist_matrix: Floats
    twist_singular_values: Floats
    twist_rank: int
    tip: tuple[str, Floats]
    tip_load: TipLoad | None
    worst: dict[str, Any] | None
    flies: bool
    gimbals: frozenset[str]
    rolls: bool = False
    free: frozenset[str] = frozenset()
    followers: Mapping[str, str] = field(default_factory=dict)

    @property
    def overloaded(self) -> tuple[str, ...]:
        """Names of the joints whose servo is too weak."""
        return tuple(n for n, u in zip(self.joints, self.use, strict=True) if u > 1.0)

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: the whole, then the joints, hardest first."""
        shares = [f"{k.replace('_', ' ')} {100 * x:.3g} %" for k, x in self.share.items() if x > 0]
        alone = ": its rotors cannot hold it here" if self.flies else ""
        alone = "; on the ground its drums carry it" if self.rolls and not self.flies else alone
        out = [("support", _SUPPORTS[self.support] + (alone if self.support == "base" else ""))]
        out.append(("consists of", ", ".join(shares) or "nothing: no load"))
        shafts = [n for n in self.joints if n in self.free and n not in self.followers]
        if shafts and not self.rolls:
            out.append(("rotor shafts", f"{', '.join(shafts)}: no servo holds them, no rows"))
        if self.overloaded:
            out.append(("overloaded", ", ".join(self.overloaded)))
        held = [i for i, name in enumerate(self.joints) if name not in self.free]
        unknown = [self.joints[i] for i in held if np.isinf(self.limit[i])]
        if unknown:
            out.append(("no declared effort", f"{', '.join(unknown)}: no share of a limit"))
        if self.followers:
            pairs = ", ".join(f"{n} ({leader})" for n, leader in self.followers.items())
            out.append(("follow others", f"{pairs}: their loads are in their leaders' torques"))
        if self.tip_load is not None and len(unknown) < len(held):
            out += self._tip_rows(self.tip_load)
        if self.worst is not None:
            use = f"{100 * self.worst['use']:.3g} % of {self.worst['joint']}"
            out.append(("worst posture", f"{use} at {self._worst_angles(self.worst)}"))
            if self.worst["use_bound"] is not None:
                most = f"no posture takes more than {100 * self.worst['use_bound']:.4g} %"
                out.append(("", f"{most} of any joint (proved)"))
        names = tuple(self.joints[i] for i in held)
        return out + joint_rows(names, self.torque[held], self.limit[held], self.use[held])

    def _worst_angles(self, worst: Mapping[str, Any]) -> str:
        """Returns the chain's angles of the worst posture; gimbals follow from them in hover."""
        posture = {k: x for k, x in worst["posture"].items() if k not in self.gimbals}
        bent = {k: x for k, x in posture.items() if abs(x) >= 0.00005}
        angles = ", ".join(f"{k} {x:+.4f}" for k, x in bent.items()) or "all joints at 0"
        return angles + (
            ", gimbals pointed up" if self.gimbals and worst["support"] != "base" else ""
        )

    def _tip_rows(self, load: TipLoad) -> list[tuple[str, str]]:
        """Returns the rows about the tip."""
        if load.payload == 0.0:
            return [("tip", f"on {self.tip[0]}: nothing more, a joint is overloaded already")]
        sag = f"{1e3 * float(np.linalg.norm(load.sag)):.3g} mm by its servos"
        # A free body moves, or its rotors react: neither is what was computed here.
        how = " (root held)" if self.flies else ""
        any_wrench = f"{load.wrench_radius:.4g} N in every direction of [force; torque / "
        any_wrench += f"{load.lever:.3g} m] (limit: {load.wrench_joint})"
        if np.isinf(load.wrench_radius):
            any_wrench = "of any size: no limit is declared that it reaches"
        return [
            (f"tip load capacity{how}", bears(load.force_radius, "N", load.force_joint, load.free)),
            ("", bears(load.torque_radius, "N·m", "", load.torque_free)),
            ("  any wrench", any_wrench),
            (
                f"tip carries{how}",
                "any weight" if np.isinf(load.payload) else f"{load.payload:.4g} kg",
            ),
            ("tip deflection", sag),
        ]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units, infinite values are null."""
        load = self.tip_load
        return {
            "joints": list(self.joints),
            "terms": self.terms,
            "support": self.support,
            "torque_Nm": self.torque.tolist(),
            "limit_Nm": plain(self.limit),
            "use": plain(self.use),
            "overloaded": list(self.overloaded),
            "by_term_Nm": {k: v.tolist() for k, v in self.by_term.items()},
            "share": self.share,
            "depths_Nm": {k: v.tolist() for k, v in self.depths.items()},
            "base_wrench_N_Nm": self.base.tolist(),
            "twist_matrix": self.twist_matrix.tolist(),
            "twist_singular_values": self.twist_singular_values.tolist(),
            "twist_rank": self.twist_rank,
            "tip": {"link": self.tip[0], "position_m": self.tip[1].tolist()},
            "tip_load": None if load is None else load.to_json(),
            "worst": self.worst,
            "followers": dict(self.followers),
        }


_SUPPORTS = {
    "base": "base held",
    "hover": "vectored thrust in hover",
    "dual": "dual-rotor hover, gimbals as they stand",
    "thrust": "thrust as given",
}


def applies(robot: Robot) -> bool:
    """A robot with a joint."""
    return len(robot.joint_names) > 0


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    v: ArrayLike | None = None,
    a: ArrayLike | None = None,
    wrenches: Wrenches = None,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    terms: Depth = "full",
    hold: Literal["auto", "base", "hover"] = "auto",
    thrust: ArrayLike | None = None,
    tip: str | None = None,
    tip_point: ArrayLike | None = None,
    direction: ArrayLike = (0.0, 0.0, -1.0),
    worst: bool = False,
    seed: int = 0,
) -> StaticsResult:
    """Returns the joint torques of a posture, their terms, and what the tip can bear.

    Args:
        robot: any robot with a joint.
        q: as in `joint_torques`.
        seed: of that search.

    Options:
        terms: depth: static, quasi_static or full (the three agree at rest)
        wrenches: loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes
        gravity: m/s², world; 0,0,0 for none
        hold: what carries the weight: base, hover or auto
        thrust: N per rotor, comma-separated, instead of the hover's
        v: joint (and base) velocities, comma-separated
        a: joint (and base) accelerations, comma-separated
        tip: link that carries the tip; the last one if absent
        tip_point: x,y,z of the tip on that link, m
        direction: direction in which the payload pulls
        worst: search the posture, at rest, that loads a servo hardest

    Raises:
        SnakegenError: wrong shapes, NaN, names that do not exist, a hover that cannot be.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} has no joint: there is no torque to analyse.")
    if terms not in DEPTHS:
        raise AnalysisError(f"terms: '{terms}' is none of {', '.join(DEPTHS)}.")
    q = robot.validate_configuration(q)
    given: dict[str, Any] = {"wrenches": wrenches, "gravity": gravity}
    held = hold_up(robot, q, hold=hold, thrust=thrust, **given)
    rows = torque_terms(robot, q, v, a, **given)
    push = torque_terms(robot, q, body_wrenches=held.wrenches, gravity=np.zeros(3))[EXTERNAL]
    first = 6 if robot.floating else 0
    if robot.followers:  # their loads go to their leaders
        through = coupling(robot.joint_names, robot.followers)
        rows[:, first:] = rows[:, first:] @ through
        push[first:] = push[first:] @ through
    depths = {k: rows[list(d)].sum(axis=0) + push for k, d in DEPTHS.items()}
    by_term = {TERMS[k]: rows[k, first:] for k in DEPTHS[terms]}
    if held.kind != "base":
        by_term["thrust"] = push[first:]
    total = depths[terms]
    limit = declared_limits(robot, robot.joint_names)
    limit[[robot.joint_names.index(n) for n in robot.followers]] = np.inf
    S = twist_matrix(robot, q)
    sigma = np.asarray(np.linalg.svd(S, compute_uv=False), float)
    end = find_tip(robot, tip, tip_point)
    load = None
    rolls = robot.floating and bool(robot.modules.screws)
    if end.body > 0 and not (rolls and held.kind == "base"):
        load = tip_load(robot, q, end, total[first:], limit, direction=direction)
    return StaticsResult(
        robot.joint_names,
        terms,
        held.kind,
        total[first:],
        limit,
        _use(total[first:], limit),
        by_term,
        _shares(by_term),
        {k: d[first:] for k, d in depths.items()},
        total[:6] if robot.floating else np.zeros(6),
        S,
        sigma,
        int(np.sum(sigma > 1e-9 * sigma[0])),
        (end.link, tip_pose(robot, q, end).position),
        load,
        worst_posture(robot, q, hold=hold, thrust=thrust, seed=seed, **given) if worst else None,
        robot.floating and bool(robot.modules.apparatuses),
        robot.gimbal_names,
        rolls,
        _free(robot, limit) | robot.followers.keys(),
        {name: leader for name, (leader, _, _) in robot.followers.items()},
    )


def _free(robot: Robot, limit: Floats) -> frozenset[str]:
    """Returns the names of the joints on drums and rotor shafts that declare no effort."""
    turning = robot.rolling_names | {robot.joint_names[b - 1] for b in robot.spinners}
    names = zip(robot.joint_names, limit, strict=True)
    return frozenset(n for n, most in names if n in turning and np.isinf(most))


def _use(torque: Floats, limit: Floats) -> Floats:
    """Returns |torque| / limit: inf for a torque against a limit of 0, 0 for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(torque) > 0, np.abs(torque) / limit, 0.0)


def _shares(by_term: Mapping[str, Floats]) -> dict[str, float]:
    """Returns each term's part of the sum over joints and terms of |torque|."""
    sizes = {k: float(np.sum(np.abs(v))) for k, v in by_term.items()}
    whole = sum(sizes.values())
    return {k: (x / whole if whole > 0 else 0.0) for k, x in sizes.items()}
