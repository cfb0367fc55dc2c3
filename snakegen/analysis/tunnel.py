"""Tunnel: how deep the whole body follows its tip into a hole along a line in space.

Follow the leader in three dimensions: the base is held, and a redundant arm folds outside, or it is
fed in behind. `reach` leads the tip alone; here every point of the body has to keep to the line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.inverse_kinematics.collisions import Collisions, Nearest, obstacles_of
from snakegen.inverse_kinematics.hole import Hole, checked_hole
from snakegen.inverse_kinematics.path_following import Options, chain_of, reach_point
from snakegen.inverse_kinematics.tip_paths import checked_path
from snakegen.inverse_kinematics.tunnel import Entry, enter
from snakegen.robot.robot import Robot
from snakegen.scene.schema import read_scene
from snakegen.scene.solids import Solid
from snakegen.statics.joint_torques import finite
from snakegen.statics.tip import find_tip

COMMAND = "tunnel"
ORDER = 71
REPORT = False  # needs a hole
EXAMPLE = "arm6 --mouth 1.25,0.08,0.08 --inwards 1,0,0 --depth 0.3"


@dataclass(frozen=True)
class TunnelResult:
    """How a body went into a hole.

    Attributes:
        joints: names of the joints that move.
        hole: centreline and room.
        entry: step by step.
        fed: whether the base may move.
        nearest: least distance of the body from itself, the floor and obstacles on the way in.
    """

    joints: tuple[str, ...]
    hole: Hole
    entry: Entry
    fed: bool
    nearest: Nearest

    @property
    def complete(self) -> bool:
        """Tells whether the hole was entered to its end and nothing touched on the way."""
        return not self.entry.why and self.nearest.free

    @property
    def why(self) -> str:
        """One sentence: complete, or how far it got and what stopped it."""
        e = self.entry
        if not e.why:
            return f"the whole body follows to the end, {_mm(e.whole)} deep"
        return f"lost {_mm(e.depth[-1])} of {_mm(e.whole)} deep: {e.why}"

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        e, base = self.entry, "held"
        if self.fed:
            base = f"fed by {_mm(e.feed[-1])}"
        at = int(np.argmax(e.off))
        rms = float(np.sqrt(np.mean(e.off**2)))
        return [
            ("base", base),
            ("hole", self.why),
            (
                "body off",
                f"{_mm(e.off[at])} at most (tip {_mm(e.depth[at])} deep), {_mm(rms)} RMS of the "
                f"largest at each depth, {_mm(e.between)} while joints turn between depths; "
                f"{_mm(self.hole.room)} of room",
            ),
            ("tip error", f"{_mm(e.tip_error.max())} at most"),
            ("clearance" if self.nearest.free else "collision", self.nearest.text()),
        ]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        e = self.entry
        return {
            "joints": list(self.joints),
            "complete": self.complete,
            "why": self.why,
            **self.nearest.to_json(),
            "depth_reached_m": float(e.depth[-1]),
            "depth_m": e.whole,
            "body_off_max_m": float(e.off.max()),
            "body_off_between_max_m": e.between,
            "tip_error_max_m": float(e.tip_error.max()),
            "room_m": self.hole.room,
            "feed_m": float(e.feed[-1]),
            "depths_m": e.depth.tolist(),
            "body_off_m": e.off.tolist(),
            "feeds_m": e.feed.tolist(),
            "joints_end_rad": dict(zip(self.joints, e.angles[-1].tolist(), strict=True)),
        }


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base, no joint of which follows another (mimic)."""
    return not robot.floating and len(robot.chain_joints) > 0 and not robot.followers


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    path: ArrayLike | None = None,
    mouth: ArrayLike | None = None,
    inwards: ArrayLike = (1.0, 0.0, 0.0),
    depth: float = 0.3,
    room: float = 0.01,
    feed: float = 0.0,
    step: float = 0.005,
    give_up: float = 1e-3,
    margin: float = 0.0,
    tip: str | None = None,
    tip_point: ArrayLike | None = None,
    obstacles: str | Path | Sequence[Solid] = (),
    opening: str | None = None,
) -> TunnelResult:
    """Returns how deep the whole body follows its tip into a hole.

    Args:
        robot: an arm.
        q: (nq,) posture it starts from; the tip first goes to the mouth.

    Options:
        path: table (CSV, Parquet, YAML) of x,y,z [m] from the base origin: the hole's
            centreline, mouth first
        mouth: x,y,z of a straight hole's mouth, m, in place of a path
        inwards: direction of that hole
        depth: m, of that hole
        room: m, that the body's line may be off the centreline
        feed: m, that the base can go along the hole's first direction; 0: it is held
        step: m, between depths
        give_up: m, tip error at which the line counts as lost
        margin: rad, kept from the joints' limits
        obstacles: scene file (YAML) of what the body must not touch, in metres from the base
        opening: obstacle of that scene whose opening or bore is the hole, in place of path and
            mouth
        tip: link that carries the tip; the last one if absent
        tip_point: x,y,z of the tip on that link, m

    Raises:
        AnalysisError: no hole, invalid numbers, a mouth that the tip cannot stand in.
    """
    q = robot.validate_configuration(q)
    if not applies(robot):
        raise AnalysisError(f"{robot.name}: tunnel needs a chain on a fixed base.")
    for name, number in (("step", step), ("give_up", give_up), ("depth", depth)):
        if not number > 0:
            raise AnalysisError(f"{name} = {number:g} m: more than 0 is needed.")
    if not feed >= 0:
        raise AnalysisError(f"feed = {feed:g} m: 0 or more is needed.")
    chain = chain_of(robot, q, find_tip(robot, tip, tip_point))
    if not 0 <= margin < 0.5 * float(np.min(chain.upper - chain.lower)):
        raise AnalysisError(f"margin = {margin:g} rad leaves the joints no range.")
    chain = replace(chain, lower=chain.lower + margin, upper=chain.upper - margin)
    given = path if opening is None else _bore(obstacles, opening)
    hole = checked_hole(_centreline(given, mouth, inwards, depth), room)
    full = robot.angles(q)
    if feed == 0:
        full, missed, held = reach_point(chain, full, hole.points[0], Options())
        if missed > give_up:
            why = f": {', '.join(held)} at the limit" if held else ""
            if float(np.linalg.norm(hole.points[0])) > chain.scale:
                why = f": it lies beyond the stretched chain of {chain.scale:.4g} m"
            raise AnalysisError(f"the tip misses the hole's mouth by {_mm(missed)}{why}.")
    entry = enter(chain, full, hole, feed=feed, step=step, give_up=give_up)
    names = tuple(robot.joint_names[j] for j in chain.joints)
    solids = obstacles_of(obstacles)
    shift = entry.feed[:, None] * hole.inwards
    nearest = Collisions(robot, solids).nearest(entry.angles, names, shift=shift)
    return TunnelResult(names, hole, entry, feed > 0, nearest)


