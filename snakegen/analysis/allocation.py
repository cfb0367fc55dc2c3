"""Allocation: from thrusts and gimbal angles to the wrench on the whole body (ZN23 eqs 4–14)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.allocation_maps import link_axes, mean_drag, thrust_points, wrench_maps
from snakegen.robot.kinematics import forward, mass_properties
from snakegen.robot.robot import GRAVITY, Robot


@dataclass(frozen=True, repr=False)
class Allocation:
    """Mass properties and allocation matrices of a posture.

    Wrenches are [force; torque] about the CoG in the root link's axes. n rotors, Ñ apparatuses.

    Attributes:
        mass: kg.
        cog: (3,) m, CoG from the root link's origin, root-link axes.
        inertia: (3, 3) kg·m², about the CoG, root-link axes.
        rotor_positions: (n, 3) m, from the CoG.
        rotor_axes: (n, 3) unit thrust directions.
        dual: (6, n) rotor thrusts to wrench, eq 10.
        virtual: (6, Ñ) apparatus thrusts to wrench, eq 14.
        force: (6, 3Ñ) apparatus forces in link axes to wrench, eqs 34–35.
        jacobian: (6, 3Ñ) ∂w/∂(λ, φ, θ), columns [all λ | all φ | all θ], eqs 42–45.
        hover_wrench: (6,) [m g Rᵀ ẑ; 0].
        thrust_points: (Ñ, 3) m, where apparatus forces act, from the CoG.
        link_axes: (Ñ, 3, 3) axes of each apparatus' link, in the root link's.
        drag: (Ñ,) m, torque along each apparatus' force per newton: the mean -κ s of its rotors.
    """

    mass: float
    cog: Floats
    inertia: Floats
    rotor_positions: Floats
    rotor_axes: Floats
    dual: Floats
    virtual: Floats
    force: Floats
    jacobian: Floats
    hover_wrench: Floats
    thrust_points: Floats
    link_axes: Floats
    drag: Floats

    def __repr__(self) -> str:
        """Returns mass and sizes in one line."""
        rotors, apparatuses = self.dual.shape[1], self.virtual.shape[1]
        return f"Allocation({self.mass:.4g} kg, {rotors} rotors, {apparatuses} apparatuses)"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program; keys carry units."""
        return {
            "mass_kg": self.mass,
            "cog_m": self.cog.tolist(),
            "inertia_kg_m2": self.inertia.tolist(),
            "rotor_positions_m": self.rotor_positions.tolist(),
            "rotor_axes": self.rotor_axes.tolist(),
            "hover_wrench_N_Nm": self.hover_wrench.tolist(),
            "dual": self.dual.tolist(),
            "virtual": self.virtual.tolist(),
            "force": self.force.tolist(),
            "jacobian": self.jacobian.tolist(),
        }


def allocation(robot: Robot, q: ArrayLike, thrust: ArrayLike | None = None) -> Allocation:
    """Returns mass properties and allocation matrices of a posture, gimbals as they are in q.

    Args:
        robot: with or without rotors.
        q: (nq,) configuration in Pinocchio's order.
        thrust: (Ñ,) N, thrust of each apparatus, m g / Ñ each if absent; it matters to the
            Jacobian alone.

    Raises:
        PostureError: q has the wrong size or holds NaN.
        AnalysisError: thrust has the wrong size or holds NaN.
    """
    q = robot.validate_configuration(q)
    base, origin = robot.base_pose(q)
    rotation, position = forward(robot.tree, base, origin, robot.angles(q))
    mass, cog, inertia = mass_properties(robot.tree, rotation, position)
    count = len(robot.modules.apparatuses)
    if thrust is None:
        shares = np.full(count, mass * GRAVITY / max(count, 1))
    else:
        shares = np.asarray(thrust, float)
        if shares.shape != (count,) or not np.all(np.isfinite(shares)):
            raise AnalysisError(f"thrust: {count} finite numbers are needed, one per apparatus.")
    points, axes, dual, virtual, force, jacobian = wrench_maps(
        robot.tree, robot.rotors, robot.gimbals, rotation, position, base, shares
    )
    weight = np.array([0.0, 0.0, mass * GRAVITY])
    return Allocation(
        float(mass),
        base.T @ (cog - origin),
        base.T @ inertia @ base,
        points,
        axes,
        dual,
        virtual,
        force,
        jacobian,
        np.concatenate([base.T @ weight, np.zeros(3)]),
        thrust_points(robot.gimbals, rotation, position, cog, base),
        link_axes(robot.gimbals, rotation, base),
        mean_drag(robot.rotors, count),
    )
