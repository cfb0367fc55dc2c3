"""The page on margins: its example runs as printed, and gives what the definitions demand."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[1] / "docs/margins.md"


def test_the_example_for_any_robot_runs() -> None:
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    names: dict = {}
    with contextlib.redirect_stdout(io.StringIO()) as said:
        exec(compile(example, str(PAGE), "exec"), names)
    assert len(said.getvalue().splitlines()) >= 3
    m, v = names["m"], names["v"]
    assert m.rank == 6 and m.feasible and m.force > 0 and m.torque > 0
    assert m.directional(m.worst("force")) == pytest.approx(m.force, rel=1e-9)
    # equal limits, centroid at the CoG: exactly Ñ L - m g
    exact = 4 * 8.0 - names["weight"]
    assert v.closed and v.force_bounds[1] == pytest.approx(exact, rel=1e-9)
    assert exact * (1.0 - v.tolerance) <= v.force == v.force_bounds[0] <= exact
    assert v.directional([1, 0, 0, 0, 0, 0]) == pytest.approx(
        np.sqrt(32.0**2 - names["weight"] ** 2), rel=1e-6
    )
