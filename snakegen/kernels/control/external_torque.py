"""What loads the joints besides thrust and weight, as their servos feel it.

A push on a link far from the root bends the joints between by torques that a controller cannot
tell from the wrench that holds the body. Servos report their torque; what weight and the rotors
do not explain of it, smoothed, is added to the loads that the constrained allocator keeps.
"""

from math import isnan

from snakegen.kernels.control.types import Law, Measured, State
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Body, Floats, Gimbals, Tree
from snakegen.kernels.dynamics.joint_loads import rotor_loads_into

STRAIN_TIME = 0.5  # s, of the smoothing: slower than the attitude loop, faster than a lasting push


@bare
def update_external_torque(
    tree: Tree,
    gimbals: Gimbals,
    law: Law,
    body: Body,
    m: Floats,
    rotor: Floats,
    last: Floats,
    measured: Measured,
    state: State,
    dt: float,
) -> None:
    """Moves ``strain ← strain + dt/(dt + T) (τ_servo - bias - rows λ - strain)`` on, in place.

    Args:
        tree, gimbals, law, body: the believed robot.
        m, rotor: from `vectoring.mounts`.
        last: (Ñ, 2) rad, joint order, gimbals of the tick before.
        measured: its torques (k,); none leave the strain as it is.
        state: thrusts of the tick before, NaN before the first.
        dt: s.
    """
    k, n = law.joints.shape[0], rotor.shape[0]
    if measured.torques.shape[0] != k or k == 0 or isnan(state.thrust[0]):
        return
    rows, bias = scratch((k, n)), scratch(k)
    rotor_loads_into(tree, gimbals, body, m, rotor, last, law.gravity, law.joints, rows, bias)
    share = dt / (dt + STRAIN_TIME)
    for i in range(k):
        known = bias[i]
        for r in range(n):
            known += rows[i, r] * state.thrust[r]
        state.strain[i] += share * (measured.torques[i] - known - state.strain[i])
