"""Off-screen pictures: drawn where GL is to be had, and one clear reason where it is not."""

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from snakegen.picture.mujoco_render import is_blank, render, robot_share
from snakegen.picture.robot_picture import figure, posture_shown
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec

BALL = """
<mujoco>
  <worldbody><body><freejoint/><geom type="sphere" size="0.3" mass="1"/></body></worldbody>
</mujoco>
"""
SCENE = """
<mujoco>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="1 1 1" rgb2=".6 .7 .8" width="32"
             height="192"/>
  </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <camera name="side" pos="0 -2 0.5" xyaxes="1 0 0 0 0 1"/>
    <camera name="away" pos="0 -2 0.5" xyaxes="-1 0 0 0 0 1"/>
    <geom type="plane" size="3 3 .1" rgba=".8 .8 .8 1"/>
    <body pos="0 0 0.5">
      <freejoint/>
      <geom type="capsule" fromto="-0.4 0 0 0.4 0 0" size="0.05" rgba="0.8 0.1 0.1 1"/>
    </body>
  </worldbody>
  <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0"/></keyframe>
</mujoco>
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def drawn(scene: Path) -> Path:
    """The path of a picture of the scene; skips where the machine has no off-screen GL."""
    png = scene.with_name("drawn.png")
    picture = render(scene, png, width=320, height=200)
    if not picture and picture.reason.startswith("no off-screen GL"):
        pytest.skip(picture.reason)
    assert picture, picture.reason
    return png


def pixels(path: Path) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(path)).astype(float)


def red(image: np.ndarray) -> np.ndarray:
    """Rows and columns of the pixels that show the red robot."""
    return np.argwhere(image[..., 0] > image[..., 1] + 60)


@pytest.mark.parametrize("links", [16, 60])
def test_a_long_chain_is_shown_coiled_and_clear_of_itself(links: int) -> None:
    robot = load(load_spec("dragon4", links=links))
    shown = figure(robot, posture_shown(robot)).link_segments
    middles = shown.mean(axis=1)
    length = np.linalg.norm(shown[0, 1] - shown[0, 0])
    apart = np.linalg.norm(middles[:, None] - middles, axis=-1)
    apart[np.abs(np.subtract.outer(range(links), range(links))) <= 2] = np.inf
    assert apart.min() > 0.8 * length
    assert np.ptp(shown.reshape(-1, 3), axis=0).max() < 1.6 * length * links**0.5


def test_picture_shows_the_robot_in_the_middle(drawn: Path) -> None:
    image = pixels(drawn)
    assert image.shape == (200, 320, 3)
    low, high = red(image).min(axis=0), red(image).max(axis=0)
    assert np.all(low > 5) and np.all(high < [195, 315])
    assert 0.5 * (high[1] - low[1]) > 60
    assert np.allclose(0.5 * (low + high), [100, 160], atol=20)


def test_camera_and_posture(scene: Path, drawn: Path) -> None:
    png = drawn.with_name("side.png")
    assert render(scene, png, camera="side", width=320, height=200)
    level = red(pixels(png))[:, 0].mean()
    assert render(scene, png, camera="side", width=320, height=200, qpos=[0, 0, 0.9, 1, 0, 0, 0])
    assert red(pixels(png))[:, 0].mean() < level - 20


def test_empty_view_is_refused(scene: Path, drawn: Path) -> None:
    png = drawn.with_name("away.png")
    picture = render(scene, png, camera="away", width=160, height=100)
    assert not picture and "blank" in picture.reason and not png.exists()


@pytest.mark.parametrize(
    "options,reason",
    [
        ({"camera": "front"}, r"no camera 'front'; it has \['side', 'away'\]"),
        ({"qpos": [0.0]}, "qpos has 1 numbers, the model needs 7"),
    ],
)
def test_refusals(scene: Path, options: dict, reason: str) -> None:
    import re

    png = scene.with_name("none.png")
    picture = render(scene, png, **options)
    assert not picture and re.search(reason, picture.reason) and not png.exists()


def test_unreadable_model(tmp_path: Path) -> None:
    (tmp_path / "bad.xml").write_text("<mujoco><wordbody/></mujoco>")
    picture = render(tmp_path / "bad.xml", tmp_path / "bad.png")
    assert not picture and picture.reason.startswith("the model cannot be read")
    assert "\n" not in picture.reason


def test_without_gl_there_is_a_reason(scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """EGL without a vendor library is what a machine without GL looks like."""
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent")
    monkeypatch.setenv("MUJOCO_GL", "egl")
    png = scene.with_name("none.png")
    picture = render(scene, png)
    assert not picture and not png.exists()
    assert picture.reason.startswith("no off-screen GL (egl: ") and "\n" not in picture.reason
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert "switched off" in render(scene, png).reason


@pytest.mark.parametrize("backend", ["osmesa", "no-such-backend"])
def test_commands_run_whatever_gl_is_named(backend: str, tmp_path: Path) -> None:
    """Importing MuJoCo with a backend that is absent or misspelt fails; no command needs it."""
    (tmp_path / "ball.xml").write_text(BALL)
    environment = {k: v for k, v in os.environ.items() if k != "SNAKEGEN_GL"}
    code = "from snakegen.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "compare", "ball.xml", "ball.xml"],
        env=environment | {"MUJOCO_GL": backend},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_renderer_that_dies_or_hangs_is_a_reason(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A child that is killed by its GL library, or that never answers, does not take us along."""
    dying = tmp_path / "dying"
    dying.write_text("#!/bin/sh\nkill -SEGV $$\n")
    dying.chmod(0o755)
    monkeypatch.setattr("snakegen.picture.mujoco_render.sys.executable", str(dying))
    assert "exit -11" in render(scene, tmp_path / "x.png").reason
    dying.write_text("#!/bin/sh\nexec sleep 5\n")
    assert "no answer in 0.2 s" in render(scene, tmp_path / "x.png", timeout=0.2).reason


def test_blank_check() -> None:
    noise = np.random.default_rng(1).integers(0, 255, (20, 30, 3))
    assert not is_blank(noise, 0.1)
    assert is_blank(noise, 0.0)
    assert is_blank(np.full((20, 30, 3), 128), 0.1)


def test_robot_share_leaves_out_the_floor() -> None:
    model = mujoco.MjModel.from_xml_string(SCENE)
    ids = np.full((10, 10, 2), -1)
    ids[:5] = [0, int(mujoco.mjtObj.mjOBJ_GEOM)]
    ids[5] = [1, int(mujoco.mjtObj.mjOBJ_GEOM)]
    assert model.geom_type[0] == mujoco.mjtGeom.mjGEOM_PLANE
    ids[6] = [99, int(mujoco.mjtObj.mjOBJ_TENDON)]  # numbers of its own, beyond the geoms'
    assert robot_share(model, ids) == pytest.approx(0.1)
