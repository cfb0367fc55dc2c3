"""Effects of small design changes on the margins of a posture, as bars."""

from pathlib import Path
from typing import TYPE_CHECKING

from snakegen.picture.style import BLUE, INK, RED, save
from snakegen.wrench_margins.design_steps import UNITS, DesignSteps

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_steps(steps: DesignSteps, robot: str, path: Path) -> Path:
    """Draws a column of bars for each margin, a row for each change, and writes the PNG."""
    kinds, names = list(steps.margins), [s.change for s in steps.steps]

    def draw(figure: "Figure") -> None:
        axes = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
        for ax, kind in zip(axes, kinds, strict=True):
            values = [s.effect[kind] for s in steps.steps]
            rows = range(len(values))
            ax.barh(rows, values, color=[BLUE if v >= 0.0 else RED for v in values], height=0.62)
            ax.axvline(0.0, color=INK, linewidth=0.8)
            for row, value in zip(rows, values, strict=True):
                text = f"{value:+.2g}" if abs(value) > 1e-9 else "0"
                ax.annotate(
                    text, (value, row), (3 if value >= 0.0 else -3, 0), fontsize=7.5,
                    textcoords="offset points", va="center", ha="left" if value >= 0.0 else "right",
                )  # fmt: skip
            unit = UNITS.get(kind, "scaled")
            ax.set_title(f"{kind.replace('_', ' ')} margin {steps.margins[kind]:.4g} {unit}")
            ax.set_xlabel(f"change [{unit}]")
            ax.margins(x=0.22)
            ax.locator_params(axis="x", nbins=5)
        axes[0].set_yticks(range(len(names)), names)
        axes[0].invert_yaxis()
        figure.suptitle(f"{robot}: what small changes do to its margins ({steps.mode})")

    return save(path, (4.0 + 3.2 * len(kinds), 1.6 + 0.27 * len(names)), draw)
