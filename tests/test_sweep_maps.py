"""The map of a sweep: one cell for each node of a grid, and what the other joints do."""

import itertools
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.figure import Figure

import snakegen
from snakegen.report import sweep_maps

JOINTS = ("joint1_yaw", "joint2_yaw")


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    figures: list[Figure] = []

    def keep(path: Path, size: object, draw: object) -> Path:
        figures.append(Figure())
        draw(figures[-1])  # type: ignore[operator]
        return path

    monkeypatch.setattr(sweep_maps, "save", keep)
    return figures


def test_a_grid_has_a_cell_for_each_of_its_nodes(drawn: list[Figure]) -> None:
    levels = [np.linspace(-1, 1, 5), np.linspace(0, 1, 7)]
    nodes = np.array(list(itertools.product(*levels)))
    margin = nodes[:, 0] + 10 * nodes[:, 1]
    columns = dict(zip(JOINTS, nodes.T, strict=True)) | {"force_margin": margin}
    robot = snakegen.load("dragon4")
    sweep_maps.sweep_map(
        Path("map.png"), robot, pa.table(columns), "force_margin", JOINTS, {"joint3_yaw": 0.5}
    )
    axes = drawn[0].axes[0]
    shown = np.asarray(axes.collections[0].get_array())
    assert shown.shape == (7, 5)
    assert np.allclose(shown, margin.reshape(5, 7).T)
    assert "joint3_yaw +0.5 rad" in axes.get_title(loc="left") + axes.get_title()


def test_scattered_postures_share_cells_and_name_what_else_varies(drawn: list[Figure]) -> None:
    generator = np.random.default_rng(0)
    columns = {n: generator.uniform(-1, 1, 900) for n in (*JOINTS, "joint3_pitch")}
    columns["force_margin"] = generator.uniform(1, 2, 900)
    robot = snakegen.load("dragon4")
    sweep_maps.sweep_map(Path("map.png"), robot, pa.table(columns), "force_margin", JOINTS)
    axes = drawn[0].axes[0]
    assert np.asarray(axes.collections[0].get_array()).shape == (6, 6)
    assert "least over joint3_pitch" in axes.get_title(loc="left") + axes.get_title()
