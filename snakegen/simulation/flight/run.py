"""A verification run from end to end: mission → plan → flight → recording → verdict."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.memory import map_large_arrays
from snakegen.base.sample_store import samples_in
from snakegen.control.controller import flight_controller, gain_set
from snakegen.errors import MissionError
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.bounds.disturbance_budget import disturbed_bounds
from snakegen.simulation.flight.bounds.error_budget import integral_limits
from snakegen.simulation.flight.bounds.flight_bounds import (
    leaves_at_start,
    tracking_bounds,
)
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.preflight import (
    check_air,
    check_references,
    check_start,
)
from snakegen.simulation.flight.prepared_run import MODES, PreparedRun
from snakegen.simulation.flight.reference_limits import check_motion
from snakegen.simulation.flight.scene_geoms import described
from snakegen.simulation.flight.tipping import check_levers
from snakegen.simulation.flight.trim import TrimOption, trimmed, usual_seconds
from snakegen.simulation.flight.vibration import Damping, check_redundancy
from snakegen.simulation.missions import is_file, mission
from snakegen.simulation.missions.options import checked_options
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.run_settings import RunSettings


def run(
    robot: Robot,
    name: str,
    *,
    seed: int = 0,
    gains: str | None = None,
    allocator: str = "paper",
    ideal: bool = False,
    options: dict[str, Any] | None = None,
    progress: Callable[[int, int], Any] | None = None,
    keep: Callable[[Recording], Any] | None = None,
    folder: str | Path | None = None,
) -> Recording:
    """Flies mission `name` with `robot` and returns the judged recording.

    Args:
        robot: any robot that the mission applies to.
        name: of the mission.
        seed: of noise and mismatch; the same seed gives the same run, bit for bit on one machine.
        gains: gain set; the robot's own choice if not given.
        allocator: "paper" or "constrained".
        ideal: perfect sensors and rotors.
        options: of the mission.
        progress: called with ticks flown and ticks in all.
        keep: called with the recording of each whole second of a flight; drives and arms have
            none.
        folder: for the samples of a run until its recording is dropped, in a nameless file; the
            system's folder for temporary files if not given.

    Raises:
        MissionError: the mission does not suit the robot, or cannot start from its posture.
    """
    module = mission(name, robot)
    map_large_arrays()
    with samples_in(folder):
        if hasattr(module, "fly"):  # no aerial flight: the mission has a loop of its own
            chosen = checked_options(name, module.Options, options or {})
            return module.fly(robot, chosen, RunSettings(seed, ideal, progress))  # type: ignore[no-any-return]
        ready = prepare(robot, name, gains=gains, allocator=allocator, ideal=ideal, options=options)
        world, rng = ready.world(), np.random.default_rng(seed)
        return ready.flown(world, ready.imperfections, rng, seed, progress, keep=keep)


def prepare(
    robot: Robot,
    name: str,
    *,
    gains: str | None = None,
    allocator: str = "paper",
    ideal: bool = False,
    options: dict[str, Any] | None = None,
) -> PreparedRun:
    """Returns mission `name` planned and checked; arguments and errors as in `run`."""
    module = mission(name, robot)
    if hasattr(module, "fly"):
        raise MissionError(f"mission '{name}' has a loop of its own; only flights can be repeated.")
    chosen = gain_set(robot, gains)
    if hasattr(module, "gains"):
        chosen = module.gains(chosen)
    controller = flight_controller(robot, chosen, allocator=allocator)
    control = robot.modules.control
    rate = float(control.get("attitude_rate", 200.0))
    given = dict(options or {}) | ({"file": name} if is_file(name) else {})
    asked = checked_options(name, module.Options, given)
    if hasattr(asked, "allocator"):
        asked = replace(asked, allocator=allocator, ideal=ideal)
    plan: Plan = module.plan(robot, rate, asked)
    if plan.rate_filter and not controller.law.rate_filter:
        controller = controller.with_law(rate_filter=plan.rate_filter)
    check_references(robot, plan)
    check_motion(robot, controller, plan)
    if isinstance(asked, TrimOption):
        untrimmed = plan.on_floor or (
            getattr(module, "UNTRIMMED", False)
            and (ideal or not leaves_at_start(robot, controller, plan))
        )
        usual = 0.0 if untrimmed else usual_seconds(controller.law)
        plan = trimmed(plan, usual if asked.trim is None else asked.trim)
    check_start(robot, controller, plan, force=getattr(asked, "force", False) is True)
    if plan.tracked:
        bounds: dict[str, dict[str, Any] | None] = tracking_bounds(
            robot,
            controller,
            plan,
            plan.kind or module.__name__.rsplit(".", 1)[-1],
            MODES[controller.mode],
            chosen,
        )
        plan = replace(plan, thresholds=bounds | plan.thresholds)
    imperfections = Imperfections.of(robot.modules.plant)
    imperfections = imperfections.ideal() if ideal else imperfections
    if plan.disturbed and imperfections.turbulence == imperfections.wind_speed == 0.0:
        known = disturbed_bounds(robot, controller, chosen, plan, MODES[controller.mode])
        plan = replace(plan, thresholds=plan.thresholds | known)
    damping = Damping.of(control)
    if damping.gain > 0.0:
        check_redundancy(controller, robot.name)
    if hasattr(module, "plant"):
        imperfections = module.plant(imperfections, asked)
    check_air(plan, imperfections)
    if gains is None:  # a gain set that is asked for by name is tried, and judged by its flight
        check_levers(robot, controller, plan, imperfections)
    if plan.trim or plan.on_floor:
        force, torque = integral_limits(robot, controller, plan, imperfections)
        controller = controller.with_law(force_integral_limit=force, torque_integral_limit=torque)
    meta = {
        "mission": module.__name__.rsplit(".", 1)[-1],
        "options": {k: v for k, v in given.items() if v is not None},
        "mode": MODES[controller.mode],
        "gains": gains or str(control.get("gains", "")),
        "allocator": allocator,
        "ideal": ideal,
        "vibration_damping": damping.gain,
        "rate_filter_hz": controller.law.rate_filter,
        "planned_s": float(plan.time[-1]),
        "trim_s": plan.trim / rate,
        "facts": plan.facts,
        "obstacles": [described(b) for b in plan.obstacles],
    }
    return PreparedRun(
        robot,
        plan,
        controller,
        imperfections,
        float(control.get("position_rate", 40.0)),
        meta,
        damping,
    )
