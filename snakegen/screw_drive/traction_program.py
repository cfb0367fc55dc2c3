"""Largest load that a body of drums holds on a plane: linear programs over its contact forces.

A drum i carries a normal force ``N_i ≥ 0``, a force F_i along its wheels' axles and a force G_i
across them, which rolling and bearing friction hold: ``F_i² + G_i² ≤ (μ N_i)²`` and
``|G_i| ≤ c N_i``, c of μ at most, as polygons round it (the bound); the figure keeps to the ellipse
inside, ``(F_i / μ)² + (G_i / c)² ≤ N_i²``. A caster's ball carries a normal force. With generalized
coordinates [base twist; held joints]:

    J_nᵀ N + J_aᵀ F + J_cᵀ G + w₀ + t w₁ = [0; -τ],   |τ_j| ≤ effort of servo or motor

The largest t over all N and F is an upper bound (any sharing of the load by the contacts). The
lower bound, the figure, has the normal forces that servos and contacts share by their
compliance (`load_sharing`). Both optima are certified by weak duality.
"""

from dataclasses import dataclass, replace

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.screw_drive.ground_stance import COMPLIANCE, Stance
from snakegen.screw_drive.load_sharing import Mask, Sharing, at_rest, sharing

_SIDES = 32  # of the polygons
_ACTIVE = 1e-7  # share of its scale at which a constraint counts as active


@dataclass(frozen=True, eq=False)
class HeldLoad:
    """The largest factor t of a load, and the forces there.

    Attributes:
        factor: t; inf where nothing limits it, nan where the body does not even rest.
        certified: bound of t by weak duality, t ≤ certified up to rounding.
        normal: (k,) N of each contact.
        along, across: (k,) N along the axles and across them.
        torque: (m,) N·m of the held joints.
        limits: names of what limits it: "friction of screw2", "lift of caster1 left" …
    """

    factor: float
    certified: float
    normal: Floats
    along: Floats
    across: Floats
    torque: Floats
    limits: tuple[str, ...]


def held_load(
    body: Stance, fixed: Floats, rising: Floats, friction: float, compliance: float = COMPLIANCE
) -> HeldLoad:
    """Returns the largest t of ``fixed + t rising`` with loads shared by compliance.

    Contacts that lift are dropped one after the other as long as that holds more. Joints with play
    share as those without: loaded ones rest on a stop, of which no side is the likelier.

    Args:
        body: at rest on the plane.
        fixed, rising: (6 + m,) generalized forces, gravity among them.
        friction: μ; inf: wheels that cannot slip.
        compliance: m/N of a contact.
    """
    body = replace(body, play=0.0)
    active, stops = at_rest(body, fixed, compliance)

    def solve(carrying: Mask) -> HeldLoad:
        share = sharing(body, carrying, stops, compliance)
        return _solve(body, fixed, rising, friction, carrying, share)

    best = solve(active)
    while np.isfinite(best.factor):
        lifted = active & (best.normal <= _ACTIVE * max(1.0, float(best.normal.max())))
        if not lifted.any() or (active & ~lifted).sum() < 3:
            break
        active = active & ~lifted
        more = solve(active)
        if not more.factor > best.factor * (1 + 1e-6):
            break
        best = more
    return best


def upper_bound(body: Stance, fixed: Floats, rising: Floats, friction: float) -> HeldLoad:
    """Returns the largest t for any sharing of the load by the contacts: none holds more."""
    return _solve(body, fixed, rising, friction, np.ones(len(body.contacts), bool), None)


