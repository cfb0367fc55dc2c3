"""What an arm's hardware adds to its model: masses, friction, encoders, late commands.

Drawn within the plant's declared imperfections, one draw a run, so that a feed-forward from the
model meets an arm that is not the model.
"""

import copy
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.inverse_kinematics.friction import Friction
from snakegen.inverse_kinematics.torques_along import Along
from snakegen.kernels.kinematics.jacobians import tip_jacobian
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.plant import Imperfections
from snakegen.simulation.flight.world import World
from snakegen.simulation.monte_carlo import Spread
from snakegen.statics.tip import Tip

ROWS = 50  # instants of a motion at which the expected error is computed
_UNIFORM = 3.0**-0.5  # standard deviation of a uniform draw over its half range; its RMS from 0


@dataclass(frozen=True, eq=False)
class ArmPlant:
    """One draw of an arm's hardware.

    Attributes:
        mass, inertia: (nbody,) factors of each body's mass, and of its inertia besides.
        friction: dry, of every joint.
        offsets: (k,) rad, of the joints' encoders.
        delay: s, of the servos' commands.
    """

    mass: Floats
    inertia: Floats
    friction: Friction
    offsets: Floats
    delay: float

    def world(self, nominal: World) -> World:
        """Returns the world with the bodies that were drawn."""
        return scaled_bodies(nominal, self.mass, self.inertia)

    def facts(self, nominal: World) -> dict[str, Any]:
        """Returns what was drawn, as JSON."""
        whole = nominal.model.body_mass
        return {
            "mass": float((whole * self.mass).sum() / whole.sum()),
            "friction_n_m": list(self.friction.highest),
            "encoder_offset_max_rad": float(np.abs(self.offsets).max(initial=0.0)),
            "delay_s": self.delay,
        }


def scaled_bodies(world: World, mass: Floats, inertia: Floats) -> World:
    """Returns a world whose bodies have other masses; inertias go with them, times `inertia`."""
    model = copy.copy(world.model)
    model.body_mass *= mass
    model.body_inertia *= (mass * inertia)[:, None]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return replace(world, model=model)


def draw_arm(world: World, friction: Friction | None, seed: int, *, ideal: bool) -> ArmPlant:
    """Returns the hardware of one run; `friction` as given, or drawn where it is None.

    Masses, inertias, friction and delay are uniform within ``plant.uncertainty``, encoder offsets
    normal with ``plant.joint_noise``; `ideal`: the model itself.
    """
    robot, bodies, joints = world.robot, world.model.nbody, len(world.chain)
    if ideal:
        none = friction or Friction()
        return ArmPlant(np.ones(bodies), np.ones(bodies), none, np.zeros(joints), 0.0)
    what, spread = Imperfections.of(robot.modules.plant), Spread.of(robot.modules.uncertainty)
    rng = np.random.default_rng(seed)
    mass = 1.0 + spread.mass * rng.uniform(-1.0, 1.0, bodies)
    inertia = 1.0 + spread.inertia * rng.uniform(-1.0, 1.0, bodies)
    offsets = what.joint_noise * rng.standard_normal(joints)
    delay = what.delay + spread.delay * rng.uniform()
    drawn = _effort(robot, world) * spread.friction * rng.uniform()
    return ArmPlant(mass, inertia, friction or Friction(drawn, drawn), offsets, delay)


def expected_tip_error(world: World, along: Along, tip: Tip) -> float:
    """Returns the largest RMS error [m] of the tip expected with default imperfections.

    A servo's error times the tip's Jacobian: encoder offsets; what mass errors and friction leave
    to the servo's spring, τ/k; and the way made within the delay. One standard deviation over
    draws, at the worst instant of the motion, servos led by the law of the model.
    """
    robot, what, spread = world.robot, Imperfections(), Spread()
    servo = world.servos
    stiffness = world.model.actuator_gainprm[servo, 0]
    rub = _UNIFORM * spread.friction * _effort(robot, world)
    late = what.delay + 0.5 * spread.delay
    worst, law = 0.0, along.torque()
    angles = robot.angles(robot.configuration())
    for k in np.unique(np.linspace(0, len(along.time) - 1, ROWS).astype(int)):
        angles[world.chain] = along.angles[k]
        jacobian = tip_jacobian(robot.tree, np.eye(3), angles, tip.body, tip.point)[2]
        moved = jacobian[:3, world.chain]
        parts = (
            what.joint_noise * np.linalg.norm(moved),
            np.linalg.norm(moved @ (_UNIFORM * spread.mass * law[k] / stiffness)),
            np.linalg.norm(moved @ (rub * np.sign(along.rates[k]) / stiffness)),
            np.linalg.norm(moved @ (late * along.rates[k])),
        )
        worst = max(worst, float(np.linalg.norm(parts)))
    return worst


def expected_joint_error(world: World, along: Along) -> float:
    """Returns the largest RMS error [rad] of a joint expected with default imperfections.

    Its encoder's offset, what mass errors and friction leave to the servo's spring, and the way
    made within the delay, as of `expected_tip_error`.
    """
    what, spread = Imperfections(), Spread()
    stiffness = world.model.actuator_gainprm[world.servos, 0]
    late = what.delay + 0.5 * spread.delay
    parts = (
        np.broadcast_to(what.joint_noise, along.rates.shape),
        _UNIFORM * spread.mass * along.torque() / stiffness,
        np.broadcast_to(
            _UNIFORM * spread.friction * _effort(world.robot, world) / stiffness, along.rates.shape
        ),
        late * along.rates,
    )
    return float(np.sqrt(np.sum(np.square(parts), axis=0)).max())


def _effort(robot: Robot, world: World) -> float:
    """Returns the smallest torque limit of the chain's servos [N·m]."""
    return float(robot.limits([robot.joint_names[i] for i in world.chain])[2].min())
