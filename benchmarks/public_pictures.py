"""Pictures of six public robots, converted: `python benchmarks/public_pictures.py --folder DIR`.

Each URDF is converted with its meshes, its MJCF rendered, and the six are put on one sheet,
docs/public_robots.png. Packages are those of benchmarks/public_robots.py.
"""

import argparse
import sys
import tempfile
import warnings
from pathlib import Path

import matplotlib
import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
import snakegen
from benchmarks.public_robots import download, files
from snakegen.picture.mujoco_render import render

matplotlib.use("Agg")
import matplotlib.image as images
import matplotlib.pyplot as plt

SHEET = Path(__file__).parent.parent / "docs/public_robots.png"
WIDTH, HEIGHT = 640, 480
ROBOTS = {  # name, and how much each joint is turned between 0 and the middle of its range
    "talos_reduced.urdf": 0.5,
    "anymal_c_simple_description/urdf/anymal.urdf": 0.5,
    "ur_description/urdf/ur5_joint_limited_robot.urdf": 0.0,
    "tiago_pro.urdf": 0.5,
    "iris.urdf": 0.0,
    "pybullet_data/franka_panda/panda.urdf": 1.0,
}


def main() -> None:
    """Converts and renders the six; says what each has."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="where the packages are, or are put")
    parser.add_argument("-o", "--out", type=Path, default=SHEET)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as made:
        folder = args.folder or Path(made) / "packages"
        if not any(folder.glob("*/**/*.urdf")):
            download(folder)
        every = list(files(folder))
        figure, axes = plt.subplots(2, 3, figsize=(12, 6.4), dpi=100)
        for number, (axis, (name, share)) in enumerate(zip(axes.flat, ROBOTS.items(), strict=True)):
            path = next(p for p in every if str(p).endswith(f"/{name}"))
            png = Path(made) / f"{number}.png"
            title = picture(path, Path(made) / str(number), png, share)
            print(f"{path.relative_to(folder)}: {title}")
            axis.imshow(images.imread(png))
            axis.set_title(title, fontsize=8)
            axis.axis("off")
        figure.tight_layout()
        figure.savefig(args.out)


def picture(path: Path, out: Path, png: Path, share: float) -> str:
    """Converts and renders one robot; returns its name, joints and worst error."""
    made = snakegen.convert(path, out)
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    q = model.qpos0.copy()
    for joint in range(model.njnt):
        if model.jnt_limited[joint] and model.jnt_type[joint] >= int(mujoco.mjtJoint.mjJNT_SLIDE):
            q[model.jnt_qposadr[joint]] = share * float(np.mean(model.jnt_range[joint]))
    done = render(made.mjcf, png, width=WIDTH, height=HEIGHT, qpos=q.tolist())
    if not done:
        raise SystemExit(f"{path}: {done.reason}")
    meshes = len(list(out.rglob("*.stl"))) + len(list(out.rglob("*.obj")))
    worst = made.equivalence.mass_matrix
    return f"{path.stem}: {model.njnt} joints, {meshes} meshes, mass matrix to {worst:.0e}"


if __name__ == "__main__":
    main()
