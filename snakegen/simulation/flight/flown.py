"""What a flight leaves behind: rows of MuJoCo's state, of commands and of what acted."""

from dataclasses import dataclass, field
from typing import Any

from snakegen.base.geometry import Floats


@dataclass(frozen=True, eq=False)
class Flown:
    """What a run left behind, a row a tick, taken before the tick's command acts.

    Attributes:
        ticks: how many rows there are.
        qpos, qvel, act, force: rows of MuJoCo's state and actuator forces.
        command: (T, nu) controls asked for.
        sigma_min, wanted, given: from the controller.
        contact: (T,) N, normal force of the floor.
        used: (T,) share of the battery.
        wind: (T, 3) m/s, world.
        events: (time, level, text).
        stopped: "" or why the run ended early.
        axes: (3, 3) of the CoG frame in the root link, at the start.
        trimmed: what the integrals held when trimming ended; empty where nothing was trimmed.
        first: tick of the first row; those before it were taken by `watch`.
    """

    ticks: int
    qpos: Floats
    qvel: Floats
    act: Floats
    force: Floats
    command: Floats
    sigma_min: Floats
    wanted: Floats
    given: Floats
    contact: Floats
    used: Floats
    wind: Floats
    events: list[tuple[float, str, str]]
    stopped: str
    axes: Floats
    trimmed: dict[str, Any] = field(default_factory=dict)
    first: int = 0
