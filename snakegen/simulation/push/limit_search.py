"""Largest push on a body with servo compliance before a limit is reached, for two allocators.

The pseudo-inverse allocator is followed until its first limit. For the constrained one the largest
push that any allocation holds is searched: a small nonlinear program, in which forces, thrust
points and bent joints agree.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from snakegen.control.underactuated import gimbals_for
from snakegen.simulation.push.quasi_static import (
    LEVEL,
    STANDS,
    Floats,
    Load,
    Steady,
    aimed,
    give_way,
    lacking,
    leaning,
)

STRIDES = 10  # steps up to the first guess of the reach
FARTHEST = 3.0  # times that guess, where the search ends
BENDS = 12  # rounds of giving way at most
KEPT = 1e-5  # share of weight and limits by which an answer may miss them


@dataclass(frozen=True, eq=False)
class LoadedReach:
    """The end of a push on a body with servo compliance.

    Attributes:
        t: multiple of the push; nan where none was found.
        q: (nq,) where the body stands there.
        stopped: ("thrust" or "servo", i) of what is at its limit.
    """

    t: float
    q: Floats
    stopped: tuple[tuple[str, int], ...]


def follow(load: Load, guess: float) -> LoadedReach:
    """Returns where the allocator, followed from hover in steady state, meets its first limit.

    Args:
        load: body, controller (its pseudo-inverse allocator) and push.
        guess: multiple of the push to expect; sets the stride.
    """
    from scipy.optimize import brentq

    good, t = Steady.hovering(load), 0.0
    if not good.settle(0.0) or good.room()[0] < 0.0:
        return LoadedReach(float("nan"), load.q, ())
    while True:
        ahead, far = good.copy(), t + guess / STRIDES
        if far > FARTHEST * guess:
            return LoadedReach(float("nan"), load.q, ())
        if not ahead.settle(far) or ahead.room()[0] < 0.0:
            break
        good, t = ahead, far

    def left(x: float) -> float:
        there = good.copy()
        return there.room()[0] if there.settle(x) else -1.0

    end = float(brentq(left, t, far, xtol=1e-5 * guess))
    last = good.copy()
    last.settle(end)
    least, rows = last.room()
    stopped = tuple((what, i) for what, i, x in rows if x <= least + 1e-3)
    return LoadedReach(end, last.q, stopped)


def farthest(load: Load, start: Floats) -> LoadedReach:
    """Returns the most of the push that thrusts, gimbals and servos can hold: a local maximum.

    ``max t`` with ``w(x) = w0 - t d``, thrusts and servo torques within limits, over the apparatus
    forces (3Ñ, world axes), or the rotor thrusts and the horizontal lean (n + 2).

    Args:
        load: body, controller and push.
        start: the unknowns and t of a first guess: the reach of the rigid body.
    """
    from scipy.optimize import minimize

    problem = _Problem(load, start)
    z = start / problem.unit
    found = minimize(
        lambda z: -z[-1],
        z,
        jac=lambda z: np.append(np.zeros(len(z) - 1), -1.0),
        constraints=[
            {"type": "eq", "fun": problem.balance},
            {"type": "ineq", "fun": problem.room},
        ],
        method="SLSQP",
        options={"maxiter": 100, "ftol": 1e-7, "eps": 1e-7},
    )
    room = problem.room(found.x)
    met = np.abs(problem.balance(found.x)).max() <= KEPT and room.min() >= -KEPT
    t = float(found.x[-1] * problem.unit[-1])
    if not (found.success and met and t > 0.0):
        return LoadedReach(float("nan"), load.q, ())
    stopped = tuple(problem.named[i] for i in np.flatnonzero(room < 1e-4))
    return LoadedReach(t, problem.at(found.x)[1], stopped)


class _Problem:
    """Balance and limits of `farthest` by its unknowns; keeps the last evaluation."""

    def __init__(self, load: Load, start: Floats) -> None:
        robot = load.robot
        self.load = load
        self.lever = np.repeat([load.weight, load.weight * robot.link_length], 3)
        typical = float(np.max(robot.rotors.thrust_max, initial=1.0))
        self.unit = np.append(np.full(len(start) - 1, typical), start[-1])
        self.bounded = np.flatnonzero(np.isfinite(load.limit) & (load.limit > 0.0))
        count = len(robot.gimbals.limit) if load.virtual else len(robot.rotors.body)
        self.named = [("thrust", i) for i in range(count)]
        self.named += [] if load.virtual else [("thrust", i) for i in range(count)]
        self.named += [("servo", int(i)) for i in self.bounded]
        self.q = np.array(load.q)
        self.key, self.value = b"", (self.lever, load.q, self.lever)
        self.q = self.at(start / self.unit)[1]  # bent already: fewer rounds from here

    def at(self, z: Floats) -> tuple[Floats, Floats, Floats]:
        """Returns the missing wrench (6,), where the body stands, and the servos' torques."""
        if z.tobytes() == self.key:
            return self.value
        load, x = self.load, z * self.unit
        q, t = self.q, float(x[-1])
        for _ in range(BENDS):
            before = q
            q, frame = leaning(load, q, x[-3:-1])
            if load.virtual:
                thrust = np.linalg.norm(x[:-1].reshape(-1, 3), axis=1)
                thrust = thrust[load.robot.rotors.apparatus] * load.share
                gimbals = aimed(load, frame, q, x[:-1])
            else:
                thrust, force = x[:-3], np.append(x[-3:-1], 0.0)
                gimbals = gimbals_for(load.controller, frame, force, LEVEL)
            q, torque = give_way(load, q, thrust, gimbals, t)
            if np.abs(q - before).max() < STANDS:
                break
        self.key, self.value = z.tobytes(), (lacking(load, q, thrust, t), q, torque)
        return self.value

    def balance(self, z: Floats) -> Floats:
        """Returns (6,) of the missing wrench, in weights and weights times link length."""
        return self.at(z)[0] / self.lever

    def room(self, z: Floats) -> Floats:
        """Returns the share of each limit that is left, rows as in `named`."""
        load, robot, x = self.load, self.load.robot, z * self.unit
        left: list[Any]
        if load.virtual:
            most = np.maximum(robot.gimbals.limit, 1e-12)
            left = [1.0 - (x[:-1].reshape(-1, 3) ** 2).sum(axis=1) / most**2]
        else:
            most = np.maximum(robot.rotors.thrust_max, 1e-12)
            left = [(most - x[:-3]) / most, (x[:-3] - robot.rotors.thrust_min) / most]
        torque = self.at(z)[2][self.bounded]
        return np.concatenate([*left, 1.0 - (torque / load.limit[self.bounded]) ** 2])
