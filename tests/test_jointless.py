"""A drone without any joint: four rotors on one rigid body, no gimbal, no servo."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import snakegen
from snakegen.robot.robot import Robot
from snakegen.simulation.flight.run import run

ARMS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


@pytest.fixture(scope="module")
def drone(tmp_path_factory: Any) -> Robot:
    """1 kg, rotors of 8 N at (±0.1, ±0.1) m."""
    folder: Path = tmp_path_factory.mktemp("drone")
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/>'
    parts = [f'<link name="body"><inertial><mass value="1"/>{inertia}</inertial></link>']
    rotors = []
    for k, (x, y) in enumerate(ARMS, 1):
        parts.append(
            f'<link name="rotor_{k}"/><joint name="mount_{k}" type="fixed"><parent link="body"/>'
            f'<child link="rotor_{k}"/><origin xyz="{0.1 * x} {0.1 * y} 0"/></joint>'
        )
        drag = 0.016 * (1 if k % 2 else -1)
        rotors.append(f"  - rotors: [{{link: rotor_{k}, thrust_max: 8, drag_ratio: {drag}}}]\n")
    (folder / "drone.urdf").write_text(f'<robot name="jointless">{"".join(parts)}</robot>')
    modules = "floating_root: body\nlink_length: 0.28\napparatuses:\n" + "".join(rotors)
    (folder / "modules.yaml").write_text(modules)
    return snakegen.load(folder / "drone.urdf", modules=folder / "modules.yaml")


@pytest.mark.parametrize(
    "mission, options",
    [("hover", {"duration": 2.0}), ("ascend", {}), ("push", {"slow": 1.0})],
)
def test_it_flies(drone: Robot, mission: str, options: dict[str, float]) -> None:
    """Missions that need no joint run to their end, without a joint or a gimbal in the log."""
    recording = run(drone, mission, seed=1, options=options)
    checks = {c.metric: c.passed for c in recording.verdict.checks}
    assert checks.get("finite", True) and checks.get("completed", True) and checks
    assert recording.channel("joint_angle").values.shape[1] == 0
    thrust = recording.channel("thrust").values
    assert np.isfinite(thrust).all() and (mission == "push" or abs(thrust[-1].sum() - 9.81) < 1)
