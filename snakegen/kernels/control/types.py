"""What goes into and comes out of one control tick, as named tuples of plain arrays."""

from typing import NamedTuple

import numpy as np

from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.types import Floats, Ints

VIRTUAL, DUAL = 1, 0  # modes: virtual single rotor (fully actuated), dual rotor (under-actuated)
FLOWN, REFUSED = 0, 1  # status of a tick: REFUSED when σ_min is below the law's threshold


class Measured(NamedTuple):
    """What the sensors say; world axes."""

    rotation: Floats  # (3, 3) attitude of body 0
    position: Floats  # (3,) m, origin of body 0
    linear: Floats  # (3,) m/s, velocity of that origin
    angular: Floats  # (3,) rad/s, of body 0
    angles: Floats  # (n-1,) rad, every joint of the tree, gimbals included
    rates: Floats  # (n-1,) rad/s
    torques: Floats = np.zeros(0)  # (k,) N·m, of the law's joints, by servos; empty where unknown


class Target(NamedTuple):
    """Where the CoG and the CoG frame should be."""

    position: Floats  # (3,) m, world
    velocity: Floats  # (3,) m/s, world
    acceleration: Floats  # (3,) m/s², world, fed forward
    rotation: Floats  # (3, 3) attitude of the CoG frame
    angular: Floats  # (3,) rad/s, in the axes of `rotation`


class Law(NamedTuple):
    """The constants of a controller: gains of eqs 15-28, limits, options."""

    force: Floats  # (3, 3) rows K_p [1/s²], K_i [1/s³], K_d [1/s], world axes
    torque: Floats  # (3, 3) the same, CoG axes
    force_integral_limit: Floats  # (3,) m s, clamp of ∫e_r
    torque_integral_limit: Floats  # (3,) rad s, clamp of ∫e_R
    attitude: Floats  # (2,) k_φ, k_θ: attitude from horizontal force
    vectoring: Floats  # (Ñ, 2) k_φi, k_θi: gimbals from horizontal force
    tilt_limit: float  # rad, clamp of commanded roll and pitch
    gimbal_lower: Floats  # (Ñ, 2) rad, roll and pitch
    gimbal_upper: Floats  # (Ñ, 2) rad
    gimbal_give: Floats  # (Ñ, 2) rad/(N·m), roll and pitch: compliance of their servos
    axes_body: int  # body whose axes the CoG frame has
    axes_rotation: Floats  # (3, 3) CoG axes in that body's axes
    gyroscopic: int  # 1 adds ω × I ω to the torque
    constrained: int  # 1 allocates within limits, 0 by pseudo-inverse as printed
    sigma_min: float  # least scaled singular value that is flown
    sweeps: int  # fixed-point sweeps of eq 36 before Newton
    newton: int  # most Newton steps
    residual: float  # N and N·m, where Newton stops
    blend_time: float  # s, of a change of mode
    gravity: float  # m/s²
    length: float  # m, lever by which torques are scaled: the mean link length
    joints: Ints  # (k,) bodies moved by the joints whose torque the constrained allocator bounds
    joint_limit: Floats  # (k,) N·m
    internal_time: Floats  # (2,) s, in which internal forces follow joints' and thrusts' limits
    integral_rate: Floats  # (2, 3) times faster ∫e_r and ∫e_R run: 1, more while trimming
    rate_filter: float  # Hz, cut-off of the low-pass on body rates and CoG velocity; 0: none


class State(NamedTuple):
    """What a controller remembers from one tick to the next."""

    force_integral: Floats  # (3,) m s
    torque_integral: Floats  # (3,) rad s
    gimbals: Floats  # (Ñ, 2) rad, roll and pitch last commanded, unwrapped
    blend: float  # 0 dual-rotor mode … 1 virtual-single-rotor mode
    saturated: int  # 1 when the last command met a limit
    internal: Floats  # (2, Ñ, 3) N, link axes, for joints' limits and all; NaN: none yet
    rates: Floats  # (2, 2, 3) memory of the low-pass on body rates and CoG velocity; NaN: none
    thrust: Floats  # (n_rotors,) N, last commanded; NaN: not yet
    strain: Floats  # (k,) N·m of the law's joints that thrust and weight do not explain


class Command(NamedTuple):
    """What one tick asks of the actuators, and how it came about."""

    thrust: Floats  # (n_rotors,) N
    gimbals: Floats  # (Ñ, 2) rad, roll and pitch
    wanted: Floats  # (6,) wrench asked for, CoG axes
    given: Floats  # (6,) wrench of the command, CoG axes
    sigma_min: float  # of the scaled map of the mode in use
    iterations: int  # Newton steps taken
    residual: float  # ‖wanted - Q λ‖ after them, before limits
    status: int  # FLOWN or REFUSED


@jit
def copied(state: State) -> State:
    """Returns a memory of its own arrays."""
    return State(
        state.force_integral.copy(),
        state.torque_integral.copy(),
        state.gimbals.copy(),
        state.blend,
        state.saturated,
        state.internal.copy(),
        state.rates.copy(),
        state.thrust.copy(),
        state.strain.copy(),
    )


@bare(inline="always")
def with_flags(state: State, blend: float, saturated: int) -> State:
    """Returns the same arrays with the blend and the flag of another tick."""
    return State(
        state.force_integral,
        state.torque_integral,
        state.gimbals,
        blend,
        saturated,
        state.internal,
        state.rates,
        state.thrust,
        state.strain,
    )
