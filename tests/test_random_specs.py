"""Random specs give clean URDFs."""

from typing import Any

import numpy as np
import pytest
from examples import EXAMPLES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from snakegen.linter import lint
from snakegen.robot.robot import from_urdf_text
from snakegen.spec.loading import load_spec
from snakegen.spec.urdf import urdf_text

_size = st.floats(0.05, 2.0, allow_nan=False)
_weight = st.floats(0.01, 20.0, allow_nan=False)
_text = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=20)


def _one_or_each(values: st.SearchStrategy[float], count: int) -> st.SearchStrategy[Any]:
    return st.one_of(values, st.lists(values, min_size=count, max_size=count))


@st.composite
def specs(draw: st.DrawFn) -> dict[str, Any]:
    """Draws a valid spec: any links, axes, places, one or two rotors, payloads, odd names."""
    n = draw(st.integers(1, 6))
    axes = st.lists(st.sampled_from(["roll", "pitch", "yaw"]), min_size=1, max_size=2, unique=True)
    spec: dict[str, Any] = {
        "name": draw(st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,10}", fullmatch=True)),
        "about": draw(_text).replace("${", "").replace("$(", ""),
        "base": draw(st.sampled_from(["floating", "fixed"])),
        "chain": {
            "links": n,
            "length": draw(_one_or_each(_size, n)),
            "mass": draw(_one_or_each(_weight, n)),
            "com": draw(_one_or_each(st.floats(0, 1), n)),
        },
        "joint": {
            "axes": draw(axes) if n == 1 else draw(st.lists(axes, min_size=n - 1, max_size=n - 1)),
            "gap": draw(st.floats(0, 0.1)),
        },
    }
    places = st.builds(
        lambda link, position: {"link": link, "position": position},
        st.integers(1, n),
        st.floats(0, 1),
    )
    if draw(st.booleans()):
        at = draw(st.lists(places, min_size=1, max_size=4))
        spec["vectoring_apparatus"] = {
            "at": at,
            "rotors": draw(_one_or_each(st.sampled_from([1, 2]), len(at))),
            "offset": draw(st.floats(-0.1, 0.1)),
            "spin": draw(st.sampled_from(["alternating", "same"])),
            "drag_ratio": draw(st.floats(0, 0.05)),
        }
    if draw(st.booleans()):
        at = draw(st.lists(places, min_size=1, max_size=2))
        spec["payload"] = {"at": at, "mass": draw(_one_or_each(_weight, len(at)))}
    return spec


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(specs())
def test_random_specs_give_clean_urdfs(data: dict[str, Any]) -> None:
    """A valid spec gives a URDF without errors that weighs what the spec says, in Pinocchio."""
    spec = load_spec(data)
    text = urdf_text(spec)
    assert [f for f in lint.lint(text) if f.severity == "error"] == []
    robot = from_urdf_text(text, None)
    resolved = spec.resolved()
    n, thrusters = spec.chain.links, resolved.get("vectoring_apparatus", {"at": []})
    joint = resolved["joint"]
    given = data.get("joint", {})
    crosses = []
    for i in range(n - 1):
        if len(joint["axes"][i]) > 1 or joint["gap"][i] > 0 or given.keys() & {"mass", "inertia"}:
            crosses.append(joint["mass"][i])
        else:
            assert joint["mass"][i] is None  # no body, and the resolved spec says so
    expected = sum(resolved["chain"]["mass"]) + sum(crosses)
    expected += sum(thrusters.get("roll_mass", [])) + sum(thrusters.get("pitch_mass", []))
    expected += sum(resolved.get("payload", {}).get("mass", []))
    if spec.base == "floating":
        assert robot.mass == pytest.approx(expected, rel=1e-9)
    assert len(robot.chain_joints) == sum(map(len, resolved["joint"]["axes"][: n - 1]))
    assert len(robot.rotors.body) == sum(thrusters.get("rotors", []))
    assert np.isfinite(robot.configuration()).all()
