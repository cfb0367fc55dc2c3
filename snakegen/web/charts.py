"""The charts of a page, drawn by plotly: every value can be read by pointing at it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from snakegen.report.collection import Page
from snakegen.simulation.recording.recording import Recording

BLUE, ORANGE, RED, GREY = "#1f6fb2", "#d9730d", "#b3261e", "#9aa3ad"
LINES = (BLUE, ORANGE, "#1b7f4d", "#8e44ad", RED, "#00838f", "#a66a00", "#4a5568")
_MOST_POINTS = 1500  # of a curve: more than a screen has
_DASHES = ("solid", "dash", "dot", "dashdot")  # so that no two curves of a chart look the same


def robot_charts(page: Page) -> dict[str, list[Any]]:
    """Returns plotly figures by analysis for what the results of `page` allow."""
    out: dict[str, list[Any]] = {}
    for command, draw in _DRAWERS.items():
        if command in page.results:
            found = [figure for figure in draw(page.results[command], page) if figure is not None]
            if found:
                out[command] = found
    return out


def flight_charts(recording: Recording) -> list[Any]:
    """Returns a figure for each group of channels of a recording, against time."""
    groups: dict[str, list[str]] = {}
    for name, channel in recording.channels.items():
        if name != "q":
            groups.setdefault(channel.group, []).append(name)
    return [_curves(recording, group, names) for group, names in groups.items()]


def _curves(recording: Recording, group: str, names: Sequence[str]) -> Any:
    import plotly.graph_objects as go

    figure = go.Figure()
    units: list[str] = []
    count = 0
    for name in names:
        channel, time = recording.channel(name), recording.times(name)
        step = max(1, len(time) // _MOST_POINTS)
        if channel.unit not in units:
            units.append(channel.unit)
        for column, label in enumerate(channel.labels):
            said = label if len(names) == 1 else f"{name.replace('_', ' ')} {label}"
            values = channel.values[::step, column]
            if not np.any(np.isfinite(values)):
                continue
            style = {
                "color": LINES[count % len(LINES)],
                "dash": _DASHES[count // len(LINES) % len(_DASHES)],
            }
            count += 1
            x, y = time[::step].round(4), _digits(values)
            figure.add_scatter(x=x, y=y, name=said, mode="lines", line=style)
    return _laid_out(figure, group, "time [s]", ", ".join(f"[{u}]" for u in units))


def _digits(values: Any) -> list[float | None]:
    """Returns six significant digits, None where a value is not finite."""
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]


def _bars(
    title: str, names: Sequence[str], values: Any, low: Any, high: Any, unit: str
) -> Any | None:
    """Returns bars of values with the range that each may take as a line behind it."""
    import plotly.graph_objects as go

    values = np.asarray(values, float)
    if not np.any(np.isfinite(values)):
        return None
    low, high = np.asarray(low, float), np.asarray(high, float)
    figure = go.Figure()
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    figure.add_bar(
        x=list(names), y=_digits(2.0 * half), base=_digits(middle - half), name="range",
        marker_color="#e3e8ee", hovertemplate="%{x}: up to %{customdata:.4g} " + unit,
        customdata=_digits(high), width=0.8,
    )  # fmt: skip
    figure.add_bar(
        x=list(names), y=_digits(values), name="needed", marker_color=BLUE, width=0.5,
        hovertemplate="%{x}: %{y:.4g} " + unit,
    )  # fmt: skip
    figure.update_layout(barmode="overlay")
    return _laid_out(figure, title, "", f"[{unit}]")


def _thrusts(result: Any, page: Page) -> list[Any]:
    rotors = page.robot.rotors
    names = [r.link for a in page.robot.modules.apparatuses for r in a.rotors]
    return [
        _bars(
            "thrust of each rotor in hover", names, result.dual_thrust, rotors.thrust_min,
            result.thrust_max, "N",
        )
    ]  # fmt: skip


def _torques(result: Any, page: Page) -> list[Any]:
    chain = set(page.robot.chain_joints)
    limit = np.asarray(result.limit, float)
    kept = [
        i for i, n in enumerate(result.joints) if n in chain and np.isfinite(limit[i]) and limit[i]
    ]
    names = [result.joints[i] for i in kept]
    figure = _bars(
        "joint torque", names, result.torque[kept], -limit[kept], limit[kept], "N·m"
    )  # fmt: skip
    return [figure] if kept else []


def _singular_values(result: Any, page: Page) -> list[Any]:
    import plotly.graph_objects as go

    figure = go.Figure()
    for k, r in enumerate(result.ranks):
        sigma = np.maximum(np.asarray(r.singular_values, float), 1e-12)
        figure.add_scatter(
            x=list(range(1, len(sigma) + 1)), y=_digits(sigma), name=f"Q {r.matrix}",
            mode="lines+markers", line={"color": LINES[k % len(LINES)]},
        )  # fmt: skip
    figure.add_hline(y=result.tolerance, line_dash="dot", annotation_text="rank is lost below")
    figure.update_yaxes(type="log", exponentformat="power")
    return [_laid_out(figure, "singular values of the allocation", "number", "scaled [1]")]


def _laid_out(figure: Any, title: str, x: str, y: str) -> Any:
    figure.update_layout(
        title={"text": title, "font": {"size": 15}},
        template="plotly_white",
        margin={"l": 60, "r": 10, "t": 40, "b": 44},
        height=340,
        showlegend=len(figure.data) > 1,
        legend={"font": {"size": 11}},
        font={"size": 12},
    )
    figure.update_xaxes(title_text=x)
    figure.update_yaxes(title_text=y)
    return figure


_DRAWERS: dict[str, Callable[[Any, Page], list[Any]]] = {
    "actuation": _singular_values,
    "hover": _thrusts,
    "statics": _torques,
}
