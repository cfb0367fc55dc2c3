"""Hover: the thrust that each rotor needs, its reserve, the φ servo's load, and the flight time."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from snakegen.analysis.allocation import Allocation, allocation
from snakegen.base.geometry import Floats
from snakegen.control.power import JOULES, battery_joules, power_factors
from snakegen.robot.box_allocation import box_allocation
from snakegen.robot.posture import aim_gimbals
from snakegen.robot.robot import Robot
from snakegen.robot.rotor_streams import kept_in_streams
from snakegen.wrench_margins.vectored import set_margins

COMMAND = "hover"
ORDER = 40
_LOST = 0.01  # of a rotor's thrust: less is not worth a line
_MET = 1e-6  # of the weight: a hover whose wrench is met to this is a hover


@dataclass(frozen=True)
class Hover:
    """Hover thrusts in both modes, gimbals as given (the command line points thrust up first).

    Attributes:
        dual_thrust: (n,) N, least-norm within the limits; nearest to hover where it is none.
        dual_residual: share of the weight (torque: of weight · link length) left unmet.
        virtual_thrust: (Ñ,) N, ‖f_j‖ of the least-norm forces, eq 36.
        virtual_residual: as above, of the unlimited least-norm answer.
        thrust_max, apparatus_max: N, limits.
        roll_moment: (Ñ,) N·m, moment of λ1 − λ2 about the roll axis in dual-rotor hover.
        roll_moment_range: (Ñ,) N·m, the same at its largest, one rotor full and one at minimum.
        roll_effort: (Ñ,) N·m, the roll servo's limit, inf where there is no such joint.
        weight: N.
        apparatus_min: (Ñ,) N, least thrusts.
        beyond: (name, angle [rad]) of gimbals that eq 36's forces would turn past their limits.
        short: (Ñ,) rad, by which each apparatus stays short of the direction of its force.
        possible: where eq 36's forces leave a limit, whether other forces within all limits hover:
            True or False as certified bounds prove it, None where they leave it open.
        vectored: whether gimbals turn any rotor; else there is dual-rotor mode alone.
        power: (2,) W, electric, of hover in dual-rotor and in virtual-single-rotor mode.
        battery: J, of the battery; inf where none is declared.
        voltage_sag: share of the voltage lost from full to empty.
        apparatuses: their names, with their links.
    """

    dual_thrust: Floats
    dual_residual: float
    virtual_thrust: Floats
    virtual_residual: float
    thrust_max: Floats
    apparatus_max: Floats
    roll_moment: Floats
    roll_moment_range: Floats
    roll_effort: Floats
    weight: float
    apparatus_min: Floats
    beyond: tuple[tuple[str, float], ...]
    short: Floats
    possible: bool | None = None
    vectored: bool = True
    power: tuple[float, float] = (float("nan"), float("nan"))
    battery: float = float("inf")
    voltage_sag: float = 0.0
    apparatuses: tuple[str, ...] = ()
    stream_loss: Mapping[str, float] = field(default_factory=dict)  # by rotor, where 1 % or more
    stream_share: Mapping[str, float] = field(default_factory=dict)  # η by rotor, where below 1

    @property
    def thrust_to_weight(self) -> float:
        """Sum of largest thrusts over the weight."""
        return float(self.thrust_max.sum() / self.weight)

    @property
    def dual_feasible(self) -> bool:
        """Whether dual-rotor mode hovers within its limits at these gimbal angles."""
        return self.dual_residual < _MET

    @property
    def virtual_feasible(self) -> bool:
        """Whether the least-norm forces of eq 36 hover within the limits."""
        met = self.virtual_residual < _MET and np.all(self.short < _MET)
        low = self.virtual_thrust >= self.apparatus_min * (1 - 1e-9)
        high = self.virtual_thrust <= self.apparatus_max * (1 + 1e-9)
        return bool(self.vectored and met and np.all(low & high))

    def flight_time(self, mode: int) -> float | None:
        """Returns for how long [s] a full battery hovers; None without hover or a battery.

        It ends where the battery is empty, or before, where the thrust limits, which fall as the
        voltage squared, meet what hover takes of a rotor.

        Args:
            mode: 0 dual-rotor, 1 virtual-single-rotor.
        """
        feasible = self.virtual_feasible if mode else self.dual_feasible
        if not feasible or not np.isfinite(self.battery):
            return None
        share = self.virtual_thrust / self.apparatus_max if mode else None
        use = float(np.max(self.dual_thrust / self.thrust_max if share is None else share))
        part = 1.0
        if self.voltage_sag > 0.0:
            part = min(1.0, (1.0 - float(np.sqrt(use))) / self.voltage_sag)
        return part * self.battery / self.power[mode]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        energy = self.battery / JOULES
        return {
            "battery_Wh": energy if np.isfinite(energy) else None,
            "weight_N": self.weight,
            "thrust_to_weight": self.thrust_to_weight,
            **({"stream_efficiency": dict(self.stream_share)} if self.stream_share else {}),
            **({"lost_in_streams": dict(self.stream_loss)} if self.stream_loss else {}),
            "dual_rotor": {
                "feasible": self.dual_feasible,
                "thrust_N": self.dual_thrust.tolist(),
                "saturation": (self.dual_thrust / self.thrust_max).tolist(),
                "residual": self.dual_residual,
                "power_W": self.power[0] if self.dual_feasible else None,
                "flight_time_s": self.flight_time(0),
                "roll_servo_moment_Nm": self.roll_moment.tolist(),
                "roll_servo_moment_max_Nm": self.roll_moment_range.tolist(),
                "roll_servo_limit_Nm": [
                    None if np.isinf(e) else float(e) for e in self.roll_effort
                ],
            },
            "virtual_single_rotor": {
                "feasible": self.virtual_feasible,
                "thrust_N": self.virtual_thrust.tolist(),
                "saturation": (self.virtual_thrust / self.apparatus_max).tolist(),
                "residual": self.virtual_residual,
                "possible_within_limits": True if self.virtual_feasible else self.possible,
                "thrust_min_N": self.apparatus_min.tolist(),
                "gimbals_beyond_limits_rad": dict(self.beyond),
                "direction_short_rad": self.short.tolist(),
                "power_W": self.power[1] if self.virtual_feasible else None,
                "flight_time_s": self.flight_time(1),
            },
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        virtual = self._row("virtual-single-rotor", self.virtual_feasible, self.virtual_thrust,
                            self.apparatus_max, self.virtual_residual,
                            self._obstacles())  # fmt: skip
        return [
            ("weight, thrust to weight", f"{self.weight:.2f} N, {self.thrust_to_weight:.2f}"),
            *([virtual] if self.vectored else []),
            self._row("dual-rotor", self.dual_feasible, self.dual_thrust,
                      self.thrust_max, self.dual_residual),
            *self._streams(),
            ("power, flight time", self._endurance()),
            ("torque on roll servos", self._servo()),
        ]  # fmt: skip

    def _streams(self) -> list[tuple[str, str]]:
        """Returns the rows on rotors in streams: what the thrusts above include and what not."""
        rows = []
        if self.stream_share:
            least = min(self.stream_share, key=lambda name: self.stream_share[name])
            have = f"{len(self.stream_share)} rotors have {100 * self.stream_share[least]:.3g} %"
            rows = [("in streams", f"{have} of their still-air thrust ({least}): counted above")]
        if not self.stream_loss:
            return rows
        worst = max(self.stream_loss, key=lambda name: self.stream_loss[name])
        lost = f"{len(self.stream_loss)} rotors lose up to {100 * self.stream_loss[worst]:.2g} %"
        how = f"of their dual-rotor thrust ({worst}): hover takes more than these thrusts"
        return [*rows, ("lost in streams", f"{lost} {how}")]

    def _endurance(self) -> str:
        """Returns power and flight time of the modes that hover."""
        parts = []
        for mode, name in ((1, "virtual-single-rotor"), (0, "dual-rotor")):
            if not (self.virtual_feasible if mode else self.dual_feasible):
                continue
            seconds = self.flight_time(mode)
            lasts = "" if seconds is None else f", {seconds / 60:.1f} min"
            parts.append(f"{name} {self.power[mode]:.0f} W{lasts}")
        if not parts:
            return "no hover"
        energy = self.battery / JOULES
        held = (
            f"{energy:g} Wh"
            if np.isfinite(energy)
            else "no battery declared (plant.battery_energy)"
        )
        return "; ".join(parts) + f"   ({held})"

    def _row(
        self,
        mode: str,
        feasible: bool,
        thrust: Floats,
        limit: Floats,
        residual: float,
        obstacles: str = "",
    ) -> tuple[str, str]:
        share = float(np.max(thrust / limit))
        values = " ".join(f"{t:.2f}" for t in thrust)
        if feasible:
            return f"hover, {mode}", f"{values} N   (at most {100 * share:.0f} % of the limit)"
        why = (
            f"{100 * residual:.3g} % of the weight cannot be balanced"
            if residual >= _MET
            else obstacles or f"{100 * share:.0f} % of the limit"
        )
        if self.vectored and mode == "virtual-single-rotor":
            why += {
                True: "; other forces within the limits hover (constrained allocator)",
                False: "; no forces within the limits hover (proved)",
                None: "",
            }[self.possible]
        return f"hover, {mode}", f"not within limits: {values} N, {why}"

    def _obstacles(self) -> str:
        """Returns which limits of gimbals and least thrusts eq 36's forces leave, in words."""
        parts = [f"{name} at {angle:+.3f} rad" for name, angle in self.beyond]
        out = [f"past the limits: {', '.join(parts)}"] if parts else []
        fixed = np.flatnonzero(self.short >= _MET)
        if len(fixed) and not parts:
            which = ", ".join(self.apparatuses[j] for j in fixed)
            out.append(f"{which} cannot point along its force")
        idle = np.flatnonzero(self.virtual_thrust < self.apparatus_min * (1 - 1e-9))
        if len(idle):
            least = ", ".join(
                f"{self.apparatus_min[j]:.2f} N of {self.apparatuses[j]}" for j in idle
            )
            out.append(f"less than the least thrust, {least}")
        return "; ".join(out)

    def _servo(self) -> str:
        finite = np.isfinite(self.roll_effort)
        if not finite.any():
            return "no roll servo"
        now = np.abs(self.roll_moment[finite])
        most = np.abs(self.roll_moment_range[finite])
        effort = self.roll_effort[finite]
        return (
            f"hover {now.max():.3f} N·m, at most {most.max():.2f} N·m with one of two rotors full "
            f"(limit {effort.min():.2f} N·m: {100 * float((most / effort).max()):.0f} %)"
        )


