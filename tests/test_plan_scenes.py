"""Scenes of plans: what is refused in words, open meshes, clouds of points."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snakegen.errors import SceneError
from snakegen.scene.schema import read_scene
from snakegen.scene.solids import Solid, from_json

TURN = pin.utils.rpyToMatrix(0.0, 0.0, 1.0)
SOLIDS = (
    Solid("plate", "box", np.array([0.1, 0.0, 0.75]), TURN, (0.4, 0.5, 0.02)),
    Solid("post", "cylinder", np.array([-0.9, 0.4, 1.0]), np.eye(3), (0.05, 1.0)),
    Solid("ground", "half_space", np.zeros(3)),
)


def test_coal_and_solids_agree() -> None:
    import coal

    rng = np.random.default_rng(4)
    ball = coal.Sphere(1e-6)
    for solid in SOLIDS:
        again = from_json(solid.to_json())
        points = rng.uniform(-1.5, 1.5, (40, 3))
        for point, expected in zip(points, again.distances(points), strict=True):
            if expected > 1e-3:
                there = coal.Transform3s(solid.rotation, solid.centre)
                here = coal.Transform3s(np.eye(3), point)
                result = coal.DistanceResult()
                found = coal.distance(
                    solid.shape(), there, ball, here, coal.DistanceRequest(), result
                )
                assert found == pytest.approx(expected, abs=2e-5)


REFUSED = [
    ("obstacles: [{size: [1, 1, 1]}]", "obstacle 1: centre: 3 finite numbers"),
    ("obstacles: [{kind: bx}]", "Did you mean 'box'"),
    ("obstacles: [{centre: [0, 0, 1500], size: [3000, 3000, 40]}]", "divide by 1000"),
    ("obstacles: [{centre: [0, 0, 0], size: [0.003, 0.003, 0.001]}]", "multiplied by 1000"),
    (
        "obstacles: [{centre: [0, 0, 1], size: [1, 1, 0.1], openings: [{size: [2, 1]}]}]",
        "reaches beyond the plate",
    ),
    ("obstacles: []\nstart: {above: roof}", "no opening 'roof'"),
    ("obstacles: [{kind: mesh, file: none.stl}]", "none.stl: no such file"),
    ("obstacles: []\ndemands: {clearence: 1}", "Did you mean 'clearance'"),
    ("obstacles: []\nstart: {cog: [-2000, 0, 1200]}", "as millimetres it is 2 m"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED, ids=[m for _, m in REFUSED])
def test_scenes_are_refused_in_words(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        read_scene(file)


def test_an_open_mesh_is_refused(tmp_path: Path) -> None:
    import trimesh

    mesh = trimesh.creation.box((0.4, 0.4, 0.4))
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.export(tmp_path / "open.stl")
    file = tmp_path / "scene.yaml"
    file.write_text("obstacles: [{kind: mesh, file: open.stl}]", encoding="utf-8")
    with pytest.raises(SceneError, match=r"open\.stl is not closed: 3 of 18 edges"):
        read_scene(file)


def test_a_cloud_becomes_balls_that_hold_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(0.0, 1.0, (20_000, 3))
    np.savetxt(tmp_path / "scan.csv", points, delimiter=",", header="x,y,z", comments="")
    file = tmp_path / "scene.yaml"
    file.write_text("obstacles: [{kind: points, file: scan.csv, radius: 0.02}]", encoding="utf-8")
    balls = [s for s in read_scene(file).solids if s.kind == "sphere"]
    assert len(balls) <= 2000
    centres, radius = np.array([b.centre for b in balls]), balls[0].size[0]
    away = np.linalg.norm(points[:200, None] - centres[None], axis=2).min(axis=1)
    assert np.all(away + 0.02 <= radius + 1e-9)
