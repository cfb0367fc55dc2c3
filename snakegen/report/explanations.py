"""What each row of a report means, in a sentence, and the page that says more."""

from __future__ import annotations

import re
from collections.abc import Sequence

_THEORY, _MARGINS, _FLIGHTS = "docs/theory.md", "docs/margins.md", "docs/flights.md"

EXPLANATIONS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "mass": (
        (r"mass", "All that moves; the root of an arm is left out.", _THEORY),
        (r"CoG.*", "Where the body balances, from the root link's origin along its axes.", _THEORY),
        (r"principal inertia", "Resistance to turning about the CoG's three own axes.", _THEORY),
    ),
    "actuation": (
        (
            r"rank of Q .*",
            "How many of the six motions these inputs command; singular values are scaled, "
            "0 where one is lost; condition is the ratio of largest to smallest, 1 at best.",
            f"{_THEORY}#a3-rank-and-class",
        ),
        (
            r"(dual-rotor|virtual-single-rotor) mode",
            "What the mode commands in this posture: fully actuated is all six motions.",
            f"{_THEORY}#a3-rank-and-class",
        ),
    ),
    "singularity": (
        (
            r"posture is .*",
            "How far the posture is from one in which a motion is lost; 0 is lost, 1 is as good "
            "as forces at a link's length.",
            f"{_THEORY}#a3-rank-and-class",
        ),
        (
            r"gimbal .*",
            "At 0° from θ = ±90° thrust points along the rod and roll turns nothing; 90° is best.",
            f"{_THEORY}#a1-one-vectoring-apparatus",
        ),
    ),
    "hover": (
        (
            r"weight.*",
            "Largest thrust over weight; below 1 it cannot fly, 1.5 leaves room.",
            _MARGINS,
        ),
        (r"hover, .*", "Thrust of each apparatus or rotor that carries the weight.", _MARGINS),
        (r".*in streams", "A rotor below another has less thrust at the same speed.", _FLIGHTS),
        (r"power.*", "Electric power of hover, and how long the battery lasts.", _FLIGHTS),
        (
            r"torque on roll servos",
            "Unequal rotors twist the roll gimbal's servo by this; beyond its limit it gives in.",
            f"{_THEORY}#a2-allocation",
        ),
    ),
    "wake": ((r".*", "A rotor in the stream of another loses thrust.", _FLIGHTS),),
    "margin": (
        (
            r"virtual-single-rotor",
            "Gimbals free: the largest force (with no torque), torque (with no force), and both "
            "together over weight, that is held in every direction.",
            f"{_THEORY}#a4-margins",
        ),
        (
            r"dual-rotor.*",
            "The same with gimbals held and each rotor free.",
            f"{_THEORY}#a4-margins",
        ),
        (r"push on .*", "Margins of a disturbance that acts on this link.", _MARGINS),
        (
            r"exact, .*",
            "What any controller can hold, thrust or joint servos being the limit.",
            _MARGINS,
        ),
        (r"pseudo-inverse.*", "What the pseudo-inverse allocator holds before a limit.", _MARGINS),
        (r"within servo limits", "The margin with joint servos' limits counted.", _MARGINS),
        (r"prediction for push", "Where mission `push` will lose the body.", _FLIGHTS),
        (r".*", "A margin is the largest disturbance held in its weakest direction.", _MARGINS),
    ),
    "statics": (
        (r"support", "What carries the body while joint torques are worked out.", _THEORY),
        (r"consists of", "Shares of gravity, thrust and motion in the torques.", _THEORY),
        (
            r"joint.*|gimbal.*",
            "Torque of the servo, and its share of the limit; 100 % is full.",
            _THEORY,
        ),
        (r"tip .*|any wrench", "What the tip can take before a servo is at its limit.", _THEORY),
        (r"no .*", "Joints without a load, or without a stated limit.", _THEORY),
        (r".*", "Joint torques of the posture, held by servos.", f"{_THEORY}#c-kinetostatics"),
    ),
    "control": (
        (
            r"gains .*",
            "Poles of each loop; all must be left of 0, the farther the faster.",
            _FLIGHTS,
        ),
        (r"motor lag.*", "Delays that the loops are judged with.", _FLIGHTS),
        (r".*", "Slowest pole, damping and the extra delay that the loop survives.", _FLIGHTS),
    ),
    "drive": (
        (
            r"units",
            "Screws and the angles of their helices; neighbours should differ in sign.",
            _THEORY,
        ),
        (
            r"hold .*",
            "Whether wheels hold the body in place: rank 3 is held.",
            f"{_THEORY}#b-screw-drive",
        ),
        (
            r"weakest shape",
            "The joint angles at which it is held least.",
            f"{_THEORY}#b-screw-drive",
        ),
        (
            r"path .*",
            "Rates of screws and joints that this speed takes.",
            f"{_THEORY}#b-screw-drive",
        ),
        (r"slip .*", "Sideways slip if one screw is off by a percent.", f"{_THEORY}#b-screw-drive"),
        (r".*", "How fast and how tightly it drives.", f"{_THEORY}#b-screw-drive"),
    ),
    "traction": ((r".*", "What friction at the wheels can hold.", f"{_THEORY}#b-screw-drive"),),
    "cables": (
        (r"cables", "Held: returns after a disturbance; balanced: does not.", _THEORY),
        (r"stiffness", "Resistance of the softest motion; negative: it leaves.", _THEORY),
        (r".*", "Cables of the arm, their routing and tensions.", _THEORY),
    ),
    "motion": (
        (r"power", "Electric power of the servos along the motion.", _THEORY),
        (r".*", "Joint torques along the motion: peak, RMS, share of the limit.", _THEORY),
    ),
    "reach": (
        (r"rank", "Directions in which the tip can move at once; 3 is all.", _THEORY),
        (r".*", "Where the tip is and how well it follows a path.", _THEORY),
    ),
}
"""By analysis: pattern of a row's label, a sentence, the page; the first that fits counts."""


def explain(analysis: str, label: str) -> tuple[str, str] | None:
    """Returns the sentence and the page of a row; None where it continues the one above."""
    label = label.strip()
    for pattern, sentence, page in EXPLANATIONS.get(analysis, ()):
        if label and re.fullmatch(pattern, label):
            return sentence, page
    return None


def explained(analysis: str, rows: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Returns `rows` with each sentence after the first row, and what continues it, it explains."""
    out: list[tuple[str, str]] = []
    explained: set[str] = set()
    waiting: list[tuple[str, str]] = []
    for label, text in rows:
        if label.strip():
            out, waiting = out + waiting, []
        out.append((label, text))
        found = explain(analysis, label)
        if found is not None and found[0] not in explained:
            explained.add(found[0])
            waiting = [("", f"? {found[0]} ({found[1]})")]
    return out + waiting
