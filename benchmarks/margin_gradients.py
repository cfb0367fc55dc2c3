"""Derivatives of margins: accuracy off kinks, subgradients at kinks, cost against the values.

    python benchmarks/margin_gradients.py [--entries 10000] [--kinks 10000] [--seed 0]

Accuracy: random entries of the derivatives by joints of dragon4 against central differences of
exact margins, each found anew by its own certified search. Kinks: postures at which two worst
directions tie, found by bisection and then on both branches; one-sided slopes along random
directions must be the least of the pieces' products. Cost: the compiled twin after the certified
search of the same margin.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np

import snakegen
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.posture_margins import place_design
from snakegen.kernels.margins import one_slice, saddle_point
from snakegen.sensitivity.margin_gradient import margin_gradients
from snakegen.wrench_margins import saddle_point as saddle
from snakegen.wrench_margins.gradients import UNIT
from snakegen.wrench_margins.vectored import set_margins

STEP = 1e-5
POSTURES = 3000  # of the cost
SHOWN = 500  # entries, or kinks, between two lines
APART = 0.7  # cosine between worst directions that are two
COARSE, FINE = 10, 8  # halvings of a line, then secants between the two branches


def posture(robot: snakegen.Robot, rng: np.random.Generator) -> np.ndarray:
    """Returns a random posture, gimbals too."""
    low, high, _ = robot.limits(robot.joint_names)
    angles = dict(zip(robot.joint_names, rng.uniform(low, high), strict=True))
    return np.array(robot.configuration(angles, base_rpy=rng.uniform(-0.5, 0.5, 3)))


def accuracy(robot: snakegen.Robot, entries: int, seed: int) -> None:
    """Prints the relative errors of random entries."""
    rng, errors, kinks = np.random.default_rng(seed), list[float](), 0
    while len(errors) < entries:
        q = posture(robot, rng)
        for kind in ("force", "torque"):
            found = margin_gradients(robot, q, kind, ties=False)
            by = found.by("joints")
            for i in rng.choice(len(by), 4, replace=False):
                moved = []
                for side in (STEP, -STEP):
                    at = q.copy()
                    at[7 + i] += side
                    moved.append(margin_gradients(robot, at, kind, ties=False))
                twists = [g.pieces[0].twist for g in (found, *moved)]
                size = np.abs(twists[0]).max()
                if max(np.abs(t - twists[0]).max() for t in twists) > 1e-2 * size:
                    kinks += 1  # another direction is the worst one on one side
                    continue
                difference = (moved[0].value - moved[1].value) / (2.0 * STEP)
                errors.append(abs(difference - by[i]) / np.abs(by).max())
                if len(errors) % SHOWN == 0 or len(errors) == entries:
                    _errors(np.array(errors), kinks)


def _errors(errors: np.ndarray, kinks: int) -> None:
    worst = np.sort(errors)
    print(
        f"{len(worst)} entries off kinks ({kinks} left out): relative error median "
        f"{np.median(worst):.1e}, 99 % {worst[int(0.99 * len(worst))]:.1e}, largest "
        f"{worst[-1]:.1e}, {np.mean(worst <= 1e-6):.2%} within 1e-6",
        flush=True,
    )


@dataclass
class Line:
    """The torque margin along a line of postures."""

    robot: snakegen.Robot
    start: np.ndarray
    way: np.ndarray

    def weakest(self, t: float) -> np.ndarray:
        """Returns the weakest twist at t (6,), N·m per N and N·m, of a certified search."""
        robot, q = self.robot, self.start + t * self.way
        hover = np.r_[robot.force_scale * robot.base_pose(q)[0][2], 0.0, 0.0, 0.0]
        found = set_margins(
            robot.force_sets(q), hover, wrench_starts=0, force_scale=robot.force_scale,
            torque_scale=robot.torque_scale,
        )  # fmt: skip
        twist = found.twists[2]
        return twist * robot.torque_scale / found.scale / np.linalg.norm(twist[3:])

    def piece(self, t: float, twist: np.ndarray) -> tuple[float, np.ndarray]:
        """Returns the value and the twist of the local optimum near a twist."""
        robot, q = self.robot, self.start + t * self.way
        sets, up = robot.force_sets(q), robot.base_pose(q)[0][2]
        scale = np.repeat([robot.force_scale, robot.torque_scale], 3)
        hover = np.r_[robot.force_scale * up, 0.0, 0.0, 0.0] / scale
        found = saddle.saddle_point(
            sets.stacked(scale)[0][0], sets.frames @ sets.spans, sets.low / scale[0],
            sets.high / scale[0], hover, UNIT["torque"], twist * scale / scale[3],
        )  # fmt: skip
        if not found.solved:
            raise ArithmeticError
        return found.value * scale[3], found.twist * scale[3] / scale

    def tie(self) -> float | None:
        """Returns t at which two worst directions tie; None where none is found."""
        low, high, first, last = 0.0, 0.5, self.weakest(0.0), self.weakest(0.5)
        if first[3:] @ last[3:] > APART:
            return None
        for _ in range(COARSE):
            middle = 0.5 * (low + high)
            now = self.weakest(middle)
            if first[3:] @ now[3:] > APART:
                low, first = middle, now
            else:
                high, last = middle, now
        if first[3:] @ last[3:] > APART:
            return None
        ends = np.array([low, high])
        gaps = []
        for t in ends:
            (a, first), (b, last) = self.piece(t, first), self.piece(t, last)
            gaps.append(a - b)
        for _ in range(FINE):
            if gaps[1] == gaps[0]:
                break
            t = ends[1] - gaps[1] * (ends[1] - ends[0]) / (gaps[1] - gaps[0])
            (a, first), (b, last) = self.piece(t, first), self.piece(t, last)
            ends, gaps = np.array([ends[1], t]), [gaps[1], a - b]
            if abs(gaps[1]) < 1e-13 * abs(a):
                break
        return float(ends[1])


def kinks(robot: snakegen.Robot, count: int, seed: int) -> None:
    """Prints how many slopes at kinks agree with the pieces."""
    rng, found, right, valid, lone = np.random.default_rng(seed), 0, 0, 0, 0
    while found < count:
        q, way = posture(robot, rng), np.zeros(robot.model.nq)
        way[7:] = rng.standard_normal(len(way) - 7)
        try:
            t = Line(robot, q, way).tie()
        except ArithmeticError:  # Newton's method lost a branch on the way
            continue
        if t is None:
            continue
        at = q + t * way
        g = margin_gradients(robot, at, "torque")
        if len(g.pieces) < 2:  # a third direction is worse than the two that tie
            lone += 1
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
        if found % SHOWN == 0 or found == count:
            print(
                f"{found} kinks ({lone} ties that are not the least left out): one-sided slope is "
                f"the least of the pieces' in {right}, no more than the subgradient's in {valid}",
                flush=True,
            )


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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--entries", type=int, default=10_000)
    parser.add_argument("--kinks", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-cost", action="store_true")
    options = parser.parse_args()
    machine = snakegen.load("dragon4")
    if not options.no_cost:
        cost(machine)
    if options.entries:
        accuracy(machine, options.entries, options.seed)
    if options.kinks:
        kinks(machine, options.kinks, options.seed + 1)
