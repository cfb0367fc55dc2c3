"""A whole flight against bare stepping of the same controls, and what its log costs.

Both are flown in turn in one run, in processor time, so that a busy machine weighs on both. The
last lines are of the whole: plan, flight with journal and recording, metrics, verdict and log, as
`snakegen analyze flight` makes them once it is imported; a thread records while another flies, so
that its wall time on two quiet cores is below its processor time.

python benchmarks/flight_speed.py [--robot dragon4] [--seconds 10] [--pairs 5] [--whole 300]
"""

import argparse
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np

from snakegen.control.controller import flight_controller
from snakegen.log import Journal, write
from snakegen.robot.robot import Robot, load
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.loop import fly
from snakegen.simulation.flight.plan import Plan
from snakegen.simulation.flight.plant import Imperfections, draw
from snakegen.simulation.flight.run import run
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
    parser.add_argument("--whole", type=float, default=300.0, help="s, of the whole; 0: none")
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
    if given.whole > 0:
        each = np.median(alone) / ticks
        with tempfile.TemporaryDirectory(dir=".") as folder:
            whole_command(robot, given.whole, Path(folder), float(each))


def whole_command(robot: Robot, seconds: float, folder: Path, bare_tick: float) -> None:
    """Prints what a flight from plan to log takes over bare stepping [s a tick] of its ticks."""
    path = folder / "whole.rrd"
    for length in (2.0, seconds):  # the first compiles and imports
        journal = Journal(path)
        begun, busy = time.perf_counter(), time.process_time()
        options = {"duration": length}
        recording = run(robot, "hover", options=options, keep=journal.keep, folder=folder)
        write(recording, path)
        journal.remove()
        taken, spent = time.perf_counter() - begun, time.process_time() - busy
    alone = bare_tick * len(recording.time)
    print(f"from plan to log, {seconds:g} s, {len(recording.time)} ticks")
    print(f"  processor time     {spent:8.2f} s, {spent / alone:.2f} of bare stepping")
    print(f"  wall               {taken:8.2f} s, {taken / alone:.2f} of bare stepping")


if __name__ == "__main__":
    main()
