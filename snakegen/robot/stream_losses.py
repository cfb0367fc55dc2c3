"""What rotors lose to the streams of the other rotors on their own body: coaxial pairs, stacks.

One model for analyses, controller, MJCF and simulated plant: the thrust coefficient of such a rotor
is the share η of that in still air, at the same speed and drag torque. η is momentum theory's with
all rotors at their limits (`rotor_streams.thrust_kept`): 0.682 for the lower of two equal coaxial
rotors. It is held constant. With the upper rotor below its limit the lower one could give more,
so the thrusts within these limits are all within reach of the real pair.
"""

from dataclasses import replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.kernels.core.types import Rotors
from snakegen.robot.modules import Modules, Rotor
from snakegen.robot.rotor_streams import kept_in_streams

LEAST = 0.01  # of a rotor's thrust: a smaller loss counts as none
_DIGITS = 4  # of η, so that descriptions do not depend on a processor's last bit


def with_stream_losses(modules: Modules, rotors: Rotors) -> Modules:
    """Returns `modules` with thrust limits and drag ratios as they are in the body's own streams.

    Limits times η, drag ratios over η; `stream_efficiency` is η from then on, 1 without a loss. A
    plant without air or without downwash has none. What a modules file gives is kept.

    Args:
        modules: limits and drag ratios of still air.
        rotors: the same rotors, placed.
    """
    listed = [r for a in modules.apparatuses for r in a.rotors]
    shares = np.ones(len(listed))
    if all(float(modules.plant.get(key, 1.0)) > 0 for key in ("downwash", "air_density")):
        shares = stream_efficiency(rotors, np.array([r.diameter for r in listed]))
    changed = iter(_in_streams(r, float(s)) for r, s in zip(listed, shares, strict=True))
    apparatuses = tuple(
        replace(a, rotors=tuple(next(changed) for _ in a.rotors)) for a in modules.apparatuses
    )
    return replace(modules, apparatuses=apparatuses)


def stream_efficiency(rotors: Rotors, diameters: Floats) -> Floats:
    """Returns η (n,) of rotors with still-air limits, by momentum theory.

    Args:
        rotors: with limits of still air.
        diameters: (n,) m.
    """
    radius, most = 0.5 * np.maximum(diameters, 1e-6), np.maximum(rotors.thrust_max, 0.0)
    kept = np.ones(len(radius))
    for body in np.unique(rotors.body):
        mine = rotors.body == body
        together = np.ones((mine.sum(), mine.sum()), bool)
        kept[mine] = kept_in_streams(
            rotors.position[mine], rotors.axis[mine], radius[mine], most[mine], together
        )
    return np.where(kept < 1.0 - LEAST, np.round(kept, _DIGITS), 1.0)


def _in_streams(rotor: Rotor, share: float) -> Rotor:
    """Returns a rotor of still air as it is with the share η of its thrust, or with its own."""
    share = rotor.stream_efficiency or share
    if share == 1.0:
        return replace(rotor, stream_efficiency=1.0)
    return replace(
        rotor,
        stream_efficiency=share,
        thrust_min=rotor.thrust_min * share,
        thrust_max=rotor.thrust_max * share,
        drag_ratio=rotor.drag_ratio / share,
    )
