"""Random apparatuses of every kind, and an independent test of what they can push with."""

import numpy as np
from scipy.spatial.transform import Rotation

from snakegen.wrench_margins.force_sets import ForceSets

WHOLE = [-np.pi, np.pi]


def random_sets(rng, n):
    """Returns sets of every kind: symmetric and other ranges, fixed joints, reversible rotors."""
    phi, theta = np.sort(rng.uniform(-np.pi, np.pi, (2, n, 2)), axis=2)
    for j in range(n):
        kind = rng.integers(6)
        if kind <= 1:
            phi[j], theta[j] = np.array([-1, 1]) * rng.uniform(0.05, np.pi, (2, 1))
        elif kind == 2:
            theta[j] = 0.0
        elif kind == 3:
            phi[j] = WHOLE
        elif kind == 4:
            phi[j], theta[j] = 0.0, 0.0
    low = rng.choice([0.0, 0.3, -1.0, -0.5], n)
    frames = Rotation.random(n, random_state=int(rng.integers(1 << 30))).as_matrix()
    return ForceSets.checked(rng.normal(size=(n, 3)), frames, low, np.ones(n), phi, theta)


def within(angle, span, slack):
    """Tells whether an angle, whole turns apart, lies in a range."""
    return any(span[0] - slack <= angle + 2 * np.pi * k <= span[1] + slack for k in range(-2, 3))


def holds(sets, j, force, slack=1e-7):
    """Tells whether some λ, φ, θ of apparatus j give the force (3,), CoG axes."""
    f = sets.frames[j].T @ force
    size = np.linalg.norm(f)
    if size < 1e-9:
        return bool(sets.low[j] <= 1e-9)
    for thrust in (size, -size):
        if not sets.low[j] - slack <= thrust <= sets.high[j] + slack:
            continue
        u = f / thrust
        flat = np.hypot(u[1], u[2])
        phi, theta = np.arctan2(-u[1], u[2]), np.arctan2(u[0], flat)
        loose = slack / max(flat, slack)  # along x every φ gives the same
        for a, b in ((phi, theta), (phi + np.pi, np.pi - theta)):
            if within(a, sets.phi[j], loose) and within(b, sets.theta[j], slack):
                return True
    return False
