"""Sizes that would do: openings in the way are widened until a motion is certified."""

from pathlib import Path

import numpy as np
import pytest

from snakegen.planning.wider import in_the_way, widened, wider_openings
from snakegen.scene.schema import Scene, read_scene

WALLS = """
obstacles:
  - {name: first, centre: [0, 0, 1.2], size: [0.06, 3.6, 2.4],
     openings: [{centre: [0, 0], size: [0.3, 0.4]}, {centre: [-1.2, 0], size: [0.5, 0.5]}]}
  - {name: second, centre: [1.3, 0, 1.2], size: [0.06, 3.6, 2.4],
     openings: [{centre: [0, 0], size: [0.35, 0.35]}]}
start: {cog: [-0.6, 0, 1.2]}
goal: {cog: [2, 0, 1.2]}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    path = tmp_path / "walls.yaml"
    path.write_text(WALLS, encoding="utf-8")
    return read_scene(path)


def blocking(scene: Scene, need: dict[str, float]) -> tuple[str, ...]:
    """Returns the first obstacle whose opening on the way is less than it need be."""
    for k in (0, 2):
        if min(scene.openings[k].size) < need[scene.openings[k].name] - 1e-9:
            return (scene.openings[k].name,)
    return ()


def test_only_what_is_in_the_way_is_widened_and_until_it_does(scene: Scene) -> None:
    tried: list[Scene] = []

    def attempt(wider: Scene) -> tuple[str, ...]:
        tried.append(wider)
        return blocking(wider, {"first": 0.4, "second": 0.45})

    words = wider_openings(scene, ("first",), attempt)
    assert "0.40 by 0.50 m in first instead of 0.30 by 0.40 m" in words
    assert "0.45 by 0.45 m in second instead of 0.35 by 0.35 m" in words
    assert len(tried) == 4  # twice each, 5 cm at a time
    assert tried[-1].openings[1].size == (0.5, 0.5)  # beside the way


def test_no_size_is_named_where_widening_is_no_help(scene: Scene) -> None:
    assert wider_openings(scene, ("first",), lambda _: None) == ""
    assert wider_openings(scene, ("post",), lambda _: ()) == ""  # no opening of its own
    assert wider_openings(scene, ("first",), lambda _: (), in_time=lambda: False) == ""
    assert wider_openings(scene, ("second",), lambda _: ("second",)) == ""


def test_no_opening_smaller_than_the_least_is_tried(scene: Scene) -> None:
    sizes: list[float] = []

    def attempt(wider: Scene) -> tuple[str, ...]:
        sizes.append(min(wider.openings[0].size))
        return ()

    assert wider_openings(scene, ("first",), attempt, least=0.48)
    assert sizes == [pytest.approx(0.5)]


def test_a_wider_scene_has_the_wider_hole_and_keeps_the_rest(scene: Scene) -> None:
    wider = widened(scene, np.array([0.2, 0.0, 0.1]))
    at = np.array([[0.0, 0.23, 1.2], [1.3, 0.21, 1.2], [0.0, -1.2, 1.2], [0.0, 0.3, 1.2]])
    # along y the openings reach 0.25 m and 0.225 m to each side of the middle

    def inside(one: Scene) -> list[bool]:
        return [any(s.distances(p[None])[0] < 0.0 for s in one.solids) for p in at]

    assert inside(scene) == [True, True, False, True]
    assert inside(wider) == [False, False, False, True]
    assert wider.start is scene.start and len(wider.openings) == 3


def test_of_several_openings_that_on_the_way_counts(scene: Scene) -> None:
    assert in_the_way(scene, ("first", "second")) == [0, 2]
