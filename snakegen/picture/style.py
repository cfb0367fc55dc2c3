"""How every picture drawn by matplotlib looks, and how it is written: no display, no date."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snakegen.base.atomic_io import replace_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, GREY, PALE = "#22272e", "#8a929c", "#e6e9ed"
BLUE, ORANGE, RED, GREEN = "#2f6db5", "#e08a1e", "#c8372d", "#2e8b57"
CYCLE = (BLUE, ORANGE, GREEN, RED, "#7a5195", "#00838f", "#9c6b30", "#5b6470")
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": PALE,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "legend.frameon": False,
}


def save(path: str | Path, size: tuple[float, float], draw: Callable[["Figure"], None]) -> Path:
    """Draws on a new figure and writes it as a PNG.

    Args:
        path: of the PNG; its folder is made when absent.
        size: width and height [inches], at 130 dots an inch.
        draw: fills the figure.

    Returns:
        The path.

    Raises:
        SnakegenError: the file cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    path = Path(path)
    style: Any = {**STYLE, "axes.prop_cycle": _cycler()}
    with rc_context(style):
        figure = Figure(figsize=size, dpi=130, layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        draw(figure)
        metadata = {"Software": None}
        replace_whole(path, lambda part: figure.savefig(part, format="png", metadata=metadata))
    return path


def _cycler() -> Any:
    from cycler import cycler

    return cycler(color=CYCLE)
