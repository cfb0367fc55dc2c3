"""What the air does to rotors and links: ground effect, streams, wind, drag (simple models)."""

from math import exp, pi, sqrt

from snakegen.kernels.core.mat3 import cross_into, turn_into
from snakegen.kernels.core.no_alloc import bare
from snakegen.kernels.core.stack_arrays import scratch
from snakegen.kernels.core.types import Floats
from snakegen.kernels.flight.types import Plant, Simulator, Wiring

JET_SPREAD = 0.1  # growth of a free jet's radius per metre
_SMALL = 1e-9


@bare
def ground_factor(radius: float, height: float, upright: float) -> float:
    """Returns thrust near the ground over thrust far from it: ``1 / (1 − (R c / 4z)²)``.

    Cheeseman and Bennett (ARC R&M 3021, 1955) for a level rotor; c = `upright` (cosine of the
    tilt) is assumed. Held at its value for z = R/2 below that, where the formula ends.

    Args:
        radius: m, R of the disc.
        height: m, z of the disc.
        upright: thrust direction's vertical part; no effect where it points down.
    """
    if upright <= 0.0:
        return 1.0
    ratio = radius * upright / (4.0 * max(height, 0.5 * radius))
    return 1.0 / (1.0 - ratio * ratio)


@bare
def add_stream(
    density: float, thrust: float, radius: float, origin: Floats, axis: Floats, at: Floats,
    out: Floats,
) -> None:  # fmt: skip
    """Adds the velocity (3,) [m/s] at point `at` of the stream that a rotor blows along −axis.

    A round jet whose momentum flow is the thrust at every section:
    ``V = √(2T / (ρ π b²)) exp(−(e/b)²)``, ``b = R + 0.1 a``, at distance a downstream and e from
    the axis. At a = 0 it is the far wake of momentum theory, 2 v_i. Upstream it is still.
    """
    down, square = 0.0, 0.0
    for i in range(3):
        step = at[i] - origin[i]
        down -= step * axis[i]
        square += step * step
    if down <= 0.0 or thrust <= 0.0:
        return
    width = radius + JET_SPREAD * down
    aside = (square - down * down) / (width * width)
    if aside > 9.0:
        return
    speed = sqrt(2.0 * thrust / (density * pi)) / width * exp(-aside)
    for i in range(3):
        out[i] -= speed * axis[i]


@bare
def mean_stream(down: float, offset: float, source: float, hit: float) -> float:
    """Returns the mean flow of a stream through a level disc, over the source's induced velocity.

    Far away the round jet of `add_stream`, averaged over the disc: ``2R/b · b²/(b² + r²/2) ·
    exp(−e²/(b² + r²/2))``. Near the source no more than the rotor itself moves: its induced
    velocity times ``1 + a/√(a² + R²)`` (McCormick's contracting wake) in a small disc, and
    ``(R/r)²`` of it in a large one, by continuity.

    Args:
        down: m, a, downstream; 0 or less is upstream.
        offset: m, e, from the stream's axis.
        source: m, R of the rotor that blows.
        hit: m, r of the disc.
    """
    if down <= _SMALL:
        return 0.0
    width = source + JET_SPREAD * down
    spread = width * width + 0.5 * hit * hit
    far = 2.0 * source * width / spread
    share = source / max(hit, _SMALL)
    near = min(1.0 + down / sqrt(down * down + source * source), share * share)
    return min(far, near) * exp(-offset * offset / spread)


@bare
def thrust_in_stream(inflow: float) -> float:
    """Returns thrust over thrust in still air, at the same power, of a rotor in a stream.

    ``x (μ + x)² = 1``, ``T'/T = x (μ + x)``: momentum theory with the flow μ v_h through the disc
    besides its own (Leishman and Ananthan, Aerodynamic Optimization of a Coaxial Proprotor, AHS
    62nd Forum, 2006). The lower of two equal coaxial rotors has μ = 1 and keeps 0.682.

    Args:
        inflow: μ ≥ 0, mean flow through the disc over v_h = √(T / 2ρA).
    """
    x = 1.0 / ((1.0 + inflow) * (1.0 + inflow))
    for _ in range(8):
        sum_ = inflow + x
        x -= (x * sum_ * sum_ - 1.0) / (sum_ * sum_ + 2.0 * x * sum_)
    return x * (inflow + x)


@bare
def add_jet(
    density: float, thrust: float, radius: float, origin: Floats, axis: Floats, at: Floats,
    hit: float, out: Floats,
) -> None:  # fmt: skip
    """Adds the mean velocity (3,) [m/s] of a rotor's stream through a disc of radius `hit`."""
    down, square = 0.0, 0.0
    for i in range(3):
        step = at[i] - origin[i]
        down -= step * axis[i]
        square += step * step
    if down <= 0.0 or thrust <= 0.0:
        return
    offset = sqrt(max(square - down * down, 0.0))
    induced = sqrt(0.5 * thrust / (density * pi)) / radius
    speed = induced * mean_stream(down, offset, radius, hit)
    for i in range(3):
        out[i] -= speed * axis[i]


