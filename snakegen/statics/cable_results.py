"""Results of the cable analysis, for people and for programs."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.statics.cabled import HELD_ACCELERATION, HELD_DRIFT, Held


@dataclass(frozen=True)
class CableMotion:
    """How stiff the posture is along a motion, quasi-statically.

    Attributes:
        name: of the motion.
        time: (m,) s.
        least: (m,) N·m/rad, least eigenvalue of the stiffness.
        tension: (m,) N, the highest.
        balanced: (m,) whether tensions balance the loads.
        softest: the joint that bends most in the softest direction of the worst instant.
        threshold: N·m/rad, above which a posture counts as held.
    """

    name: str
    time: Floats
    least: Floats
    tension: Floats
    balanced: Floats
    softest: str
    threshold: float

    @property
    def held(self) -> bool:
        """Whether every instant is balanced and held."""
        return bool(np.all(self.balanced) and self.least.min() > self.threshold)

    def text(self) -> str:
        """Returns the result for people."""
        k = int(np.argmin(self.least))
        lost = int(np.sum(self.balanced < 1))
        word = "held throughout" if self.held else "NOT held throughout"
        out = (
            f"{self.name}: {word}; least stiffness {self.least[k]:.4g} N·m/rad at "
            f"{self.time[k]:.3g} s ({self.softest}), highest tension {self.tension.max():.4g} N"
        )
        return out + (f"; {lost} of {len(self.time)} instants not balanced" if lost else "")

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        return {
            "motion": self.name,
            "held": self.held,
            "instants": len(self.time),
            "balanced_instants": int(np.sum(self.balanced)),
            "stiffness_least_Nm_rad": float(self.least.min()),
            "time_of_least_s": float(self.time[np.argmin(self.least)]),
            "softest_joint": self.softest,
            "tension_max_N": float(self.tension.max()),
        }


@dataclass(frozen=True)
class CablesResult:
    """Tensions that balance a posture, and whether they hold it.

    Attributes:
        names: (c,) cables, ``cable{segment}_{number}``.
        tension: (c,) N, at the winch.
        length: (c,) m, along the holes.
        joints: (n,) chain joints.
        arms: (n, c) m, ``A = -(∂l/∂θ)ᵀ``.
        torque: (n,) N·m, wanted of the cables.
        shortage: (n,) N·m, what they leave; all zero where the posture is balanced.
        method: ``back-substitution`` or, where that fails, ``all segments at once``.
        why: one sentence.
        routing: what `route` was given, its keys with units, and whether all of it is assumed;
            empty for a routing of one's own.
        stiffness: (n, n) N·m/rad, of the joints.
        least: N·m/rad, its least eigenvalue.
        softest: (n,) unit direction of that, chain joints.
        threshold: N·m/rad, above which the posture counts as held.
        holding: (c,) N, tensions of least sum that balance and hold; None where none do.
        limit: N, the highest least tension at which some tensions still hold; nan if none does.
        along: how stiff a motion is, where one was given.
        mjcf: the MJCF written, "" if none; `held`: what MuJoCo says of it.
    """

    names: tuple[str, ...]
    tension: Floats
    length: Floats
    joints: tuple[str, ...]
    arms: Floats
    torque: Floats
    shortage: Floats
    method: str
    why: str
    routing: dict[str, Any]
    stiffness: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    least: float = np.nan
    softest: Floats = field(default_factory=lambda: np.zeros(0))
    threshold: float = 0.0
    holding: Floats | None = None
    limit: float = np.nan
    along: CableMotion | None = None
    mjcf: str = ""
    held: Held | None = None

    @property
    def feasible(self) -> bool:
        """Whether the tensions balance the loads."""
        return balanced(self.shortage, self.torque)

    @property
    def holds(self) -> bool:
        """Whether the posture is balanced and comes back when it is disturbed."""
        return self.feasible and self.least > self.threshold

    @property
    def softest_joint(self) -> str:
        """The joint that bends most in the softest direction."""
        return self.joints[int(np.argmax(np.abs(self.softest)))] if self.softest.size else ""

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: tensions segment by segment."""
        out = [("routing", routing_text(self.routing)), ("cables", self.why)]
        if self.feasible:
            out.append(("stiffness", f"{self.least:.4g} N·m/rad at least ({self.softest_joint})"))
            out += self._holding_rows()
        parts: dict[str, list[float]] = {}
        for name, t in zip(self.names, self.tension, strict=True):
            parts.setdefault(name.split("_")[0].replace("cable", "segment "), []).append(t)
        out += [(k, " ".join(f"{t:.4g}" for t in ts) + " N") for k, ts in parts.items()]
        if self.along is not None:
            out.append(("motion", self.along.text()))
        if self.held is not None:
            out.append(("mjcf", f"{self.mjcf}: {len(self.names)} tendons, keyframe 'held'"))
            out.append(("in MuJoCo", self._mujoco_text(self.held)))
        return out

    def _holding_rows(self) -> list[tuple[str, str]]:
        if self.holding is not None:
            text = f"{self.holding.max():.4g} N at most, {self.holding.sum():.5g} N in all"
        else:
            text = "none within the limits of tension"
        if np.isnan(self.limit):
            limit = "with no --minimum"
        elif np.isinf(self.limit):
            limit = "with any --minimum"
        else:
            limit = f"with a --minimum of up to {self.limit:.4g} N"
        return [("least that holds", text), ("would be held", limit)]

    def _mujoco_text(self, held: Held) -> str:
        gap = max(abs(held.torque[n] - t) for n, t in zip(self.joints, self.torque, strict=True))
        still = "balanced" if _still(held) else "NOT balanced"
        bent = f"bent by {1e3 * held.pushed:g} mrad ({self.softest_joint}) it "
        bent += {
            None: f"is {held.end:.1e} rad off after {held.waited:.3g} s",
            True: f"leaves: {held.end:.2g} rad off after {held.waited:.3g} s",
            False: f"comes back: {held.end:.1e} rad off after {held.waited:.3g} s",
        }[held.left]
        return f"{still}: torques {gap:.1e} N·m off, {held.drift:.1e} rad of drift; {bent}"

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""

        def by_cable(values: Floats | None) -> dict[str, float] | None:
            return None if values is None else dict(zip(self.names, values.tolist(), strict=True))

        def by_joint(values: Floats) -> dict[str, float]:
            return dict(zip(self.joints, values.tolist(), strict=True))

        out: dict[str, Any] = {
            "routing": self.routing or None,
            "feasible": self.feasible,
            "held": self.holds,
            "state": "held" if self.holds else "balanced" if self.feasible else "not balanced",
            "why": self.why,
            "method": self.method,
            "tension_N": by_cable(self.tension),
            "length_m": by_cable(self.length),
            "torque_Nm": by_joint(self.torque),
            "shortage_Nm": by_joint(self.shortage),
            "arms_m": self.arms.tolist(),
            "stiffness_Nm_rad": self.stiffness.tolist(),
            "stiffness_least_Nm_rad": self.least,
            "softest_direction": by_joint(self.softest),
            "least_tension_that_holds_N": by_cable(self.holding),
            "held_up_to_least_tension_N": self.limit,
        }
        if self.along is not None:
            out["along"] = self.along.to_json()
        if self.held is not None:
            out |= {"mjcf": self.mjcf, "in_mujoco": self._mujoco_json(self.held)}
        return out

    def _mujoco_json(self, held: Held) -> dict[str, Any]:
        return {
            "balanced": _still(held),
            "held": _still(held) and held.left is False,
            "acceleration_max_rad_s2": held.acceleration,
            "torque_Nm": held.torque,
            "drift_max_rad": held.drift,
            "seconds": held.seconds,
            "tension_end_N": dict(zip(self.names, held.tension.tolist(), strict=True)),
            "disturbance_rad": held.pushed,
            "disturbed_max_rad": held.farthest,
            "disturbed_end_rad": held.end,
            "disturbed_left": held.left,
            "disturbed_s": held.waited,
        }


def _still(held: Held) -> bool:
    return held.drift <= HELD_DRIFT and held.acceleration <= HELD_ACCELERATION


def balanced(shortage: Floats, torque: Floats) -> bool:
    """Tells whether what is left of torques (k,) [N·m] is the solver's rounding only."""
    return bool(np.max(np.abs(shortage)) <= 1e-7 * max(1.0, float(np.max(np.abs(torque)))))


def routing_text(routing: dict[str, Any]) -> str:
    """Returns a routing for people: ``assumed routing: 3 a segment at 30 mm …``."""
    if not routing:
        return "as given"
    said = "assumed routing: " if routing["assumed"] else ""
    run = "sheathed up to their segment" if routing["sheathed"] else "through the segments before"
    return (
        f"{said}{routing['cables_per_segment']} a segment at {1e3 * routing['radius_m']:g} mm, "
        f"holes {1e3 * routing['standoff_m']:g} mm either side of a joint, {run}"
    )
