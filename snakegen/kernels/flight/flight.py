"""The flight loop, compiled whole: sense, decide, act, step the simulator, remember.

It runs without Python's lock, so that flights in threads are flown at the same time.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.control.control_tick import decide
from snakegen.kernels.control.types import Command, Law, State, Target, copied, with_flags
from snakegen.kernels.control.vibration_damping import damped, swinging
from snakegen.kernels.core.c_call import call_two_pointers
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import borrowed, scratch
from snakegen.kernels.core.types import Floats, Mechanism
from snakegen.kernels.dynamics.generalized_forces import generalize
from snakegen.kernels.flight.aerodynamics import air_forces, push
from snakegen.kernels.flight.sensing import read_imu, remember, sense
from snakegen.kernels.flight.types import (
    Damper,
    Memory,
    Plant,
    References,
    Simulator,
    Wiring,
    World,
)

LOST = 50.0  # m/s or rad/s: a run this fast has diverged
FLYING, DIVERGED, ASTRAY = 0, 1, 2  # how a stretch of ticks ended


@bare
def thrusts_into(sim: Simulator, wires: Wiring, out: Floats) -> None:
    """Writes the thrust (r,) [N] that each rotor gives now, after its motor's lag."""
    for r in range(out.shape[0]):
        a = wires.activation[r]
        out[r] = sim.act[a] if a >= 0 else sim.ctrl[wires.rotors[r]]


@bare
def slew(now: float, goal: float, step: float) -> float:
    """Returns `goal`, or as near to it as a `step` from `now` gets."""
    return min(max(goal, now - step), now + step)


@bare(no_cpython_wrapper=True)
def act(
    sim: Simulator,
    wires: Wiring,
    plan: References,
    plant: Plant,
    memory: Memory,
    thrust: Floats,
    gimbals: Floats,
    k: int,
    row: Floats,
) -> None:
    """Writes the controls of tick k, servos within their speed, and `row` as they were asked."""
    for j in range(gimbals.shape[0]):
        for i in range(2):
            memory.gimbals[j, i] = slew(
                memory.gimbals[j, i], gimbals[j, i], plant.gimbal_step[j, i]
            )
            if wires.gimbals[j, i] >= 0:
                sim.ctrl[wires.gimbals[j, i]] = memory.gimbals[j, i]
    for i in range(memory.joints.shape[0]):
        memory.joints[i] = slew(memory.joints[i], plan.joints[k, i], plant.joint_step[i])
        sim.ctrl[wires.servos[i]] = memory.joints[i]
    voltage = 1.0 - plant.sag * min(memory.used[0], 1.0)
    most = voltage * voltage if memory.used[0] < 1.0 else 0.0
    for r in range(thrust.shape[0]):
        ceiling = most * plant.thrust_max[r]
        sim.ctrl[wires.rotors[r]] = min(thrust[r] * plan.strength[k, r], ceiling)
    for i in range(row.shape[0]):
        row[i] = sim.ctrl[i]
    for r in range(thrust.shape[0]):
        row[wires.rotors[r]] = thrust[r]


@bare(no_cpython_wrapper=True)
def world_forces(
    sim: Simulator,
    wires: Wiring,
    plan: References,
    plant: Plant,
    memory: Memory,
    thrust: Floats,
    k: int,
) -> None:
    """Applies the forces that are held during tick k: disturbance and air; drains the battery."""
    for b in range(memory.steady.shape[0]):
        for i in range(6):
            memory.steady[b, i] = 0.0
    if plan.disturbance.shape[0] > 0:
        body = wires.disturbed
        at = sim.com if wires.at_cog else sim.body_position[body]
        push(sim, body, at, plan.disturbance[k], memory.steady)
        for i in range(3, 6):
            memory.steady[body, i] += plan.disturbance[k, i]
    if plant.air > 0.0:
        air_forces(sim, wires, plant, thrust, plan.wind[k], memory.steady)
    for b in range(memory.steady.shape[0]):
        for i in range(6):
            sim.applied[b, i] = memory.steady[b, i]
    power = 0.0
    for r in range(thrust.shape[0]):
        given = max(thrust[r], 0.0)
        power += plant.power[r] * given * sqrt(given)
    memory.used[0] += power * plant.substeps * plant.timestep / plant.capacity


