"""A rendered picture of an MJCF, off screen, or the reason why there is none.

MuJoCo binds its GL library at import, and a GL library that is half there may abort the process.
So the picture is made by a child process, one per backend, until one succeeds.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mujoco

BACKENDS = ("egl", "osmesa")
"""Off-screen GL backends in the order they are tried, without a ``MUJOCO_GL`` of the user's."""

ROBOT_SHARE = 0.002
"""Smallest share of pixels that show the robot in a picture that is not blank."""


@dataclass(frozen=True)
class Picture:
    """What became of a picture; true when the file was written.

    Attributes:
        written: whether the PNG is there.
        backend: the GL backend that drew it, or "".
        reason: one line that says why there is no picture, or "".
    """

    written: bool
    backend: str
    reason: str

    def __bool__(self) -> bool:
        return self.written


def render(
    mjcf_path: str | Path,
    png_path: str | Path,
    *,
    camera: str | None = None,
    width: int = 1280,
    height: int = 800,
    qpos: Sequence[float] | None = None,
    labels: Sequence[tuple[str, Sequence[float]]] = (),
    caption: str = "",
    timeout: float = 60.0,
) -> Picture:
    """Renders an MJCF to a PNG without a display.

    Args:
        mjcf_path: the model; a ``home`` keyframe is its posture unless `qpos` is given.
        png_path: written only when the picture shows the robot.
        camera: name of a camera in the model; None fits a free camera round the robot.
        width: of the picture [pixels].
        height: of the picture [pixels].
        qpos: (nq,) posture in MuJoCo's order.
        labels: words and their places (3,) in the world [m]; drawn over the picture.
        caption: one line in the lower left corner.
        timeout: for one backend [s].

    Returns:
        A `Picture`; where it is false, its `reason` is fit to be shown, and the caller draws the
        stick figure instead.
    """
    ask = {
        "mjcf": str(Path(mjcf_path).resolve()),
        "png": str(Path(png_path).resolve()),
        "camera": camera,
        "size": [width, height],
        "qpos": None if qpos is None else [float(value) for value in qpos],
        "labels": [(text, [float(value) for value in place]) for text, place in labels],
        "caption": caption,
    }
    reasons = []
    for backend in _backends():
        picture = _in_child(ask, backend, timeout)
        # a fault of the model is the same under every backend
        if picture or not picture.reason.startswith("GL"):
            return picture
        reasons.append(f"{backend}: {picture.reason.removeprefix('GL: ')}")
    why = "; ".join(reasons) or "rendering is switched off by MUJOCO_GL"
    return Picture(False, "", f"no off-screen GL ({why})")


def _backends() -> tuple[str, ...]:
    # the command line keeps the user's choice in SNAKEGEN_GL: it loads MuJoCo without GL
    named = os.environ.get("SNAKEGEN_GL") or os.environ.get("MUJOCO_GL", "")
    chosen = named.strip().lower()
    if chosen in ("0", "off", "false", "no", "none", "disable", "disabled"):
        return ()
    return (chosen,) if chosen in BACKENDS else BACKENDS


def _in_child(ask: dict[str, Any], backend: str, timeout: float) -> Picture:
    environment = {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend}
    command = [sys.executable, "-m", __name__, json.dumps(ask)]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired:
        return Picture(False, "", f"GL: gave no answer in {timeout:g} s")
    except OSError as error:
        return Picture(False, "", f"GL: the renderer could not be started: {error.strerror}")
    answer = next((line for line in done.stdout.splitlines() if line.startswith("{")), None)
    if answer is None:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return Picture(False, "", f"GL: exit {done.returncode}, {last[:100]}")
    reason = json.loads(answer)["reason"]
    return Picture(not reason, "" if reason else backend, reason)


def _draw(ask: dict[str, Any]) -> str:
    """Draws in this process; returns the reason why there is no picture, or ""."""
    try:
        import mujoco
    except Exception as error:
        # importing mujoco loads the backend's library; without it PyOpenGL fails in many ways
        return f"GL: its library does not load, {type(error).__name__}"
    try:
        from snakegen.description.mjcf.files import load_model

        model = load_model(Path(ask["mjcf"]))
    except ValueError as error:
        return f"the model cannot be read: {_line(error)}"
    if model.ngeom == 0:
        return "the model has no shapes to draw"
    width, height = ask["size"]
    data = mujoco.MjData(model)
    home = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, "home")
    if home >= 0:
        mujoco.mj_resetDataKeyframe(model, data, home)
    if ask["qpos"] is not None:
        if len(ask["qpos"]) != model.nq:
            return f"qpos has {len(ask['qpos'])} numbers, the model needs {model.nq}"
        data.qpos[:] = ask["qpos"]
    mujoco.mj_forward(model, data)
    cameras = [model.camera(i).name for i in range(model.ncam)]
    if ask["camera"] is not None and ask["camera"] not in cameras:
        return f"the model has no camera {ask['camera']!r}; it has {cameras or 'none'}"
    camera = ask["camera"] or _fitted_camera(model, data, width / height)
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.quality.offsamples = 8
    try:
        with mujoco.Renderer(model, height, width) as renderer:
            renderer.update_scene(data, camera)
            pixels = renderer.render()
            eye = renderer.scene.camera[0]
            renderer.enable_segmentation_rendering()
            renderer.update_scene(data, camera)
            ids = renderer.render()
    except Exception as error:
        # whatever the GL stack throws, the reason is all that the caller needs
        return f"GL: {_line(error)}"
    if is_blank(pixels, robot_share(model, ids)):
        return "GL: the picture came out blank"
    return _save(_labelled(pixels, eye, ask["labels"], ask["caption"]), ask["png"])


