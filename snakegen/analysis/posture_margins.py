"""Margins of one posture as a typed result: values with units, bounds, directions, limits."""

from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from snakegen.analysis.allocation import allocation
from snakegen.analysis.push_margins import DUAL_MODE, VIRTUAL_MODE
from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError, near
from snakegen.robot.configuration import Configuration
from snakegen.robot.robot import Robot
from snakegen.sensitivity.margin_gradient import margin_gradient
from snakegen.wrench_margins.thrust import ThrustMargins, thrust_margins
from snakegen.wrench_margins.vectored import VectoredMargins, set_margins

Mode = Literal["virtual_single_rotor", "dual_rotor"]
MODES = (VIRTUAL_MODE, DUAL_MODE)


@dataclass(frozen=True)
class ActiveLimits:
    """What stops a margin where it is reached; names of rotors (dual-rotor) or apparatuses.

    Attributes:
        at_upper: at their largest thrust.
        at_lower: at their least thrust; vectored sets name none, as each of theirs has room.
    """

    at_upper: tuple[str, ...]
    at_lower: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class PostureMargins:
    """How large a disturbance a posture withstands in hover, in every direction (THEORY A4).

    Forces and torques are along the root link's axes, torques about the CoG. Each value is the
    certified lower one of its bounds; the two are equal where the value is exact.

    Attributes:
        configuration: the posture, gimbal angles included.
        mode: ``virtual_single_rotor``, gimbals free within their limits, or ``dual_rotor``, gimbals
            held at the configuration's angles.
        force_N, torque_Nm: radius of the largest ball of forces with no torque, and of torques
            with no force, that the rotors can add to hover; NaN where hover is infeasible.
        wrench: the same of the scaled wrench ``[force / force_scale_N; torque / torque_scale_Nm]``;
            negative where hover is infeasible, by the distance to what is feasible.
        attitude_altitude: of its rows ``[f_z; τ]`` alone; NaN in virtual-single-rotor mode.
        force_bounds_N, torque_bounds_Nm, wrench_bounds: certified (lower, upper).
        worst_force, worst_torque: (3,) unit directions in which force and torque margin are
            reached.
        worst_wrench_N_Nm: (6,) direction in which the wrench margin is reached, of scaled length 1.
        force_limits, torque_limits, wrench_limits: the limits that are active there.
        rank: dimensions in which the rotors can change the wrench.
        feasible: whether the robot hovers within its limits.
        closed: whether lower and upper bounds agree to `tolerance`.
        tolerance: relative, (upper - lower)/upper.
        force_scale_N, torque_scale_Nm: m g, and m g times the mean link length.
        exact: the wrench set's own result, for what is not named here.
    """

    configuration: Configuration
    mode: Mode
    force_N: float
    torque_Nm: float
    wrench: float
    attitude_altitude: float
    force_bounds_N: tuple[float, float]
    torque_bounds_Nm: tuple[float, float]
    wrench_bounds: tuple[float, float]
    worst_force: Floats
    worst_torque: Floats
    worst_wrench_N_Nm: Floats
    force_limits: ActiveLimits
    torque_limits: ActiveLimits
    wrench_limits: ActiveLimits
    rank: int
    feasible: bool
    closed: bool
    tolerance: float
    force_scale_N: float
    torque_scale_Nm: float
    exact: ThrustMargins | VectoredMargins

    def directional(self, u: ArrayLike) -> float:
        """Returns the largest t for which the rotors can add ``t u`` to hover: the lower bound.

        Args:
            u: (6,) N and N·m, root link's axes; need not be a unit vector.

        Raises:
            AnalysisError: `u` is zero, not finite or of another shape.
        """
        return float(self.exact.directional(u))

    def gradient(self, kind: str, wrt: str = "joints") -> Floats:
        """Returns the exact derivative of a margin, a subgradient where it has a kink.

        Args:
            kind: "force" [N/…], "torque" [N·m/…] or "wrench"; "attitude_altitude" in dual-rotor
                mode.
            wrt: "joints": (n,) per rad, in the order of ``robot.joint_names``, gimbals included;
                or as `snakegen.margin_gradient` takes it.

        Raises:
            AnalysisError: no such margin, hover out of reach, or an optimum that was not found.
        """
        robot = cast(Robot, self.configuration.robot)
        return margin_gradient(robot, self.configuration, kind, self.mode, wrt)

    def __repr__(self) -> str:
        """Returns the margins in one line."""
        head = f"PostureMargins({self.configuration.robot.name}, {self.mode}: "
        if not self.feasible:
            return f"{head}hover is infeasible by {-self.wrench:.3g} (scaled), rank {self.rank})"
        return (
            f"{head}force {self.force_N:.4g} N, torque {self.torque_Nm:.4g} N·m, "
            f"wrench {self.wrench:.3g}, rank {self.rank}{'' if self.closed else ', bounds differ'})"
        )


