"""Vibration suppression by internal forces: redundant thrust damps what bends (ZN23 section 6).

ZN23 names it as future work after Maki et al. (RA-L 7, 2022). Here: compliant hinges (springs
of links, servos) move the thrust points at velocities v; ``δf = −c P v``, P the orthogonal
projector onto the null space of the allocation. So the net wrench stays what the pose law asks
for, rigid motions (the range of ``Qᵀ``) are left alone, and the power ``v·δf = −c ‖P v‖²`` of ideal
actuators is never positive, whatever the body's stiffness: nothing of it has to be known. What is
known of it keeps noise out: of hinge rates only what swings at a slow mode's frequency is damped.
"""

import numpy as np

from snakegen.kernels.allocation.confinement import confinement
from snakegen.kernels.allocation.fully_actuated import (
    aim_forces,
    forces_of,
    point_map,
    refine,
    wrench_of,
)
from snakegen.kernels.allocation.gimbals import joint_order, mounts, thrust_line, turned_into
from snakegen.kernels.allocation.mode_blending import wrench_scale
from snakegen.kernels.allocation.underactuated import level_axes, rotor_map, truncated
from snakegen.kernels.control.control_tick import clip_to, spread_thrust
from snakegen.kernels.control.types import Command, Law, Measured
from snakegen.kernels.core.cholesky import least_norm
from snakegen.kernels.core.jit import jit
from snakegen.kernels.core.mat3 import cross_into, matmul_into, turn_back_into, turn_into
from snakegen.kernels.core.types import Body, Floats, Gimbals, Mechanism, Rotors
from snakegen.kernels.flight.types import Damper
from snakegen.kernels.kinematics.chain import centre_of_gravity, forward

SHARE = 0.2  # of a largest thrust that damping may ask for
HALVINGS = 6
SHARPNESS = 0.5  # ω over the band (rad/s) that is let through about each mode


@jit
def hinge_velocities(
    damper: Damper, body: Body, rates: Floats, apparatus: int, point: Floats, out: Floats
) -> None:
    """Writes the velocity (3,) [m/s] that hinges give a point of an apparatus, CoG axes.

    ``Σ_e rate_e a_e × (p − o_e)`` over the hinges between the base and the apparatus.
    """
    world, arm, a, o, step = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    out[:] = 0.0
    for e in range(rates.shape[0]):
        if damper.beyond[e, apparatus] == 0:
            continue
        b = damper.body[e]
        turn_into(body.rotation[b], damper.axis[e], world)
        turn_back_into(body.axes, world, a)
        turn_into(body.rotation[b], damper.anchor[e], world)
        for k in range(3):
            world[k] += body.position[b, k] - body.cog[k]
        turn_back_into(body.axes, world, o)
        for k in range(3):
            arm[k] = point[k] - o[k]
        cross_into(a, arm, step)
        for k in range(3):
            out[k] += rates[e] * step[k]


@jit
def swinging(damper: Damper, hinges: Floats, dt: float) -> Floats:
    """Returns the hinge rates (e,) that slow modes have, from noisy ones; `swing` is updated.

    ``a' = v, v' = −ω² a + l (u − v)`` for each mode, u its measured speed: from u to v a band of
    l = ω / SHARPNESS about ω, without lag there (semi-implicit Euler). Since actuators lag by T,
    what comes out is led at ω: ``v − T ω² a``, which is v + T v' there and adds nothing to faster
    modes; what is slower passes by −T l, negligible against the stiffness that rules it.
    """
    speed, out = damper.pull @ hinges, np.zeros(hinges.shape[0])
    place, rate = damper.swing
    for i in range(speed.shape[0]):
        w = damper.tuned[i]
        band = w / SHARPNESS
        rate[i] = (rate[i] + dt * (band * speed[i] - w * w * place[i])) / (1.0 + dt * band)
        place[i] += dt * rate[i]
        led = rate[i] - damper.lead * w * w * place[i]
        for e in range(out.shape[0]):
            out[e] += damper.shape[e, i] * led
    return out


@jit
def internal(q: Floats, weight: Floats, speed: Floats) -> Floats:
    """Returns ``P speed`` (n,): what no wrench of the map q (m, n) can tell of it.

    Weights are 1, or 0 for a column that is lost and stays out.
    """
    kept, modal = speed * weight, np.zeros(q.shape[0])
    for i in range(q.shape[0]):
        for c in range(kept.shape[0]):
            modal[i] += q[i, c] * kept[c]
    seen = least_norm(q, weight, modal)
    for c in range(kept.shape[0]):
        kept[c] -= seen[c]
    return kept


@jit
def share_of(forces: Floats, extra: Floats, lower: Floats, upper: Floats, width: int) -> float:
    """Returns the share 0 … 1 of `extra` that may be added to `forces`, all in one proportion.

    Groups of `width` numbers are an apparatus' force, or a rotor's thrust: none is changed by
    more than SHARE of its limit, none leaves its limits (as far as it is within them now).
    """
    share = 1.0
    for j in range(upper.shape[0]):
        part = slice(width * j, width * (j + 1))
        size = np.sqrt((extra[part] ** 2).sum())
        if size > SHARE * upper[j]:
            share = min(share, SHARE * upper[j] / size)
    for _ in range(HALVINGS):
        fits = True
        for j in range(upper.shape[0]):
            part = slice(width * j, width * (j + 1))
            both = forces[part] + share * extra[part]
            if width == 1:
                fits &= lower[j] <= both[0] <= upper[j]
            else:
                fits &= np.sqrt((both**2).sum()) <= upper[j]
        if fits:
            return share
        share *= 0.5
    return 0.0