def _bore(obstacles: str | Path | Sequence[Solid], name: str) -> Floats:
    """Returns the way (m, 3) through an opening of a scene file, from the base's side.

    Raises:
        AnalysisError: no scene file, or no such opening in it.
    """
    if not isinstance(obstacles, str | Path):
        raise AnalysisError("an opening is named by its obstacle in a scene file: --obstacles.")
    ways = {w.name: w.line for w in read_scene(Path(obstacles), ground=False).openings}
    if name not in ways:
        known = near(name, ways) or f" It has {', '.join(ways) or 'none'}."
        raise AnalysisError(f"{Path(obstacles).name}: no opening '{name}'.{known}")
    line = ways[name]
    return line if np.linalg.norm(line[0]) <= np.linalg.norm(line[-1]) else line[::-1]


def _centreline(
    path: ArrayLike | None, mouth: ArrayLike | None, inwards: ArrayLike, depth: float
) -> Floats:
    """Returns the points (m, 3) of a hole's centreline."""
    if path is not None:
        return checked_path(path)
    if mouth is None:
        raise AnalysisError(
            "tunnel needs a hole: --path FILE, --mouth x,y,z, or --obstacles FILE --opening NAME."
        )
    along = finite(inwards, (3,), "inwards")
    if not np.linalg.norm(along) > 0:
        raise AnalysisError("inwards: a direction of length 0.")
    begin = finite(mouth, (3,), "mouth")
    return np.array([begin, begin + depth * along / np.linalg.norm(along)])


def _mm(metres: float) -> str:
    """Returns a length as people say it: mm below a metre."""
    if abs(metres) >= 1.0:
        return f"{metres:.3g} m"
    return f"{1e3 * metres:.3g} mm" if abs(metres) > 1e-9 else "0 mm"
