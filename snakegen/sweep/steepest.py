"""Steps along a margin's exact derivative from a posture: they find, certified margins decide."""

import numpy as np

from snakegen.base.geometry import Floats, rpy_from_rotation
from snakegen.errors import SnakegenError
from snakegen.robot.posture import hover_gimbals
from snakegen.sensitivity.margin_gradient import DUAL, VIRTUAL, margin_gradients
from snakegen.sweep.batch import Body

KINDS = ("force", "torque", "wrench", "attitude_altitude")
AIM = 1e-6  # rad, of the differences by which gimbals follow the joints
STEPS = 0.1 * 2.0 ** -np.arange(12.0)  # share of the joints' ranges that a step takes at most


def slope(body: Body, column: str, angles: Floats) -> Floats | None:
    """Returns the derivative (k,) of a sweep's column by its joints, gimbals aimed anew.

    ``dm/dq = ∂m/∂q + ∂m/∂g dg/dq``, g the gimbals that point thrusts up. None where the column
    has no derivative, or the margin none here.

    Args:
        body: of the sweep.
        column: a margin of it.
        angles: (k,) rad.
    """
    name = column.removeprefix("dual_").removesuffix("_upper").removesuffix("_margin")
    mode = DUAL if column.startswith("dual_") else VIRTUAL
    if name not in KINDS:
        return None
    robot = body.robot

    def aimed(at: Floats) -> Floats:
        given = dict(body.held) | dict(zip(body.joints, at.tolist(), strict=True))
        base = tuple(float(x) for x in rpy_from_rotation(body.base))
        return np.array(hover_gimbals(robot, robot.configuration(given, base_rpy=base)))

    try:
        by = margin_gradients(robot, aimed(angles), name, mode, ties=False, close=False).by(
            "joints"
        )
    except SnakegenError:
        return None
    out = np.empty(len(angles))
    for i, index in enumerate(body.indices):
        step = AIM * np.eye(len(angles))[i]
        follow = (robot.angles(aimed(angles + step)) - robot.angles(aimed(angles - step))) / 2 / AIM
        follow[np.abs(follow) > 1.0 / AIM] = 0.0  # an angle that turned over
        follow[body.indices] = 0.0
        out[i] = by[index] + by @ follow
    return out


def steps_down(body: Body, column: str, angles: Floats) -> Floats | None:
    """Returns postures (12, k) down the steepest slope from `angles`, within the joints' limits.

    Steepest in shares of the joints' ranges; None where there is no slope.
    """
    found = slope(body, column, angles)
    if found is None or not np.isfinite(found).all() or not found.any():
        return None
    low, high, _ = body.robot.limits(body.joints)
    span = high - low
    way = -found * span
    way[((angles <= low) & (way < 0.0)) | ((angles >= high) & (way > 0.0))] = 0.0
    if not way.any():
        return None
    way /= np.abs(way).max()
    return np.clip(angles + STEPS[:, None] * way * span, low, high)
