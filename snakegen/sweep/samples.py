"""Which postures a sweep visits: grids, space-filling samples, walks, or a person's own table."""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.base.memory import refuse_beyond
from snakegen.base.number_table import NumberTable, read_number_table
from snakegen.errors import AnalysisError, near
from snakegen.robot.followers import refuse_followers
from snakegen.robot.robot import Robot

KINDS = ("sobol", "lhs", "random", "walk", "grid")
MOST = 50_000_000
_STEP = 0.05  # share of a joint's range that a walk moves at once


def chosen_joints(robot: Robot, names: str | None, held: Collection[str] = ()) -> tuple[str, ...]:
    """Returns the joints to sample: those named (comma-separated), or all that shape the body.

    Raises:
        AnalysisError: a joint that is unknown, a gimbal, named twice, or `held` as well; none left.
    """
    refuse_followers(robot.name, robot.followers, "a sweep")
    if not names:
        free = tuple(n for n in robot.chain_joints if n not in held)
        if robot.chain_joints and not free:
            raise AnalysisError(f"every joint of {robot.name} is held: none is left to vary.")
        return free
    out = tuple(n.strip() for n in names.split(","))
    for name in out:
        if name not in robot.joint_names:
            known = [n for n in robot.joint_names if n not in robot.gimbal_names]
            raise AnalysisError(f"{robot.name} has no joint '{name}' to vary.{near(name, known)}")
        if name in robot.gimbal_names:
            raise AnalysisError(f"'{name}' is a gimbal: a sweep points the gimbals up by itself.")
        if name in held:
            raise AnalysisError(f"'{name}' is held at an angle and cannot be varied too.")
    if len(set(out)) != len(out):
        raise AnalysisError(f"joints '{names}': a name stands twice.")
    return out


class Samples(ABC):
    """Postures of a sweep, drawn block by block in rising order, the same ones every time."""

    count: int

    @abstractmethod
    def blocks(self, size: int) -> Iterator[tuple[int, Floats]]:
        """Yields (index, (≤ size, k) rad) of all postures in blocks of `size`."""


@dataclass(frozen=True, eq=False)
class Table(Samples):
    """Postures that are held in memory."""

    angles: Floats  # (m, k) rad

    @property
    def count(self) -> int:  # type: ignore[override]
        """How many there are."""
        return len(self.angles)

    def blocks(self, size: int) -> Iterator[tuple[int, Floats]]:
        """Yields its rows in blocks of `size`."""
        for i in range(0, self.count, size):
            yield i // size, self.angles[i : i + size]


@dataclass(frozen=True, eq=False)
class Drawn(Samples):
    """Postures drawn from a seed as they are needed; the memory is that of one block."""

    kind: str
    count: int
    seed: int
    low: Floats  # (k,) rad
    high: Floats

    def blocks(self, size: int) -> Iterator[tuple[int, Floats]]:
        """Yields the postures in blocks of `size`; their values do not depend on it."""
        if self.kind == "grid":
            yield from enumerate(self._grid(size))
            return
        unit = {"walk": self._walk, "sobol": self._sobol}.get(self.kind, self._random)
        for index, rows in enumerate(unit(size)):
            yield index, self.low + (self.high - self.low) * rows

    def _sizes(self, size: int) -> Iterator[int]:
        for first in range(0, self.count, size):
            yield min(size, self.count - first)

    def _random(self, size: int) -> Iterator[Floats]:
        rng = np.random.default_rng(self.seed)
        for m in self._sizes(size):
            yield rng.uniform(size=(m, self.low.size))

    def _walk(self, size: int) -> Iterator[Floats]:
        rng, k = np.random.default_rng(self.seed), self.low.size
        # the start follows the steps in the generator's stream: they are drawn once for it alone
        for m in self._sizes(size):
            rng.normal(size=(m, k))
        at = rng.uniform(0.0, 1.0, k)
        rng = np.random.default_rng(self.seed)
        for i, m in enumerate(self._sizes(size)):
            steps = rng.normal(0.0, _STEP, (m, k))
            steps[0] = at if i == 0 else at + steps[0]
            path = np.cumsum(steps, axis=0)
            at = path[-1]
            yield np.abs((path + 1.0) % 2.0 - 1.0)  # reflection at 0 and 1

    def _sobol(self, size: int) -> Iterator[Floats]:
        from scipy.stats import qmc

        source = qmc.Sobol(self.low.size, rng=np.random.default_rng(self.seed))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a count that is no power of 2 is balanced less well
            for m in self._sizes(size):
                yield source.random(m)

    def _grid(self, size: int) -> Iterator[Floats]:
        k = self.low.size
        side = round(self.count ** (1.0 / k))
        at = np.linspace(self.low, self.high, side)
        for first in range(0, self.count, size):
            rows = np.arange(first, min(first + size, self.count))
            yield at[np.stack(np.unravel_index(rows, (side,) * k), axis=1), np.arange(k)]


