"""Thrusts, reserve, servo load and flight time of a hover, as data and as text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.power import JOULES

UNMET = 1e-6  # share of the weight that may be left unmet


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
        return self.dual_residual < UNMET

    @property
    def virtual_feasible(self) -> bool:
        """Whether the least-norm forces of eq 36 hover within the limits."""
        met = self.virtual_residual < UNMET and np.all(self.short < UNMET)
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
            if residual >= UNMET
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
        fixed = np.flatnonzero(self.short >= UNMET)
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
