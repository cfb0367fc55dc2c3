"""The blueprint: a log opens with the robot in view, the curves next to it, the verdict below."""

from __future__ import annotations

from typing import Any

import numpy as np

from snakegen.log import plots, style
from snakegen.log.scene import Scene
from snakegen.simulation.recording.recording import Recording

# Pages of plots, each a tab; a group that no page names goes to the last one.
PAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "Tracking",
        (
            *("position error", "attitude error", "thrust", "joints", "screws", "slip"),
            *("margins", "scaled margins"),
        ),
    ),
    (
        "Actuators",
        (
            *("gimbals", "gimbal torque", "roll moment", "joint torque", "joint torque by the law"),
            *("joint torque gap", "joint friction", "screw torque", "joint power", "power"),
            "battery",
        ),
    ),
    ("Safety", ("clearance", "contact", "friction use", "disturbance", "wind")),
    ("Vibration", ("modal energy", "elastic angles")),
    ("State", ("position", "attitude", "velocity", "state error")),
)


def blueprint(
    recording: Recording, view: Scene, shown: list[plots.Series], *, states: bool = True
) -> Any:
    """Returns the rerun blueprint of a run; `states`: whether there are lanes of states."""
    import rerun.blueprint as rrb

    documents = [
        rrb.TextDocumentView(origin="report", name="Report"),
        rrb.TextLogView(
            origin="events",
            name="Events",
            columns=rrb.TextLogColumns(
                timeline_columns=[style.TIMELINE], text_log_columns=["LogLevel", "Body"]
            ),
        ),
    ]
    if states:
        documents.append(rrb.StateTimelineView(origin="state", name="States"))
    left = rrb.Vertical(
        _world(recording, view), rrb.Tabs(*documents, active_tab=0), row_shares=[3, 1]
    )
    pages = _pages(plots.groups(shown))
    root = rrb.Horizontal(left, rrb.Tabs(*pages, active_tab=0), column_shares=[3, 2])
    return rrb.Blueprint(
        root if pages else left,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed", timeline=style.TIMELINE, play_state="paused", loop_mode="all"
        ),
        auto_views=False,
        auto_layout=False,
    )


def _world(recording: Recording, view: Scene) -> Any:
    import rerun.blueprint as rrb

    away = np.array([-0.55, -1.0, 0.5])
    # far enough for what flies high in the view, and for an arm's base, which is near the eye
    held = float(np.ptp(view.base[1], axis=0).max(initial=0.0)) == 0.0
    distance = (2.2 if held else 1.9) * view.radius
    eye = view.center + distance * away / np.linalg.norm(away)
    title = " · ".join(
        str(recording.meta[k]) for k in ("robot", "mission", "mode") if recording.meta.get(k)
    )
    hidden = []
    if view.skeleton is not None:
        hidden = [f"- $origin/{view.skeleton.name}/collision_geometries/**"]
    return rrb.Spatial3DView(
        origin="world",
        contents=["+ $origin/**", *hidden],
        name=title or "Robot",
        background=rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=style.GROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.5),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=view.center, eye_up=(0, 0, 1)
        ),
    )


def _pages(units: dict[str, str]) -> list[Any]:
    import rerun.blueprint as rrb

    named = {group for _, groups in PAGES for group in groups}
    pages = []
    for title, groups in PAGES:
        shown = [group for group in groups if group in units]
        if title == PAGES[-1][0]:
            shown += [group for group in units if group not in named]
        if shown:
            views = [_plot(group, units[group]) for group in shown]
            pages.append(rrb.Vertical(*views, name=title))
    return pages


def _plot(group: str, unit: str) -> Any:
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin=plots.folder(group),
        name=f"{group} [{unit}]" if unit not in ("", "1") else group,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=True),
    )
