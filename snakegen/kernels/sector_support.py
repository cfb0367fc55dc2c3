"""Support of a slice of the hull of vectored sets under gimbal limits, by column generation.

Each apparatus pushes with a convex mixture of forces from its sector, so a slice of the hull is a
linear program of 3 + n rows (the held wrench, a mixture for each apparatus) and endless columns.
The simplex method asks the sectors' closed-form support for the column to enter; the same question
bounds the optimum from above. Only the cost changes from one direction to the next, so the last
basis is a feasible start.
"""

from math import atan2, cos, pi, sin

import numpy as np

from snakegen.kernels.bare import bare
from snakegen.kernels.jit import jit

PENALTY = 1e3  # of a held wrench that the columns found so far cannot hold
ROUNDS = 400  # of the simplex method, for one direction
TINY = 1e-11  # a pivot or a reduced cost below this is rounding


@bare
def farthest(d, phi_most, theta_most, out):
    """Writes the unit thrust (3,) of a sector that lies farthest along d, link axes; their product.

    For each extreme φ, clamped, of ``-d_y sinφ + d_z cosφ`` the best θ is clamped likewise.
    """
    best = -np.inf
    peak = atan2(-d[1], d[2])
    for i in range(5):
        phi = peak
        if i == 1:
            phi = peak + pi
        elif i == 2:
            phi = peak - pi
        elif i == 3:
            phi = -phi_most
        elif i == 4:
            phi = phi_most
        phi = min(max(phi, -phi_most), phi_most)
        across = -d[1] * sin(phi) + d[2] * cos(phi)
        for k in range(3):
            theta = atan2(d[0], across)
            if k == 1:
                theta = -theta_most
            elif k == 2:
                theta = theta_most
            theta = min(max(theta, -theta_most), theta_most)
            along = d[0] * sin(theta) + across * cos(theta)
            if along > best:
                best = along
                out[0] = sin(theta)
                out[1] = -sin(phi) * cos(theta)
                out[2] = cos(phi) * cos(theta)
    return best


@bare
def _price(j, twist, p, low, high, gimbal, turn, local, u, column):
    """Writes the wrench (6,) of apparatus j that lies farthest along the twist; its product."""
    x, y, z, drag = p[j, 0], p[j, 1], p[j, 2], p[j, 3]
    speed = (
        twist[0] + twist[4] * z - twist[5] * y + drag * twist[3],
        twist[1] + twist[5] * x - twist[3] * z + drag * twist[4],
        twist[2] + twist[3] * y - twist[4] * x + drag * twist[5],
    )
    for c in range(3):
        local[c] = turn[j, 0, c] * speed[0] + turn[j, 1, c] * speed[1] + turn[j, 2, c] * speed[2]
    along = farthest(local, gimbal[j, 0], gimbal[j, 1], u)
    strength = high[j] if along > 0.0 else low[j]
    for c in range(3):
        column[c] = turn[j, c, 0] * u[0] + turn[j, c, 1] * u[1] + turn[j, c, 2] * u[2]
        column[c] *= strength
    column[3] = y * column[2] - z * column[1] + drag * column[0]
    column[4] = z * column[0] - x * column[2] + drag * column[1]
    column[5] = x * column[1] - y * column[0] + drag * column[2]
    return along * strength


@jit
def start(torque, p, low, high, gimbal, turn, hover, wrenches, owner):
    """Fills the first basis: a force of each apparatus along hover, and three that take the rest.

    `wrenches` (3 + n, 6) and `owner` (3 + n,) describe its columns; an owner of -1 marks a wrench
    that no apparatus gives, at a PENALTY.
    """
    n, first = low.size, 0 if torque else 3
    local, u, twist = np.empty(3), np.empty(3), np.zeros(6)
    rest = hover[first : first + 3].copy()
    twist[:3] = hover[:3]
    for j in range(n):
        _price(j, twist, p, low, high, gimbal, turn, local, u, wrenches[3 + j])
        owner[3 + j] = j
        for c in range(3):
            rest[c] -= wrenches[3 + j, first + c]
    for c in range(3):
        wrenches[c] = 0.0
        wrenches[c, first + c] = 1.0 if rest[c] >= 0.0 else -1.0
        owner[c] = -1