@jit
def damp_rotors(
    rotors: Rotors, damper: Damper, frame: Body, rates: Floats, m: Floats, rotor: Floats,
    angles: Floats, tilt: Floats, thrust: Floats,
) -> None:  # fmt: skip
    """Adds δλ to rotor thrusts (r,) at held gimbals, in the null space of ``[f_z; τ]``."""
    q, count = rotor_map(m, rotor, angles), thrust.shape[0]
    speed, weight = np.zeros(count), np.ones(count)
    p, v, elbow = np.empty(3), np.empty(3), np.empty(3)
    once, twice = np.empty((3, 3)), np.empty((3, 3))
    for r in range(count):
        j = int(rotor[r, 2, 1])
        turned_into(m, j, angles[j, 0], angles[j, 1], once, twice, elbow)
        turn_into(twice, rotor[r, 0], p)
        for k in range(3):
            p[k] += elbow[k]
        hinge_velocities(damper, frame, rates, j, p, v)
        for k in range(3):
            speed[r] += v[k] * q[k, r]
        weight[r] = 1.0 if rotors.thrust_max[r] > 0.0 else 0.0
    extra = -damper.gain * internal(truncated(q, tilt), weight, speed)
    share = share_of(thrust, extra, rotors.thrust_min, rotors.thrust_max, 1)
    for r in range(count):
        thrust[r] += share * extra[r]


@jit
def damp_apparatuses(
    gimbals: Gimbals, law: Law, damper: Damper, frame: Body, rates: Floats, m: Floats,
    rows: Floats, pushes: Floats, angles: Floats,
) -> None:  # fmt: skip
    """Adds δf to the forces of apparatuses: thrusts (Ñ,) and angles (Ñ, 2) are written anew."""
    n = pushes.shape[0]
    speed, weight = np.zeros(3 * n), np.ones(3 * n)
    u, p, v = np.empty(3), np.empty(3), np.empty(3)
    allowed = confinement(m, angles)
    for j in range(n):
        thrust_line(m, j, angles[j], u, p)
        hinge_velocities(damper, frame, rates, j, p, v)
        for k in range(3):
            for i in range(3):
                speed[3 * j + k] += allowed[j, k, i] * v[i]
            weight[3 * j + k] = 1.0 if gimbals.limit[j] > 0.0 else 0.0
    wrench, forces = wrench_of(m, pushes, angles), forces_of(m, pushes, angles)
    extra = -damper.gain * internal(point_map(m, angles, allowed), weight, speed)
    share = share_of(forces, extra, np.zeros(n), gimbals.limit, 3)
    if share == 0.0:
        return
    lower, upper = joint_order(m, law.gimbal_lower), joint_order(m, law.gimbal_upper)
    aim_forces(m, forces + share * extra, lower, upper, pushes, angles)
    # a thrust point moves with its gimbal: the wrench is made exact again
    scale = 1.0 / (rows[0] * n)
    refine(m, wrench, pushes, angles, gimbals.limit, rows, scale, law.newton, law.residual)
    for j in range(n):
        clip_to(lower[j], upper[j], angles[j])


@jit
def damped(
    mechanism: Mechanism,
    law: Law,
    damper: Damper,
    measured: Measured,
    rates: Floats,
    target: Floats,
    blend: float,
    command: Command,
) -> tuple[Floats, Floats]:
    """Returns thrust (r,) and gimbals (Ñ, 2) of a command with damping added.

    Virtual single rotor: δf at every apparatus, by its thrust and gimbals. Dual rotor: δλ at held
    gimbals. While the mode changes nothing is added.

    Args:
        mechanism, law: of the controller.
        damper: hinges and gain.
        measured: what the controller knew.
        rates: (e,) rad/s, of the hinges beyond what is asked of them.
        target: (3, 3) target attitude.
        blend: 0 dual … 1 virtual.
        command: of the pose law.
    """
    if 0.0 < blend < 1.0:
        return command.thrust, command.gimbals
    tree, rotors, gimbals = mechanism
    rotation, position = forward(tree, measured.rotation, measured.position, measured.angles)
    mass, cog = centre_of_gravity(tree, rotation, position)
    axes = np.empty((3, 3))
    matmul_into(rotation[law.axes_body], law.axes_rotation, axes)
    frame = Body(rotation, position, cog, axes)
    m, rotor = mounts(tree, rotors, gimbals, rotation, position, cog, axes)
    angles, thrust = joint_order(m, command.gimbals), command.thrust.copy()
    if blend == 0.0:
        tilt = level_axes(target)
        damp_rotors(rotors, damper, frame, rates, m, rotor, angles, tilt, thrust)
        return thrust, command.gimbals
    pushes = np.zeros(gimbals.limit.shape[0])
    for r in range(thrust.shape[0]):
        pushes[int(rotor[r, 2, 1])] += thrust[r]
    rows = wrench_scale(mass, law.gravity, law.length)
    damp_apparatuses(gimbals, law, damper, frame, rates, m, rows, pushes, angles)
    spread_thrust(rotor, pushes, thrust)
    clip_to(rotors.thrust_min, rotors.thrust_max, thrust)
    return thrust, joint_order(m, angles)
