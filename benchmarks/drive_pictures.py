"""Pictures of drives and arms: `python benchmarks/drive_pictures.py [stand] [slope] [cables]`.

docs/arm_stand.png: arm6 on its stand, on the wall, hanging and upright. docs/slope.png: screw4
before and after its slope lets it go, by the log's own picture. docs/cables.png: arm6 by its cables
alone, at rest and 1 s later: where they hold, where they merely balance (disturbed by 1 mrad), and
where they are let go.
"""

import sys
import tempfile
from pathlib import Path

import matplotlib
import mujoco
import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).parent.parent))
from snakegen.analysis import cables
from snakegen.log.plain_picture import draw
from snakegen.picture.mujoco_render import render
from snakegen.pipeline.build import build
from snakegen.robot.robot import load
from snakegen.simulation.flight.run import run
from snakegen.spec.loading import load_spec

matplotlib.use("Agg")
import matplotlib.image as images
import matplotlib.pyplot as plt

DOCS = Path(__file__).parent.parent / "docs"
POSES = ("stand", "wall", "ceiling", "vertical")
BENT = {"joint3_yaw": 0.4}
DISTURBED = 1e-3  # rad
COLOURS = 128  # of a sheet: a third of its bytes
LATER = 1.0  # s
FROM = [0.6, -2.2, -0.2]  # m, of the camera


def sheet(shown: list[tuple[str, Path]], rows: int, out: Path, width: float = 4.0) -> None:
    """Puts PNGs with titles on one sheet."""
    columns = len(shown) // rows
    figure, axes = plt.subplots(
        rows,
        columns,
        figsize=(width * columns, (0.75 if width < 5 else 0.53) * width * rows),
        dpi=100,
    )
    for axis, (title, png) in zip(np.ravel(axes), shown, strict=True):
        axis.imshow(images.imread(png))
        axis.set_title(title, fontsize=9)
        axis.axis("off")
    figure.tight_layout()
    figure.savefig(out)
    with Image.open(out) as picture:
        small = picture.convert("RGB").quantize(COLOURS)
    small.save(out, optimize=True)
    print(out)


def rendered(model: Path, png: Path, qpos: np.ndarray | None = None, camera: str = "") -> Path:
    """Renders a model in a posture; raises where there is no picture."""
    found = render(model, png, width=640, height=480, qpos=qpos, camera=camera or None)
    if not found:
        raise SystemExit(found.reason)
    return png


def lit(path: Path) -> Path:
    """Returns a copy of a model with more light and a camera from the side."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.visual.headlight.ambient = [0.7, 0.7, 0.7]
    spec.worldbody.add_camera(name="aside", pos=FROM, xyaxes=[1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    out = path.with_name(f"{path.stem}_lit.xml")
    spec.compile()
    out.write_text(spec.to_xml())
    return out


def stand(made: Path) -> None:
    """Builds arm6 in every pose."""
    shown = []
    for pose in POSES:
        build(load_spec("arm6", overrides=[f"base.pose={pose}"]), made / pose)
        shown.append(
            (f"base.pose: {pose}", rendered(made / pose / "scene.xml", made / f"{pose}.png"))
        )
    sheet(shown, 2, DOCS / "arm_stand.png")


def slope(made: Path) -> None:
    """Runs the slope of screw4 and draws it while it holds and as it ends."""
    log = run(load("screw4"), "slope", options={"side": "left_down"})
    lost = log.metrics["lost_s"]
    shown = []
    for at, text in ((lost - 1.0, "held"), (float(log.time[-1]), "let go")):
        png = made / f"{text}.png"
        draw(log, png, at, (1400, 700))
        shown.append((f"{text}, {at:.1f} s", png))
    sheet(shown, 2, DOCS / "slope.png", 9.0)


def cabled(made: Path) -> None:
    """Lets arm6 stand by its cables for a second, thrice."""
    robot, shown = load("arm6"), []
    q = robot.configuration(BENT)
    for number, (minimum, factor, text) in enumerate(
        ((5.0, 1.0, "held"), (80.0, 1.0, "balanced, not held"), (5.0, 0.0, "let go"))
    ):
        path = made / f"cables{number}.xml"
        found = cables.analyze(robot, q, minimum=minimum, mjcf=path)
        print(f"{text}: least stiffness {found.least:.3g} N·m/rad")
        bright = lit(path)
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[:] += DISTURBED
        model.actuator_gainprm[:] *= factor
        model.actuator_biasprm[:] *= factor
        start = data.qpos.copy()
        while data.time < LATER:
            mujoco.mj_step(model, data)
        moved = float(np.abs(data.qpos - start).max())
        print(f"  {moved:.3g} rad in {LATER:g} s")
        shown.append(
            (f"{text}: at rest", rendered(bright, made / f"a{number}.png", start, "aside"))
        )
        title = f"{text}: {LATER:g} s later, {moved:.2g} rad off"
        shown.append((title, rendered(bright, made / f"b{number}.png", data.qpos, "aside")))
    sheet(shown[::2] + shown[1::2], 2, DOCS / "cables.png")


def main() -> None:
    """Draws what is named, or all."""
    every = {"stand": stand, "slope": slope, "cables": cabled}
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or every:
            every[name](Path(folder))


if __name__ == "__main__":
    main()
