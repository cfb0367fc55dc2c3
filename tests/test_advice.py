"""Warnings of a build: what a spec allows and its maker should know."""

import pytest

from snakegen.advice import warnings
from snakegen.robot import load
from snakegen.spec_file import load_spec, presets


@pytest.mark.parametrize("name", sorted(presets()))
def test_presets_earn_no_warning(name: str) -> None:
    assert warnings(load_spec(name)) == ()


def test_apparatuses_that_overlap_are_named() -> None:
    (found,) = warnings(load_spec("dragon4", apparatus="1@0.3,1@0.32,3,4"))
    assert "apparatuses 1 and 2 stand 0.0084 m apart on link 1" in found
    assert warnings(load_spec("dragon4", apparatus="1@0.2,1@0.8,3,4")) == ()


def test_too_heavy_says_both_forces_and_they_are_the_robots() -> None:
    spec = load_spec("dragon4", overrides=["chain.mass=5"])
    (found,) = warnings(spec)
    robot = load(spec)
    assert f"{robot.mass * 9.81:.1f} N of weight" in found
    assert f"{robot.rotors.thrust_max.sum():.1f} N of thrust" in found