def _solve(
    body: Stance,
    fixed: Floats,
    rising: Floats,
    friction: float,
    active: Mask,
    share: Sharing | None,
) -> HeldLoad:
    """Solves one program in [F and G of the drums; N of the active contacts; t]."""
    from scipy.optimize import linprog

    drums = np.flatnonzero(body.drums)
    carrying = np.flatnonzero(active)
    n, k = len(drums), len(carrying)
    slack = np.isfinite(friction) and body.rolling > 0.0
    sideways = body.across[drums].T if slack else np.zeros((body.across.shape[1], n))
    forces = np.hstack([body.along[drums].T, sideways, body.normal[carrying].T])
    equal = [np.hstack([forces[:6], rising[:6, None]])]
    value = [-fixed[:6]]
    if share is not None:
        by_load = share.force[:, 1:]
        by_tangent = by_load @ share.tangents
        equal.append(np.hstack([-by_tangent, np.eye(k), -(by_load @ rising)[:, None]]))
        value.append(share.loads(fixed))
    rows, most, names = [], [], []
    for i, drum in enumerate(drums):
        where = np.flatnonzero(carrying == drum)
        limited = np.isfinite(friction) or not where.size
        rolling = min(body.rolling, friction) if slack else 0.0
        for f, g, h in _cone(friction, rolling, share is not None):
            row = np.zeros(2 * n + k + 1)
            row[i], row[n + i] = f, g
            if where.size:
                row[2 * n + where] = -h
            if limited:
                rows.append(row)
                most.append(0.0)
                names.append(f"friction of {body.contacts[drum].name}")
    joints = np.hstack([forces[6:], rising[6:, None]])
    for j, name in enumerate(body.joints):
        for sign in (1.0, -1.0):
            rows.append(sign * joints[j])
            most.append(body.effort[j] - sign * fixed[6 + j])
            names.append(f"torque of {name}")
    sideways_bound = (None, None) if slack else (0.0, 0.0)
    bounds = [(None, None)] * n + [sideways_bound] * n + [(0.0, None)] * (k + 1)
    cost = np.zeros(2 * n + k + 1)
    cost[-1] = -1.0
    A, b = np.array(rows), np.array(most)
    Ae, be = np.vstack(equal), np.concatenate(value)
    found = linprog(cost, A, b, Ae, be, bounds, method="highs")
    shape = len(body.contacts)
    if found.status != 0:
        factor = np.inf if found.status == 3 else np.nan
        nothing = np.zeros(shape)
        return HeldLoad(factor, factor, nothing, nothing, nothing, np.zeros(len(body.joints)), ())
    normal, along, across = np.zeros((3, shape))
    along[drums], across[drums] = found.x[:n], found.x[n : 2 * n]
    normal[carrying] = found.x[2 * n : 2 * n + k]
    weights = found.ineqlin.marginals
    limits = [names[i] for i in np.flatnonzero(np.abs(weights) > 1e-9)]
    lifted = np.flatnonzero(found.lower.marginals[2 * n : 2 * n + k] > 1e-9)
    limits += [f"lift of {body.contacts[carrying[i]].name}" for i in lifted]
    bound = -(b @ weights + be @ found.eqlin.marginals)
    torque = -(joints @ found.x + fixed[6:])
    unique = tuple(dict.fromkeys(limits))
    return HeldLoad(float(found.x[-1]), float(bound), normal, along, across, torque, unique)


def _cone(friction: float, rolling: float, inside: bool) -> list[tuple[float, float, float]]:
    """Returns (f, g, h) of ``f F + g G ≤ h N``: the friction of a drum along and across its axles.

    Args:
        friction: μ; inf gives the rows that hold a drum in the air.
        rolling: c, of μ at most; 0: wheels that roll freely.
        inside: a polygon inside the ellipse of both, its corners on the axes, else one round
            circle and strip.
    """
    if not rolling:
        return [(1.0, 0.0, friction), (-1.0, 0.0, friction)]
    angle = 2.0 * np.pi / _SIDES * (np.arange(_SIDES) + 0.5)
    if inside:
        size = float(friction * np.cos(np.pi / _SIDES))
        return [(np.cos(a), np.sin(a) * friction / rolling, size) for a in angle]
    circle = [(float(np.cos(a)), float(np.sin(a)), friction) for a in angle]
    return [*circle, (0.0, 1.0, rolling), (0.0, -1.0, rolling)]