def applies(robot: Robot) -> bool:
    """A robot with rotors and a free base."""
    return bool(robot.modules.apparatuses) and robot.floating


def analyze(robot: Robot, q: Floats) -> Hover:
    """Returns hover thrusts at q in both modes, their reserve and the roll servos' load.

    Dual: ``min ‖λ/λ_max‖`` with ``Q_dual λ = w0`` and the limits (a small QP). Virtual: eq 36,
    ``F = Q_force^# w0``. Roll moment: ``Σ_k λ_k (p_k − o) × u_k + drag``, along the roll axis.
    """
    a = allocation(robot, q)
    rotors, gimbals = robot.rotors, robot.gimbals
    rows = np.repeat([1.0 / robot.force_scale, 1.0 / robot.torque_scale], 3)
    dual = box_allocation(
        a.dual, a.hover_wrench, rows, rotors.thrust_max, rotors.thrust_min, rotors.thrust_max
    )
    forces = np.linalg.pinv(rows[:, None] * a.force, rcond=1e-9) @ (rows * a.hover_wrench)
    moment, largest = _roll_moments(robot, a, dual)
    effort = np.array(
        [
            robot.limits([robot.joint_names[b - 1]])[2][0] if b >= 0 else np.inf
            for b in gimbals.roll_body
        ]
    )
    beyond, short = _reach(robot, q, a, forces.reshape(-1, 3))
    found = Hover(
        dual,
        float(np.linalg.norm(rows * (a.dual @ dual - a.hover_wrench))),
        np.linalg.norm(forces.reshape(-1, 3), axis=1),
        float(np.linalg.norm(rows * (a.force @ forces - a.hover_wrench))),
        np.array(rotors.thrust_max),
        np.array(gimbals.limit),
        moment,
        largest,
        effort,
        a.mass * 9.81,
        np.bincount(rotors.apparatus, rotors.thrust_min, len(gimbals.limit)).astype(float),
        beyond,
        short,
        vectored=bool(robot.gimbal_names),
        power=_powers(robot, dual, np.linalg.norm(forces.reshape(-1, 3), axis=1)),
        battery=battery_joules(robot.modules.plant.get("battery_energy", 0.0)),
        voltage_sag=float(robot.modules.plant.get("voltage_sag", 0.1)),
        apparatuses=robot.apparatus_names,
        stream_loss=_stream_loss(robot, a, dual),
        stream_share=_stream_share(robot),
    )
    if not found.vectored or found.virtual_feasible:
        return found
    return replace(found, possible=_possible(robot, q, a))


