"""A verification run from Python: a robot and a mission in, a judged recording out."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from snakegen.log.write import write
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import Robot, load
from snakegen.simulation.flight.memory_check import refuse_too_long
from snakegen.simulation.flight.run import run
from snakegen.simulation.recording.recording import Recording
from snakegen.spec.robot_spec import RobotSpec


@dataclass(frozen=True, repr=False)
class SimulatedRecording(Recording):
    """A recording that was simulated here, and knows the meshes of its robot.

    ``recording["position"]`` is a signal's array (T, k), ``recording.names`` are their names,
    ``recording.channel(name)`` has labels, unit and meaning, ``recording.metrics`` and
    ``recording.verdict`` what the checks found.

    Attributes:
        robot: that flew, drove or moved.
        spec: that it was loaded from, if any.
    """

    robot: Robot | None = field(default=None, compare=False)
    spec: RobotSpec | None = field(default=None, compare=False)

    @property
    def passed(self) -> bool:
        """Whether every check of the verdict passed."""
        return self.verdict is not None and self.verdict.passed

    def save(self, path: str | Path) -> Path:
        """Writes the rerun log (.rrd), whole or not at all, and returns its path.

        Raises:
            LogError: it cannot be written there.
        """
        if self.robot is not None and self.robot.folder is not None:
            return write(self, path, mesh_folder=self.robot.folder)
        from snakegen.description.meshes.folder import write_robot_meshes

        with TemporaryDirectory() as folder:
            return write(self, path, mesh_folder=write_robot_meshes(Path(folder), self.spec))


def simulate(
    robot: Any,
    mission: str,
    *,
    seed: int = 0,
    gains: str | None = None,
    allocator: str = "paper",
    ideal: bool = False,
    progress: Callable[[int, int], Any] | None = None,
    **options: Any,
) -> SimulatedRecording:
    """Flies, drives or moves a robot through a mission in MuJoCo and returns what was recorded.

    Args:
        robot: a Robot, or what `load` takes.
        mission: its name, or a YAML file of waypoints; ``snakegen missions ROBOT`` lists them.
        seed: of noise and mismatch; the same seed gives the same run, bit for bit on one machine.
        gains: gain set of a flight; the robot's own choice if not given.
        allocator: of a flight: ``paper`` (pseudo-inverse) or ``constrained``.
        ideal: perfect sensors and actuators.
        progress: called with steps done and steps in all.
        **options: of the mission, as ``snakegen missions ROBOT MISSION`` lists them; `posture` is a
            mapping of joint angles, or a Configuration (a mission points the gimbals itself).

    Raises:
        MissionError: the mission does not suit the robot, has no such option, or cannot start.
        SnakegenError: the robot cannot be read.
    """
    spec = robot if isinstance(robot, RobotSpec) else None
    body = robot if isinstance(robot, Robot) else load(robot)
    posture = options.get("posture")
    if isinstance(posture, Configuration):
        held = {"base_position", *body.gimbal_names}
        options["posture"] = {k: v for k, v in posture.posture().items() if k not in held}
    if isinstance(seconds := options.get("duration"), int | float):
        refuse_too_long(body, seconds)
    how: dict[str, Any] = {"gains": gains, "allocator": allocator, "ideal": ideal}
    found = run(body, mission, seed=seed, options=options, progress=progress, **how)
    parts = {f.name: getattr(found, f.name) for f in fields(Recording)}
    return SimulatedRecording(**parts, robot=body, spec=spec)
