"""Forces on bodies as forces on the simulator's degrees of freedom: one pass from tips to root.

MuJoCo does the same with a Jacobian for each body that is pushed, which costs some 0.2 µs each.
"""

from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.flight.types import Simulator, Wiring


@bare
def generalize(sim: Simulator, wires: Wiring) -> None:
    """Writes ``Σ_b J_bᵀ [f; τ]_b`` (nv,) of what is applied to the bodies, at the present pose.

    ``Q_d = S_d · Σ_b [τ + (c_b - C) × f; f]_b`` over the bodies that dof d carries: S_d its motion
    axis [angular; linear at C], c_b centres of mass, C that of the robot.
    """
    count = wires.parent.shape[0]
    load = scratch((count, 6))
    for b in range(count):
        f, g, h = sim.applied[b, 0], sim.applied[b, 1], sim.applied[b, 2]
        x = sim.body_com[b, 0] - sim.com[0]
        y = sim.body_com[b, 1] - sim.com[1]
        z = sim.body_com[b, 2] - sim.com[2]
        load[b, 0] = sim.applied[b, 3] + y * h - z * g
        load[b, 1] = sim.applied[b, 4] + z * f - x * h
        load[b, 2] = sim.applied[b, 5] + x * g - y * f
        load[b, 3], load[b, 4], load[b, 5] = f, g, h
    for b in range(count - 1, 0, -1):
        for k in range(6):
            load[wires.parent[b], k] += load[b, k]
    for d in range(wires.carrier.shape[0]):
        total = 0.0
        for k in range(6):
            total += sim.motion[d, k] * load[wires.carrier[d], k]
        sim.generalized[d] = total
