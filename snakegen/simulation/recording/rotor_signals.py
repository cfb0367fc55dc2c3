"""What rotors did along a run: thrust, electric power, and the moment their difference makes."""

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.power import power_factors
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.flown import Flown
from snakegen.simulation.flight.world import World


def thrusts(world: World, flown: Flown) -> Floats:
    """Returns the thrust (T, n_rotors) [N] that each rotor gives, after its lag."""
    lagged = world.activation >= 0
    out = np.array(flown.force[:, world.rotors])
    out[:, lagged] = flown.act[:, world.activation[lagged]]
    return out


def power(robot: Robot, thrust: Floats) -> Floats:
    """Returns the electric power (T,) [W] of thrusts (T, n_rotors)."""
    return np.asarray(np.maximum(thrust, 0.0) ** 1.5 @ power_factors(robot))


def roll_moments(robot: Robot, thrust: Floats, angles: Floats) -> Floats:
    """Returns the moment (T, k) [N·m] that unequal rotors make about each φ axis.

    ``a · Σ_r ((p_r − F) × u_r + κ_r u_r) λ_r``: for a pair at ±s/2, ``(λ1 − λ2) (s/2) cosθ`` and
    the part of their drag torques that θ turns onto the axis. ZN23 names this load on the φ servo
    as the reason for its virtual-single-rotor mode.

    Args:
        robot: with k apparatuses that have a roll joint.
        thrust: (T, n_rotors) N.
        angles: (T, n-1) rad, the tree's.
    """
    gimbals, rotors, tree = robot.gimbals, robot.rotors, robot.tree
    columns = []
    for j in np.flatnonzero(gimbals.roll_body >= 0):
        mine = np.flatnonzero(rotors.apparatus == j)
        arms, axes = rotors.position[mine] - gimbals.thrust_point[j], rotors.axis[mine]
        couple = thrust[:, mine] @ (np.cross(arms, axes) + rotors.torque_ratio[mine, None] * axes)
        roll, pitch = int(gimbals.roll_body[j]), int(gimbals.pitch_body[j])
        if pitch < 0 or gimbals.thrust_body[j] == roll:
            columns.append(couple @ tree.axis[roll])
            continue
        hinge = tree.axis[pitch]
        along = tree.rotation[pitch].T @ tree.axis[roll]
        theta = angles[:, pitch - 1]
        # the roll axis in the pitch body's axes: Rodrigues' turn by -θ about the hinge
        across, side = along - hinge * (hinge @ along), np.cross(hinge, along)
        turned = np.outer(np.cos(theta), across) - np.outer(np.sin(theta), side)
        columns.append(np.einsum("ti,ti->t", couple, turned + hinge * (hinge @ along)))
    return np.array(columns).T.reshape(len(thrust), -1)
