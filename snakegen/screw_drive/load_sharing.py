"""How a body's contacts share its load by the compliance of servos and contacts.

With ξ the height, roll and pitch of the base, δ the bends of held joints, J_n the contacts' speeds:

    K (δ − s p/2) = (J_aᵀ F + J_cᵀ G + J_nᵀ N + w)_δ,   J_n [ξ; δ] + ε N = −gap

A contact whose force would become negative has lifted and carries no more. A joint with play p is
limp within it (s = 0), or rests on a stop (s = ±1), beyond which its servo of stiffness K resists.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from snakegen.base.geometry import Floats
from snakegen.screw_drive.ground_stance import COMPLIANCE, Stance

Mask = NDArray[np.bool_]
Stops = NDArray[np.int64]
_UPRIGHT = (2, 3, 4)  # z, roll, pitch of the base twist: what normal forces hold
_LIMP = 1e-3  # N·m/rad of a joint within its play
_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Sharing:
    """Contact forces and joint bends, linear in loads, for given contacts and stops.

    Attributes:
        force: (k, 1 + 6 + m) N of the active contacts, of [1; w].
        bend: (s, 1 + 6 + m) rad of the joints with a servo.
        tangents: (6 + m, 2 n) generalized forces of [F; G].
    """

    force: Floats
    bend: Floats
    tangents: Floats

    def loads(self, load: Floats, tangent: Floats | None = None) -> Floats:
        """Returns N (k,) under a generalized load and tangential forces [F; G]."""
        return np.asarray(self.force @ self._all(load, tangent))

    def bends(self, load: Floats, tangent: Floats | None = None) -> Floats:
        """Returns δ (s,) [rad] likewise."""
        return np.asarray(self.bend @ self._all(load, tangent))

    def _all(self, load: Floats, tangent: Floats | None) -> Floats:
        whole = load if tangent is None else load + self.tangents @ tangent
        return np.concatenate([[1.0], whole])


def no_stops(body: Stance) -> Stops:
    """Returns all joints within their play."""
    return np.zeros(int(np.isfinite(body.stiffness).sum()), np.int64)


def sharing(body: Stance, active: Mask, stops: Stops, compliance: float) -> Sharing:
    """Returns how the active contacts share the load with joints at these stops."""
    soft = np.flatnonzero(np.isfinite(body.stiffness))
    index = np.concatenate([_UPRIGHT, 6 + soft])
    J, many = body.normal[np.ix_(active, index)], int(active.sum())
    stiff = body.stiffness[soft]
    K = np.zeros((len(index), len(index)))
    K[3:, 3:] = np.diag(np.where((body.play == 0.0) | (stops != 0), stiff, _LIMP))
    left = np.block([[K, -J.T], [J, compliance * np.eye(many)]])
    select = np.eye(body.normal.shape[1])[index]
    right = np.zeros((len(left), 1 + select.shape[1]))
    right[3 : len(index), 0] = stiff * stops * body.play / 2
    right[len(index) :, 0] = -body.gap[active]
    right[: len(index), 1:] = select
    found = np.linalg.lstsq(left, right, rcond=1e-13)[0]
    tangents = np.vstack([body.along[body.drums], body.across[body.drums]]).T
    return Sharing(found[len(index) :], found[3 : len(index)], tangents)


def moved_stop(body: Stance, stops: Stops, bends: Floats) -> Stops | None:
    """Returns the stops with the joint changed that contradicts its own the most; None: none."""
    if body.play == 0.0:
        return None
    half = 0.5 * body.play
    beyond = np.where(stops == 0, np.abs(bends) - half, half - stops * bends)
    worst = int(np.argmax(beyond, axis=0)) if len(beyond) else 0
    if not len(beyond) or beyond[worst] <= 1e-9:
        return None
    out = stops.copy()
    out[worst] = int(np.sign(bends[worst])) if stops[worst] == 0 else 0
    return out


def at_rest(body: Stance, load: Floats, compliance: float) -> tuple[Mask, Stops]:
    """Returns which contacts carry at rest, and the joints' stops.

    Contacts that would pull are dropped, joints that contradict their stop are moved, one at a
    time.
    """
    active, stops = np.ones(len(body.contacts), bool), no_stops(body)
    for _ in range(_ROUNDS):
        share = sharing(body, active, stops, compliance)
        moved = moved_stop(body, stops, share.bends(load))
        if moved is not None:
            stops = moved
            continue
        force = share.loads(load)
        if active.sum() <= 1 or force.min() >= -1e-9 * max(1.0, float(force.max())):
            break
        active[np.flatnonzero(active)[int(force.argmin())]] = False
    return active, stops


def resting_loads(body: Stance, load: Floats, compliance: float = COMPLIANCE) -> Floats:
    """Returns the normal forces (k,) [N] under a generalized load, without tangential forces."""
    active, stops = at_rest(body, load, compliance)
    out = np.zeros(len(body.contacts))
    out[active] = sharing(body, active, stops, compliance).loads(load)
    return out
