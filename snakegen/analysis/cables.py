"""Cables: the tensions that balance a posture, and whether they hold it (ZS24 section 2).

Three or more cables a segment; those of far segments run through the near ones and load them too.
The paper prints neither radius nor phase: both are parameters, of the spec's `cables` or options.
Balanced: tensions carry the loads. Held: the posture also comes back when it is disturbed, since
its stiffness (cables, their tension, weight, loads) has no negative eigenvalue.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.atomic_io import require_suffix
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.motion_files import motion_of
from snakegen.kernels.cables.cables import back_substitute, balance, lengths_and_rates
from snakegen.robot.modules import Cables
from snakegen.robot.posture import set_angle
from snakegen.robot.robot import Robot
from snakegen.statics.cable_holding import (
    Stiffness,
    holding_limit,
    least_holding_tension,
    stiffness_of,
)
from snakegen.statics.cable_options import cables_from_options, load_at, loads_of
from snakegen.statics.cable_results import CableMotion, CablesResult, balanced
from snakegen.statics.cable_stiffness import PointLoad, cable_geometry
from snakegen.statics.cabled import cables_of, hold_in_mujoco
from snakegen.statics.joint_torques import Wrenches, finite, joint_torques
from snakegen.statics.routing import Routing, route
from snakegen.statics.tip import tip_pose

__all__ = ["CablesResult", "Routing", "analyze", "applies", "route"]

COMMAND = "cables"
ORDER = 75
EXAMPLE = "arm6 --joint joint3_yaw=0.4 --mjcf arm6_cables.xml"
_RATE = 20.0  # instants a second of a motion


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base, no joint of which follows another (mimic)."""
    return not robot.floating and len(robot.chain_joints) > 0 and not robot.followers


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    routing: Routing | None = None,
    torque: ArrayLike | None = None,
    wrenches: Wrenches = None,
    tip_force: ArrayLike | None = None,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    motion: str | Path | None = None,
    mjcf: str | Path | None = None,
    count: int | None = None,
    radius: float | None = None,
    phase: float | None = None,
    standoff: float | None = None,
    sheathed: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
    stiffness: float | None = None,
    elasticity: float | None = None,
    friction: float | None = None,
) -> CablesResult:
    """Returns the least cable tensions that balance a posture, and whether they hold it.

    Args:
        robot: an arm.
        q: (nq,) posture.
        routing: from `route`; made from the options if absent.
        torque: (n,) N·m of the chain joints; the static ones of gravity and loads if absent.
        sizes: ``count radius phase standoff sheathed minimum maximum stiffness elasticity
            friction`` as in the spec's `cables`, in place of those.

    Options:
        count: cables a segment, three or more; the spec's, else 3
        radius: m, of the circle of holes; the spec's, else 0.03
        phase: rad, of the first hole from y towards z; the spec's, else 0
        standoff: m, from a joint to the holes on either side; the spec's, else 0.02
        sheathed: cables start at their own joint instead of running through all before
        minimum: N, least tension; the spec's, else 5
        maximum: N, highest tension; the spec's, else none
        stiffness: N/m, of a winch; the spec's, else 50000
        elasticity: N, EA of a cable; the spec's, else one that does not stretch
        friction: coefficient of cable on hole, cables being wound in; the spec's, else 0
        wrenches: loads, as in "link4=0,0,-5,0,0,0": [force; torque] at a link, world axes
        tip_force: N, force at the tip, world axes, as in 0,0,-5
        gravity: m/s², world; 0,0,0 for none
        motion: table3, a table or a YAML: how stiff the arm is along it, at 20 instants a s
        mjcf: MJCF to write: the cables as tendons with winches, in place of the servos

    Raises:
        AnalysisError: not an arm, wrong shapes, NaN, minimum above maximum; an MJCF asked for
            where the cables do not balance the posture, or for loads that it does not have.
    """
    if not applies(robot):
        raise AnalysisError(f"{robot.name} is not an arm on a fixed base: cables are for those.")
    if mjcf is not None:
        require_suffix(mjcf, ".xml")
    sizes = {
        "count": count,
        "radius": radius,
        "phase": phase,
        "standoff": standoff,
        "sheathed": sheathed or None,
        "minimum": minimum,
        "maximum": maximum,
        "stiffness": stiffness,
        "elasticity": elasticity,
        "friction": friction,
    }
    cables, given = cables_from_options(robot, {k: v for k, v in sizes.items() if v is not None})
    q = robot.validate_configuration(q)
    how: dict[str, Any] = {}
    if routing is None:
        places: dict[str, Any] = {
            "count": cables.count,
            "radius": cables.radius,
            "phase": cables.phase,
            "standoff": cables.standoff,
            "coupled": not cables.sheathed,
        }
        routing = route(robot, **places)
        how = _routing_json(places, robot.modules.cables is None and not given)
    g = finite(gravity, (3,), "gravity")
    loads = loads_of(robot, wrenches, tip_force)
    case = _Case(robot, routing, cables, g, loads)
    result = case.solve(q, torque, how)
    if motion is not None:
        result = replace(result, along=case.along(q, motion))
    if mjcf is None:
        return result
    if loads or torque is not None:
        raise AnalysisError(
            "an MJCF has no loads of its own: ask for it without tip force, wrenches, torque."
        )
    if cables.friction > 0:
        raise AnalysisError("MuJoCo's tendons have no friction over holes: ask for it without.")
    if not result.feasible:
        raise AnalysisError(f"{robot.name}: {result.why}; no MJCF of that was written.")
    cable = case.stiffness(q).cable
    made = cables_of(robot, routing, result.tension, result.length, cables.maximum, cable)
    soft = np.zeros(len(robot.joint_names))
    soft[case.index] = result.softest
    held = hold_in_mujoco(Path(mjcf), robot, q, made, g, soft)
    return replace(result, mjcf=str(mjcf), held=held)


