"""The flight loop, compiled whole: sense, decide, act, step the simulator, remember.

It runs without Python's lock, so that flights in threads are flown at the same time.
"""

from math import sqrt

import numpy as np

from snakegen.kernels.air import air_forces, push
from snakegen.kernels.borrowed import borrowed
from snakegen.kernels.control_tick import control_tick
from snakegen.kernels.control_types import Law, Measured, State, Target
from snakegen.kernels.damping import damped
from snakegen.kernels.flight_types import (
    Damper,
    Memory,
    Plant,
    References,
    Rows,
    Simulator,
    Wiring,
)
from snakegen.kernels.foreign import call_two_pointers
from snakegen.kernels.history import rotation_of_quaternion
from snakegen.kernels.jit import jit
from snakegen.kernels.linear import cross_into, matmul_into, turn_into
from snakegen.kernels.tree import Floats, Gimbals, Rotors, Tree

LOST = 50.0  # m/s or rad/s: a run this fast has diverged
FLYING, DIVERGED, ASTRAY = 0, 1, 2  # how a stretch of ticks ended


@jit
def read_imu(sim: Simulator, memory: Memory) -> None:
    """Takes a sample of attitude and angular rate."""
    rotation_of_quaternion(sim.qpos[3:7], memory.imu[:9].reshape(3, 3))
    for i in range(3):
        memory.imu[9 + i] = sim.qvel[3 + i]


@jit
def thrusts_into(sim: Simulator, wires: Wiring, out: Floats) -> None:
    """Writes the thrust (r,) [N] that each rotor gives now, after its motor's lag."""
    for r in range(out.shape[0]):
        a = wires.activation[r]
        out[r] = sim.act[a] if a >= 0 else sim.ctrl[wires.rotors[r]]


@jit
def sense(
    sim: Simulator,
    wires: Wiring,
    damper: Damper,
    plan: References,
    plant: Plant,
    memory: Memory,
    k: int,
) -> tuple[Measured, Floats]:
    """Returns what the controller learns at tick k: noisy, held between samples, late.

    Besides, the rates (e,) of the damped hinges beyond what is asked of their servos.
    """
    if k % plant.hold == 0:
        for i in range(3):
            memory.seen[i] = sim.qpos[i] + plan.position_noise[k, i]
            memory.seen[3 + i] = sim.qvel[i] + plan.velocity_noise[k, i]
    n, dt = wires.qpos.shape[0], plant.substeps * plant.timestep
    row = memory.ring[k % memory.ring.shape[0]]
    rotation, rate = np.empty((3, 3)), np.empty(3)
    matmul_into(memory.imu[:9].reshape(3, 3), plan.attitude_noise[k], rotation)
    row[:9] = rotation.ravel()
    for i in range(3):
        rate[i] = memory.imu[9 + i] + plan.gyro_noise[k, i]
    row[9:15] = memory.seen
    turn_into(rotation, rate, row[15:18])
    for i in range(n):
        row[18 + i] = sim.qpos[wires.qpos[i]] + plan.angle_noise[i]
        row[18 + n + i] = sim.qvel[wires.qvel[i]]
    for e in range(damper.rate.shape[0]):
        asked, servo = 0.0, damper.servo[e]
        if servo >= 0 and k > 0:
            asked = (plan.joints[k, servo] - plan.joints[k - 1, servo]) / dt
        row[18 + 2 * n + e] = sim.qvel[damper.rate[e]] + plan.hinge_noise[k, e] - asked
    late = memory.ring[max(k - plant.delay, 0) % memory.ring.shape[0]]
    measured = Measured(
        late[:9].reshape(3, 3),
        late[9:12],
        late[12:15],
        late[15:18],
        late[18 : 18 + n],
        late[18 + n : 18 + 2 * n],
    )
    return measured, late[18 + 2 * n :]


@jit
def slew(now: float, goal: float, step: float) -> float:
    """Returns `goal`, or as near to it as a `step` from `now` gets."""
    return min(max(goal, now - step), now + step)


@jit
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
    row[:] = sim.ctrl
    for r in range(thrust.shape[0]):
        row[wires.rotors[r]] = thrust[r]


