"""What a design is worth: its figures, margins over posture sets, and what it violates."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.control.power import AIR, FIGURE_OF_MERIT, battery_joules
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.grammar import DUAL, FIGURES, JOINT_LIMITED, MEASURES, Measure
from snakegen.design_search.joint_limited import joint_limited_values
from snakegen.design_search.posture_figures import (
    Best,
    body_reach,
    joint_loads,
    joint_torques,
    opening_clearance,
    wake_losses,
)
from snakegen.design_search.posture_margins import (
    PlacedDesign,
    certify,
    dual_values,
    place_design,
)
from snakegen.design_search.problem import Problem
from snakegen.design_search.study import Objective
from snakegen.robot.robot import GRAVITY

SEARCHED, SHOWN = 1e-2, 1e-4  # tolerance of the certified bounds
SLOW = 1e-3  # of joint-limited ones that are shown
BY_POSTURE = {
    "joint_torque": joint_torques, "joint_load": joint_loads, "wake_loss": wake_losses,
}  # fmt: skip


@dataclass(frozen=True)
class Score:
    """A design's values.

    Attributes:
        values: by name of objective or constraint; margins -inf where hover is out of reach, and
            absent where a cheaper constraint is violated already.
        violated: by name of constraint, by how much, relative.
    """

    values: dict[str, float]
    violated: dict[str, float] = field(default_factory=dict)

    @property
    def feasible(self) -> bool:
        """Whether all constraints hold and all margins exist."""
        return not self.violated and all(np.isfinite(v) for v in self.values.values())


def option(problem: Problem, name: str) -> Objective:
    """Returns how a figure over postures is taken."""
    study = problem.study
    return study.objectives.get(name) or study.constraints.get(name) or Objective()


def figures(arrays: BodyArrays, resolved: dict[str, Any], price: float) -> dict[str, float]:
    """Returns the cheap figures of a design, by the names of `FIGURES`."""
    chain, joint, unit = resolved["chain"], resolved["joint"], resolved["vectoring_apparatus"]
    starts = np.concatenate([[0.0], np.cumsum(np.add(chain["length"][:-1], joint["gap"]))])
    places = np.sort(
        [starts[p["link"] - 1] + p["position"] * chain["length"][p["link"] - 1] for p in unit["at"]]
    )
    power = least_power(arrays.mass * GRAVITY, np.repeat(unit["rotor_diameter"], unit["rotors"]))
    joules = battery_joules(float(resolved["plant"]["battery_energy"]))
    return {
        "mass_kg": arrays.mass,
        "length_m": float(sum(chain["length"]) + sum(joint["gap"])),
        "thrust_to_weight": float(arrays.shapes.high.sum() / (arrays.mass * GRAVITY)),
        "price": price,
        "apparatus_gap_m": float(np.diff(places).min()) if len(places) > 1 else np.inf,
        "joint_effort_Nm": float(max(joint["effort"], default=0.0)),
        "hover_power_W": power,
        "flight_time_min": joules / power / 60.0,
    }


def least_power(weight: float, diameters: Floats) -> float:
    """Returns the least electric power [W] with which rotors carry a weight [N].

    ``P = Σ c T^1.5`` under ``Σ T = m g`` is least at T ∝ 1/c²: ``(m g)^1.5 / √(Σ 1/c²)``, thrusts
    vertical. No posture needs less; those that share the weight unevenly need more.
    """
    c = 1.0 / (FIGURE_OF_MERIT * np.sqrt(2.0 * AIR * np.pi * (0.5 * diameters) ** 2))
    return float(weight**1.5 / np.sqrt((1.0 / c**2).sum()))


def evaluate(problem: Problem, x: Floats, *, final: bool = False) -> Score:
    """Returns the score of a design vector.

    Args:
        problem: the study.
        x: (d,).
        final: over the postures and at the tolerance of what is shown.
    """
    resolved, price = problem.resolved(x)
    topology = problem.topology(x)
    arrays = topology.skeleton.fill(resolved)
    return score(problem, arrays, topology.indices, topology.sets, resolved, price, final=final)


def score(
    problem: Problem,
    arrays: BodyArrays,
    indices: Any,
    sets: dict[str, Floats],
    resolved: dict[str, Any],
    price: float,
    *,
    final: bool,
) -> Score:
    """Returns the score of a design's arrays, wherever they come from."""
    study = problem.study
    asked = [*study.objectives, *(n for n in study.constraints if n not in study.objectives)]
    cheap = figures(arrays, resolved, price)
    values = {n: cheap[n] for n in asked if n in FIGURES}
    violated = _violations(problem, values)
    if violated and not final:
        return Score(values, violated)
    placed: dict[str, PlacedDesign] = {}
    found: dict[tuple[str, tuple[str, str, bool]], Floats] = {}
    for name in asked:
        measure = MEASURES.get(name)
        if measure is None:
            continue
        ask = option(problem, name)
        over: str = "certify" if final and ask.over == "range" else ask.over
        if over not in placed:
            placed[over] = place_design(arrays, sets[over], indices)
        if measure.how == "best":
            values[name] = best_posture(problem, measure, placed[over]).value
            continue
        key = (over, measure.key)
        if key not in found:
            found[key] = by_posture(measure, placed[over], SHOWN if final else SEARCHED)
        values[name] = aggregate(measure, found[key], ask.quantile)
    violated = _violations(problem, values)
    for (over, same), margin in found.items():
        if over != "motion" and not np.isfinite(margin).all():
            kind, mode, failed = same
            words = [kind, *(["joint-limited"] if mode == JOINT_LIMITED else [])]
            name = f"hover out of reach ({' '.join(words)}{', after a loss' if failed else ''})"
            lost = [v for n, v in values.items() if n in MEASURES and MEASURES[n].key == same]
            if not np.isfinite(lost).all():  # a slope towards what hovers
                violated[name] = 10.0 + float(np.mean(~np.isfinite(margin)))
    return Score(values, violated)


