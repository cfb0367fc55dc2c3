"""A front as a picture: every design that was scored, those that are shown, and their layouts."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from snakegen.design_search.evaluate import Score
from snakegen.design_search.front import Design
from snakegen.design_search.report import UNITS, StudyResult, words
from snakegen.picture.style import BLUE, GREY, INK, ORANGE, PALE, RED, save
from snakegen.spec.loading import load_spec

CROWDED = 0.02  # of the axes: labels nearer than this would overlap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_front(result: StudyResult, scores: list[Score], path: Path) -> Path:
    """Draws the front over the first two objectives, and the layouts of its designs."""
    rows = len(result.front) + (result.given is not None)

    def draw(figure: "Figure") -> None:
        left, right = figure.subplots(1, 2, width_ratios=[1.25, 1.0])
        _scatter(left, result, scores)
        _layouts(right, result)

    return save(path, (12.0, max(4.6, 1.2 + 0.34 * rows)), draw)


def _scatter(ax: Any, result: StudyResult, scores: list[Score]) -> None:
    names = list(result.study.objectives)
    first, second = names[0], names[1] if len(names) > 1 else names[0]
    fine = [s for s in scores if s.feasible]
    ax.scatter(
        [s.values[first] for s in fine], [s.values[second] for s in fine], s=7, color=PALE,
        edgecolor=GREY, linewidth=0.25, label=f"{len(fine)} designs scored ({len(scores)} asked)",
    )  # fmt: skip
    x, y = ([d.values[n] for d in result.front] for n in (first, second))
    shade: dict[str, Any] = {"color": BLUE}
    if len(names) > 2:
        shade = {"c": [d.values[names[2]] for d in result.front], "cmap": "viridis"}
    dots = ax.scatter(
        x, y, s=52, **shade, zorder=3, edgecolor=INK, linewidth=0.6,
        label="front, over the certifying postures",
    )  # fmt: skip
    if len(names) > 2:
        ax.figure.colorbar(dots, ax=ax, label=_label(names[2]), fraction=0.05)
    last = np.full(2, -np.inf)
    span = np.maximum([np.ptp([s.values[n] for s in fine]) for n in (first, second)], 1e-9)
    for d, a, b in zip(result.front, x, y, strict=True):
        if np.abs((np.array([a, b]) - last) / span).max() > CROWDED:
            last = np.array([a, b])
            ax.annotate(d.label, (a, b), (5, 5), textcoords="offset points", weight="bold")
    if result.given is not None:
        a, b = result.given.values[first], result.given.values[second]
        ax.scatter([a], [b], s=90, marker="*", color=ORANGE, zorder=4, edgecolor=INK, linewidth=0.6,
                   label=f"{result.study.robot} as given")  # fmt: skip
        ax.annotate(result.study.robot, (a, b), (8, -3), textcoords="offset points")
    if result.bound is not None:
        ax.axvline(result.bound.upper, color=RED, linewidth=1.2, linestyle="--",
                   label="no design passes this (postures of the search)")  # fmt: skip
    ax.set_xlabel(_label(first))
    ax.set_ylabel(_label(second))
    count = len(result.front)
    ax.set_title(f"{result.study.name}: {count} design{'s'[: count != 1]} on the front")
    ax.legend(fontsize=8, loc="best")


def _label(name: str) -> str:
    unit = UNITS.get(name.rpartition("_")[2], "")
    return f"{words(name)} [{unit}]" if unit else words(name)


def _layouts(ax: Any, result: StudyResult) -> None:
    """Draws each design straight: links as bars, apparatuses as dots as large as their thrust."""
    shown = [*result.front, *([result.given] if result.given else [])]
    for row, d in enumerate(shown):
        _layout(ax, -row, d)
    ax.set_yticks([-k for k in range(len(shown))], [d.label for d in shown])
    ax.set_xlabel("along the straight body [m]")
    ax.set_title("links and apparatuses")
    ax.set_ylim(-len(shown) + 0.4, 0.6)
    ax.grid(visible=False)


def _layout(ax: Any, y: float, design: Design) -> None:
    spec = load_spec(design.spec).resolved()
    lengths = np.array(spec["chain"]["length"], float)
    gaps = np.append(spec["joint"]["gap"], 0.0)
    starts = np.concatenate([[0.0], np.cumsum(lengths + gaps)[:-1]])
    for a, size in zip(starts, lengths, strict=True):
        ax.plot([a, a + size], [y, y], color=GREY, linewidth=5, solid_capstyle="butt")
    unit = spec["vectoring_apparatus"]
    places = [starts[p["link"] - 1] + p["position"] * lengths[p["link"] - 1] for p in unit["at"]]
    size = 4.0 * np.array(unit["thrust_max"])
    ax.scatter(places, [y] * len(places), s=size, color=BLUE, zorder=3, edgecolor="white")
