"""Tracking errors to expect of a hover along a motion, and how many of them its clearance covers.

Rotors are unequal and an IMU is tilted. The integrals make up for both where a flight is trimmed;
along a motion the levers of the thrusts, the inertia and the attitude change, and with them the
acceleration a that the integrals have to hold. They follow within τ = `SETTLING`: the error is a's
high-pass over the proportional gain, ``e' + e/τ = a'/K_p`` (THEORY A6). A straight body has little
inertia about its own line, and turns about it for the smallest difference of thrusts.

`simulation.flight.bounds.error_budget` judges flights by the same figures, with every source, in
the posture of the gimbals; here all poses of all seeds are looked at, so the two largest are taken.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from snakegen.base.geometry import Floats, skew
from snakegen.control.controller import Controller, flight_controller
from snakegen.planning.body import PlannedBody
from snakegen.planning.hover_actuation import hover_forces
from snakegen.planning.plan_file import SETTLING
from snakegen.robot.robot import GRAVITY

MISMATCH = 0.03  # of a rotor's thrust, one standard deviation
TILT = 0.00698  # rad, of an IMU about each axis, likewise
SCALE = np.array([0.018, 0.019, 0.0085, 0.013, 0.0165, 0.0165])  # m, rad: half of ZN23's Table 6
NEAR = 0.3  # m: pairs of bodies that are farther apart are safe from tracking errors


@dataclass(frozen=True)
class Cover:
    """The least clearance in standard deviations of the tracking error toward it.

    Attributes:
        sigmas: clearance over `error`.
        error: m, one standard deviation over draws of the hardware.
        time: s, or the number of the pose.
        between: the two bodies.
    """

    sigmas: float
    error: float
    time: float
    between: tuple[str, str]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data."""
        return {
            "sigmas": float(f"{self.sigmas:.4g}"),
            "error_m": float(f"{self.error:.4g}"),
            "time_s": float(f"{self.time:.4g}"),
            "between": list(self.between),
        }


