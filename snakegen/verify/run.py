"""A verification run from end to end: mission → plan → flight → recording → verdict."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from snakegen.control.controller import Controller, flight_controller, gain_set
from snakegen.description.mjcf import lowest_point
from snakegen.errors import MissionError
from snakegen.robot import GRAVITY, Robot
from snakegen.verify.elastic import modal_frequencies
from snakegen.verify.flight_report import flight_report
from snakegen.verify.loop import fly
from snakegen.verify.metrics import metrics
from snakegen.verify.missions import is_file, mission
from snakegen.verify.plan import Plan
from snakegen.verify.plant import Imperfections, draw
from snakegen.verify.postures import driven_joints, place
from snakegen.verify.record import record
from snakegen.verify.recording import Recording
from snakegen.verify.verdict import FLIGHT_THRESHOLDS, verdict
from snakegen.verify.vibration import OFF, Damping, check_redundancy, hinges
from snakegen.verify.world import World, make_world


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
) -> Recording:
    """Flies mission `name` with `robot` and returns the judged recording.

    Args:
        robot: any robot that the mission applies to.
        name: of the mission.
        seed: of noise and mismatch; the same seed gives the same run, bit for bit.
        gains: gain set; the robot's own choice if not given.
        allocator: "paper" or "constrained".
        ideal: perfect sensors and rotors.
        options: of the mission.
        progress: called with ticks flown and ticks in all.

    Raises:
        MissionError: the mission does not suit the robot, or cannot start from its posture.
    """
    module = mission(name, robot)
    if hasattr(module, "fly"):  # no aerial flight: the mission has a loop of its own
        given = dict(options or {})
        return module.fly(robot, seed=seed, ideal=ideal, options=given, progress=progress)
    ready = prepare(robot, name, gains=gains, allocator=allocator, ideal=ideal, options=options)
    world = ready.world()
    return ready.flown(world, ready.imperfections, np.random.default_rng(seed), seed, progress)


@dataclass(frozen=True, eq=False)
class Ready:
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

    def world(self) -> World:
        """Returns the nominal world of its flights."""
        plant = self.imperfections
        return make_world(
            self.robot,
            obstacles=self.plan.obstacles,
            link_stiffness=plant.link_stiffness,
            link_damping=plant.link_damping,
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
    ) -> Recording:
        """Flies it in `world` with noise from `rng` and returns the judged recording.

        Args:
            world: of the robot, its masses or motors changed or not.
            imperfections: of the plant.
            rng: of noise and mismatch.
            seed: what the log names as such.
            progress: called with ticks flown and ticks in all.
            margins: work out the margins along the run; they cost more than the rest of the log.
        """
        plan, count = self.plan, len(self.plan.time)
        rate = 1.0 / float(plan.time[1] - plan.time[0]) if count > 1 else 200.0
        sizes = (count, len(world.rotors), len(self.robot.joint_names))
        shares = hinges(world).noise if self.damping.gain > 0 else []
        noise = draw(imperfections, rng, *sizes, rate=rate, hinges=shares)
        flown = fly(
            world,
            plan,
            self.controller,
            noise,
            imperfections,
            position_rate=self.position_rate,
            damping=self.damping,
            progress=None if progress is None else lambda k: progress(k, count),
        )
        window = plan.window or (0.0, float(plan.time[-1]))
        meta = self.meta | {
            "seed": seed,
            "plant": vars(imperfections),
            "stopped": flown.stopped,
            "metrics_window_s": [window[0], min(window[1], float(plan.time[flown.ticks - 1]))],
        }
        if imperfections.link_stiffness > 0:
            modes = modal_frequencies(world.model, flown.qpos[0])
            meta["modal_frequencies_hz"] = [round(float(f), 3) for f in modes]
        recording = record(world, plan, self.controller, flown, meta, margins=margins)
        return judge(recording, plan)


def prepare(
    robot: Robot,
    name: str,
    *,
    gains: str | None = None,
    allocator: str = "paper",
    ideal: bool = False,
    options: dict[str, Any] | None = None,
) -> Ready:
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
    given = dict(options or {})
    if is_file(name):
        given["file"] = name
    if "allocator" in module.OPTIONS:
        given["allocator"] = allocator
    plan: Plan = module.plan(robot, rate, **given)
    check_references(robot, plan)
    check_start(robot, controller, plan, force=bool(given.get("force")))
    damping = Damping.of(control)
    if damping.gain > 0.0:
        check_redundancy(controller, robot.name)
    imperfections = Imperfections.of(robot.modules.plant)
    modes = ("dual_rotor", "virtual_single_rotor")
    meta = {
        "mission": module.__name__.rsplit(".", 1)[-1],
        "options": {k: v for k, v in given.items() if v is not None},
        "mode": modes[controller.mode],
        "gains": gains or str(control.get("gains", "")),
        "allocator": allocator,
        "ideal": ideal,
        "vibration_damping": damping.gain,
        "planned_s": float(plan.time[-1]),
        "facts": plan.facts,
        "obstacles": [vars(b) for b in plan.obstacles],
    }
    return Ready(
        robot,
        plan,
        controller,
        imperfections.ideal() if ideal else imperfections,
        float(control.get("position_rate", 40.0)),
        meta,
        damping,
    )


def judge(recording: Recording, plan: Plan) -> Recording:
    """Returns the recording with its metrics and verdict; a run cut short does not pass."""
    found = metrics(recording)
    found["completed"] = not recording.meta["stopped"]
    bounds = {"completed": {"equals": True}} | FLIGHT_THRESHOLDS | plan.thresholds
    wanted = {k: v for k, v in bounds.items() if v is not None}
    judged = recording.judged(found, verdict(found, wanted))
    return replace(judged, report=flight_report(judged))


def check_references(robot: Robot, plan: Plan) -> None:
    """Refuses a plan that leads joints beyond their limits or the body into the floor.

    Raises:
        MissionError: the first such joint or instant.
    """
    names = driven_joints(robot)
    low, high, _ = robot.limits(names)
    beyond = np.argwhere((plan.joints < low - 1e-9) | (plan.joints > high + 1e-9))
    if len(beyond):
        k, i = beyond[0]
        raise MissionError(
            f"the mission leads {names[i]} to {plan.joints[k, i]:.3f} rad at {plan.time[k]:.2f} s; "
            f"its limits are {low[i]:g} … {high[i]:g}."
        )
    if plan.on_floor:
        return
    world = make_world(robot, floor=False)
    data = mujoco.MjData(world.model)
    for k in np.unique(np.linspace(0, len(plan.time) - 1, 40).astype(int)):
        world.set_state(data, place(robot, plan.joints[k], plan.position[k], plan.rotation[k]))
        mujoco.mj_kinematics(world.model, data)
        lowest = lowest_point(world.model, data)
        if lowest < 0.0:
            raise MissionError(
                f"the mission leads the body {-lowest:.2f} m into the floor at "
                f"{plan.time[k]:.2f} s: CoG at {plan.position[k, 2]:.2f} m; fly higher."
            )


def check_start(robot: Robot, controller: Controller, plan: Plan, *, force: bool = False) -> None:
    """Refuses a start that cannot hover; `force` lets a singular posture pass.

    Raises:
        MissionError: too heavy, no hover within limits, or σ_min below the controller's threshold.
    """
    from snakegen.control.frame import cog_frame

    most = float(robot.rotors.thrust_max.sum())
    weight = robot.mass * GRAVITY
    if most <= weight:
        raise MissionError(
            f"{robot.name} is too heavy to fly: {weight:.1f} N of weight, {most:.1f} N of thrust "
            f"at most (thrust to weight {most / weight:.2f})."
        )
    base, origin = robot.base_pose(plan.start)
    angles = robot.angles(plan.start)
    frame = cog_frame(controller, angles, base, origin)
    sigma, unmet, thrust, limit = _first_allocation(robot, controller, plan, frame)
    if sigma < controller.law.sigma_min and controller.mode == 1 and not force:
        raise MissionError(
            f"{robot.name} starts in a singular posture: scaled σ_min {sigma:.2g} is below "
            f"{controller.law.sigma_min:g}; bend the body, or lower control.sigma_min."
        )
    if force:
        return
    if unmet > 1e-3 or np.any(thrust > limit * (1 + 1e-9)) or np.any(thrust < -1e-9):
        raise MissionError(
            f"{robot.name} cannot hover in the mission's first posture: thrusts "
            f"{np.round(thrust, 2).tolist()} N for limits {np.round(limit, 2).tolist()} N, "
            f"{100 * unmet:.2g} % of the weight unbalanced."
        )


def _first_allocation(
    robot: Robot, controller: Controller, plan: Plan, frame: Any
) -> tuple[float, float, Any, Any]:
    """Returns σ_min, share of the weight unmet, thrusts and limits of the first tick."""
    from snakegen.kernels.control_types import Measured, Target

    base, origin = robot.base_pose(plan.start)
    angles = robot.angles(plan.start)
    still = np.zeros(3)
    measured = Measured(base, origin, still, still, angles, np.zeros_like(angles))
    target = Target(frame.cog, still, still, frame.axes, still)
    turns = np.zeros((controller.apparatuses, 2))
    for j in range(controller.apparatuses):
        for k, body in enumerate((robot.gimbals.roll_body[j], robot.gimbals.pitch_body[j])):
            turns[j, k] = angles[body - 1] if body >= 0 else 0.0
    _, command = controller.tick(measured, target, controller.start(turns), 1e-9)
    gap = frame.scale * (command.given - frame.hover_wrench)
    if controller.mode == 0:
        gap = gap[2:]
    return (
        float(command.sigma_min),
        float(np.linalg.norm(gap)),
        command.thrust,
        robot.rotors.thrust_max,
    )
