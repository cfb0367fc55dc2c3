"""A mission that is planned and checked: it may start, and its flights are judged."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.memory import trim
from snakegen.base.sample_store import SampleStore
from snakegen.control.controller import Controller
from snakegen.control.servos import bounded_joints
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.bounds.flight_bounds import (
    hover_sigmas,
    trim_sigmas,
    usual_accelerations,
)
from snakegen.simulation.flight.elastic import modal_frequencies
from snakegen.simulation.flight.loop import Flown, fly
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections, NoiseStream
from snakegen.simulation.flight.vibration import OFF, Damping, hinges
from snakegen.simulation.flight.world import World, make_world
from snakegen.simulation.recording.blocks import Behind, Recorder
from snakegen.simulation.recording.flight_report import flight_report
from snakegen.simulation.recording.metrics import metrics
from snakegen.simulation.recording.recording import Recording
from snakegen.simulation.recording.verdict import FLIGHT_THRESHOLDS, verdict
from snakegen.simulation.recording.worst_place import judged_verdict

MODES = ("dual_rotor", "virtual_single_rotor")


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """A mission that may start: everything about it but the world and chance.

    Attributes:
        robot, plan, controller, imperfections: what flies, where, how.
        position_rate: Hz.
        meta: of its recordings.
        damping: of vibration by internal forces.
    """

    robot: Robot
    plan: Plan
    controller: Controller
    imperfections: Imperfections
    position_rate: float
    meta: dict[str, Any]
    damping: Damping = OFF

    @cached_property
    def usual(self) -> Floats:
        """What default imperfections ask for at its start, by which a flight's hover is judged."""
        return usual_accelerations(self.robot, self.controller, self.plan)

    def world(self) -> World:
        """Returns the nominal world of its flights."""
        plant = self.imperfections
        return make_world(
            self.robot,
            obstacles=self.plan.obstacles,
            link_stiffness=plant.link_stiffness,
            link_damping=plant.link_damping,
            motor_lag=bool(plant.motor_lag),
        )

    def flown(
        self,
        world: World,
        imperfections: Imperfections,
        rng: np.random.Generator,
        seed: int,
        progress: Callable[[int, int], Any] | None = None,
        *,
        margins: bool = True,
        located: bool = True,
        keep: Callable[[Recording], Any] | None = None,
        folder: str | Path | None = None,
    ) -> Recording:
        """Flies it in `world` with noise from `rng` and returns the judged recording.

        Args:
            world: of the robot, its masses or motors changed or not.
            imperfections: of the plant.
            rng: of noise and mismatch.
            seed: what the log names as such.
            progress: called with ticks flown and ticks in all.
            margins: compute the margins along the run; they cost more than the rest of the log.
            located: say of each check where it is at its worst.
            keep: called with the recording of each whole second, as soon as it is flown.
            folder: for the samples.
        """
        plan, count = self.plan, len(self.plan.time)
        rougher = float(np.hypot(imperfections.turbulence, plan.turbulence))
        imperfections = replace(imperfections, turbulence=rougher)
        rate = 1.0 / float(plan.time[1] - plan.time[0]) if count > 1 else 200.0
        sizes = (count, len(world.rotors), len(self.robot.joint_names))
        shares = hinges(world).noise if self.damping.gain > 0 else []
        servos = len(bounded_joints(self.robot))
        noise = NoiseStream(imperfections, rng, *sizes, rate=rate, hinges=shares, servos=servos)
        about = self.meta | {"seed": seed, "plant": vars(imperfections)}
        trim()  # what planning took
        windy = bool(np.any(noise.wind)) or (plan.wind is not None and bool(np.any(plan.wind)))
        recorder = Recorder(
            world, plan, self.controller, SampleStore(folder), about,
            windy=windy, margins=margins, keep=keep,
        )  # fmt: skip
        with Behind(recorder.add, aside=keep is not None) as behind:
            flown = self._fly(world, noise, imperfections, recorder, behind, progress)
        recorder.finish(flown)
        trim()
        window = plan.window or (0.0, float(plan.time[-1]))
        end = min(window[1], float(plan.time[recorder.done - 1]))
        meta = about | {
            "stopped": flown.stopped,
            "metrics_window_s": [min(window[0], end), end],
        }
        if plan.mode is not None:
            meta["mode_changes"] = _mode_changes(plan, recorder.done)
        if plan.drawn is not None:
            meta["facts"] = meta["facts"] | plan.drawn(noise.thrust_factor, noise.torques)
        if flown.trimmed:
            held = trim_sigmas(flown.trimmed, self.usual)
            meta["trim"] = flown.trimmed | {"sigmas": held}
        if plan.tracked:
            torque = recorder.wanted_torque()
            asked = hover_sigmas(self.robot, self.controller, plan, torque, self.usual)
            if asked is not None:
                meta["hover_sigmas"] = asked
        if imperfections.link_stiffness > 0 and recorder.bends is not None:
            modes = modal_frequencies(world.model, recorder.bends.start)
            meta["modal_frequencies_hz"] = [round(float(f), 3) for f in modes]
        return judge(recorder.recording(flown.events, meta), plan, located=located)

    def _fly(
        self,
        world: World,
        noise: NoiseStream,
        imperfections: Imperfections,
        recorder: Recorder,
        behind: Behind,
        progress: Callable[[int, int], Any] | None,
    ) -> Flown:
        """Flies it, whole pieces handed to `behind`; returns the ticks after the last of them."""
        count, taken = len(self.plan.time), 0

        def watch(ticks: int, rows: Callable[[int, int], Flown]) -> int:
            nonlocal taken
            whole = recorder.whole(ticks)
            if whole > taken:
                behind.put(rows(taken, whole))
                taken = whole
            return taken

        return fly(
            world,
            self.plan,
            self.controller,
            noise,
            imperfections,
            position_rate=self.position_rate,
            damping=self.damping,
            progress=None if progress is None else lambda k: progress(k, count),
            watch=watch,
        )


def _mode_changes(plan: Plan, ticks: int) -> list[list[Any]]:
    """Returns when the mode flown changes [s], and to which, in the first ticks of a plan."""
    mode = np.asarray(plan.mode)[:ticks].astype(int)
    at = np.flatnonzero(np.diff(mode)) + 1
    return [[float(plan.time[k]), MODES[mode[k]]] for k in at]


def judge(recording: Recording, plan: Plan, *, located: bool = True) -> Recording:
    """Returns the recording with its metrics and verdict; a run cut short does not pass.

    `located` checks say where they are at their worst.
    """
    found = metrics(recording)
    found["completed"] = not recording.meta["stopped"]
    if "trim" in recording.meta:
        found["trim_sigmas"] = max(recording.meta["trim"]["sigmas"])
    if "hover_sigmas" in recording.meta:
        found["hover_sigmas"] = max(recording.meta["hover_sigmas"])
    bounds = {"completed": {"equals": True}} | FLIGHT_THRESHOLDS | plan.thresholds
    if "saturation_share" in bounds and "gimbal_angle_limit_share" in found:
        bounds["gimbal_angle_limit_share"] = bounds["saturation_share"]
    if not located:
        kept = {name: bound for name, bound in bounds.items() if bound is not None}
        return recording.judged(found, verdict(found, kept, recording.recorded))
    judged = recording.judged(found, judged_verdict(recording, found, bounds))
    return replace(judged, report=flight_report(judged))
