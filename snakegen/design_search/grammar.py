"""The names by which a study asks for figures of a design, and when one does not apply."""

from dataclasses import dataclass
from typing import Any, Literal

from snakegen.errors import near

FIGURES = (
    "mass_kg", "length_m", "thrust_to_weight", "price", "apparatus_gap_m", "joint_effort_Nm",
    "hover_power_W", "flight_time_min",
)  # fmt: skip
LOW_FIGURES = (
    "mass_kg", "length_m", "thrust_to_weight", "price", "joint_effort_Nm", "hover_power_W",
)  # fmt: skip
VIRTUAL, DUAL, JOINT_LIMITED = "virtual_single_rotor", "dual_rotor", "joint_limited"
HOLDS = ("force", "torque", "attitude_altitude")

Quantity = Literal[
    "force", "torque", "attitude_altitude", "joint_torque", "joint_load", "wake_loss", "reach",
    "opening_clearance",
]  # fmt: skip


@dataclass(frozen=True)
class Measure:
    """What a name asks for at each posture, and what is made of it.

    Attributes:
        quantity: which.
        mode: of a margin.
        failed: whether a margin is the least after the loss of any one apparatus.
        how: "quantile", "worst" or "best" of the postures.
        large: whether large values are good.
    """

    quantity: Quantity
    mode: str = VIRTUAL
    failed: bool = False
    how: str = "worst"
    large: bool = True

    @property
    def margin(self) -> bool:
        """Whether it is a margin."""
        return self.quantity in HOLDS

    @property
    def key(self) -> tuple[str, str, bool]:
        """What measures of the same values by posture share."""
        return self.quantity, self.mode, self.failed


def _measures() -> dict[str, Measure]:
    out: dict[str, Measure] = {}
    for failed in (False, True):
        for how in ("quantile", "worst"):
            tail = f"{'_failed' if failed else ''}_{how}"
            for mode, word in ((VIRTUAL, ""), (JOINT_LIMITED, "_joint_limited")):
                out[f"force_margin{word}{tail}_N"] = Measure("force", mode, failed, how)
                out[f"torque_margin{word}{tail}_Nm"] = Measure("torque", mode, failed, how)
            out[f"torque_margin_dual{tail}_Nm"] = Measure("torque", DUAL, failed, how)
            out[f"attitude_altitude_margin_dual{tail}"] = Measure(
                "attitude_altitude", DUAL, failed, how
            )
    for how in ("quantile", "worst"):
        out[f"joint_torque_{how}_Nm"] = Measure("joint_torque", how=how, large=False)
        out[f"joint_load_{how}"] = Measure("joint_load", how=how, large=False)
        out[f"wake_loss_{how}"] = Measure("wake_loss", how=how, large=False)
    out["reach_m"] = Measure("reach", how="best")
    out["opening_clearance_m"] = Measure("opening_clearance", how="best")
    return out


MEASURES = _measures()
NAMES = (*MEASURES, *FIGURES)


def sign(name: str) -> float:
    """Returns +1 for a figure that is better large, -1 for one that is better small."""
    large = MEASURES[name].large if name in MEASURES else name not in LOW_FIGURES
    return 1.0 if large else -1.0


def unknown(name: str) -> str:
    """Returns why a name is not in the grammar."""
    if name.startswith("force_margin_dual"):
        return (
            " does not apply: in dual-rotor mode gimbals stay as they are, pointed up, and push "
            "nowhere sideways; attitude_altitude_margin_dual_worst says what is left."
        )
    return f" is unknown.{near(name, NAMES)}"


def why_not(name: str, joints: int, free: bool, resolved: dict[str, Any]) -> str:
    """Returns why a figure does not apply to a robot; empty where it does.

    Args:
        name: of the figure.
        joints: number of those that shape the body.
        free: whether its gimbals have no limits and its rotors no least thrust.
        resolved: the robot's resolved spec.
    """
    unit = resolved["vectoring_apparatus"]
    count, measure = len(unit["at"]), MEASURES.get(name)
    bends = measure and (
        measure.mode == JOINT_LIMITED or measure.quantity in ("joint_torque", "joint_load")
    )
    if (bends or name == "joint_effort_Nm") and not joints:
        return "the body has no joints"
    if measure and measure.mode == JOINT_LIMITED and not free:
        return "its gimbals have limits or its rotors a least thrust"
    if measure and measure.failed and count < 2:
        return "nothing hovers after the loss of the only apparatus"
    if name == "apparatus_gap_m" and count < 2:
        return "there is one apparatus"
    if measure and measure.quantity == "wake_loss" and sum(unit["rotors"]) < 2:
        return "there is one rotor"
    if name == "flight_time_min" and not resolved["plant"]["battery_energy"] > 0.0:
        return "plant.battery_energy is 0, a battery that never empties"
    return ""
