"""What small changes of a design do to margins at one posture, as plain data and in words."""

from dataclasses import dataclass, field
from typing import Any

UNITS = {"force": "N", "torque": "N·m"}  # the others are scaled
WORDS = {"wrench": "6-D margin", "attitude_altitude": "lift and torque"}
LEAST = 1e-9  # of a margin, below which a change does nothing to it


@dataclass(frozen=True)
class DesignStep:
    """One small change and its effect on each margin, to first order.

    Attributes:
        change: in words, as in "1 cm of apparatus 2 towards the tip".
        effect: by margin: N, N·m, the others scaled.
        about_zero: change that may be made either way.
        thrust: more thrust.
        back: by margin, the effect of the opposite change, where it may be made; other than
            ``-effect`` where directions tie.
    """

    change: str
    effect: dict[str, float]
    about_zero: bool = False
    thrust: bool = False
    back: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DesignSteps:
    """Effects of small changes at one posture, gimbals held at its angles.

    Attributes:
        mode: "virtual_single_rotor" or "dual_rotor".
        margins: the exact margins, by kind.
        steps: the changes.
        kinks: margins that have no derivative here, and why: their effects are of one piece.
    """

    mode: str
    margins: dict[str, float]
    steps: tuple[DesignStep, ...]
    kinks: dict[str, str]

    def best(self, kind: str, *, thrust: bool = False) -> tuple[str, float] | None:
        """Returns the change that raises a margin most, and by how much; None where none does.

        Args:
            kind: of the margin.
            thrust: among more thrust, else among places, lengths and masses.
        """
        rows = []
        for s in self.steps:
            if s.thrust != thrust:
                continue
            rows.append((s.effect.get(kind, 0.0), s.change))
            if s.about_zero:
                text = s.change.replace("towards the tip", "towards the root")
                text = text.replace("longer", "shorter").replace("body's +x", "body's −x")
                text = text.replace("10 g more", "10 g less")
                rows.append((s.back.get(kind, 0.0), text))
        value, text = max(rows, default=(0.0, ""))
        least = LEAST * max(abs(self.margins.get(kind, 0.0)), 1.0)
        return (text, value) if value > least else None

    def to_json(self) -> dict[str, Any]:
        """Returns plain data for a program."""
        return {
            "mode": self.mode,
            "margins": self.margins,
            "steps": [
                {"change": s.change, "effect": s.effect, "opposite_effect": s.back}
                for s in self.steps
            ],
            "kinks": self.kinks,
            "best": {
                kind: None if found is None else {"change": found[0], "effect": found[1]}
                for kind in self.margins
                for found in [self.best(kind)]
            },
            "best_thrust": {
                kind: None if found is None else {"change": found[0], "effect": found[1]}
                for kind in self.margins
                for found in [self.best(kind, thrust=True)]
            },
            "units": {kind: UNITS.get(kind, "1, scaled") for kind in self.margins},
        }

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        out = [(f"sensitivity, {self.mode}", "to first order, gimbals held")]
        for s in self.steps:
            out.append((f"  {s.change}", ", ".join(_signed(k, v) for k, v in s.effect.items())))
        for kind in self.margins:
            found, push = self.best(kind), self.best(kind, thrust=True)
            parts = [f"{c}: {_signed(kind, v)}" for c, v in (r for r in (found, push) if r)]
            out.append(
                (
                    f"  best for {WORDS.get(kind, kind)}",
                    "; or ".join(parts) or "nothing of the above",
                )
            )
        out += [
            (f"  {WORDS.get(kind, kind)} has a kink", text) for kind, text in self.kinks.items()
        ]
        return out


def _signed(kind: str, value: float) -> str:
    value, kind, unit = 0.0 if abs(value) < LEAST else value, WORDS.get(kind, kind), UNITS.get(kind)
    sign = "+" if value >= 0.0 else "−"
    return f"{kind} {sign}{abs(value):.3g} {unit or ''}".rstrip()
