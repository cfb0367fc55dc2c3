"""ZS24's two robots as flat trees, from the paper's tables alone (THEORY C's reconstruction)."""

import numpy as np
from flat_robots import FlatRobot, X, Z, _pack

from snakegen.kernels.core.types import Tree

LENGTHS = np.array([0.294, *[0.218] * 5])  # Table 2, m
INERTIAS = 1e-6 * np.array(  # Table 4, kg·m²: two transverse values and the axial one
    [[6402, 6384, 674], *[[3609, 3567, 554]] * 3, [3570, 3529, 549], [3218, 3195, 539]]
)
TABLE_5 = 1e-3 * np.array(  # N·m
    [
        *(2818.09, 2876.88, 2119.55, 2075.67, 1424.83, 1454.34),
        *(847.05, 829.45, 390.11, 397.99, 90.21, 88.25),
    ]
)
SIGNS = np.tile([1.0, -1.0], 6)
GRASPER_ANGLES = np.array([np.pi / 3, 11 * np.pi / 6, 4 * np.pi / 3])  # Table 1


def arm6() -> Tree:
    """The arm along +y: segment 1 fixed, universal joints x,z | z,x | …, an end body like 6."""
    robot = FlatRobot(0.0, np.zeros(3), np.zeros((3, 3)))
    body, step = 0, LENGTHS[0]
    for k in range(6):
        segment = min(k + 1, 5)
        length, (a, b, axial) = LENGTHS[segment], INERTIAS[segment]
        mass = 12 * ((a + b) / 2 - axial / 2) / length**2
        first, second = (X, Z) if k % 2 == 0 else (Z, X)
        cross = robot.add(body, (0, step, 0), first)
        centre = (0, length / 2, 0)
        body = robot.add(cross, (0, 0, 0), second, mass, centre, np.diag([a, axial, b]))
        step = length
    return _pack(Tree, robot.bodies, (0, 1))


def grasper() -> Tree:
    """The planar grasper: three massless links of 200, 200, 260 mm turning about z."""
    robot = FlatRobot(0.0, np.zeros(3), np.zeros((3, 3)))
    body = 0
    for step in (0.0, 0.2, 0.2):
        body = robot.add(body, (step, 0, 0), Z)
    return _pack(Tree, robot.bodies, (0, 1))
