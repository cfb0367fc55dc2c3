"""A whole flight against bare stepping of the same controls, and what its log costs.

Both are flown in turn in one run, in processor time, so that a busy machine weighs on both.

python benchmarks/flight_speed.py [--robot dragon4] [--seconds 10] [--pairs 5]
"""

import argparse
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

from snakegen.control.controller import flight_controller
from snakegen.log import write
from snakegen.robot.robot import load
from snakegen.simulation.flight.loop import Flown, fly
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections, draw
from snakegen.simulation.flight.world import World, make_world
from snakegen.simulation.missions import planned
from snakegen.simulation.recording.record import record


def bare(world: World, plan: Plan, flown: Flown) -> float:
    """Returns the seconds that MuJoCo alone takes for the controls of a flight.

    Each tick starts from the state that was flown: replayed open loop, without the forces of air
    and rotors, the robot would fall and lie on the floor, where a step costs twice as much.
    """
    data = mujoco.MjData(world.model)
    world.set_state(data, plan.start)
    data.act[:] = flown.act[0]
    substeps = round(float(plan.time[1]) / world.model.opt.timestep)
    spent = 0.0
    for k, command in enumerate(flown.command):
        data.qpos[:], data.qvel[:], data.act[:] = flown.qpos[k], flown.qvel[k], flown.act[k]
        data.ctrl[:] = command
        start = time.process_time()
        mujoco.mj_step(world.model, data, substeps)
        spent += time.process_time() - start
    return spent


def main() -> None:
    """Prints ratio, cost of a tick, cost and size of the log."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pairs", type=int, default=5)
    given = parser.parse_args()
    robot = load(given.robot)
    plan = planned("hover", robot, 200.0, duration=given.seconds)
    controller, world = flight_controller(robot), make_world(robot)
    what = Imperfections.of(robot.modules.plant)
    ticks = len(plan.time)
    noise = draw(what, np.random.default_rng(0), ticks, len(world.rotors), len(robot.joint_names))
    flown = fly(world, plan, controller, noise, what)  # compiles
    whole, alone = [], []
    for _ in range(given.pairs):
        start = time.process_time()
        flown = fly(world, plan, controller, noise, what)
        whole.append(time.process_time() - start)
        alone.append(bare(world, plan, flown))
    ratio = np.array(whole) / np.array(alone)
    print(f"{given.robot}, hover {given.seconds:g} s, {ticks} ticks; processor time, median")
    print(f"  whole flight       {1e6 * np.median(whole) / ticks:8.1f} µs a tick")
    print(f"  bare mj_step       {1e6 * np.median(alone) / ticks:8.1f} µs a tick")
    print(f"  whole over bare    {np.median(ratio):8.2f}   ({ratio.min():.2f} … {ratio.max():.2f})")
    recording = record(world, plan, controller, flown, {})
    start = time.process_time()
    recording = record(world, plan, controller, flown, {})
    made = time.process_time() - start
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.rrd"
        write(recording, path)
        start = time.process_time()
        write(recording, path)
        wrote = time.process_time() - start
        size = path.stat().st_size
    print(f"  recording          {1e6 * made / ticks:8.1f} µs a tick, margins at 10 Hz included")
    print(f"  writing the .rrd   {1e6 * wrote / ticks:8.1f} µs a tick, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
