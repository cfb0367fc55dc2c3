"""Writes the page of a robot in a posture, or of a flight, as one HTML file that asks for nothing.

The 3-D engine (three.js) is the one that trimesh ships; plotly brings its own; a browser without
WebGL shows the picture of the posture instead.
"""

from __future__ import annotations

import base64
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.analysis import catalogue
from snakegen.base.atomic_io import check_writable, require_suffix, write_atomically
from snakegen.base.geometry import Floats, quaternion_xyzw
from snakegen.log import skeleton as sk
from snakegen.report.answers import answers
from snakegen.report.collection import Page
from snakegen.report.page import HTML, heading, tidy
from snakegen.robot.posture import angles_by_name
from snakegen.robot.robot import Robot
from snakegen.simulation.recording.recording import Recording
from snakegen.web.body import body_glb, body_joints, body_links, boxes
from snakegen.web.charts import flight_charts, robot_charts
from snakegen.web.document import fill_document, section, verdict_section

_FRAMES = 25.0  # poses of a flight a second
_UNITS = {
    "_rad_s": "rad/s", "_m_s": "m/s", "_n_m": "N·m", "_rad": "rad", "_hz": "Hz", "_w": "W",
    "_j": "J", "_n": "N", "_m": "m", "_s": "s",
}  # fmt: skip
_ARROW = 0.6  # mean link lengths that an arrow of the largest thrust is long


def write_robot_page(page: Page, path: Path, folder: Path | None, command: str) -> None:
    """Writes the analyses of a robot in a posture.

    Args:
        page: the results.
        path: the file, ``.html``.
        folder: where the URDF's mesh paths start; None leaves meshes out.
        command: what makes this page again.

    Raises:
        SnakegenError: another suffix, or a file that cannot be written.
    """
    require_suffix(path, *HTML)
    check_writable(path)
    robot, about = page.robot, catalogue()
    charts = robot_charts(page)
    answered = [(question, tidy(text)) for question, text in answers(page)]
    sections = [section("in short", "", answered, [])] if answered else []
    for name, result in page.results.items():
        rows = [(label, tidy(text)) for label, text in result.rows()]
        sections.append(section(name, about[name].help, rows, charts.get(name, [])))
    hover = page.results.get("hover")
    thrust = [] if hover is None else list(np.asarray(hover.dual_thrust, float))
    data = _body(robot.urdf, folder) | _markings(robot) | _sliders(robot)
    base, origin = robot.base_pose(page.q)
    data |= {
        "base": [*origin.tolist(), *quaternion_xyzw(base).tolist()],
        "angles": angles_by_name(robot, page.q),
        "thrust": thrust if len(thrust) == len(data["rotors"]) else [0.0] * len(data["rotors"]),
        "flight": None,
        "floor": None,
        "obstacles": [],
    }
    text = fill_document(
        robot.name, heading(page) + " (rad)", sections, data, _still(robot, page.q), command,
        robot.urdf_hash,
    )  # fmt: skip
    write_atomically(path, text)


def write_flight_page(
    recording: Recording, path: Path, robot: Robot, folder: Path | None, command: str
) -> None:
    """Writes a flight, drive or motion: it plays, with its verdict and every channel.

    Args:
        recording: judged; its ``meta`` holds the URDF that was flown.
        path, folder, command: as for `write_robot_page`.
        robot: what flew.

    Raises:
        SnakegenError: another suffix, or a file that cannot be written.
    """
    require_suffix(path, *HTML)
    check_writable(path)
    meta, verdict = recording.meta, recording.verdict
    data = _body(robot.urdf, folder) | _markings(robot) | _sliders(robot)
    q = recording.channel("q")
    step = max(1, round(1.0 / (_FRAMES * _spacing(recording.times("q")))))
    time, values = recording.times("q")[::step], q.values[::step]
    rotation, position = sk.base_poses(q.labels, values)
    xyzw = np.array([quaternion_xyzw(r) for r in rotation])
    angles = sk.joint_angles(q.labels, values)
    moving = [j["name"] for j in data["joints"] if j["name"] in angles]
    flight: dict[str, Any] = {
        "time": time.round(3).tolist(),
        "base": np.hstack([position, xyzw]).round(4).tolist(),
        "names": moving,
        "angles": np.column_stack([angles[n] for n in moving]).round(4).tolist() if moving else [],
        "thrust": [],
    }
    if "thrust" in recording.channels and recording.channel("thrust").values.shape[1] == len(
        data["rotors"]
    ):
        flight["thrust"] = recording.held("thrust", time).round(2).tolist()
    data |= {
        "base": flight["base"][0],
        "angles": dict(zip(moving, flight["angles"][0], strict=True)) if moving else {},
        "thrust": [0.0] * len(data["rotors"]),
        "flight": flight,
        "floor": 0.0,
        "obstacles": boxes(meta.get("obstacles") or []),
    }
    checks = [] if verdict is None else [(c.line(), c.passed) for c in verdict.checks]
    summary = "no verdict" if verdict is None else f"verdict: {verdict.summary()}"
    sections = [verdict_section(summary, checks)]
    metrics = [(_worded(k), _short(v)) for k, v in recording.metrics.items()]
    sections.append(section("metrics", "Computed from the samples.", metrics, []))
    sections.append(section("channels", "Every signal of the log.", [], flight_charts(recording)))
    about = ", ".join(f"{k} {meta[k]}" for k in ("mission", "mode", "seed") if k in meta)
    start = robot.configuration()
    text = fill_document(
        str(meta.get("robot", robot.name)), f"{about}; {summary}", sections, data,
        _still(robot, start), command, robot.urdf_hash,
    )  # fmt: skip
    write_atomically(path, text)