class Tracking:
    """The errors that a body's hardware leaves along poses; see the module."""

    def __init__(self, body: PlannedBody) -> None:
        """Takes the gains that the body flies with."""
        self.body = body

    @cached_property
    def _controller(self) -> Controller:
        return flight_controller(self.body.robot)

    @cached_property
    def _gains(self) -> Floats:
        """K_p (6,)."""
        law = self._controller.law
        return np.concatenate([law.force[0], law.torque[0]])

    @cached_property
    def _arms(self) -> Floats:
        """(r,) m, each rotor's signed distance from its apparatus' thrust point."""
        rotors, gimbals = self.body.robot.rotors, self.body.robot.gimbals
        away = rotors.position - gimbals.thrust_point[rotors.apparatus]
        first: dict[int, Floats] = {}
        out = []
        for j, arm in zip(rotors.apparatus, away, strict=True):
            size = float(np.linalg.norm(arm))
            axis = first.setdefault(int(j), arm / size if size > 1e-9 else arm)
            out.append(float(arm @ axis))
        return np.array(out)

    def errors(self, poses: Floats, times: Floats) -> Floats:
        """Returns the errors (m, 6, s) that s sources leave: CoG [m], turn [rad], world axes.

        One standard deviation of each source; the first pose is where the body is trimmed.

        Args:
            poses: (m, 6 + k).
            times: (m,) s.
        """
        body, law = self.body, self._controller.law
        points, held, turns = [], [], []
        for pose in poses:
            now = body.at_pose(pose)
            points.append(now.points)
            pin.ccrba(body.model, body.data, now.q, np.zeros(body.model.nv))
            axes = body.data.oMi[int(law.axes_body) + 1].rotation @ law.axes_rotation
            origin = np.array(body.data.oMi[1].translation)
            held.append((np.array(body.data.Ig.inertia), axes, pose[:3] - origin))
            turns.append(np.array([body.data.oMi[j].rotation for j in body.mounts.joint]))
        wrench = np.concatenate([[0.0, 0.0, body.weight], np.zeros(3)])
        forces = hover_forces(np.array(points), np.asarray(body.sets.high), wrench)
        out, error = [], np.zeros((6, 0))
        before: Floats | None = None
        steps = np.diff(times, prepend=times[0]) / SETTLING
        for p, f, turn, (inertia, axes, lever), step in zip(
            points, forces, turns, held, steps, strict=True
        ):
            columns = self._accelerations(p, f, turn, inertia, axes) / self._gains[:, None]
            if before is None:
                error = np.zeros_like(columns)
            else:
                kept = float(np.exp(-step))
                gained = (1.0 - kept) / step if step > 1e-9 else 1.0
                error = kept * error + gained * (columns - before)
            before = columns
            tilt = np.vstack([skew(lever) @ axes, axes]) * TILT
            out.append(np.hstack([np.vstack([error[:3], axes @ error[3:]]), tilt]))
        return np.array(out)

    def _accelerations(
        self, points: Floats, forces: Floats, turns: Floats, inertia: Floats, axes: Floats
    ) -> Floats:
        """Returns accelerations (6, r + 3) of unequal rotors and a tilt: world, CoG axes."""
        body, rotors = self.body, self.body.robot.rotors
        rod = np.einsum("nij,nj->ni", turns, body.mounts.axis)
        side = np.cross(rod, forces)
        side /= np.maximum(np.linalg.norm(side, axis=1), 1e-9)[:, None]
        owner = rotors.apparatus
        count = np.bincount(owner, minlength=len(forces))
        force = MISMATCH * forces[owner] / count[owner][:, None]
        torque = np.cross(points[owner] + self._arms[:, None] * side[owner], force)
        tilt = TILT * GRAVITY * skew(np.array([0.0, 0.0, 1.0])) @ axes
        return np.hstack(
            [
                np.vstack([force.T / body.mass, axes.T @ np.linalg.solve(inertia, torque.T)]),
                np.vstack([tilt, np.zeros((3, 3))]),
            ]
        )

    def rms(self, errors: Floats, poses: Floats) -> Floats:
        """Returns the RMS (6,) over poses of CoG errors [m] and turns about CoG axes [rad]."""
        body, law = self.body, self._controller.law
        own = errors.copy()
        for row, pose in zip(own, poses, strict=True):
            body.at_pose(pose)
            axes = body.data.oMi[int(law.axes_body) + 1].rotation @ law.axes_rotation
            row[3:] = axes.T @ row[3:]
        return np.asarray(np.sqrt(np.mean(np.sum(own**2, axis=2), axis=0)))

    def cover(self, errors: Floats, poses: Floats, times: Floats) -> Cover:
        """Returns the least clearance in standard deviations of the error toward the obstacle.

        A point of the body at r from the CoG errs by ``e_p + e_R × r``; of every pair of bodies
        nearer than `NEAR` the part along the line between their nearest points is taken.

        Args:
            errors: (m, 6, s) from `errors`.
            poses: (m, 6 + k).
            times: (m,) s.
        """
        body, shapes = self.body, self.body.shapes
        best = Cover(np.inf, 0.0, 0.0, ("", ""))
        for pose, error, time in zip(poses, errors, times, strict=True):
            now = body.at_pose(pose)
            gaps = body.distances(now.q)[: shapes.outer] - now.slack
            close = np.flatnonzero(gaps < NEAR)
            if not len(close):
                continue
            found = [body.places.distanceResults[int(k)] for k in close]
            near = np.array([r.getNearestPoint1() for r in found])
            normal = np.array([r.normal for r in found])  # from the body to the obstacle
            toward = normal @ error[:3] + np.cross(near - pose[:3], normal) @ error[3:]
            sigma = np.maximum(np.linalg.norm(toward, axis=1), 1e-9)
            k = int(np.argmin(gaps[close] / sigma))
            if gaps[close[k]] < best.sigmas * sigma[k]:
                a, b = (shapes.labels[i] for i in shapes.pairs[close[k]])
                least = float(gaps[close[k]] / sigma[k])
                best = Cover(least, float(sigma[k]), float(time), (a, b))
        return best
