"""Why a posture cannot hover, and which way the whole body would have to tilt so that it can."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.base.describe_motion import components
from snakegen.base.geometry import Floats, cross, rotation_about, rpy_from_rotation
from snakegen.robot.force_sets import fixed_rotors_in_the_way, gimbals_in_the_way
from snakegen.robot.posture import aim_gimbals
from snakegen.robot.robot import Robot
from snakegen.wrench_margins.force_sets import ForceSets

STARTS = 24  # of the search for a tilt
ROUNDS = 8  # of gimbals that move the points where forces act
MET = 1e-7  # scaled, by which a tilted hover may be missed


@dataclass(frozen=True)
class HoverObstacles:
    """What keeps a posture from hovering with thrusts that each apparatus' rotors share.

    Attributes:
        thrust: N, sum of the largest thrusts.
        weight: N.
        gimbals: joints whose limits keep a thrust from pointing up.
        rotors: links of rotors that no gimbal turns and that do not point up.
        missing: (6,) N and N·m, root-link axes: from the nearest wrench in reach to hover.
        rpy: rad, attitude of the root link, as it is turned by `tilt`, in which it hovers; None
            where the search found none, which is no proof that there is none.
        tilt: rad, between the two attitudes; the least one that was found.
        forces: (n, 3) N of that hover, root-link axes.
    """

    thrust: float
    weight: float
    gimbals: tuple[str, ...]
    rotors: tuple[str, ...]
    missing: tuple[float, ...]
    rpy: tuple[float, float, float] | None
    tilt: float
    forces: Floats

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "largest_thrusts_N": self.thrust,
            "weight_N": self.weight,
            "gimbals_in_the_way": list(self.gimbals),
            "fixed_rotors_not_vertical": list(self.rotors),
            "missing_N_Nm": list(self.missing),
            "hovers_at_base_rpy_rad": None if self.rpy is None else list(self.rpy),
            "least_tilt_found_rad": None if self.rpy is None else self.tilt,
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        if self.thrust < self.weight:
            heavy = f"all thrusts at their largest add up to {self.thrust:.4g} N"
            return [("", f"too heavy: {heavy}, the weight is {self.weight:.4g} N")]
        out = []
        force, torque = np.array(self.missing[:3]), np.array(self.missing[3:])
        parts = [
            f"{name} {components(v)} {unit}"
            for name, v, unit in (("force", force, "N"), ("torque", torque, "N·m"))
            if np.abs(v).max() >= 0.005
        ]
        if parts:
            out.append(("", f"missing: {', '.join(parts)}"))
        if self.gimbals:
            out.append(("", f"gimbal limits keep thrusts from vertical: {' '.join(self.gimbals)}"))
        if self.rotors:
            out.append(("", f"fixed rotors not vertical: {' '.join(self.rotors)}"))
        if self.rpy is None:
            out.append(("", "no tilt of the whole body was found in which it hovers"))
        else:
            roll, pitch, yaw = np.rad2deg(self.rpy)
            turned = f"roll {roll:+.2f}°, pitch {pitch:+.2f}°, yaw {yaw:+.2f}°"
            by = f"tilted by {np.rad2deg(self.tilt):.2f}°"
            out.append(("", f"hovers {by}: root link at {turned} (least tilt found)"))
        return out


def hover_obstacles(
    robot: Robot, q: Floats, hover_wrench: Floats, missing: Floats
) -> HoverObstacles:
    """Returns what keeps q from hovering, and the least tilt found in which it does.

    A tilted hover has ``Σ p_j × f_j + c_j f_j = 0`` and ``‖Σ f_j‖ = m g``, f_j of thrusts λ and
    angles φ, θ in range; the tilt is that of ``Σ f_j`` from up. It is searched by sequential
    quadratic programs from many starts; points move as gimbals turn, so each answer's gimbals are
    set and the search repeated until they agree.

    Args:
        robot: the robot.
        q: (nq,) configuration.
        hover_wrench: (6,) N and N·m.
        missing: (6,) from the nearest wrench in reach to hover, N and N·m.
    """
    sets, weight = robot.force_sets(q), float(np.linalg.norm(hover_wrench[:3]))
    up = hover_wrench[:3] / weight
    forces = _tilted(robot, q, sets, up, weight) if sets.strengths.sum() >= weight else None
    rpy, tilt = None, float("nan")
    if forces is not None:
        new_up = forces.sum(axis=0) / weight
        tilt = float(np.arccos(np.clip(new_up @ up, -1.0, 1.0)))
        axis = np.cross(new_up, up)
        size = float(np.linalg.norm(axis))
        base, _ = robot.base_pose(q)
        turned = base @ rotation_about(axis / size, tilt) if size > 1e-12 else base
        roll, pitch, yaw = (float(x) for x in rpy_from_rotation(turned))
        rpy = (roll, pitch, yaw)
    return HoverObstacles(
        float(sets.strengths.sum()),
        weight,
        gimbals_in_the_way(robot, sets, up),
        fixed_rotors_in_the_way(robot, sets, up),
        tuple(float(x) for x in missing),
        rpy,
        tilt,
        np.full((len(sets), 3), np.nan) if forces is None else forces,
    )


def _tilted(robot: Robot, q: Floats, sets: ForceSets, up: Floats, weight: float) -> Floats | None:
    """Returns forces (n, 3) of least tilt that carry the weight without torque, if found."""
    rng, best, least = np.random.default_rng(0), None, np.inf
    low = np.r_[sets.low, sets.phi[:, 0], sets.theta[:, 0]]
    high = np.r_[sets.high, sets.phi[:, 1], sets.theta[:, 1]]
    middle: Floats = np.clip(
        np.r_[np.full(len(sets), weight / len(sets)), np.zeros(2 * len(sets))], low, high
    )
    arm = robot.torque_scale / robot.force_scale
    for k in range(STARTS):
        x: Floats = np.asarray(rng.uniform(low, high), float) if k else middle
        here = sets
        for _ in range(ROUNDS):
            x = _search(here, x, up, weight, arm)
            f = _forces(here, x)
            turned = aim_gimbals(robot, q, _directions(f) @ robot.base_pose(q)[0].T)[0]
            moved = robot.force_sets(turned)
            done = np.abs(moved.points - here.points).max() < 1e-9
            here = moved
            if done:
                break
        f = _forces(here, x)
        wrench = _wrench(here, f)
        missed = np.r_[np.linalg.norm(wrench[:3]) / weight - 1.0, wrench[3:] / (weight * arm)]
        tilt = float(np.arccos(np.clip(wrench[:3] @ up / weight, -1.0, 1.0)))
        if np.abs(missed).max() < MET and tilt < least - 1e-9:
            best, least = f, tilt
    return best


def _directions(forces: Floats) -> Floats:
    """Returns unit vectors (n, 3) along forces; up where there is none."""
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.where(size > 1e-9, forces / np.maximum(size, 1e-9), [0.0, 0.0, 1.0])


def _search(sets: ForceSets, x: Floats, up: Floats, weight: float, arm: float) -> Floats:
    """Returns thrusts and angles (3n,) of least tilt near x that carry the weight, no torque."""
    from scipy.optimize import minimize

    low = np.r_[sets.low, sets.phi[:, 0], sets.theta[:, 0]]
    high = np.r_[sets.high, sets.phi[:, 1], sets.theta[:, 1]]

    def missed(y: Floats) -> Floats:
        wrench = _wrench(sets, _forces(sets, y))
        return np.r_[wrench[:3] @ wrench[:3] / weight**2 - 1.0, wrench[3:] / (weight * arm)]

    def missed_slope(y: Floats) -> Floats:
        total, by = _forces(sets, y).sum(axis=0), _force_slopes(sets, y)
        torque = cross(sets.points, by) + sets.drag[:, None] * by
        rows = np.concatenate([2.0 / weight * (by @ total)[..., None], torque / arm], axis=-1)
        return np.asarray(rows.reshape(-1, 4).T / weight)

    found = minimize(
        lambda y: -float(_forces(sets, y).sum(axis=0) @ up) / weight,
        x,
        jac=lambda y: -(_force_slopes(sets, y) @ up).ravel() / weight,
        constraints={"type": "eq", "fun": missed, "jac": missed_slope},
        bounds=list(zip(low, high, strict=True)),
        method="SLSQP",
        options={"maxiter": 200, "ftol": 1e-12},
    )
    return np.clip(np.asarray(found.x, float), low, high)


def _force_slopes(sets: ForceSets, x: Floats) -> Floats:
    """Returns each force's derivative (3, n, 3) by its thrust, φ and θ, of `_forces`."""
    thrust, phi, theta = x.reshape(3, -1)
    sin_p, cos_p, sin_t, cos_t = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    by_thrust = [sin_t, -sin_p * cos_t, cos_p * cos_t]
    by_phi = [0.0 * phi, -cos_p * cos_t * thrust, -sin_p * cos_t * thrust]
    by_theta = [cos_t * thrust, sin_p * sin_t * thrust, -cos_p * sin_t * thrust]
    return np.einsum("nij,kjn->kni", sets.frames, np.array([by_thrust, by_phi, by_theta]))


def _forces(sets: ForceSets, x: Floats) -> Floats:
    """Returns the forces (n, 3), CoG axes, of thrusts and angles x (3n,)."""
    thrust, phi, theta = x.reshape(3, -1)
    u = [np.sin(theta), -np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return np.einsum("nij,jn->ni", sets.frames, thrust * np.array(u))


def _wrench(sets: ForceSets, forces: Floats) -> Floats:
    """Returns the wrench (6,) of forces (n, 3)."""
    torque = cross(sets.points, forces) + sets.drag[:, None] * forces
    return np.r_[forces.sum(axis=0), torque.sum(axis=0)]