def _body(urdf: str, folder: Path | None) -> dict[str, Any]:
    links = body_links(urdf)
    masses = []
    for element in ET.fromstring(urdf).findall("link"):
        mass, origin = element.find("inertial/mass"), element.find("inertial/origin")
        if mass is None or element.get("name") not in links:
            continue
        at = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        masses.append(
            {
                "link": links.index(element.get("name", "")),
                "mass": float(mass.get("value", "0")),
                "at": [float(v) for v in at.split()],
            }
        )
    return {
        "links": links,
        "joints": body_joints(urdf),
        "masses": masses,
        "glb": base64.b64encode(body_glb(urdf, folder)).decode(),
    }


def _markings(robot: Robot) -> dict[str, Any]:
    """Returns rotors and numbers: links in the middle of their rods, apparatuses at their axes."""
    links = body_links(robot.urdf)
    size = robot.link_length
    labels = [
        {"text": f"{i + 1}", "link": links.index(name), "at": [0.5 * length, 0.0, 0.08 * size]}
        for i, (name, length) in enumerate(robot.modules.lengths.items())
    ]
    rotors = []
    for number, apparatus in enumerate(robot.modules.apparatuses, start=1):
        for rotor in apparatus.rotors:
            place = {"link": links.index(rotor.link), "axis": [float(v) for v in rotor.axis]}
            rotors.append(place)
        first = apparatus.rotors[0].link
        labels.append({"text": f"A{number}", "link": links.index(first), "at": [0, 0, -0.1 * size]})
    most = float(np.max(robot.rotors.thrust_max, initial=0.0))
    newton = _ARROW * size / most if most > 0 else 0.0
    return {"rotors": rotors, "labels": labels, "newton": newton, "size": size}


def _sliders(robot: Robot) -> dict[str, Any]:
    """Returns the joints that a person may turn, in groups."""
    gimbals = [n for n in robot.gimbal_names if n]
    chain = list(robot.chain_joints)
    rest = [n for n in robot.joint_names if n not in gimbals and n not in chain]
    groups = [["joints", chain], ["gimbals", gimbals], ["rotors, drums and wheels", rest]]
    return {"groups": [[title, names] for title, names in groups if names]}


def _still(robot: Robot, q: Floats) -> str:
    from snakegen.picture.robot_figure import draw_robot
    from snakegen.picture.robot_picture import figure

    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / "posture.png"
        draw_robot(png, figure(robot, q))
        return "data:image/png;base64," + base64.b64encode(png.read_bytes()).decode()


def _spacing(time: Floats) -> float:
    return float(np.median(np.diff(time))) if len(time) > 1 else 1.0 / _FRAMES


def _worded(key: str) -> str:
    """Returns a metric's key as words with its unit in brackets."""
    for ending, unit in _UNITS.items():
        if key.endswith(ending):
            return f"{key.removesuffix(ending).replace('_', ' ')} [{unit}]"
    return key.replace("_", " ")


def _short(value: Any) -> str:
    if isinstance(value, list | tuple | np.ndarray):
        return ", ".join(_short(v) for v in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