def sampling(kind: str, count: int, seed: int, low: Floats, high: Floats) -> Samples:
    """Returns joint angles [rad] within [low, high], drawn as they are needed.

    Args:
        kind: "sobol" (scrambled), "lhs" (Latin hypercube), "random", "walk" (reflected at the
            limits), or "grid" (the same number of points along every joint, at most `count`).
        count: how many.
        seed: the same seed gives the same postures.
        low, high: (k,) rad.

    Raises:
        AnalysisError: an unknown kind, no samples, or more than 50 million; a Latin hypercube
            that does not fit into memory, which it needs whole.
    """
    if kind not in KINDS:
        raise AnalysisError(f"sampling '{kind}' is unknown.{near(kind, KINDS)}")
    if not 0 < count <= MOST:
        raise AnalysisError(f"--samples {count}: between 1 and {MOST} postures.")
    k = low.size
    if kind == "grid":
        side = int(np.floor(count ** (1.0 / k) + 1e-9))
        if side < 2:
            raise AnalysisError(f"--samples {count} is no grid: 2 points a joint need {2**k}.")
        count = side**k
    if kind == "lhs":
        from scipy.stats import qmc

        refuse_beyond(
            4.0 * 8 * count * k, f"a Latin hypercube of {count} postures", "'sobol' needs no memory"
        )
        unit = qmc.LatinHypercube(k, rng=np.random.default_rng(seed)).random(count)
        return Table(low + (high - low) * unit)
    return Drawn(kind, count, seed, low, high)


def draw(kind: str, count: int, seed: int, low: Floats, high: Floats) -> Floats:
    """Returns (m, k) joint angles [rad] within [low, high] at once; arguments as `sampling`."""
    return np.concatenate([rows for _, rows in sampling(kind, count, seed, low, high).blocks(4096)])


def read_postures(path: Path, joints: tuple[str, ...], low: Floats, high: Floats) -> Floats:
    """Returns postures (m, k) from the columns `joints` of a table.

    Raises:
        AnalysisError: as `read_number_table`, no rows, or an angle out of its joint's limits.
    """
    return postures_of(read_number_table(path), joints, low, high)


def postures_of(table: NumberTable, joints: tuple[str, ...], low: Floats, high: Floats) -> Floats:
    """Returns postures (m, k) from the columns `joints` of a table; errors as `read_postures`."""
    if len(table) == 0:
        raise AnalysisError(f"{table.name} has no rows.")
    values = table.stack(joints)
    out = (values < low - 1e-9) | (values > high + 1e-9)
    if out.any():
        row, column = np.argwhere(out)[0]
        name = joints[column]
        raise AnalysisError(
            f"{table.name}, {table.places[row]}: {name} = {values[row, column]:g} is outside the "
            f"joint's limits {low[column]:g} … {high[column]:g}."
        )
    return values
