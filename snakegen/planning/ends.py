"""Where a motion starts and ends: postures at a place, headings and positions left open."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats, quaternion_xyzw, rotation_from_rpy
from snakegen.errors import PlanError, near
from snakegen.planning.body import PlannedBody
from snakegen.planning.follow import Chain, pose_of
from snakegen.robot.posture import bent
from snakegen.scene.schema import Demands, Place, Scene

HEADINGS = 8


@dataclass(frozen=True, eq=False)
class End:
    """A body at its start or goal.

    Attributes:
        q: (nq,) configuration, gimbals at 0; CoG where the place has it.
        free: whether it may be moved as a whole, within the place's distance.
        place: what the scene says.
    """

    q: Floats
    free: bool
    place: Place


def angles_of(body: PlannedBody, place: Place) -> Floats | None:
    """Returns the joints (k,) that a place gives; None where the body rests spread out.

    Raises:
        PlanError: an unknown joint or an angle beyond its limits.
    """
    if place.joints is None:
        return None
    out = np.zeros(len(body.names))
    for name, angle in place.joints.items():
        if name not in body.names:
            raise PlanError(f"no driven joint '{name}'.{near(name, body.names)}")
        k = body.names.index(name)
        if not body.low[k] - 1e-9 <= angle <= body.high[k] + 1e-9:
            raise PlanError(
                f"{name} = {angle:g} is outside its limits {body.low[k]:g} … {body.high[k]:g}."
            )
        out[k] = angle
    return out


def ends_of(body: PlannedBody, place: Place) -> Iterator[End]:
    """Yields bodies at a place: bent to either side if free, in `HEADINGS` headings if free."""
    given = angles_of(body, place)
    shapes = [bent(body.robot), -bent(body.robot)] if given is None else [given]
    turns = [0.0] if place.rpy is not None else np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS
    for shape in shapes:
        for turn in turns:
            rpy = np.array([0.0, 0.0, turn]) if place.rpy is None else place.rpy
            q = body.neutral.copy()
            q[3:7] = quaternion_xyzw(rotation_from_rpy(rpy))
            q[body.at] = np.clip(shape, body.low, body.high)
            q[:3] += place.cog - pose_of(body, q)[:3]
            yield End(q, place.within > 0.0, place)


def moved(end: End, body: PlannedBody, shift: Floats) -> End | None:
    """Returns the end moved by `shift` [m]; None if that is farther than its place allows."""
    if float(np.linalg.norm(shift)) > end.place.within:
        return None
    q = end.q.copy()
    q[:3] += shift
    return End(q, end.free, end.place)


def line_of(chain: Chain, end: End) -> tuple[Floats, Floats, Floats]:
    """Returns the rods' ends (r + 1, 3) [m], last first, and directions of last and leader."""
    line = chain.line(end.q)
    first, last = line[1] - line[0], line[-1] - line[-2]
    return line, first / np.linalg.norm(first), last / np.linalg.norm(last)


def check_end(body: PlannedBody, end: End, name: str, demands: Demands) -> str:
    """Returns why a body cannot be at an end, "" if it can; of a free one hover alone counts."""
    now = body.at_pose(pose_of(body, end.q))
    found = body.distances(now.q)
    shapes = body.shapes
    for kind, part, least in (
        ("from obstacles", found[: shapes.outer], demands.clearance + now.slack),
        ("from itself", found[shapes.outer :], 0.0),
    ):
        if end.free and kind == "from obstacles":
            continue
        if len(part) and part.min() < least:
            k = int(np.argmin(part)) + (0 if kind == "from obstacles" else shapes.outer)
            a, b = (shapes.labels[i] for i in shapes.pairs[k])
            gap = float(part.min())
            deep = f"{-1e3 * gap:.3g} mm in each other" if gap < 0 else f"{1e3 * gap:.3g} mm apart"
            return (
                f"{name}: {a} and {b} are {deep} (gimbals at any angle); "
                f"{1e3 * least:.3g} mm are demanded"
            )
    force, torque = (float(x[0]) for x in body.margins(now.points[None]))
    limits = np.asarray(body.sets.high)
    if force <= 0.0 or torque <= 0.0:
        why = "lacks thrust" if float(limits.sum()) <= body.weight else "cannot hold all directions"
        return (
            f"{name}: {body.robot.name} {why} there: force margin {force:.3g} N, torque margin "
            f"{torque:.3g} N·m (weight {body.weight:.1f} N, thrust {limits.sum():.1f} N)"
        )
    if force < demands.force_margin or torque < demands.torque_margin:
        return (
            f"{name}: margins of {force:.3g} N and {torque:.3g} N·m are less than the demanded "
            f"{demands.force_margin:g} N and {demands.torque_margin:g} N·m"
        )
    return ""


def check_places(body: PlannedBody, scene: Scene) -> None:
    """Refuses a start or goal that cannot be held: a free one in no attitude that it may have.

    Raises:
        PlanError: which, and by how much.
    """
    for name in ("start", "goal"):
        place: Place | None = getattr(scene, name)
        if place is None:
            raise PlanError(f"{scene.name}: '{name}' is missing: a plan needs start and goal.")
        reasons: list[str] = []
        for end in ends_of(body, place):
            reasons.append(check_end(body, end, name, scene.demands))
            if not reasons[-1]:
                break
        else:
            raise PlanError(f"{scene.name}: {reasons[0]}.")