class _Case:
    """Cables of a robot under its loads, in any posture."""

    def __init__(
        self,
        robot: Robot,
        routing: Routing,
        cables: Cables,
        gravity: Floats,
        loads: tuple[PointLoad, ...],
    ) -> None:
        self.robot, self.routing, self.cables = robot, routing, cables
        self.gravity, self.loads = gravity, loads
        self.names = [n for group in routing.segments for n in group]
        self.index = np.array([robot.body_of_joint(n) - 1 for n in self.names], int)

    def stiffness(self, q: Floats) -> Stiffness:
        """Returns the stiffness of posture q (nq,) as a function of tension."""
        cables = self.cables
        geometry = cable_geometry(self.robot, q, self.routing.holes, self.index, cables.friction)
        return stiffness_of(
            self.robot,
            geometry,
            gravity=self.gravity,
            loads=self.loads,
            winch=cables.stiffness,
            elasticity=cables.elasticity,
        )

    def wanted(self, q: Floats) -> Floats:
        """Returns the static torques (k,) [N·m] of weight and loads in posture q (nq,)."""
        static = joint_torques(self.robot, q, gravity=self.gravity, terms="static")[self.index]
        out = np.asarray(static, float)
        for load in self.loads:
            tip = tip_pose(self.robot, q, load_at(self.robot, load))
            wrench = np.concatenate([load.force, load.moment])
            out = out - (tip.jacobian.T @ wrench)[self.index]
        return out

    def tensions(self, arms: Floats, wanted: Floats) -> tuple[Floats, Floats, str]:
        """Returns least tensions (c,) [N], the shortage (k,) [N·m] and how they were got."""
        routing, least, most = self.routing, self.cables.minimum, self.cables.maximum
        ends = np.cumsum([len(g) for g in routing.segments])
        rows = [np.arange(e - len(g), e) for e, g in zip(ends, routing.segments, strict=True)]
        t, short = back_substitute(arms, wanted, rows, list(routing.columns), least, most)
        if not balanced(short, wanted) and routing.coupled:
            # Least tensions beyond may be the wrong ones for the segments before: all at once.
            together, left = balance(arms, wanted, least, most)
            if np.sum(np.abs(left)) < np.sum(np.abs(short)):
                return together, left, "all segments at once"
        return t, short, "back-substitution"

    def solve(self, q: Floats, torque: ArrayLike | None, how: dict[str, Any]) -> CablesResult:
        """Returns tensions and stiffness of posture q (nq,)."""
        robot, routing, cables = self.robot, self.routing, self.cables
        stiffness = self.stiffness(q)
        wanted = self.wanted(q) if torque is None else finite(torque, (len(self.index),), "torque")
        base = robot.base_pose(q)[0]
        length, _ = lengths_and_rates(robot.tree, base, robot.angles(q), routing.holes)
        t, short, method = self.tensions(stiffness.arms, wanted)
        least, softest = stiffness.softest(t)
        result = CablesResult(
            routing.names, t, length, tuple(self.names), stiffness.arms, wanted, short, method,
            "", how, stiffness.matrix(t), least, softest, stiffness.threshold,
        )  # fmt: skip
        if result.feasible:
            limits = cables.minimum, cables.maximum
            holding = least_holding_tension(stiffness, wanted, *limits)
            limit = holding_limit(stiffness, wanted, *limits)
            result = replace(result, holding=holding, limit=limit)
        return replace(result, why=_why(result, cables.maximum))

    def along(self, q: Floats, motion: str | Path) -> CableMotion:
        """Returns the stiffness along a motion, quasi-statically."""
        robot = self.robot
        start = robot.angles(q)[[robot.joint_names.index(n) for n in robot.chain_joints]]
        moved = motion_of(robot, motion, start=start)
        time = moved.times(_RATE)
        angles = moved.at(time)[0]
        least, highest, good = np.zeros((3, len(time)))
        softest, threshold = [], 0.0
        for k in range(len(time)):
            posed = q.copy()
            for name, angle in zip(moved.joints, angles[k], strict=True):
                set_angle(robot, posed, name, float(angle))
            stiffness, wanted = self.stiffness(posed), self.wanted(posed)
            t, short, _ = self.tensions(stiffness.arms, wanted)
            least[k], soft = stiffness.softest(t)
            highest[k], good[k] = t.max(), balanced(short, wanted)
            softest.append(self.names[int(np.argmax(np.abs(soft)))])
            threshold = max(threshold, stiffness.threshold)
        worst = softest[int(np.argmin(least))]
        return CableMotion(moved.name, time, least, highest, good, worst, threshold)


