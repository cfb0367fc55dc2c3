"""Pictures by matplotlib: same bytes, true projection, bars as high as their numbers."""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from snakegen.errors import SnakegenError
from snakegen.picture.figure_arrays import RobotFigure
from snakegen.picture.style import BLUE, GREEN, ORANGE, RED
from snakegen.report import charts
from snakegen.report.plots import shrink

SEGMENTS = np.array([[[0, 0, 0], [0.4, 0, 0]], [[0.4, 0, 0], [0.6, 0.3, 0.1]]], dtype=float)
ROTORS = np.array([[0.2, 0.1, 0.0], [0.2, -0.1, 0.0]])
AXES = np.array([[0.0, 0.0, 2.0], [0.1, 0.0, 1.0]])


def pixels(path: Path, colour: str) -> np.ndarray:
    """Rows and columns of the pixels of exactly this colour."""
    image = np.asarray(Image.open(path).convert("RGB"))
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return np.argwhere((image == wanted).all(axis=2))


def bars(path: Path, colour: str) -> list[int]:
    """Heights in pixels of the bars of this colour, from left to right."""
    found = pixels(path, colour)
    heights = np.bincount(found[:, 1]) if len(found) else np.zeros(1, int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], heights > 8, [0]])))
    runs = zip(edges[::2], edges[1::2], strict=True)
    return [int(np.median(heights[a:b])) for a, b in runs if b - a > 5]


def everything(folder: Path) -> list[Path]:
    time = np.linspace(0, 1, 20)
    joints, rotors = ["joint1_pitch", "joint1_yaw"], ["rotor1_1", "rotor1_2"]
    grid = charts.sphere_grid(13, 25)
    return [
        charts.draw_robot(folder / "robot.png", RobotFigure(SEGMENTS, ROTORS, AXES, thrusts=[3, 4],
                        cog=[0.3, 0, 0], link_names=["link1", "link2"]), title="robot"),
        charts.hover_thrust_chart(folder / "hover.png", [3.0, 4.0], 0, 5, rotors),
        charts.joint_torque_chart(folder / "torque.png", [3.0, -4.0], 5, joints),
        charts.singular_value_chart(folder / "sigma.png", {"Q": [1.0, 0.1], "J": [2.0, 0.0]}),
        charts.margin_map(folder / "map.png", 2 + grid[..., 2], title="Force margin", unit="N"),
        charts.time_series(folder / "time.png", time, {"x [m]": {"x": time, "y": time**2}},
                         limits={"x [m]": [0.5]}),
    ]  # fmt: skip


def test_same_arrays_same_bytes(tmp_path: Path) -> None:
    first, second = everything(tmp_path / "a"), everything(tmp_path / "b")
    for one, other in zip(first, second, strict=True):
        data = one.read_bytes()
        assert data == other.read_bytes()
        assert b"tIME" not in data and b"Software" not in data
        image = np.asarray(Image.open(one).convert("L"), dtype=float)
        assert image.std() > 5 and min(image.shape) > 300