@jit
def support(e, torque, p, low, high, gimbal, turn, hover, gap, wrenches, owner, inverse, point):
    """Bounds the slice's support along the unit `e` (3,) from above, to a share `gap` of it.

    Args:
        torque: the torque slice (force held), else the force slice.
        p, low, high: (n, 4), (n,), (n,), scaled points and drags, least and largest forces.
        gimbal: (n, 2) rad, largest |φ| and |θ|.
        turn: (n, 3, 3) link axes in CoG axes.
        hover: (6,) scaled.
        gap: relative, at which to stop.
        wrenches, owner: the basis, from `start` or the call before, updated.
        inverse: (3 + n, 3 + n) of the basis matrix: the held wrench in its first three rows, then
            one row an apparatus; updated.
        point: (3,) of the slice, seen from hover, filled.
    """
    n, r = low.size, 3 + low.size
    part, first = (3, 0) if torque else (0, 3)
    share, cost, prices, step = np.empty(r), np.empty(r), np.empty(r), np.empty(r)
    local, u, twist = np.empty(3), np.empty(3), np.empty(6)
    column, entering = np.empty(6), np.empty(6)
    upper, offset = np.inf, 0.0
    for c in range(3):
        offset += e[c] * hover[part + c]
    for k in range(r):
        share[k] = 0.0
        for i in range(r):
            share[k] += inverse[k, i] * (hover[first + i] if i < 3 else 1.0)
        cost[k] = -PENALTY
        if owner[k] >= 0:
            cost[k] = 0.0
            for c in range(3):
                cost[k] += e[c] * wrenches[k, part + c]
    for _ in range(ROUNDS):
        reached = -offset
        for i in range(r):
            prices[i] = 0.0
            for k in range(r):
                prices[i] += cost[k] * inverse[k, i]
            reached += cost[i] * share[i]
        above = 0.0
        for c in range(3):
            twist[part + c], twist[first + c] = e[c], -prices[c]
        for c in range(6):
            above -= twist[c] * hover[c]
        most, enters = TINY, -1
        for j in range(n):
            value = _price(j, twist, p, low, high, gimbal, turn, local, u, column)
            above += value
            if value - prices[3 + j] > most:
                most, enters = value - prices[3 + j], j
                entering[:] = column
        upper = min(upper, above)
        if enters < 0 or upper < 0.0 or upper - reached <= gap * upper:
            break
        leaves = _ratio(entering, enters, first, inverse, share, step)
        if leaves < 0:
            break
        _pivot(leaves, inverse, share, step)
        wrenches[leaves], owner[leaves] = entering, enters
        cost[leaves] = 0.0
        for c in range(3):
            cost[leaves] += e[c] * entering[part + c]
    for c in range(3):
        point[c] = -hover[part + c]
        for k in range(r):
            point[c] += share[k] * wrenches[k, part + c] if owner[k] >= 0 else 0.0
    return upper


@bare
def _ratio(entering, enters, first, inverse, share, step):
    """Fills `step` (r,), what the entering column costs each share; the first to vanish, or -1."""
    leaves, least = -1, np.inf
    for k in range(step.size):
        step[k] = inverse[k, 3 + enters]
        for c in range(3):
            step[k] += inverse[k, c] * entering[first + c]
        if step[k] > TINY and max(share[k], 0.0) / step[k] < least:
            leaves, least = k, max(share[k], 0.0) / step[k]
    return leaves


@bare
def _pivot(leaves, inverse, share, step):
    """Exchanges row `leaves` of the basis for the column whose `step` is given."""
    r = step.size
    unit = 1.0 / step[leaves]
    share[leaves] *= unit
    for i in range(r):
        inverse[leaves, i] *= unit
    for k in range(r):
        if k != leaves:
            share[k] -= step[k] * share[leaves]
            for i in range(r):
                inverse[k, i] -= step[k] * inverse[leaves, i]