def _labelled(
    pixels: Any, eye: Any, labels: Sequence[tuple[str, Sequence[float]]], caption: str
) -> Any:
    """Returns the picture with a caption, and words where the scene's eye sees their places."""
    import numpy as np
    from matplotlib import font_manager
    from PIL import Image, ImageDraw, ImageFont

    height, width = pixels.shape[:2]
    forward, up = np.array(eye.forward, float), np.array(eye.up, float)
    axes = np.array([np.cross(forward, up), up])
    per_metre = 0.5 * height * eye.frustum_near / eye.frustum_top  # pixels, at 1 m from the eye
    image = Image.fromarray(pixels)
    pen = ImageDraw.Draw(image)
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), max(height // 40, 9))
    edge: dict[str, Any] = {"stroke_width": 3, "stroke_fill": "white"}
    pen.text((height // 40, height - height // 40), caption, "#59626d", font, anchor="ls", **edge)
    for text, place in labels:
        ray = np.asarray(place) - np.array(eye.pos, float)
        right, above = per_metre * (axes @ ray) / (forward @ ray)
        at = (0.5 * width + right, 0.5 * height - above)
        pen.text(at, text, "#22272e", font, anchor="mm", **edge)
    return np.asarray(image)


def robot_share(model: "mujoco.MjModel", ids: Any) -> float:
    """Returns the share of pixels that show a geom which is not a plane.

    Args:
        model: the compiled model.
        ids: (height, width, 2) object id and type of each pixel, −1 where there is none.
    """
    import mujoco

    is_geom = ids[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)
    types = model.geom_type[(ids[..., 0] * is_geom).clip(0)]  # tendons have numbers of their own
    return float((is_geom & (types != int(mujoco.mjtGeom.mjGEOM_PLANE))).mean())


def is_blank(pixels: Any, share: float) -> bool:
    """Tells whether a picture shows nothing: one flat colour, or no robot in it.

    Args:
        pixels: (height, width, 3), 0…255.
        share: of pixels that show the robot.
    """
    return bool(pixels.reshape(-1, 3).std(axis=0).max() < 2.0 or share < ROBOT_SHARE)


def _fitted_camera(model: "mujoco.MjModel", data: "mujoco.MjData", aspect: float) -> Any:
    """Returns a free camera that looks at the robot from the side and above and fills its view.

    Every geom's bounding sphere must lie within the frustum; lookat moves to the middle of what
    is seen and the distance follows, a few times over.
    """
    import mujoco
    import numpy as np

    is_plane = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
    solid = ~is_plane & (model.geom_group < 3)
    centres, radii = data.geom_xpos[solid], model.geom_rbound[solid]
    if len(centres) == 0:
        centres, radii = data.xpos, np.full(model.nbody, 0.1)
    span = np.ptp(centres, axis=0)
    camera = mujoco.MjvCamera()
    # broadside to the longer horizontal extent, a little to one end; what holds a base is behind it
    held = bool(np.any((model.geom_bodyid == 0) & ~is_plane))
    camera.azimuth = 120.0 if span[0] >= span[1] else 150.0 if held else 30.0
    camera.elevation = -12.0 if held and span[2] >= max(span[:2]) else -28.0
    turn, tilt = np.radians([camera.azimuth, camera.elevation])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    ahead = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    axes = np.array([right, np.cross(right, ahead)])
    reach = np.tan(np.radians(model.vis.global_.fovy) / 2) * np.array([aspect, 1.0])
    lookat = centres.mean(axis=0)
    for _ in range(8):
        seen, depth = axes @ (centres - lookat).T, (centres - lookat) @ ahead
        distance = ((np.abs(seen) + radii) / reach[:, None] - depth).max()
        scale = distance + depth
        shift = 0.5 * (((seen + radii) / scale).max(axis=1) + ((seen - radii) / scale).min(axis=1))
        lookat = lookat + distance * shift @ axes
    camera.lookat[:] = lookat
    camera.distance = 1.06 * float(distance)
    return camera


def _save(image: Any, path: str) -> str:
    from PIL import Image

    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(image).save(path, format="PNG", optimize=True)
    except OSError as error:
        return f"the picture cannot be written: {error.strerror or error}"
    return ""


def _line(error: Exception) -> str:
    """Returns the first sentence of an error in one line."""
    text = " ".join(str(error).split()).split(". ")[0].rstrip(".")
    return text[:160] or type(error).__name__


if __name__ == "__main__":
    print(json.dumps({"reason": _draw(json.loads(sys.argv[1]))}))