def _stream_loss(robot: Robot, a: Allocation, thrust: Floats) -> dict[str, float]:
    """Returns the share, of 1 % or more, that rotors lose to streams of other bodies' rotors."""
    rotors = [r for apparatus in robot.modules.apparatuses for r in apparatus.rotors]
    radius = 0.5 * np.array([max(r.diameter, 1e-6) for r in rotors])
    apart = robot.rotors.body[:, None] != robot.rotors.body
    lost = 1.0 - kept_in_streams(a.rotor_positions, a.rotor_axes, radius, thrust, apart)
    named = zip(rotors, lost, strict=True)
    return {r.label: float(x) for r, x in named if x >= _LOST}


def _stream_share(robot: Robot) -> dict[str, float]:
    """Returns the share of its still-air thrust that limits count on, of each rotor in a stream."""
    rotors = [r for apparatus in robot.modules.apparatuses for r in apparatus.rotors]
    return {r.label: r.stream_efficiency for r in rotors if r.stream_efficiency < 1.0}


def _possible(robot: Robot, q: Floats, a: Allocation) -> bool | None:
    """Returns whether some forces of the apparatuses' sets give the hover wrench, None if open."""
    scale: dict[str, Any] = {"force_scale": robot.force_scale, "torque_scale": robot.torque_scale}
    m = set_margins(robot.force_sets(q), a.hover_wrench, wrench_starts=0, **scale)
    low, high = (float(x) for x in m.wrench_bounds)
    return True if low > 0.0 else False if high < 0.0 else None  # 0: a lost rank, no proof