@bare
def rotor_in_stream(
    density: float, thrust: float, radius: float, axis: Floats, jet: Floats, out: Floats
) -> float:
    """Writes the force (3,) [N] that other rotors' streams `jet` add to a thrust.

    Returns the thrust that is left [N]. Across the axis the momentum drag, as in `rotor_in_air`.
    """
    area = pi * radius * radius
    through = -(jet[0] * axis[0] + jet[1] * axis[1] + jet[2] * axis[2])
    left = thrust
    if thrust > _SMALL:
        hover = sqrt(0.5 * thrust / (density * area))
        if through >= 0.0:
            left = thrust * thrust_in_stream(through / hover)
        else:  # a stream from below: as wind
            left = thrust * (1.0 + min(-0.5 * through / hover, 0.25))
    mass_flow = sqrt(0.5 * density * area * thrust)
    for i in range(3):
        out[i] = (left - thrust) * axis[i] + mass_flow * (jet[i] + through * axis[i])
    return left


@bare
def rotor_in_air(
    density: float, thrust: float, radius: float, axis: Floats, flow: Floats, out: Floats
) -> None:
    """Writes the force (3,) [N] that air moving at `flow` past a rotor adds to its thrust.

    Along the axis ``−T V / 2v_i`` with V the flow through the disc: a rotor cannot speed up air
    that already moves as fast as its own wake (assumed; kept within −T … T/4). Across it the
    momentum drag ``ṁ flow⊥``, ``ṁ = ρ A v_i = √(ρ A T / 2)``.
    """
    area = pi * radius * radius
    through = -(flow[0] * axis[0] + flow[1] * axis[1] + flow[2] * axis[2])
    wake = sqrt(2.0 * thrust / (density * area)) + _SMALL
    lost = min(max(through / wake, -0.25), 1.0)
    mass_flow = sqrt(0.5 * density * area * thrust)
    for i in range(3):
        out[i] = -lost * thrust * axis[i] + mass_flow * (flow[i] + through * axis[i])


@bare(no_cpython_wrapper=True)
def velocity_into(sim: Simulator, body: int, at: Floats, out: Floats) -> None:
    """Writes the velocity (3,) [m/s, world] of the point `at` of a body."""
    arm = scratch(3)
    for i in range(3):
        arm[i] = at[i] - sim.com[i]
    cross_into(sim.twist[body], arm, out)
    for i in range(3):
        out[i] += sim.twist[body, 3 + i]


@bare(no_cpython_wrapper=True)
def push(sim: Simulator, body: int, at: Floats, force: Floats, applied: Floats) -> None:
    """Adds a force (3,) at the point `at` to the wrench about the body's centre of mass."""
    arm, torque = scratch(3), scratch(3)
    for i in range(3):
        arm[i] = at[i] - sim.body_com[body, i]
    cross_into(arm, force, torque)
    for i in range(3):
        applied[body, i] += force[i]
        applied[body, 3 + i] += torque[i]


@bare
def air_forces(
    sim: Simulator, wires: Wiring, plant: Plant, thrust: Floats, wind: Floats, applied: Floats
) -> None:
    """Adds to `applied` (nbody, 6) what the air does at the present state.

    Rotors: ground effect, wind, streams of other bodies' rotors (`robot.stream_losses`).
    Links, at a few stations each:
    ``½ ρ C_d A |v⊥| v⊥`` of the flow across the rod (C_d of a cylinder: Hoerner, Fluid-Dynamic
    Drag). A link does not feel the rotors less for standing in a stream's shadow.
    """
    count = wires.rotor_site.shape[0]
    axes, points = scratch((count, 3)), scratch((count, 3))
    for r in range(count):
        site = wires.rotor_site[r]
        for i in range(3):
            axes[r, i] = sim.site_axes[site, 3 * i + 2]
            points[r, i] = sim.site_position[site, i]
    flow, own, force = scratch(3), scratch(3), scratch(3)
    jet, more_force = scratch(3), scratch(3)
    for r in range(count):
        body, given = wires.rotor_body[r], max(thrust[r], 0.0)
        velocity_into(sim, body, points[r], own)
        for i in range(3):
            flow[i] = wind[i] - own[i]
            jet[i] = more_force[i] = 0.0
        left, radius = given, plant.radius[r]
        if plant.downwash:
            for s in range(count):
                if plant.carrier[s] != plant.carrier[r]:
                    add_jet(
                        plant.air, thrust[s], plant.radius[s], points[s], axes[s], points[r],
                        radius, jet,
                    )  # fmt: skip
            left = rotor_in_stream(plant.air, given, radius, axes[r], jet, more_force)
        rotor_in_air(plant.air, left, radius, axes[r], flow, force)
        for i in range(3):
            force[i] += more_force[i]
        if plant.ground:
            more = ground_factor(plant.radius[r], points[r, 2], axes[r, 2]) - 1.0
            for i in range(3):
                force[i] += more * given * axes[r, i]
        push(sim, body, points[r], force, applied)
    at, rod = scratch(3), scratch(3)
    for s in range(wires.station_body.shape[0]):
        body = wires.station_body[s]
        frame = sim.body_axes[body].reshape(3, 3)
        turn_into(frame, wires.station_position[s], at)
        turn_into(frame, wires.station_axis[s], rod)
        for i in range(3):
            at[i] += sim.body_position[body, i]
        velocity_into(sim, body, at, own)
        for i in range(3):
            flow[i] = wind[i] - own[i]
        if plant.downwash:
            for r in range(count):
                add_stream(plant.air, thrust[r], plant.radius[r], points[r], axes[r], at, flow)
        along = flow[0] * rod[0] + flow[1] * rod[1] + flow[2] * rod[2]
        square = 0.0
        for i in range(3):
            flow[i] -= along * rod[i]
            square += flow[i] * flow[i]
        size = 0.5 * plant.air * plant.drag * wires.station_area[s] * sqrt(square)
        for i in range(3):
            force[i] = size * flow[i]
        push(sim, body, at, force, applied)