def margins(
    q: Configuration, mode: Mode = "virtual_single_rotor", *, tolerance: float = 1e-3
) -> PostureMargins:
    """Returns the feasible-wrench margins of a posture in one mode (THEORY A4).

    Gimbals are taken as they are in q: in dual-rotor mode they hold the rotors' axes, in
    virtual-single-rotor mode they place the points at which the apparatuses push.
    ``robot.configuration({…}, gimbals="hover")`` points every thrust up.

    Args:
        q: from ``robot.configuration()``.
        mode: ``virtual_single_rotor`` (certified bounds) or ``dual_rotor`` (exact).
        tolerance: relative gap of the certified bounds.

    Raises:
        AnalysisError: q is a plain array, the robot has no free base, no rotors or no gimbals for
            the mode, or the mode is unknown.
    """
    if mode not in MODES:
        raise AnalysisError(f"mode '{mode}' is unknown.{near(str(mode), MODES)}")
    robot = q.robot if isinstance(q, Configuration) else None
    if not isinstance(q, Configuration) or not isinstance(robot, Robot):
        raise AnalysisError(
            f"margins() takes a configuration, not of type {type(q).__name__}: "
            "robot.configuration({…}), or robot.validate_configuration(array)."
        )
    if not robot.floating or not robot.modules.apparatuses:
        raise AnalysisError(f"{robot.name}: margins need a floating base and rotors.")
    if mode == VIRTUAL_MODE and not robot.gimbal_names:
        raise AnalysisError(f"{robot.name} has no gimbals; its margins are those of '{DUAL_MODE}'.")
    a = allocation(robot, q)
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    if mode == VIRTUAL_MODE:
        sets = robot.force_sets(q)
        return _result(q, mode, set_margins(sets, a.hover_wrench, tolerance=tolerance, **scale))
    low, high = robot.rotors.thrust_min, robot.rotors.thrust_max
    return _result(q, mode, thrust_margins(a.dual, low, high, a.hover_wrench, **scale), tolerance)


def _result(
    q: Configuration,
    mode: Mode,
    found: ThrustMargins | VectoredMargins,
    tolerance: float = 0.0,
) -> PostureMargins:
    """Returns the typed result of one mode's margins."""
    robot = cast(Robot, q.robot)
    dual = isinstance(found, ThrustMargins)
    units = robot.apparatus_names
    rotors = [r.label for part in robot.modules.apparatuses for r in part.rotors]

    def bounds(name: str) -> tuple[float, float]:
        low, high = [getattr(found, name)] * 2 if dual else getattr(found, f"{name}_bounds")
        return float(low), float(high)

    def limits(name: str) -> ActiveLimits:
        labels = rotors if dual else units
        full, idle = found.saturated(name)
        lower = tuple(labels[i] for i in idle) if dual else ()
        return ActiveLimits(tuple(labels[i] for i in full), lower)

    return PostureMargins(
        configuration=q,
        mode=mode,
        force_N=float(found.force),
        torque_Nm=float(found.torque),
        wrench=float(found.wrench),
        attitude_altitude=float(found.attitude_altitude),
        force_bounds_N=bounds("force"),
        torque_bounds_Nm=bounds("torque"),
        wrench_bounds=bounds("wrench"),
        worst_force=np.array(found.worst("force")[:3]),
        worst_torque=np.array(found.worst("torque")[3:]),
        worst_wrench_N_Nm=np.array(found.worst("wrench")),
        force_limits=limits("force"),
        torque_limits=limits("torque"),
        wrench_limits=limits("wrench"),
        rank=int(found.rank),
        feasible=bool(found.feasible),
        closed=True if isinstance(found, ThrustMargins) else bool(found.closed),
        tolerance=tolerance if isinstance(found, ThrustMargins) else found.tolerance,
        force_scale_N=robot.force_scale,
        torque_scale_Nm=robot.torque_scale,
        exact=found,
    )