def _reach(
    robot: Robot, q: Floats, a: Allocation, forces: Floats
) -> tuple[tuple[tuple[str, float], ...], Floats]:
    """Returns gimbals that forces (Ñ, 3), link axes, turn past their limits, and angles short.

    An apparatus without a force keeps its direction.
    """
    base, _ = robot.base_pose(q)
    size = np.linalg.norm(forces, axis=1)
    asked = size > _MET * a.mass
    up = np.einsum("nij,nj->ni", a.link_axes, forces) / np.where(asked, size, 1.0)[:, None]
    directions = np.where(asked[:, None], up, [0.0, 0.0, 1.0]) @ base.T
    short = np.where(asked, aim_gimbals(robot, q, directions)[1], 0.0)
    free = robot.angles(aim_gimbals(robot, q, directions, limited=False)[0])
    low, high, _ = robot.limits(robot.joint_names)
    beyond = []
    for j, apparatus in enumerate(robot.modules.apparatuses):
        for name in (apparatus.roll, apparatus.pitch):
            if name is None or short[j] < _MET:
                continue
            k = robot.joint_names.index(name)
            if not low[k] - _MET <= free[k] <= high[k] + _MET:
                beyond.append((name, float(free[k])))
    return tuple(beyond), short


def _powers(robot: Robot, dual: Floats, virtual: Floats) -> tuple[float, float]:
    """Returns the electric power [W] of hover in both modes; a pair shares its force equally."""
    owner = robot.rotors.apparatus
    shared = (virtual / np.bincount(owner))[owner]
    factors = power_factors(robot)
    dual_power, virtual_power = (factors @ np.maximum(t, 0.0) ** 1.5 for t in (dual, shared))
    return float(dual_power), float(virtual_power)


def _roll_moments(robot: Robot, a: Allocation, thrust: Floats) -> tuple[Floats, Floats]:
    """Returns each roll servo's moment [N·m] for `thrust`, and the largest the limits allow."""
    rotors, gimbals = robot.rotors, robot.gimbals
    now, most = np.zeros(gimbals.limit.size), np.zeros(gimbals.limit.size)
    for j in range(gimbals.limit.size):
        mine = np.flatnonzero(rotors.apparatus == j)
        # at hover the roll axis and the thrust are square: use the link's own x as the axis
        axis = a.link_axes[j] @ _roll_axis(robot, j)
        arm = a.rotor_positions[mine] - a.thrust_points[j]
        unit = (
            np.cross(arm, a.rotor_axes[mine]) + rotors.torque_ratio[mine, None] * a.rotor_axes[mine]
        ) @ axis
        now[j] = float(unit @ thrust[mine])
        high, low = rotors.thrust_max[mine], rotors.thrust_min[mine]
        up = np.where(unit > 0, high, low) @ unit
        down = np.where(unit < 0, high, low) @ unit
        most[j] = max(abs(float(up)), abs(float(down)))
    return now, most


def _roll_axis(robot: Robot, j: int) -> Floats:
    """Returns the roll axis of apparatus j in its link's axes."""
    roll = int(robot.gimbals.roll_body[j])
    if roll < 0:
        return np.array([1.0, 0.0, 0.0])
    in_parent = robot.tree.rotation[roll] @ robot.tree.axis[roll]
    if robot.tree.parent[roll] == robot.gimbals.link_body[j]:
        return np.asarray(robot.gimbals.link_rotation[j].T @ in_parent)
    return np.array([1.0, 0.0, 0.0])
