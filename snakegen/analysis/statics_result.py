"""Joint torques of a posture and what the tip can carry, as data and as text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.statics.joint_torques import Depth
from snakegen.statics.statics_rows import capacity_text, joint_rows
from snakegen.statics.tip import TipLoad, plain

_SUPPORTS = {
    "base": "base held",
    "hover": "vectored thrust in hover",
    "dual": "dual-rotor hover, gimbals as they stand",
    "thrust": "thrust as given",
}


@dataclass(frozen=True)
class StaticsResult:
    """Joint torques of a posture.

    Attributes:
        joints: (n,) names.
        terms: depth that `torque` has.
        support: what carries the weight: ``base``, ``hover``, ``dual`` (as in `Support`) or
            ``thrust``.
        torque: (n,) N·m.
        limit: (n,) N·m, servo limits.
        use: (n,) |torque| / limit.
        by_term: (n,) N·m by term name; the terms that the depth sums, and thrust.
        share: by term, its part of the sum over joints and terms of |torque|.
        depths: (n,) N·m by depth: static, quasi_static, full.
        base: (6,) [force; torque] that the base must be given, root-link axes; zero in balance.
        twist_matrix: (6, n).
        twist_singular_values: of the twist matrix, its rank beside them (tolerance 1e-9 σ1).
        twist_rank: see above.
        tip: link and place of the tip (m from the base origin, world axes).
        tip_load: what the tip can bear, for robots with a chain joint.
        worst: the hardest posture at rest by joint name, gimbals included, its support, its largest
            use, a proved bound of the use in any posture (base held), and the joint, if asked.
        flies: whether the robot floats and has rotors.
        gimbals: names of the joints that turn an apparatus.
        rolls: whether it rests on drums: no `tip_load` unless it flies.
        followers: leaders of the joints that follow another (mimic); their torque is 0, for their
            load is in their leader's, through the ratio.
        free: names of the wheels on drums and of spinning rotors without a servo; no rows of text.
    """

    joints: tuple[str, ...]
    terms: Depth
    support: str
    torque: Floats
    limit: Floats
    use: Floats
    by_term: dict[str, Floats]
    share: dict[str, float]
    depths: dict[str, Floats]
    base: Floats
    twist_matrix: Floats
    twist_singular_values: Floats
    twist_rank: int
    tip: tuple[str, Floats]
    tip_load: TipLoad | None
    worst: dict[str, Any] | None
    flies: bool
    gimbals: frozenset[str]
    rolls: bool = False
    free: frozenset[str] = frozenset()
    followers: Mapping[str, str] = field(default_factory=dict)

    @property
    def overloaded(self) -> tuple[str, ...]:
        """Names of the joints whose servo is too weak."""
        return tuple(n for n, u in zip(self.joints, self.use, strict=True) if u > 1.0)

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people: the whole, then the joints, hardest first."""
        shares = [f"{k.replace('_', ' ')} {100 * x:.3g} %" for k, x in self.share.items() if x > 0]
        alone = ": its rotors cannot hold it here" if self.flies else ""
        alone = "; on the ground its drums carry it" if self.rolls and not self.flies else alone
        out = [("support", _SUPPORTS[self.support] + (alone if self.support == "base" else ""))]
        out.append(("consists of", ", ".join(shares) or "nothing: no load"))
        shafts = [n for n in self.joints if n in self.free and n not in self.followers]
        if shafts and not self.rolls:
            out.append(("rotor shafts", f"{', '.join(shafts)}: no servo holds them, no rows"))
        if self.overloaded:
            out.append(("overloaded", ", ".join(self.overloaded)))
        held = [i for i, name in enumerate(self.joints) if name not in self.free]
        unknown = [self.joints[i] for i in held if np.isinf(self.limit[i])]
        if unknown:
            out.append(("no declared effort", f"{', '.join(unknown)}: no share of a limit"))
        if self.followers:
            pairs = ", ".join(f"{n} ({leader})" for n, leader in self.followers.items())
            out.append(("follow others", f"{pairs}: their loads are in their leaders' torques"))
        if self.tip_load is not None and len(unknown) < len(held):
            out += self._tip_rows(self.tip_load)
        if self.worst is not None:
            use = f"{100 * self.worst['use']:.3g} % of {self.worst['joint']}"
            out.append(("worst posture", f"{use} at {self._worst_angles(self.worst)}"))
            if self.worst["use_bound"] is not None:
                most = f"no posture takes more than {100 * self.worst['use_bound']:.4g} %"
                out.append(("", f"{most} of any joint (proved)"))
        names = tuple(self.joints[i] for i in held)
        return out + joint_rows(names, self.torque[held], self.limit[held], self.use[held])

    def _worst_angles(self, worst: Mapping[str, Any]) -> str:
        """Returns the chain's angles of the worst posture; gimbals follow from them in hover."""
        posture = {k: x for k, x in worst["posture"].items() if k not in self.gimbals}
        bent = {k: x for k, x in posture.items() if abs(x) >= 0.00005}
        angles = ", ".join(f"{k} {x:+.4f}" for k, x in bent.items()) or "all joints at 0"
        return angles + (
            ", gimbals pointed up" if self.gimbals and worst["support"] != "base" else ""
        )

    def _tip_rows(self, load: TipLoad) -> list[tuple[str, str]]:
        """Returns the rows about the tip."""
        if load.payload == 0.0:
            return [("tip", f"on {self.tip[0]}: nothing more, a joint is overloaded already")]
        sag = f"{1e3 * float(np.linalg.norm(load.sag)):.3g} mm by its servos"
        # A free body moves, or its rotors react: neither is what was computed here.
        how = " (root held)" if self.flies else ""
        any_wrench = f"{load.wrench_radius:.4g} N in every direction of [force; torque / "
        any_wrench += f"{load.lever:.3g} m] (limit: {load.wrench_joint})"
        if np.isinf(load.wrench_radius):
            any_wrench = "of any size: no limit is declared that it reaches"
        return [
            (
                f"tip load capacity{how}",
                capacity_text(load.force_radius, "N", load.force_joint, load.free),
            ),
            ("", capacity_text(load.torque_radius, "N·m", "", load.torque_free)),
            ("  any wrench", any_wrench),
            (
                f"tip carries{how}",
                "any weight" if np.isinf(load.payload) else f"{load.payload:.4g} kg",
            ),
            ("tip deflection", sag),
        ]

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units, infinite values are null."""
        load = self.tip_load
        return {
            "joints": list(self.joints),
            "terms": self.terms,
            "support": self.support,
            "torque_Nm": self.torque.tolist(),
            "limit_Nm": plain(self.limit),
            "use": plain(self.use),
            "overloaded": list(self.overloaded),
            "by_term_Nm": {k: v.tolist() for k, v in self.by_term.items()},
            "share": self.share,
            "depths_Nm": {k: v.tolist() for k, v in self.depths.items()},
            "base_wrench_N_Nm": self.base.tolist(),
            "twist_matrix": self.twist_matrix.tolist(),
            "twist_singular_values": self.twist_singular_values.tolist(),
            "twist_rank": self.twist_rank,
            "tip": {"link": self.tip[0], "position_m": self.tip[1].tolist()},
            "tip_load": None if load is None else load.to_json(),
            "worst": self.worst,
            "followers": dict(self.followers),
        }
