"""What a flight's controller learns of the simulator, and what the log keeps of it."""

from snakegen.kernels.control.types import Measured
from snakegen.kernels.core.mat3 import matmul_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.flight.run_history import rotation_of_quaternion
from snakegen.kernels.flight.types import Damper, Memory, Plant, References, Rows, Simulator, Wiring


@bare
def read_imu(sim: Simulator, memory: Memory) -> None:
    """Takes a sample of attitude and angular rate."""
    rotation_of_quaternion(sim.qpos[3:7], memory.imu[:9].reshape(3, 3))
    for i in range(3):
        memory.imu[9 + i] = sim.qvel[3 + i]


@bare
def mixed_into(newer: Floats, older: Floats, share: float, out: Floats) -> None:
    """Writes ``(1 − share) newer + share older``; the first nine numbers stay a rotation.

    A mean of rotations θ apart is brought back by one step of ``R (3 − RᵀR)/2``, to O(θ⁴).
    """
    for i in range(out.shape[0]):
        out[i] = (1.0 - share) * newer[i] + share * older[i]
    if share == 0.0:
        return
    mean, gram = scratch((3, 3)), scratch((3, 3))
    for i in range(3):
        for j in range(3):
            mean[i, j] = out[3 * i + j]
    matmul_into(mean.T, mean, gram)
    for i in range(3):
        for j in range(3):
            gram[i, j] = (1.5 if i == j else 0.0) - 0.5 * gram[i, j]
    matmul_into(mean, gram, out[:9].reshape(3, 3))


@bare(no_cpython_wrapper=True)
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

    A delay between two ticks mixes both; a held position is the last one that had arrived. Besides,
    the rates (e,) of the damped hinges beyond what is asked of their servos.
    """
    if k % plant.hold == 0:
        for i in range(3):
            memory.seen[i] = sim.qpos[i] + plan.position_noise[k, i]
            memory.seen[3 + i] = sim.qvel[i] + plan.velocity_noise[k, i]
    n, dt = wires.qpos.shape[0], plant.substeps * plant.timestep
    row = memory.ring[k % memory.ring.shape[0]]
    for i in range(9):
        row[i] = memory.imu[i]
    for i in range(6):
        row[9 + i] = memory.seen[i]
    for i in range(3):
        row[15 + i] = memory.imu[9 + i]
    for i in range(n):
        row[18 + i] = sim.qpos[wires.qpos[i]]
        row[18 + n + i] = sim.qvel[wires.qvel[i]]
    hinges = damper.rate.shape[0]
    for e in range(hinges):
        asked, servo = 0.0, damper.servo[e]
        if servo >= 0 and k > 0:
            asked = (plan.joints[k, servo] - plan.joints[k - 1, servo]) / dt
        row[18 + 2 * n + e] = sim.qvel[damper.rate[e]] - asked
    first = 18 + 2 * n + hinges
    for i in range(wires.loaded.shape[0]):
        row[first + i] = sim.force[wires.loaded[i]]

    late, count = memory.late, memory.ring.shape[0]
    at = max(k - plant.delay, 0)  # whose noise it is
    newer = memory.ring[at % count]
    older = newer if plant.part == 0.0 else memory.ring[max(k - plant.delay - 1, 0) % count]
    mixed_into(newer, older, plant.part, late)
    for i in range(6):
        late[9 + i] = older[9 + i]
    rotation, rate = scratch((3, 3)), scratch(3)
    matmul_into(late[:9].reshape(3, 3), plan.attitude_noise[at], rotation)
    for i in range(3):
        rate[i] = late[15 + i] + plan.gyro_noise[at, i]
    for i in range(3):
        for j in range(3):
            late[3 * i + j] = rotation[i, j]
    turn_into(rotation, rate, late[15:18])
    for i in range(n):
        late[18 + i] += plan.angle_noise[i]
    for e in range(hinges):
        late[18 + 2 * n + e] += plan.hinge_noise[at, e]
    for i in range(min(wires.loaded.shape[0], plan.torque_noise.shape[0])):
        late[first + i] += plan.torque_noise[i]
    measured = Measured(
        late[:9].reshape(3, 3),
        late[9:12],
        late[12:15],
        late[15:18],
        late[18 : 18 + n],
        late[18 + n : 18 + 2 * n],
        late[first:],
    )
    return measured, late[18 + 2 * n : first]


@bare(no_cpython_wrapper=True)
def remember(sim: Simulator, memory: Memory, rows: Rows, k: int) -> None:
    """Writes the state at the start of tick k into its row of the log."""
    for i in range(sim.qpos.shape[0]):
        rows.qpos[k, i] = sim.qpos[i]
    for i in range(sim.qvel.shape[0]):
        rows.qvel[k, i] = sim.qvel[i]
    for i in range(sim.act.shape[0]):
        rows.act[k, i] = sim.act[i]
    for i in range(sim.force.shape[0]):
        rows.force[k, i] = sim.force[i]
    total = 0.0
    for i in range(sim.touch.shape[0]):
        total += sim.touch[i]
    rows.contact[k], rows.used[k] = total, memory.used[0]
