"""Derivatives of margins: accuracy off kinks, subgradients at kinks, cost against the values.

    python benchmarks/margin_gradients.py [ENTRIES]

Accuracy: random entries of the derivatives by joints of dragon4 against central differences of
exact margins, each found anew by its own certified search. Kinks: postures at which two worst
directions tie, found by bisection; one-sided slopes along random directions must be the least of
the pieces' products. Cost: the compiled twin after the certified search of the same margin.
"""

import sys
import time

import numpy as np

import snakegen
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.posture_margins import place_design
from snakegen.kernels.margins import one_slice, saddle_point
from snakegen.sensitivity.margin_gradient import margin_gradients
from snakegen.wrench_margins.gradients import UNIT

STEP = 1e-5
POSTURES = 3000  # of the cost


def posture(robot: snakegen.Robot, rng: np.random.Generator) -> np.ndarray:
    """Returns a random posture, gimbals too."""
    low, high, _ = robot.limits(robot.joint_names)
    angles = dict(zip(robot.joint_names, rng.uniform(low, high), strict=True))
    return np.array(robot.configuration(angles, base_rpy=rng.uniform(-0.5, 0.5, 3)))


def accuracy(robot: snakegen.Robot, entries: int) -> None:
    """Prints the relative errors of random entries."""
    rng, errors, kinks = np.random.default_rng(0), list[float](), 0
    while len(errors) < entries:
        q = posture(robot, rng)
        for kind in ("force", "torque"):
            found = margin_gradients(robot, q, kind)
            by = found.by("joints")
            for i in rng.choice(len(by), 4, replace=False):
                moved = []
                for side in (STEP, -STEP):
                    at = q.copy()
                    at[7 + i] += side
                    moved.append(margin_gradients(robot, at, kind))
                twists = [g.pieces[0].twist for g in (found, *moved)]
                size = np.abs(twists[0]).max()
                if max(np.abs(t - twists[0]).max() for t in twists) > 1e-2 * size:
                    kinks += 1  # another direction is the worst one on one side
                    continue
                difference = (moved[0].value - moved[1].value) / (2.0 * STEP)
                errors.append(abs(difference - by[i]) / np.abs(by).max())
    worst = np.sort(errors)
    print(
        f"{len(worst)} entries off kinks ({kinks} left out): relative error median "
        f"{np.median(worst):.1e}, 99 % {worst[int(0.99 * len(worst))]:.1e}, largest {worst[-1]:.1e}"
    )


def kinks(robot: snakegen.Robot, count: int) -> None:
    """Prints how many slopes at kinks agree with the pieces."""
    rng, found, right, valid = np.random.default_rng(1), 0, 0, 0
    while found < count:
        q, way = posture(robot, rng), np.zeros(robot.model.nq)
        way[7:] = rng.standard_normal(len(way) - 7)

        def optimum(t: float, q: np.ndarray = q, way: np.ndarray = way) -> np.ndarray:
            return np.asarray(margin_gradients(robot, q + t * way, "torque").pieces[0].twist[3:])

        low, high, first = 0.0, 0.5, optimum(0.0)
        if first @ optimum(high) > 0.7:
            continue
        for _ in range(50):
            middle = 0.5 * (low + high)
            now = optimum(middle)
            if first @ now > 0.7:
                low, first = middle, now
            else:
                high = middle
        at = q + low * way
        g = margin_gradients(robot, at, "torque")
        if len(g.pieces) < 2:  # it turned fast, but there is no tie
            continue
        found += 1
        slopes = np.array([g.by("joints", k) for k in range(len(g.pieces))])
        h, turn = 1e-6, np.zeros(len(way))
        turn[7:] = rng.standard_normal(len(way) - 7)
        slope = (margin_gradients(robot, at + h * turn, "torque").value - g.value) / h
        least = (slopes @ turn[7:]).min()
        size = np.abs(slopes @ turn[7:]).max()
        right += int(abs(slope - least) <= 1e-3 * size)
        valid += int(slope <= slopes[0] @ turn[7:] + 1e-3 * size)
    print(f"{found} kinks: one-sided slope is the least of the pieces' in {right}, no more than "
          f"the subgradient's in {valid}")  # fmt: skip


def cost(robot: snakegen.Robot) -> None:
    """Prints CPU time a posture of value and derivative."""
    names, rng = robot.chain_joints, np.random.default_rng(2)
    low, high, _ = robot.limits(names)
    indices = np.array([robot.joint_names.index(n) for n in names], np.int64)
    arrays = BodyArrays.of(robot)
    placed = place_design(arrays, rng.uniform(low, high, (POSTURES, len(names))), indices)
    force, torque = arrays.scale
    points = np.zeros((*placed.points.shape[:2], 4))
    points[..., :3] = placed.points * force / torque
    limit, hover = arrays.shapes.high / force, placed.hover / np.repeat([force, torque], 3)
    for kind in ("force", "torque"):
        bounds, twists = np.empty((POSTURES, 2)), np.empty((POSTURES, 6))
        values, solved = np.empty(POSTURES), np.empty(POSTURES, np.int64)
        forces = np.empty((POSTURES, limit.size, 3))
        taken = np.empty(2)
        for _ in range(2):  # the first round compiles
            begun = time.process_time()
            one_slice.batch(kind == "torque", points, limit, hover, 1e-3, bounds, twists)
            middle = time.process_time()
            saddle_point.batch(
                points, limit, hover, UNIT[kind], bounds, twists, values, forces, solved
            )
            taken[:] = middle - begun, time.process_time() - middle
        value, more = 1e6 * taken / POSTURES
        print(
            f"{kind}: certified value to 1e-3 {value:.1f} µs a posture, with exact value, twist "
            f"and forces {value + more:.1f} µs ({(value + more) / value:.2f} times), exact in "
            f"{100.0 * solved.mean():.2f} %"
        )


if __name__ == "__main__":
    machine = snakegen.load("dragon4")
    cost(machine)
    accuracy(machine, int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
    kinks(machine, 200)