@jit
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
    memory.steady[:] = 0.0
    if plan.disturbance.shape[0] > 0:
        body = wires.disturbed
        at = sim.com if wires.at_cog else sim.body_position[body]
        push(sim, body, at, plan.disturbance[k], memory.steady)
        for i in range(3, 6):
            memory.steady[body, i] += plan.disturbance[k, i]
    if plant.air > 0.0:
        air_forces(sim, wires, plant, thrust, plan.wind[k], memory.steady)
    sim.applied[:] = memory.steady
    power = 0.0
    for r in range(thrust.shape[0]):
        given = max(thrust[r], 0.0)
        power += plant.power[r] * given * sqrt(given)
    memory.used[0] += power * plant.substeps * plant.timestep / plant.capacity


@jit
def spin_torques(
    sim: Simulator, wires: Wiring, plant: Plant, memory: Memory, thrust: Floats
) -> None:
    """Applies what the spinning rotors do to their bodies: ``τ = −d(H u)/dt``.

    ``H = J Ω s``, Ω grows as the root of thrust; the moment is ``−Ḣ u − ω × H u``.
    """
    axis, turned = np.empty(3), np.empty(3)
    for r in range(thrust.shape[0]):
        body = wires.rotor_body[r]
        sim.applied[body, 3:] = memory.steady[body, 3:]
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


@jit
def fastest(speeds: Floats) -> float:
    """Returns the largest magnitude; inf when any entry is not a number."""
    most = 0.0
    for v in speeds:
        if not abs(v) <= most:
            most = abs(v) if v == v else np.inf
    return most


@jit
def distance(a: Floats, b: Floats) -> float:
    """Returns ``‖a − b‖`` of two (3,) vectors."""
    return sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@jit(nogil=True)
def fly_ticks(
    tree: Tree,
    rotors: Rotors,
    gimbals: Gimbals,
    law: Law,
    length: float,
    damper: Damper,
    sim: Simulator,
    wires: Wiring,
    plan: References,
    plant: Plant,
    memory: Memory,
    rows: Rows,
    state: State,
    first: int,
    last: int,
) -> tuple[State, int, int]:
    """Flies ticks `first` … `last` − 1; returns memory, the next tick, and how it ended."""
    tree, rotors, gimbals, law = borrowed((tree, rotors, gimbals, law))  # type: ignore[call-arg]
    sim, wires, damper, plan = borrowed((sim, wires, damper, plan))
    plant, memory, rows = borrowed((plant, memory, rows))
    dt = plant.substeps * plant.timestep
    thrust = np.empty(wires.rotors.shape[0])
    for k in range(first, last):
        rows.qpos[k], rows.qvel[k] = sim.qpos, sim.qvel
        rows.act[k], rows.force[k] = sim.act, sim.force
        rows.contact[k] = sim.touch.sum()
        rows.used[k] = memory.used[0]
        measured, hinges = sense(sim, wires, damper, plan, plant, memory, k)
        target = Target(
            plan.position[k],
            plan.velocity[k],
            plan.acceleration[k],
            plan.rotation[k],
            plan.angular[k],
        )
        force_dt = plant.hold * dt if k % plant.hold == 0 else 0.0
        state, command = control_tick(
            tree, rotors, gimbals, law, length, plan.mode[k], measured, target, state, dt, force_dt
        )
        rows.wanted[k], rows.given[k] = command.wanted, command.given
        rows.sigma[k], rows.status[k] = command.sigma_min, command.status
        asked, turns = command.thrust, command.gimbals
        if hinges.shape[0] > 0:
            asked, turns = damped(
                tree,
                rotors,
                gimbals,
                law,
                length,
                damper,
                measured,
                damper.modes @ hinges,
                plan.rotation[k],
                state.blend,
                command,
            )
        act(sim, wires, plan, plant, memory, asked, turns, k, rows.command[k])
        thrusts_into(sim, wires, thrust)
        world_forces(sim, wires, plan, plant, memory, thrust, k)
        for i in range(plant.substeps):
            thrusts_into(sim, wires, thrust)
            spin_torques(sim, wires, plant, memory, thrust)
            call_two_pointers(sim.step, sim.model, sim.data)  # type: ignore[call-arg]
            if (k * plant.substeps + i + 1) % plant.imu == 0:
                read_imu(sim, memory)
        if not fastest(sim.qvel) < LOST:
            return state, k + 1, DIVERGED
        if distance(sim.com, plan.position[k]) > plant.give_up:
            return state, k + 1, ASTRAY
    return state, last, FLYING
