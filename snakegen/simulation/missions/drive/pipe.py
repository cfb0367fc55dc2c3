"""Drive through a round pipe a little wider than the body, and compare with open ground.

Straight ahead, every wheel's no-slip condition (HA eq 3) is the same all round a drum, so a wall
that touches anywhere rolls along as the ground does.
"""

import copy
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from snakegen.errors import MissionError
from snakegen.robot.robot import Robot, from_urdf_text
from snakegen.scene.schema import read_scene
from snakegen.simulation.drive.plan import (
    DriveOptions,
    DrivePlan,
    at_most,
    can_drive,
    following,
    lasting,
)
from snakegen.simulation.drive.record import PASSAGE, beside_open_ground, drive
from snakegen.simulation.obstacles import pipe
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


@dataclass(frozen=True)
class Options(DriveOptions):
    """Options of mission `pipe`.

    Attributes:
        room: m, between drums and pipe all round; less than 0: the pipe presses on them
        staves: 1, flats that make the pipe's section; the lowest is the ground
        entry: m ahead of the head, where the pipe begins
        length: m, of the pipe
        fit: casters too wide for the pipe get the widest track that fits, and a body with one at
            its head gets one at its tail; false: refuse
        scene: scene file (YAML) whose first pipe gives entry, length and radius; it lies on the
            ground along x, the head starts at x = 0
    """

    room: float = 0.001
    staves: int = 16
    entry: float = 0.25
    length: float = 1.2
    fit: bool = True
    scene: str | None = None


TAIL = "caster_tail"
BOUNDS = {
    "distance_excess_m": 0.022,
    "distance_rmse_m": 0.009,
    "distance_end_m": 0.0052,
    "shape_rmse_rad": 0.009,
    "tilt_max_rad": 0.15,
    "slip_mean_m_s": 0.007,
}
"""2.5 to 3 medians of ten seeds of `screw4`."""


def applies(robot: Robot) -> bool:
    """A floating base and two or more screw drums."""
    return can_drive(robot)


