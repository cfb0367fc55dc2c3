"""Multirotors for tests: arms round a body, each with a rotor that is fixed or tilts."""

from pathlib import Path

import numpy as np

import snakegen
from snakegen.robot.robot import Robot

INERTIA = '<inertia ixx="{0}" iyy="{0}" izz="{1}" ixy="0" ixz="0" iyz="0"/>'


def multirotor(
    folder: Path,
    azimuths: tuple[float, ...] = (45.0, 135.0, 225.0, 315.0),
    *,
    tilts: tuple[str | None, ...] = (None,) * 4,
    drag: tuple[float, ...] = (0.016, -0.016, 0.016, -0.016),
    control: str = "",
    reach: float = 0.2,
) -> Robot:
    """Returns a body of 0.8 kg with an arm of `reach` m at each azimuth [deg], rotors of 8 N.

    Args:
        folder: where the URDF and its modules file are written.
        azimuths: deg, of the arms, counter-clockwise from x.
        tilts: the axis of each arm's gimbal in the body, as in "1 0 0"; None: a fixed rotor.
        drag: m, drag ratios.
        control: what the modules file has under `control`.
        reach: m.
    """
    links = (
        '<link name="body"><inertial><mass value="0.8"/>' + INERTIA.format(0.006, 0.01)
    ) + '</inertial><collision><geometry><box size="0.1 0.1 0.05"/></geometry></collision></link>'
    joints, apparatuses = "", []
    for k, (azimuth, axis, ratio) in enumerate(zip(azimuths, tilts, drag, strict=True)):
        x, y = reach * np.cos(np.radians(azimuth)), reach * np.sin(np.radians(azimuth))
        links += f'<link name="rotor{k}"><inertial><mass value="0.05"/>'
        links += INERTIA.format(1e-4, 1e-4) + "</inertial></link>"
        kind = "fixed" if axis is None else "revolute"
        turn = "" if axis is None else (
            f'<axis xyz="{axis}"/><limit lower="-1.5" upper="1.5" effort="2" velocity="20"/>'
        )  # fmt: skip
        joints += (
            f'<joint name="arm{k}" type="{kind}"><parent link="body"/><child link="rotor{k}"/>'
            f'<origin xyz="{x:.6f} {y:.6f} 0"/>{turn}</joint>'
        )
        gimbal = "" if axis is None else f"roll: arm{k}, "
        rotor = f"{{link: rotor{k}, thrust_max: 8, drag_ratio: {ratio}}}"
        apparatuses.append(f"  - {{{gimbal}rotors: [{rotor}]}}")
    (folder / "m.urdf").write_text(f'<robot name="multirotor">{links}{joints}</robot>')
    said = f"control: {{{control}}}\n" if control else ""
    (folder / "m.yaml").write_text(
        f"floating_root: body\nlink_length: {reach}\n{said}apparatuses:\n" + "\n".join(apparatuses)
    )
    return snakegen.load(folder / "m.urdf", modules=folder / "m.yaml")
