"""Gait of a screw drive over an edge: one drum up at a time, the others carry and drive.

Before each lift the body takes the shape in which its centre of gravity lies deep inside the
triangle (or polygon) of the drums that stay down, and in which these steer.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import MissionError
from snakegen.kernels.kinematics.chain import forward
from snakegen.robot.robot import Robot
from snakegen.screw_drive.kinematics import ScrewGeometry
from snakegen.simulation.drive.stance import Heights, Stance
from snakegen.simulation.flight.plan import PEAK_RATE, quintic

_SAMPLE = 0.02  # s, between the instants that are computed
_CURVE = 10.0 / np.sqrt(3.0)  # largest curvature of the quintic
_SHORTEST = 0.2  # s, of a stage
_ROOM = 0.01  # m, kept between a drum on the ground and an edge
_CLEAR = 0.008  # m, over the edge; a drum held out sags 3 mm


@dataclass(frozen=True)
class Stage:
    """A stretch of the gait: from one state of drums' mean, shape and drums' heights to another."""

    time: float  # s, that it takes
    x: tuple[float, float]  # m
    shape: tuple[Floats, Floats]  # (m − 1,) rad
    floor: tuple[Floats, Floats]  # (n,) m

    def at(self, t: float) -> tuple[float, Floats, Floats]:
        """Returns x, shape and floors after t [s]."""
        f = float(quintic(t / self.time)[0])
        a, b = 1.0 - f, f
        return (
            a * self.x[0] + b * self.x[1],
            a * self.shape[0] + b * self.shape[1],
            a * self.floor[0] + b * self.floor[1],
        )


@dataclass(frozen=True, eq=False)
class Gait:
    """Stages one after the other, as a reference for the law and pitch joints over time."""

    stance: Stance
    stages: tuple[Stage, ...]

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""
        return float(sum(stage.time for stage in self.stages))

    def state(self, t: float) -> tuple[float, Floats, Floats]:
        """Returns x of the drums' mean, shape and floors at time t [s]."""
        for stage in self.stages[:-1]:
            if t < stage.time:
                return stage.at(t)
            t -= stage.time
        return self.stages[-1].at(t)

    @cached_property
    def _splines(self) -> tuple[Any, Any]:
        from scipy.interpolate import CubicSpline

        time = np.arange(0.0, self.duration + 2 * _SAMPLE, _SAMPLE)
        heights = Heights(self.stance.geometry, self.stance.pitch_first)
        states, bends = [], []
        for t in time:
            x, shape, floor = self.state(float(t))
            head, _ = self.stance.places(shape)
            headings = self.stance.headings(shape)
            states.append([head[0] + x, head[1], headings[0], *shape])
            least = np.concatenate([floor[:1], floor, floor[-1:]])
            pitch, yaw = heights.joints(heights.over(least), headings)
            bends.append(np.concatenate([pitch, yaw - shape]))
        ends = ((1, np.zeros(len(states[0]))),) * 2
        return CubicSpline(time, states, bc_type=ends), CubicSpline(time, bends)

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Returns w_d and ẇ_d at time t [s]."""
        w, _ = self._splines
        if t >= self.duration:
            return np.asarray(w(self.duration)), np.zeros(w.c.shape[-1])
        return np.asarray(w(t)), np.asarray(w(t, 1))

    def lift(self, t: float) -> tuple[Floats, Floats]:
        """Returns pitch joints, and what is added to yaw joints, (m − 1,) [rad] each."""
        both = np.asarray(self._splines[1](min(t, self.duration)))
        return both[: len(both) // 2], both[len(both) // 2 :]

    @property
    def steepest(self) -> tuple[float, float]:
        """The largest pitch and yaw joint angle of all [rad]."""
        w, bend = (spline.c[-1] for spline in self._splines)
        half = bend.shape[1] // 2
        yaw = w[:, 3:] + bend[:, half:]
        return float(np.abs(bend[:, :half]).max()), float(np.abs(yaw).max())


@dataclass(frozen=True)
class Pace:
    """How fast a gait goes: m/s and m/s² ahead, rad/s of yaw joints, m/s of drums up and down."""

    speed: float
    acceleration: float
    bend: float = 0.4
    lift: float = 0.05

    def time(self, before: tuple[float, Floats, Floats], x: float, b: Floats, f: Floats) -> float:
        """Returns the time [s] of a stage to x, shape b and floors f, a quintic in all of them."""
        way = abs(x - before[0])
        swing = float(np.abs(b - before[1]).max(initial=0.0))
        rise = float(np.abs(f - before[2]).max())
        eager = np.sqrt(_CURVE * way / self.acceleration) if self.acceleration > 0 else 0.0
        slow = max(way / self.speed, swing / self.bend, rise / self.lift)
        return max(PEAK_RATE * slow, float(eager), _SHORTEST)


def reaches(robot: Robot, g: ScrewGeometry) -> Floats:
    """Returns what of each drum's link (n, 2) [m] stands on the ground ahead of and behind it.

    Half of the drum, or the caster on the same link where that is farther.
    """
    _, place = forward(robot.tree, np.eye(3), np.zeros(3), np.zeros(len(robot.joint_names)))
    starts = np.concatenate([[0.0], np.cumsum(g.lengths)])
    centres = starts[list(g.link)] + np.array(g.offset)
    out = np.zeros((g.units, 2))
    for k, screw in enumerate(robot.modules.screws):
        drum = robot.body_of_joint(screw.joint)
        wheels = np.flatnonzero(robot.tree.parent == drum)
        far = np.abs(place[wheels, 0] - place[drum, 0]).max(initial=0.0) + screw.wheel_radius
        out[k] = max(far, 0.5 * screw.radius)
    for caster in robot.modules.casters:
        body, _, shift = robot.body_of_link(caster.link)
        at = place[body, 0] + shift[0]
        k = int(np.argmin(np.abs(centres - at)))
        ahead, behind = centres[k] - at + caster.radius, at - centres[k] + caster.radius
        out[k] = np.maximum(out[k], [ahead, behind])
    return out


def crossing(
    robot: Robot, edges: tuple[float, float], height: float, pace: Pace, ahead: float
) -> Gait:
    """Returns the gait from `ahead` [m] before a ledge's first edge to behind its second.

    Args:
        robot: four drums or more; with three, two would be left to stand on.
        edges: x [m] of the edge up and of the edge down.
        height: m, of the ledge.
        pace: how fast.
        ahead: m, from the foremost drum or caster to the first edge at the start.

    Raises:
        MissionError: no shape within the yaw limits stands with a drum lifted, or drums that
            stand too close for one at a time.
    """
    stance = Stance(robot)
    g = stance.geometry
    firm = stance.shapes()
    margins = [stance.margin(shape, k) for k, shape in enumerate(firm)]
    weakest = int(np.argmin(margins))
    if margins[weakest] <= 0:
        raise MissionError(
            f"{robot.name}: with drum {weakest + 1} lifted no shape within the yaw joints' limits "
            f"stands; its centre of gravity is {-1e3 * margins[weakest]:.1f} mm outside."
        )
    reach, rim = reaches(robot, g), np.sqrt(g.r**2 - max(g.r - height, 0.0) ** 2)

    def span(shape: Floats, k: int) -> tuple[float, float]:
        """Returns how far (m) drum k reaches ahead of and behind the drums' mean along x."""
        psi, place = stance.headings(shape)[g.link[k]], stance.places(shape)[1][k, 0]
        along = np.abs(np.cos(psi)) * reach[k] + np.abs(np.sin(psi)) * rim + _ROOM
        return float(place + along[0]), float(along[1] - place)

    floor, stages = np.zeros(g.units), []
    now = (edges[0] - ahead - span(firm[0], 0)[0], firm[0], floor)

    def on(x: float, shape: Floats, floor: Floats) -> None:
        nonlocal now
        time = pace.time(now, x, shape, floor)
        stages.append(Stage(time, (now[0], x), (now[1], shape), (now[2], floor)))
        now = (x, shape, floor)

    top = height + _CLEAR
    for edge, level in zip(edges, (height, 0.0), strict=True):
        for k, shape in enumerate(firm):
            before, behind = span(shape, k)
            if edge - before < now[0]:
                raise MissionError(
                    f"{robot.name}: drum {k + 1} meets the edge {now[0] - edge + before:.3f} m "
                    "before the one ahead of it is past it: the drums stand too close."
                )
            up, down = now[2].copy(), now[2].copy()
            up[k], down[k] = top, level
            on(edge - before, shape, now[2])
            on(now[0], shape, up)
            on(edge + behind, shape, up)
            on(now[0], shape, down)
    on(now[0] + ahead, now[1], now[2])
    return Gait(stance, tuple(stages))
