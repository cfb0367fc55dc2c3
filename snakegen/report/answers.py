"""The first lines of a report: questions that a person asks, answered from the results in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.report.collection import Page

_MODES = {"virtual_single_rotor": "gimbals free", "dual_rotor": "gimbals held"}
_AXES = (
    ("forward (+x of the root link)", "+x of the root link", (1, 0, 0)),
    ("backward (−x)", "−x", (-1, 0, 0)),
    ("to the left (+y)", "+y", (0, 1, 0)),
    ("to the right (−y)", "−y", (0, -1, 0)),
    ("upward (+z)", "+z", (0, 0, 1)),
    ("downward (−z)", "−z", (0, 0, -1)),
)
_KINDS = (("force", "N", "from any side"), ("torque", "N·m", "about any axis"))
_CLOSE = 0.94  # cosine to an axis for which the axis' name stands


def answers(page: Page) -> list[tuple[str, str]]:
    """Returns (question, answer) pairs for what the results of `page` tell; in words, with units.

    A body that flies is asked whether it hovers, what it can command, what it resists and how near
    a singular posture is; a drive whether it is held and how it drives; an arm what its servos
    bear.
    """
    results = page.results
    out: list[tuple[str, str]] = []
    if "hover" in results:
        out += [("Can it hover?", _hover(results["hover"]))]
        out += [("Can it move?", _motion(results["actuation"]))] if "actuation" in results else []
        out += _resists(results.get("margin"), results.get("singularity"))
        out += _singular(results.get("singularity"))
    if "drive" in results:
        out += _drives(results["drive"])
    if "statics" in results and "hover" not in results:
        out += _arm(results["statics"], drives="drive" in results)
    return out


def _hover(found: Any) -> str:
    total = float(np.sum(found.thrust_max))
    most = f"{found.weight:.0f} N of weight, {total:.0f} N of thrust ({found.thrust_to_weight:.2f})"
    virtual, dual = found.virtual_feasible, found.dual_feasible
    if not virtual and not dual:
        if found.thrust_to_weight < 1.0:
            return f"no: {most}"
        why = ", ".join(f"{n} would have to turn to {a:+.2f} rad" for n, a in found.beyond)
        if found.possible:
            return f"yes, but not by least-norm forces; other forces within limits do: {most}"
        said = "not level in this posture" if found.possible is False else "not shown"
        return f"no, {said}: {most}" + (f"; {why}" if why else "")
    if virtual:
        share = found.virtual_thrust / found.apparatus_max
        names = found.apparatuses or [f"apparatus {i + 1}" for i in range(len(share))]
        busiest = (
            f"{names[int(np.argmax(share))]} is the busiest, at {np.max(share):.0%} of its limit"
        )
    else:
        share = found.dual_thrust / found.thrust_max
        busiest = f"the busiest rotor is at {np.max(share):.0%} of its limit"
    held = "" if virtual or not found.vectored else " with gimbals held only"
    return f"yes{held}: {most}; {busiest}"


def _motion(found: Any) -> str:
    """Returns class and rank of each mode."""
    rank = {r.matrix: r.rank for r in found.ranks}
    said = []
    for mode in sorted(found.modes, key=lambda m: m.mode != "virtual_single_rotor"):
        name = _MODES.get(mode.mode, mode.mode)
        count = rank.get("jacobian" if mode.mode == "virtual_single_rotor" else "dual", 0)
        kind = mode.value.replace("_", " ")
        said.append(f"{name}: {kind}, {count} of 6 motions commanded")
    return "; ".join(said)


def _resists(margin: Any, singularity: Any) -> list[tuple[str, str]]:
    """Returns the force and torque held in every direction, the limits that stop them named.

    Of the mode with gimbals free; where that does not hover, of the one with gimbals held.
    """
    push = {} if margin is None else margin.push or {}
    lost = ", ".join(getattr(singularity, "lost", ()))
    for mode in ("virtual_single_rotor", "dual_rotor"):
        kinds = push[mode].kinds if mode in push else {}
        found = [_resisted(kinds, *kind, lost) for kind in _KINDS]
        if "attitude_altitude" in kinds:
            found.append(_tilted(kinds["attitude_altitude"], margin))
        texts = [text for text in found if text]
        if texts:
            return [("What does it resist?" if not i else "", t) for i, t in enumerate(texts)]
    return []


def _resisted(kinds: Any, kind: str, unit: str, about: str, lost: str) -> str:
    """Returns what of one kind is held in every direction; empty where nothing is known."""
    found = kinds.get(kind)
    if not found or not np.isfinite(found["exact_thrust"].value):
        return ""
    by_thrust = found["exact_thrust"].value
    best = found.get("exact_servo", found["exact_thrust"])
    text = f"{best.value:.4g} {unit} {about}"
    if best.value <= 0.0:
        return text + (
            f": no {lost}, in this posture; that is geometry, bend the body"
            if lost
            else ": one direction is not commanded"
        )
    start = slice(0, 3) if kind == "force" else slice(3, 6)
    towards = _towards(best.push[start], turning=kind == "torque")
    text += f", weakest {towards}" + _stops(best.at_limit)
    return text + (
        f"; thrust alone {by_thrust:.4g} {unit}" if best.value < 0.995 * by_thrust else ""
    )


def _tilted(found: Any, margin: Any) -> str:
    """Returns what is held of height and attitude alone; empty where nothing is known."""
    share = min(one.value for one in found.values())
    if not np.isfinite(share):
        return ""
    force, torque = share * margin.force_scale, share * margin.torque_scale
    return f"{force:.3g} N up or down, or {torque:.3g} N·m about any axis; no force across"


def _stops(names: tuple[str, ...]) -> str:
    return (
        f", where {', '.join(names)} {'is' if len(names) == 1 else 'are'} at the limit"
        if names
        else ""
    )


def _towards(direction: Any, *, turning: bool) -> str:
    """Returns a direction by the name of the axis that it is near, else by its components."""
    size = float(np.linalg.norm(direction))
    if not np.isfinite(size) or size == 0.0:
        return "in no one direction"
    unit = np.asarray(direction, float) / size
    for name, about, axis in _AXES:
        if float(unit @ axis) > _CLOSE:
            return f"about {about}" if turning else name
    return ("about " if turning else "along ") + " ".join(f"{v:+.2f}" for v in unit)


def _singular(found: Any) -> list[tuple[str, str]]:
    if found is None:
        return []
    left = f"{found.sigma_min:.2f} of full authority is left in the weakest motion"
    if found.verdict == "singular":
        text = f"it is in one: {', '.join(found.lost) or 'a motion'} is not commanded"
    else:
        text = f"{left} ({found.verdict}): {found.weakest.split(' about a line')[0]}"
    return [("How near is a singularity?", text)]


def _drives(found: Any) -> list[tuple[str, str]]:
    """Returns whether wheels hold a drive at its shape, its speeds and its tightest turn."""
    hold = found.hold
    held = f"no ({hold.rank} of 3 motions held): {hold.text}"
    if hold.rank == 3:
        held = "yes, along, across and turning, with screws and joints stopped"
        held += f" (σ₃ {hold.sigma[-1]:.3g})"
    out = [("Do its wheels hold it?", held)]
    if found.cone is not None:
        low, high = found.cone.speed.min(), found.cone.speed.max()
        wide = np.degrees(found.cone.width(found.speed))
        way = "in every direction" if wide > 359.5 else f"in {wide:.0f}° of directions"
        best = f"{low:.3f} m/s in its slowest direction, {high:.3f} m/s in its fastest"
        out.append(("How fast?", f"{best}; {found.speed:g} m/s {way}"))
    return [*out, ("How tightly?", dict(found.rows())["turning radius"])]


def _arm(found: Any, *, drives: bool) -> list[tuple[str, str]]:
    """Returns what servos hold with the base held, and what the tip carries besides."""
    use = np.asarray(found.use, float)
    kept = [i for i in range(len(use)) if np.isfinite(use[i])]
    if not kept:
        return [("Do the servos hold it?", "no joint has a limit")]
    busiest = max(kept, key=lambda i: use[i])
    said = "yes" if use[busiest] <= 1.0 else "no"
    how = " when lifted by its base" if drives else ""
    text = (
        f"{said}{how}: {found.joints[busiest]} is the busiest, at {use[busiest]:.0%} of its limit"
    )
    out = [("Do the servos hold it?", text)]
    load = found.tip_load
    if load is None or drives:
        return out
    pushes = [text for name, text in found.rows() if name.startswith("tip load capacity")]
    if load.payload > 0.0:
        sag = f"; unloaded, servos give {1e3 * float(np.linalg.norm(load.sag)):.3g} mm at the tip"
        carried = "any weight" if np.isinf(load.payload) else f"{load.payload:.3g} kg at the tip"
        out.append(("What does it carry?", carried + sag))
        out += [("What does its tip push?", text) for text in pushes[:1]]
    return out
