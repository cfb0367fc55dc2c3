"""What the compiled flight loop works on: a simulator's arrays, wiring, references, memory."""

from typing import NamedTuple

from snakegen.kernels.core.types import Floats, Ints


class Simulator(NamedTuple):
    """Addresses (int) and live views of a physics simulator's state."""

    begin: int  # void begin(model, data): where things are, as a step starts
    finish: int  # void finish(model, data): the rest of the step, under the forces then applied
    model: int
    data: int
    qpos: Floats  # (nq,)
    qvel: Floats  # (nv,)
    act: Floats  # (na,) motors after their lag
    ctrl: Floats  # (nu,)
    force: Floats  # (nu,) of the actuators
    applied: Floats  # (nbody, 6) [force; torque] at the body's centre of mass, world axes
    generalized: Floats  # (nv,) the same on the degrees of freedom: what the simulator takes
    motion: Floats  # (nv, 6) axis of each: [angular; linear at `com`], world axes
    body_position: Floats  # (nbody, 3) m, origin; as of the last step's start, like all below
    body_axes: Floats  # (nbody, 9)
    body_com: Floats  # (nbody, 3) m
    twist: Floats  # (nbody, 6) [angular; linear at `com`], world axes
    com: Floats  # (3,) m, of the whole robot
    site_position: Floats  # (nsite, 3) m
    site_axes: Floats  # (nsite, 9)
    touch: Floats  # (·,) N, normal force on the ground; empty without ground


class Wiring(NamedTuple):
    """Where the robot's quantities stand in the simulator's arrays."""

    qpos: Ints  # (n-1,) joints in the tree's order
    qvel: Ints  # (n-1,)
    parent: Ints  # (nbody,) of each body of the simulator
    carrier: Ints  # (nv,) the body that each degree of freedom moves
    rotors: Ints  # (r,) actuators
    activation: Ints  # (r,) in `act`, -1 for a motor without lag
    rotor_body: Ints  # (r,)
    rotor_site: Ints  # (r,)
    gimbals: Ints  # (Ñ, 2) actuators, -1 where absent
    servos: Ints  # (k,) actuators of the joints that shape the body
    loaded: Ints  # (l,) actuators of those whose torque the controller bounds
    disturbed: int  # body on which the plan's disturbance acts
    at_cog: int  # 1: about the robot's centre of gravity, 0: about that body's origin
    station_body: Ints  # (s,) bodies of the points at which links meet the air
    station_position: Floats  # (s, 3) m, in the body's axes
    station_axis: Floats  # (s, 3) unit, along the rod
    station_area: Floats  # (s,) m², seen from the side


class Damper(NamedTuple):
    """The hinges that are damped, and how hard; no hinges: it is off."""

    gain: float  # c, N s/m
    body: Ints  # (e,) body of the believed tree in which a hinge stands
    anchor: Floats  # (e, 3) m, in that body's axes
    axis: Floats  # (e, 3) unit
    beyond: Ints  # (e, Ñ) 1 where an apparatus stands beyond the hinge
    rate: Ints  # (e,) address of its rate in the simulator's velocities
    servo: Ints  # (e,) its servo among those that shape the body, -1 for a spring
    shape: Floats  # (e, k) hinge rates of a modal speed of 1, of the k modes that are damped
    pull: Floats  # (k, e) modal speeds of hinge rates
    tuned: Floats  # (k,) rad/s, of the modes
    swing: Floats  # (2, k) places and speeds of the modes as observed, written in place
    lead: float  # s, by which modes are led: what gimbals or motors lag behind


class References(NamedTuple):
    """What is asked for at each of T ticks, and what the world does meanwhile."""

    position: Floats  # (T, 3) m
    velocity: Floats  # (T, 3) m/s
    acceleration: Floats  # (T, 3) m/s²
    rotation: Floats  # (T, 3, 3)
    angular: Floats  # (T, 3) rad/s
    joints: Floats  # (T, k) rad
    mode: Ints  # (T,)
    strength: Floats  # (T, r) thrust given over thrust asked
    disturbance: Floats  # (T, 6) or (0, 6): N, N·m
    wind: Floats  # (T, 3) m/s
    attitude_noise: Floats  # (T, 3, 3) from true to measured attitude, body axes
    position_noise: Floats  # (T, 3) m
    velocity_noise: Floats  # (T, 3) m/s
    gyro_noise: Floats  # (T, 3) rad/s
    angle_noise: Floats  # (n-1,) rad, constant in a run
    torque_noise: Floats  # (l,) N·m, constant in a run
    hinge_noise: Floats  # (T, e) rad/s, of the damped hinges' rates


class Plant(NamedTuple):
    """Constants of the simulated hardware; effects are off where their constant is 0."""

    substeps: int  # physics steps a tick
    timestep: float  # s
    hold: int  # ticks between two position samples
    imu: int  # physics steps between two attitude samples
    delay: int  # whole ticks from sensing to the controller
    part: float  # share of a tick that the delay has besides
    gimbal_step: Floats  # (Ñ, 2) rad a tick, fastest
    joint_step: Floats  # (k,) rad a tick, fastest
    thrust_max: Floats  # (r,) N
    spin_momentum: Floats  # (r,) N·m·s at thrust_max, signed: counter-clockwise about the thrust
    power: Floats  # (r,) W N^-1.5
    capacity: float  # J, inf for an endless battery
    sag: float  # share of voltage lost from full to empty
    air: float  # kg/m³
    radius: Floats  # (r,) m, of the discs
    drag: float  # coefficient of a rod across the flow
    ground: int  # 1: ground effect over a floor at z = 0
    downwash: int  # 1: streams act on rotors and links
    carrier: Ints  # (r,) moving body of each rotor: streams within one are in its thrust limits
    give_up: float  # m, distance of the CoG from its target at which a run ends


class Memory(NamedTuple):
    """What the loop itself remembers; arrays are written in place."""

    gimbals: Floats  # (Ñ, 2) rad, now commanded
    joints: Floats  # (k,) rad, now commanded
    imu: Floats  # (12,) last attitude (row-major) and angular rate (body axes)
    seen: Floats  # (6,) last position sample and velocity
    ring: Floats  # (delay + 2, 18 + 2(n-1) + e + l) states on their way to the controller
    late: Floats  # (18 + 2(n-1) + e + l,) what has reached it, noise included
    momentum: Floats  # (r,) N·m·s, of each rotor about its axis
    steady: Floats  # (nbody, 6) forces held during a tick
    used: Floats  # (1,) share of the battery


class Rows(NamedTuple):
    """The log: a row a tick, taken before the tick's command acts."""

    qpos: Floats
    qvel: Floats
    act: Floats
    force: Floats
    command: Floats
    wanted: Floats  # (T, 6)
    given: Floats  # (T, 6)
    sigma: Floats  # (T,)
    contact: Floats  # (T,) N
    used: Floats  # (T,) share of the battery
    status: Ints  # (T,)


class World(NamedTuple):
    """Everything outside the controller: simulator, plan, hardware, memory and log."""

    sim: Simulator
    wires: Wiring
    plan: References
    plant: Plant
    memory: Memory
    rows: Rows