def _routing_json(sizes: dict[str, Any], assumed: bool) -> dict[str, Any]:
    """Returns a routing's sizes, and whether nobody gave any."""
    return {
        "assumed": assumed,
        "cables_per_segment": sizes["count"],
        "radius_m": sizes["radius"],
        "phase_rad": sizes["phase"],
        "standoff_m": sizes["standoff"],
        "sheathed": not sizes["coupled"],
    }


def _why(result: CablesResult, maximum: float) -> str:
    """Returns one sentence: held or balanced, or the joint with the largest shortage."""
    tension, joints = result.tension, result.joints
    if result.feasible:
        i = int(np.argmax(tension))
        high = f"the highest tension is {tension[i]:.4g} N in {result.names[i]}"
        if result.holds:
            return f"held; {high}"
        return f"balanced but NOT held: {result.softest_joint} leaves when disturbed; {high}"
    shortage, torque = result.shortage, result.torque
    i = int(np.argmax(np.abs(shortage)))
    others = int(np.sum(np.abs(shortage) > 1e-7)) - 1
    cap = f" within {maximum:g} N" if np.isfinite(maximum) else ""
    more = f" ({others} more joints need more)" if others else ""
    return (
        f"not held{cap}: {joints[i]} needs {torque[i]:.4g} N·m and is short of "
        f"{abs(shortage[i]):.4g} N·m{more}"
    )
