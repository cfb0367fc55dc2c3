"""Compiles the margins that a log holds in a process of its own, while the flight's loop compiles.

Numba compiles on one core; a first flight needs the kernel of the margins only at its end. What
this process finds in the cache by then it does not compile again.
"""

import os
import subprocess
import sys
from typing import Any

import numpy as np

from snakegen.control.controller import MODES
from snakegen.kernels.control.types import VIRTUAL
from snakegen.kernels.core.jit import cold
from snakegen.robot.robot import Robot
from snakegen.wrench_margins.force_sets import ForceSets
from snakegen.wrench_margins.thrust import thrust_margins
from snakegen.wrench_margins.vectored import set_margins

KERNELS = {True: "margins.vectored", False: "margins.zonotope"}  # virtual-single-rotor mode or not
SCALES: dict[str, Any] = {"force_scale": 1.0, "torque_scale": 1.0}


def compile_ahead(robot: Robot) -> None:
    """Starts the process if the kernel of the robot's mode has yet to be compiled."""
    mode = str(robot.modules.control.get("mode", "virtual_single_rotor"))
    virtual = MODES.get(mode) == VIRTUAL and bool(robot.gimbal_names)
    if not robot.modules.apparatuses or (os.cpu_count() or 1) < 2 or not cold(KERNELS[virtual]):
        return
    command = [sys.executable, "-m", __spec__.name, "virtual" if virtual else "dual"]
    null = subprocess.DEVNULL
    subprocess.Popen(command, stdin=null, stdout=null, stderr=null)


def main(mode: str) -> None:
    """Compiles the kernel of a mode by measuring two postures of a made-up body."""
    points = np.random.default_rng(0).normal(size=(2, 4, 3))
    hover = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if mode == "virtual":
        set_margins(ForceSets.free(points, 1.0), hover, **SCALES)
    else:
        thrust_margins(np.random.default_rng(0).normal(size=(2, 6, 8)), 0.0, 1.0, hover, **SCALES)


if __name__ == "__main__":
    main(sys.argv[1])