@bare
def spin_torques(
    sim: Simulator, wires: Wiring, plant: Plant, memory: Memory, thrust: Floats
) -> None:
    """Applies what the spinning rotors do to their bodies: ``τ = −d(H u)/dt``.

    ``H = J Ω s``, Ω grows as the root of thrust; the moment is ``−Ḣ u − ω × H u``.
    """
    axis, turned = scratch(3), scratch(3)
    for r in range(thrust.shape[0]):
        body = wires.rotor_body[r]
        for i in range(3, 6):
            sim.applied[body, i] = memory.steady[body, i]
    for r in range(thrust.shape[0]):
        body, site = wires.rotor_body[r], wires.rotor_site[r]
        share = max(thrust[r], 0.0) / plant.thrust_max[r]
        momentum = plant.spin_momentum[r] * sqrt(share)
        rate = (momentum - memory.momentum[r]) / plant.timestep
        memory.momentum[r] = momentum
        for i in range(3):
            axis[i] = sim.site_axes[site, 3 * i + 2]
        cross_into(sim.twist[body], axis, turned)
        for i in range(3):
            sim.applied[body, 3 + i] -= rate * axis[i] + momentum * turned[i]


@bare
def fastest(speeds: Floats) -> float:
    """Returns the largest magnitude; inf when any entry is not a number."""
    most = 0.0
    for v in speeds:
        if not abs(v) <= most:
            most = abs(v) if v == v else np.inf
    return most


@bare
def distance(a: Floats, b: Floats) -> float:
    """Returns ``‖a − b‖`` of two (3,) vectors."""
    return sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@jit(nogil=True)
def fly_ticks(
    mechanism: Mechanism,
    law: Law,
    damper: Damper,
    world: World,
    state: State,
    first: int,
    last: int,
) -> tuple[State, int, int]:
    """Flies ticks `first` … `last` − 1; returns memory, the next tick, and how it ended."""
    mechanism, law, damper, world = borrowed((mechanism, law, damper, world))  # type: ignore[call-arg]
    sim, wires, plan, plant, memory, rows = world
    dt = plant.substeps * plant.timestep
    count = wires.rotors.shape[0]
    own, thrust = copied(state), scratch(count)
    now, wish, turn = borrowed(own), scratch(count), scratch(memory.gimbals.shape)  # type: ignore[call-arg]
    for k in range(first, last):
        remember(sim, memory, rows, k)
        measured, hinges = sense(sim, wires, damper, plan, plant, memory, k)
        target = Target(
            plan.position[k],
            plan.velocity[k],
            plan.acceleration[k],
            plan.rotation[k],
            plan.angular[k],
        )
        force_dt = plant.hold * dt if k % plant.hold == 0 else 0.0
        command = Command(wish, turn, rows.wanted[k], rows.given[k], 0.0, 0, 0.0, 0)
        blend, short, sigma, _, _, status = decide(
            mechanism, law, plan.mode[k], measured, target, now, dt, force_dt, command
        )
        now = with_flags(now, blend, short)
        rows.sigma[k], rows.status[k] = sigma, status
        asked, turns = wish, turn
        if hinges.shape[0] > 0:
            asked, turns = damped(
                mechanism, law, damper, measured, swinging(damper, hinges, dt),
                plan.rotation[k], blend, command,
            )  # fmt: skip
        act(sim, wires, plan, plant, memory, asked, turns, k, rows.command[k])
        thrusts_into(sim, wires, thrust)
        world_forces(sim, wires, plan, plant, memory, thrust, k)
        for i in range(plant.substeps):
            thrusts_into(sim, wires, thrust)
            spin_torques(sim, wires, plant, memory, thrust)
            call_two_pointers(sim.begin, sim.model, sim.data)
            generalize(sim, wires)
            call_two_pointers(sim.finish, sim.model, sim.data)
            if (k * plant.substeps + i + 1) % plant.imu == 0:
                read_imu(sim, memory)
        if not fastest(sim.qvel) < LOST:
            return with_flags(own, blend, short), k + 1, DIVERGED
        if distance(sim.com, plan.position[k]) > plant.give_up:
            return with_flags(own, blend, short), k + 1, ASTRAY
    return with_flags(own, now.blend, now.saturated), last, FLYING
