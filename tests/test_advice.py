"""Warnings of a build: what a spec allows and its maker should know."""

from xml.etree import ElementTree

import numpy as np
import pytest

from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec, presets
from snakegen.spec.urdf import urdf_text
from snakegen.spec.warnings import warnings


@pytest.mark.parametrize("name", sorted(presets()))
def test_presets_earn_no_warning(name: str) -> None:
    assert warnings(load_spec(name)) == ()


def test_apparatuses_that_overlap_are_named() -> None:
    (found,) = warnings(load_spec("dragon4", apparatus="1@0.3,1@0.32,3,4"))
    assert "apparatuses 1 and 2 stand 0.0084 m apart on link 1" in found
    assert warnings(load_spec("dragon4", apparatus="1@0.2,1@0.8,3,4")) == ()


def test_too_heavy_says_both_forces_and_they_are_the_robots() -> None:
    spec = load_spec("dragon4", overrides=["chain.mass=5"])
    scaled, found = warnings(spec)
    assert scaled.startswith("chain.inertia: scaled")
    robot = load(spec)
    assert f"{robot.mass * 9.81:.1f} N of weight" in found
    assert f"{robot.rotors.thrust_max.sum():.1f} N of thrust" in found


OFF = {
    "joint.upper=90": "joint.upper: 90 rad are 14.3 turns; degrees? 90° are 1.571 rad",
    "joint.lower=-90": "joint.lower: -90 rad",
    "vectoring_apparatus.roll_limit=180": "roll_limit: 180 rad are 28.6 turns; degrees?",
    "vectoring_apparatus.pitch_limit=90": "pitch_limit: 90 rad",
    "chain.length=420": "chain.length: 420 m; millimetres?",
    "chain.length=0.0004": "chain.length: 0.0004 m; metres are meant",
    "vectoring_apparatus.offset=37": "vectoring_apparatus.offset: 37 m; millimetres?",
    "chain.radius=0.25": "chain.radius: 0.25 m is more than half the length of 0.42 m",
    "vectoring_apparatus.drag_ratio=12.5": "drag_ratio: 12.5 m; millimetres?",
    "vectoring_apparatus.separation=0.06": "separation: 0.06 m between the rotors of apparatuses "
    "1, 2, 3 and 4 on link1, link2, link3, link4 is less than their diameter, 0.07 m",
}


@pytest.mark.parametrize("override", OFF)
def test_sizes_off_by_orders_say_field_value_and_what_was_meant(override: str) -> None:
    found = warnings(load_spec("dragon4", overrides=[override]))
    assert any(OFF[override] in text for text in found), found


def test_each_value_is_warned_of_once() -> None:
    found = warnings(load_spec("dragon4", overrides=["joint.upper=[90,90,1.5]"]))
    assert [text.split(":")[0] for text in found] == ["joint.lower", "joint.upper"]


LONE = ["vectoring_apparatus.rotors=1", "vectoring_apparatus.thrust_max=40"]


def test_one_rotor_clears_its_link_unless_told_otherwise() -> None:
    spec = load_spec("dragon4", overrides=[*LONE, "vectoring_apparatus.offset=null"])
    assert warnings(spec) == ()
    (offset,) = set(spec.resolved()["vectoring_apparatus"]["offset"])
    duct, module = 0.07 * np.hypot(0.5, 0.35), 1.9 * 0.0125  # its half diagonal; on the axis
    assert -offset - duct > module > -offset - 1.02 * duct
    (inside,) = warnings(load_spec("dragon4", overrides=LONE))
    assert (
        "3 and 4 on link1, link2, link3, link4, at 0.037 m, stands inside its own link's" in inside
    )
    (above,) = warnings(load_spec("dragon4", overrides=[*LONE, "vectoring_apparatus.offset=0.08"]))
    assert "at 0.08 m, blows on its own link" in above


def test_the_ducts_of_a_lone_rotor_and_its_module_are_apart_at_every_pitch() -> None:
    """The solids as the URDF has them, sampled: no point of the duct is in the roll module."""
    spec = load_spec("dragon4", overrides=[*LONE, "vectoring_apparatus.offset=null"])
    text = ElementTree.fromstring(urdf_text(spec))

    def solid(link: str) -> tuple[float, float]:
        (found,) = text.findall(f"link[@name='{link}']/collision/geometry/cylinder")
        return float(found.get("radius", "")), float(found.get("length", ""))

    height = text.find("joint[@name='gimbal1_pitch']/origin")
    assert height is not None
    up = float(height.get("xyz", "").split()[2])
    (radius, tall), (module, _) = solid("gimbal1_pitch_module"), solid("gimbal1_roll_module")
    corners = np.array([[x, z] for x in (-radius, radius) for z in (-tall / 2, tall / 2)])
    for angle in np.linspace(-np.pi, np.pi, 721):
        z = up - np.sin(angle) * corners[:, 0] + np.cos(angle) * corners[:, 1]
        assert z.max() < -module


def test_one_axis_joints_carry_what_the_spec_says() -> None:
    chain = {"links": 3, "length": 0.3, "mass": 1.0}
    bare = load_spec({"name": "bare", "chain": chain, "joint": {"axes": ["yaw"]}})
    assert bare.resolved()["joint"]["mass"] == [None, None]
    assert bare.resolved()["joint"]["inertia"] == [None, None]
    assert load(bare).mass == pytest.approx(3.0)
    heavy = {"axes": ["yaw"], "mass": [0.2, None], "gap": [0.04, 0.0]}
    robot = load(load_spec({"name": "heavy", "chain": chain, "joint": heavy}))
    assert robot.mass == pytest.approx(3.2)
    assert robot.tree.translation[1:, 0] == pytest.approx([0.34, 0.3])
    wide = load_spec({"name": "wide", "chain": chain, "joint": {"axes": ["yaw"], "gap": 0.05}})
    assert load(wide).mass == pytest.approx(3.2)  # what bridges a gap weighs 0.1 kg unless told