def widest_track(radius: float, room: float, ball: float, staves: int) -> float:
    """Returns how far apart [m] a caster's balls may stand in a pipe of inner radius R.

    Balls of radius b at ±t/2 touch stave k, at angle a, lifted by δ where
    ``t/2 sin a + (R − b − δ) cos a = R − b``; δ = twice the room presses drums against the top.
    """
    inside, angle = radius - ball, 2.0 * np.pi * np.arange(1, staves // 2) / staves
    lifted = inside - (inside - 2.0 * max(room, 0.0)) * np.cos(angle)
    return 2.0 * float(np.min(lifted / np.sin(angle)))


def fitted(robot: Robot, radius: float, room: float, staves: int, fit: bool) -> Robot:
    """Returns the robot with casters whose balls fit a pipe of inner `radius` [m].

    Raises:
        MissionError: balls that stand too far apart, where they may not be moved.
    """
    casters = []
    for caster in robot.modules.casters:
        most = math.floor(1e3 * widest_track(radius, room, caster.radius, staves)) / 1e3
        if caster.track > most and not (fit and most > 0):
            raise MissionError(
                f"the balls of {caster.link} stand {caster.track:g} m apart; a pipe "
                f"{2 * radius:g} m wide takes caster.track = {most:g} m"
            )
        casters.append(replace(caster, track=min(caster.track, most)))
    return replace(robot, modules=replace(robot.modules, casters=tuple(casters)))


def of_scene(options: Options, path: Path, drum: float) -> Options:
    """Returns options with entry, length and room of a scene's first pipe.

    Args:
        options: whose others are kept.
        path: of the scene.
        drum: m, radius of the drums.

    Raises:
        MissionError: no pipe in the scene, or one that does not lie along x on the ground ahead.
    """
    pipes = [w for w in read_scene(path).openings if w.bore]
    if not pipes:
        raise MissionError(
            f"{path.name}: no obstacle of kind pipe; the mission drives through one."
        )
    way, radius = pipes[0], 0.5 * pipes[0].size[0]
    ends = way.bore[:1] + way.bore[-1:]
    straight = all(abs(y) < 1e-6 and abs(z - radius) < 1e-6 for _, y, z in way.bore)
    if not straight or not 0.0 <= ends[0][0] < ends[1][0]:
        raise MissionError(
            f"{path.name}: {way.name}: a drive needs a pipe on the ground along x, ahead of its "
            f"head: points [[x0, 0, {radius:g}], [x1, 0, {radius:g}]] with 0 ≤ x0 < x1."
        )
    entry, length = ends[0][0], ends[1][0] - ends[0][0]
    return replace(options, entry=entry, length=length, room=radius - drum)


def braced(robot: Robot) -> Robot:
    """Returns the robot with a caster at its tail too, where it has one at the head alone.

    Casters as narrow as a pipe hold a body upright only where both of its ends have one.
    """
    if len(robot.modules.casters) != 1:
        return robot
    name, last = robot.modules.casters[0].link, list(robot.modules.lengths)[-1]
    tree = ElementTree.fromstring(robot.urdf)
    (link,) = (one for one in tree.iter("link") if one.get("name") == name)
    (module,) = (one for one in tree.iter("caster") if one.get("link") == name)
    link, extra = copy.deepcopy(link), copy.deepcopy(module)
    for one, key in ((link, "name"), (extra, "link")):
        one.set(key, TAIL)
    mount = ElementTree.Element("joint", name=f"{TAIL}_mount", type="fixed")
    ElementTree.SubElement(mount, "parent", link=last)
    ElementTree.SubElement(mount, "child", link=TAIL)
    place = f"{robot.modules.lengths[last]:g} 0 {-robot.modules.screws[0].radius:g}"
    ElementTree.SubElement(mount, "origin", rpy="0 0 0", xyz=place)
    tree.extend([mount, link])
    (holder,) = tree.iter("snakegen")
    holder.insert(list(holder).index(module) + 1, extra)
    text = ElementTree.tostring(tree, encoding="unicode")
    return from_urdf_text(text, robot.folder, checked=True)


def fly(robot: Robot, options: Options, settings: RunSettings) -> Recording:
    """Drives open ground first, then the pipe, and returns the judged recording of the latter."""
    drum = robot.modules.screws[0].radius
    if options.scene is not None:
        options = of_scene(options, Path(options.scene), drum)
    radius, staves = drum + options.room, options.staves
    if not (radius > 0.9 * drum and options.length > 0):
        raise MissionError("pipe needs a length above 0 and at least 0.9 of the drums' radius.")
    if not (isinstance(staves, int) and 6 <= staves <= 64):
        raise MissionError(f"staves = {staves}: a pipe is made of 6 to 64.")
    given = len(robot.modules.casters)
    robot = braced(robot) if options.fit else robot
    tracks = [caster.track for caster in robot.modules.casters]
    robot = fitted(robot, radius, options.room, staves, options.fit)
    narrow = [c for c, was in zip(robot.modules.casters, tracks, strict=True) if c.track < was]
    notes = [f"a pipe {2 * radius:.3f} m wide inside lies ahead"]
    notes += [f"{c.link}: balls {c.track:g} m apart, to fit the pipe" for c in narrow]
    body = sum(robot.modules.lengths.values())
    path = [("line", options.entry + options.length + body + 0.1)]
    reference = following(robot, path, options.speed, options.acceleration)
    if len(tracks) > given:
        notes.append("a caster is added at the tail, to hold the body upright")
    plan = DrivePlan(
        reference,
        reference.at(0.0)[0],
        lasting(options, reference.duration + 1.0),
        options.gain,
        options.feedback,
        obstacles=pipe((options.entry, options.entry + options.length), radius, staves),
        events=tuple((0.0, text) for text in notes),
        facts={
            "pipe_diameter_m": 2.0 * radius,
            "drum_diameter_m": 2.0 * drum,
            "caster_track_m": [c.track for c in robot.modules.casters],
        },
        thresholds=PASSAGE | at_most(BOUNDS, options),
    )
    open_plan = DrivePlan(reference, plan.start, plan.duration, plan.gain, plan.feedback)
    quiet = replace(settings, progress=None)
    free = drive(robot, "pipe", open_plan, plant=options.plant, settings=quiet).metrics
    return drive(
        robot, "pipe", plan, plant=options.plant, settings=settings, more=beside_open_ground(free)
    )
