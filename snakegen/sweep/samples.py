"""Which postures a sweep visits: grids, space-filling samples, walks, or a person's own table."""

from pathlib import Path

import numpy as np

from snakegen.errors import AnalysisError, near
from snakegen.geometry import Floats
from snakegen.robot import Robot

KINDS = ("sobol", "lhs", "random", "walk", "grid")
MOST = 50_000_000
_STEP = 0.05  # share of a joint's range that a walk moves at once


def chosen_joints(robot: Robot, names: str | None) -> tuple[str, ...]:
    """Returns the joints to sample: those named (comma-separated), or all that shape the body."""
    if not names:
        return robot.chain_joints
    out = tuple(n.strip() for n in names.split(","))
    for name in out:
        if name not in robot.joint_names:
            known = [n for n in robot.joint_names if n not in robot.gimbal_names]
            raise AnalysisError(f"{robot.name} has no joint '{name}' to vary.{near(name, known)}")
        if name in robot.gimbal_names:
            raise AnalysisError(f"'{name}' is a gimbal: a sweep points the gimbals up by itself.")
    if len(set(out)) != len(out):
        raise AnalysisError(f"joints '{names}': a name stands twice.")
    return out


def draw(kind: str, count: int, seed: int, low: Floats, high: Floats) -> Floats:
    """Returns (m, k) joint angles [rad] within [low, high].

    Args:
        kind: "sobol" (scrambled), "lhs" (Latin hypercube), "random", "walk" (reflected at the
            limits), or "grid" (the same number of points along every joint, at most `count`).
        count: how many.
        seed: the same seed gives the same postures.
        low, high: (k,) rad.

    Raises:
        AnalysisError: an unknown kind, no samples, or more than 50 million.
    """
    if kind not in KINDS:
        raise AnalysisError(f"sampling '{kind}' is unknown.{near(kind, KINDS)}")
    if not 0 < count <= MOST:
        raise AnalysisError(f"--samples {count}: between 1 and {MOST} postures.")
    k, span = low.size, high - low
    rng = np.random.default_rng(seed)
    if kind == "grid":
        side = int(np.floor(count ** (1.0 / k) + 1e-9))
        if side < 2:
            raise AnalysisError(f"--samples {count} is no grid: 2 points a joint need {2**k}.")
        axes = np.meshgrid(
            *(np.linspace(a, b, side) for a, b in zip(low, high, strict=True)), indexing="ij"
        )
        return np.stack([a.ravel() for a in axes], axis=1)
    if kind == "walk":
        steps = rng.normal(0.0, _STEP, (count, k))
        steps[0] = rng.uniform(0.0, 1.0, k)
        folded = np.abs((np.cumsum(steps, axis=0) + 1.0) % 2.0 - 1.0)  # reflection at 0 and 1
        return low + span * folded
    if kind == "random":
        return low + span * rng.uniform(size=(count, k))
    from scipy.stats import qmc

    if kind == "lhs":
        unit = qmc.LatinHypercube(k, rng=rng).random(count)
    else:
        power = int(np.ceil(np.log2(count)))
        unit = qmc.Sobol(k, rng=rng).random_base2(power)[:count]
    return low + span * unit


def read_table(path: Path, joints: tuple[str, ...], low: Floats, high: Floats) -> Floats:
    """Returns postures (m, k) from the columns `joints` of a CSV or Parquet file.

    Raises:
        AnalysisError: a file that cannot be read, no rows, a missing column, NaN, out of limits.
    """
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet

    try:
        if path.suffix.lower() == ".csv":
            table = pyarrow.csv.read_csv(path)
        else:
            table = pyarrow.parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise AnalysisError(f"{path}: cannot be read as CSV or Parquet ({reason}).") from None
    missing = [n for n in joints if n not in table.column_names]
    if missing:
        raise AnalysisError(
            f"{path.name} has no column '{missing[0]}'.{near(missing[0], table.column_names)} "
            "Name the joints that it has with --joints."
        )
    if table.num_rows == 0:
        raise AnalysisError(f"{path.name} has no rows.")
    try:
        values = np.stack([np.asarray(table[n], dtype=float) for n in joints], axis=1)
    except (TypeError, ValueError):
        raise AnalysisError(f"{path.name}: a column of angles holds text.") from None
    bad = ~np.isfinite(values)
    out = (values < low - 1e-9) | (values > high + 1e-9)
    for what, mask in (("is not a number", bad), ("is outside the joint's limits", out)):
        if mask.any():
            row, column = np.argwhere(mask)[0]
            raise AnalysisError(
                f"{path.name}, row {row + 1}: {joints[column]} = {values[row, column]:g} {what}."
            )
    return values
