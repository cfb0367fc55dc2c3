"""What a mission predicted and what came of it, in words: for the terminal and the log's report."""

from collections.abc import Callable
from typing import Any

import numpy as np

Dict = dict[str, Any]


def outcome(meta: Dict, found: Dict) -> list[str]:
    """Returns the lines that a mission's own numbers are worth; none where it has none.

    Args:
        meta: of the recording; its facts are what the plan knew beforehand.
        found: the metrics.
    """
    facts = {"options": meta.get("options") or {}} | (meta.get("facts") or {})
    if meta.get("feed_forward"):
        facts["feed_forward"] = meta["feed_forward"]
    return [line for tell in _TELLERS for line in tell(facts, found)]


def _push(facts: Dict, found: Dict) -> list[str]:
    forecast = facts.get("forecast")
    if not forecast or found.get("ratio") is None:
        return []
    limits = ", ".join(forecast["stopped"])
    told = f"predicted limit: {_wrench(found['predicted_wrench'])} on {forecast['link']}"
    told += f"; there at its limit: {limits}" if limits else ""
    most = forecast.get("any_forces")
    if most and most > 1.01 * forecast["held"]:
        share = most / forecast["held"]
        told += f"; past that its integrals go on, to at most {share:.2f} of it (any forces)"
    others = [
        f"{found[key]:.3f} of that {about}"
        for key, about in _PREDICTIONS.items()
        if found.get(key) is not None and abs(found[key] - found["ratio"]) > 5e-4
    ]
    more = f" ({', '.join(others)})" if others else ""
    if found.get("lost_wrench") is None:
        end = f"tracking held to the end of the ramp, {found['ratio']:.3f} of the prediction"
    else:
        end = (
            f"measured limit: {_wrench(found['lost_wrench'])} at {found['lost_s']:.2f} s, "
            f"{found['ratio']:.3f} of the prediction"
        )
    return [told, end + more]


_PREDICTIONS = {
    "informed_ratio": "with the rotors' thrust factors known",
    "loaded_ratio": "of the deflected body",
}


def _loss(facts: Dict, found: Dict) -> list[str]:
    if "lost" not in facts:
        return []
    left = float(facts["predicted_wrench_margin"])
    # level: the mission's attitude. A body may bear more tilted, and drift there by itself.
    word = "level hover goes on" if left >= 0 else "it cannot hover level"
    part = facts.get("lost_part", facts["lost"])  # logs of older versions have no part
    return [
        f"lost: {part}; scaled wrench margin without it {left:.3f}: {word}, "
        "says the analysis of the posture"
    ]


def _steps(facts: Dict, found: Dict) -> list[str]:
    lines = []
    for step in facts.get("steps", ()):
        axis = step["axis"]
        unit = "m" if axis in "xyz" else "rad"
        rise, settled = found.get(f"rise_{axis}_s"), found.get(f"settling_{axis}_s")
        over = found.get(f"overshoot_{axis}")
        if f"rise_{axis}_s" not in found or over is None:
            continue
        up = "did not get there" if rise is None else f"rise {rise:.2f} s"
        rest = "not settled" if settled is None else f"settled after {settled:.2f} s"
        lines.append(
            f"step of {step['size']:g} {unit} in {axis}: {up}, overshoot {100 * over:.1f} %, {rest}"
        )
    return lines


def _gust(facts: Dict, found: Dict) -> list[str]:
    if found.get("carried_off_m") is None:
        return []
    off, back = f"carried off {found['carried_off_m']:.3f} m", found.get("recovery_s")
    if facts["options"].get("turbulence"):  # which goes on: there is nothing to come back to
        return [f"{off} by gust and turbulence"]
    came = "did not come back" if back is None else f"back within 5 cm {back:.2f} s after the gust"
    return [f"{off}, {came}"]


def _switch(facts: Dict, found: Dict) -> list[str]:
    jumps, strays = found.get("switch_thrust_step_n"), found.get("switch_stray_m")
    if not jumps or not strays:
        return []
    return [
        f"change {i + 1} of mode: thrusts jump by at most {jump:.2f} N a tick, "
        f"the CoG strays {stray:.3f} m"
        for i, (jump, stray) in enumerate(zip(jumps, strays, strict=True))
    ]


def _opening(facts: Dict, found: Dict) -> list[str]:
    if found.get("opening_m") is None or found.get("span_over_opening") is None:
        return []
    return [
        f"opening {found['opening_m']:.3f} m; the unfolded body spans "
        f"{found['span_over_opening']:.2f} times as much"
    ]


def _ground_load(facts: Dict, found: Dict) -> list[str]:
    if "load_kind" not in facts or found.get("ratio") is None:
        return []
    slope = facts["load_kind"] == "slope"
    figure = np.degrees(facts["predicted"]) if slope else facts["predicted"]
    unit = "°" if slope else " N"
    limits = ", ".join(facts["predicted_limits"]) or "nothing but the body's balance"
    lines = [f"predicted to be held: {figure:.3g}{unit}; limit: {limits}"]
    if found.get("lost") is None:
        return [*lines, f"held to the end of the ramp, {found['ratio']:.3f} of the prediction"]
    lost = np.degrees(found["lost"]) if slope else found["lost"]
    share = f"{found['ratio']:.3f} of the prediction"
    return [*lines, f"let go at {found['lost_s']:.2f} s: {lost:.3g}{unit}, {share}"]


def _battery(facts: Dict, found: Dict) -> list[str]:
    empty = found.get("battery_empty_s") is not None
    return ["the battery ran empty on the way: then the rotors stop"] if empty else []


def _arm(facts: Dict, found: Dict) -> list[str]:
    if "feed_forward" not in facts:
        return []
    drawn = facts.get("arm_plant")
    arm = "the arm is its model"
    if drawn:
        arm = (
            f"the arm is not its model: mass {drawn['mass']:.3f} of it, dry friction "
            f"{drawn['friction_n_m'][0]:.2g} N·m, encoders off by up to "
            f"{1e3 * drawn['encoder_offset_max_rad']:.2g} mrad, commands "
            f"{1e3 * drawn['delay_s']:.3g} ms late"
        )
    return [f"feed-forward: {facts['feed_forward']}; {arm}"]


_TELLERS: tuple[Callable[[Dict, Dict], list[str]], ...] = (
    _push,
    _loss,
    _steps,
    _gust,
    _switch,
    _opening,
    _ground_load,
    _battery,
    _arm,
)


def _wrench(wrench: Any) -> str:
    """Returns force and torque of a wrench (6,), whichever it has, with size and direction."""
    parts = []
    for vector, unit in ((wrench[:3], "N"), (wrench[3:], "N·m")):
        size = float(np.linalg.norm(vector))
        if size > 1e-4 * float(np.linalg.norm(wrench)):
            way = " ".join(f"{round(v / size, 2) + 0.0:+.2f}" for v in vector)  # no -0.00
            parts.append(f"{size:.4g} {unit} along {way}")
    return " and ".join(parts) or "nothing"