def test_pictures_touch_no_global_state(tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    everything(tmp_path)
    assert dict(matplotlib.rcParams) == before


def drawn(segments: np.ndarray, **options: Any) -> Figure:
    figure = Figure()
    seen = {name: options.pop(name) for name in ("view", "thrust_scale") if name in options}
    robot = RobotFigure(segments, **options)
    assert charts.draw_robot(figure.add_subplot(), robot, **seen) is None
    return figure


@pytest.mark.parametrize("view", [(26.0, -62.0), (0.0, 10.0), (80.0, 200.0)])
def test_projection_keeps_one_scale(view: tuple[float, float]) -> None:
    """Under parallel projection the squared lengths of three orthogonal unit rods add up to 2."""
    rods = np.array([[[0, 0, 0], axis] for axis in np.eye(3)])
    (axes,) = drawn(rods, view=view).axes
    found = [line.get_xydata() for line in axes.lines if line.get_linewidth() == 8.0]
    assert len(found) == 3 and axes.get_aspect() == 1.0
    assert sum(np.sum((end - start) ** 2) for start, end in found) == pytest.approx(2.0)
    up = found[2][1] - found[2][0]
    assert up[0] == pytest.approx(0.0, abs=1e-12) and up[1] > 0


def test_rotors_are_discs_of_their_radius() -> None:
    (axes,) = drawn(
        SEGMENTS, rotor_positions=ROTORS, rotor_axes=AXES, rotor_radius=[0.07, 0.07]
    ).axes
    rims = [p.get_xy() for p in axes.patches if p.get_linewidth() == 1.6]
    assert len(rims) == len(ROTORS)
    for rim in rims:
        # the long half axis of a disc's projection is its radius, however it is tilted
        middle = rim[:36].mean(axis=0)
        assert np.linalg.norm(rim - middle, axis=1).max() == pytest.approx(0.07, rel=5e-3)


def test_gaps_and_arms_hold_the_parts_together() -> None:
    """A joint's gap is bridged, a far branch is not; an arm runs at right angles to its link."""
    apart = np.array([[[0, 0, 0], [1, 0, 0]], [[1.2, 0, 0], [2.2, 0, 0]], [[0, 3, 0], [1, 3, 0]]])
    rotor = np.array([[1.7, 0.3, 0.0]])
    (axes,) = drawn(apart, rotor_positions=rotor, rotor_axes=[[0, 0, 1]], view=(90, -90)).axes
    bridges = [line.get_xydata() for line in axes.lines if line.get_linewidth() == 5.0
               and line.get_color() == ORANGE]  # fmt: skip
    arms = [line.get_xydata() for line in axes.lines if line.get_linewidth() == 2.0]
    assert len(bridges) == 1 and np.allclose(bridges[0], [[1, 0], [1.2, 0]])
    assert len(arms) == 1 and np.allclose(arms[0], [[1.7, 0.3], [1.7, 0]])


def test_thrust_arrows_have_their_length() -> None:
    (axes,) = drawn(
        SEGMENTS,
        rotor_positions=ROTORS,
        rotor_axes=AXES,
        thrusts=[2, 4],
        thrust_scale=0.1,
        view=(0, 0),
    ).axes
    arrows = [note for note in axes.texts if note.get_text() == ""]
    rises = [note.xy[1] - note.xyann[1] for note in arrows]
    assert rises == pytest.approx([0.2, 0.4 / np.hypot(0.1, 1.0)])


@pytest.mark.parametrize("links,length", [(8, 1.0), (8, 0.002), (60, 1.0)])
def test_the_whole_robot_is_in_the_picture(tmp_path: Path, links: int, length: float) -> None:
    long = length * np.array([[[i, 0, 0], [i + 1, 0, 0]] for i in range(links)], dtype=float)
    path = charts.draw_robot(tmp_path / "long.png", RobotFigure(long))
    image = np.asarray(Image.open(path).convert("RGB")).max(axis=-1)
    tubes = np.argwhere(image < 0x70)
    height, width = image.shape
    assert tubes[:, 1].min() > 5 and tubes[:, 1].max() < width - 5
    assert np.ptp(tubes[:, 1]) > 0.6 * width and height > 300


@pytest.mark.parametrize(
    "options,reason",
    [
        ({"link_segments": np.zeros((2, 3))}, r"link_segments must be .* \(n, 2, 3\)"),
        ({"link_segments": SEGMENTS * np.nan}, "finite"),
        ({"rotor_positions": ROTORS, "rotor_axes": AXES[:1]}, r"rotor_axes must be .* \(2, 3\)"),
        ({"rotor_positions": ROTORS, "rotor_axes": AXES, "thrusts": [1.0]}, "thrusts"),
        ({"link_names": ["one"]}, "link_names has 1 entries, not 2"),
    ],
)
def test_robot_refusals(tmp_path: Path, options: dict, reason: str) -> None:
    with pytest.raises(SnakegenError, match=reason):
        charts.draw_robot(tmp_path / "x.png", RobotFigure(**{"link_segments": SEGMENTS, **options}))
    assert not (tmp_path / "x.png").exists()


def test_bar_heights_and_colours(tmp_path: Path) -> None:
    names = ["a", "b", "c", "d"]
    path = charts.limit_chart(tmp_path / "x.png", np.array([2.0, 4.0, 9.6, 11.0]), 0, 10, names,
                            title="t", unit="N")  # fmt: skip
    blue, orange, red = (bars(path, colour) for colour in (BLUE, ORANGE, RED))
    assert (len(blue), len(orange), len(red)) == (2, 1, 1)
    assert blue[1] == pytest.approx(2 * blue[0], abs=3)
    assert orange[0] == pytest.approx(4.8 * blue[0], rel=0.06)
    assert red[0] > orange[0]


def test_negative_torque_uses_its_own_limit(tmp_path: Path) -> None:
    path = charts.joint_torque_chart(tmp_path / "x.png", np.array([-6.8, -7.5]), 7, ["a", "b"])
    assert len(bars(path, ORANGE)) == 1 and len(bars(path, RED)) == 1 and not bars(path, BLUE)


def test_singular_values_stand_on_a_log_axis(tmp_path: Path) -> None:
    """The axis goes from 1e-9 to 4: σ/σ1 = 10^-4.5 reaches half the height of 1."""
    path = charts.singular_value_chart(tmp_path / "x.png", {"Q": np.array([2.0, 2 * 10**-4.5])})
    whole, half = bars(path, BLUE)[:2]
    assert half == pytest.approx(whole / 2, rel=0.04)


def test_lost_directions_are_not_bars(tmp_path: Path) -> None:
    values = {"Q": np.ones(3), "J": np.array([1.0, 1e-12, 0.0])}
    path = charts.singular_value_chart(tmp_path / "x.png", values)
    assert len([h for h in bars(path, BLUE) if h > 100]) == 3
    assert len([h for h in bars(path, ORANGE) if h > 100]) == 1
    assert not bars(path, GREEN)


def test_sphere_grid() -> None:
    grid = charts.sphere_grid(7, 9)
    assert grid.shape == (7, 9, 3)
    assert np.allclose(np.linalg.norm(grid, axis=-1), 1)
    assert np.allclose(grid[3, 4], [1, 0, 0]) and np.allclose(grid[3, 6], [0, 1, 0])
    assert np.allclose(grid[-1], [0, 0, 1])


@pytest.mark.parametrize("weakest,side", [([0, 1, 0], 1), ([0, -1, 0], -1)])
def test_margin_map_marks_the_weakest_direction(tmp_path: Path, weakest: list, side: int) -> None:
    values = 3 - charts.sphere_grid() @ np.array(weakest, dtype=float)
    path = charts.margin_map(tmp_path / "x.png", values, title="m", unit="N")
    ring, centre = pixels(path, RED)[:, 1].mean(), 0.42 * Image.open(path).width
    assert side * (ring - centre) > 0.1 * Image.open(path).width


def test_margin_map_takes_what_is_known_better_and_a_report_keeps_its_colour(
    tmp_path: Path,
) -> None:
    """The certified direction is marked, and the palette of a report does not grey the mark."""
    values = 3 - charts.sphere_grid() @ np.array([0.0, 1.0, 0.0])
    known = (1.9, [0.0, -1.0, 0.0])
    path = charts.margin_map(tmp_path / "x.png", values, title="m", unit="N", weakest=known)
    before = len(pixels(path, RED))
    shrink(path)
    image = np.asarray(Image.open(path).convert("RGB")).astype(int)
    reddish = np.argwhere((image[..., 0] > 150) & (image[..., 1:].max(axis=-1) < 90))
    assert len(reddish) > 0.5 * before > 0
    assert reddish[:, 1].mean() < 0.3 * image.shape[1]


def test_chart_refusals(tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    with pytest.raises(SnakegenError, match="values 2, names 1"):
        charts.hover_thrust_chart(path, np.ones(2), 0, 1, ["a"])
    with pytest.raises(SnakegenError, match="finite"):
        charts.margin_map(path, np.full((3, 3), np.nan), title="", unit="")
    with pytest.raises(SnakegenError, match="time 3, x 2"):
        charts.time_series(path, np.arange(3), {"p": {"x": np.arange(2)}})
    with pytest.raises(SnakegenError, match="at least one panel"):
        charts.time_series(path, np.arange(3), {})
    (tmp_path / "file").write_text("")
    with pytest.raises(SnakegenError, match="cannot be written"):
        charts.hover_thrust_chart(tmp_path / "file" / "x.png", np.ones(1), 0, 1, ["a"])
    assert not path.exists()