def aggregate(measure: Measure, values: Floats, quantile: float) -> float:
    """Returns what is made of values by posture: the worst, or what a share of them may pass."""
    large = values if measure.large else -values
    if measure.how == "quantile":
        out = np.quantile(large, quantile, method="inverted_cdf")
    else:
        out = large.min()
    return float(out if measure.large else -out)


def best_posture(problem: Problem, measure: Measure, placed: PlacedDesign) -> Best:
    """Returns the posture at which reach or clearance is best."""
    holding, opening = problem.study.postures.holding, problem.study.opening
    if measure.quantity == "reach" or opening is None:
        return body_reach(placed, holding)
    return opening_clearance(placed, opening.width, opening.height, holding)


def by_posture(measure: Measure, placed: PlacedDesign, tolerance: float) -> Floats:
    """Returns a figure by posture (m,); of margins -inf where hover is out of reach.

    With `failed` a margin is the least after the loss of any one apparatus.
    """
    kind = measure.quantity
    if kind in BY_POSTURE:
        return BY_POSTURE[kind](placed)

    def margin(lost: int) -> Floats:
        if measure.mode == DUAL:
            return dual_values(placed, kind, lost)
        if measure.mode == JOINT_LIMITED:
            return joint_limited_values(placed, kind, max(tolerance, SLOW), lost)
        return certify(placed, (kind,), tolerance, lost)[kind].values

    lost = range(placed.points.shape[1]) if measure.failed else [-1]
    return np.asarray(np.min([margin(j) for j in lost], axis=0))


def _violations(problem: Problem, values: dict[str, float]) -> dict[str, float]:
    out = {}
    for name, bound in problem.study.constraints.items():
        if name not in values or values[name] == -np.inf:
            continue
        value, low, high = values[name], bound.min, bound.max
        if low is not None and value < low:
            out[name] = min((low - value) / max(abs(low), 1e-3), 1e6)
        if high is not None and value > high:
            out[name] = min((value - high) / max(abs(high), 1e-3), 1e6)
    return out
