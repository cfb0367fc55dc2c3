"""The <snakegen> element is checked as a spec is: one line, with element, attribute and line."""

from pathlib import Path

import pytest

from snakegen.errors import DescriptionError
from snakegen.robot.modules import from_urdf
from snakegen.robot.modules_file import from_file
from snakegen.robot.robot import from_urdf_text, load

URDF = """<robot name="drone">
  <link name="base"/>
  <snakegen version="1" base="floating">
    <link name="base" length="0.4"/>
    <servo joint="tilt" stiffness="100.0"/>
    <vectoring_apparatus link="base" roll="tilt">
      <rotor link="r1" thrust_min="0.0" thrust_max="16.0" drag_ratio="-0.01"/>
      <rotor link="r2" thrust_min="-4" thrust_max="16.0" drag_ratio="0.01" axis="0 0 -2"/>
    </vectoring_apparatus>
    <screw_drive joint="s" link="base" alpha="0.7" radius="0.08" blades="6"/>
    <caster link="c"/>
    <control mode="dual_rotor" gains="soft">
      <gains name="soft" force_p="1 2 3" vectoring_roll="1 1"/>
    </control>
    <plant downwash="0" delay="0.005"><uncertainty mass="0.1"/></plant>
  </snakegen>
</robot>
"""
FAULTS = [
    ('thrust_max="16.0"', 'thrust_max="nan"', "line 7: <rotor thrust_max='nan'>: a finite"),
    ('thrust_max="16.0"', 'thrust_max="1e400"', "line 7: <rotor thrust_max='1e400'>: a finite"),
    ('thrust_max="16.0"', 'thrust_max="-5"', "line 7: <rotor thrust_max='-5'>: more than 0"),
    ('thrust_max="16.0"', 'thrust_max="five"', "line 7: .*'five'>: a number"),
    ('thrust_min="0.0"', 'thrust_min="16"', "line 7: .*thrust_min='16'.*below max"),
    ('thrust_min="0.0" ', "", "line 7: <rotor> needs 'thrust_min'"),
    ('drag_ratio="-0.01"', 'drag="1"', "line 7: <rotor> needs 'drag_ratio'"),
    ('axis="0 0 -2"', 'axis="0 1"', "line 8: .*three numbers"),
    ('axis="0 0 -2"', 'axis="0 0 0"', "line 8: .*three numbers"),
    ('axis="0 0 -2"', 'spin="3"', "line 8: <rotor spin='3'>: 1, -1 or 0"),
    ('link="r2"', 'link="r1"', "line 8: .*line 7 has that name"),
    ('roll="tilt"', 'rol="tilt"', "line 6: .*has no attribute 'rol'. Did you mean 'roll'"),
    ('length="0.4"', 'length="0"', "line 4: <link length='0'>: more than 0"),
    ('stiffness="100.0"', 'stiffness="-1"', "line 5: <servo stiffness='-1'>: 0 or more"),
    ('blades="6"', 'blades="6.5"', "line 10: <screw_drive blades='6.5'>: a whole number"),
    ('blades="6"', 'blades="100000"', "line 10: .*1 to 64"),
    ('blades="6"', 'rollers="square"', "line 10: .*one of helix_capsule"),
    ('mode="dual_rotor"', 'mode="magic"', "line 12: <control mode='magic'>"),
    ('gains="soft"', 'gains="hard"', "line 12: .*must be one of .*got 'hard'"),
    ('force_p="1 2 3"', 'force_p="1 2"', "line 13: <gains force_p='1 2'>"),
    ('force_p="1 2 3"', 'force_q="1 2 3"', "line 13: <gains> has no attribute 'force_q'"),
    ('force_p="1 2 3"', 'force_p="1 2 inf"', "line 13: <gains force_p='1 2 inf'>: .*finite"),
    ('downwash="0"', 'downwsh="0"', "line 15: <plant> has no attribute 'downwsh'. Did you"),
    ('downwash="0"', 'downwash="2"', "line 15: <plant downwash='2'>"),
    ('delay="0.005"', 'delay="-1"', "line 15: <plant delay='-1'>"),
    ('mass="0.1"', 'mass="1.5"', "line 15: <uncertainty mass='1.5'>"),
    ("<caster", "<castor", "line 11: <castor> is not known in <snakegen>. Did you mean 'caster'"),
    ('version="1"', 'version="7"', "line 3: version '7'"),
    ('base="floating"', 'base="flying"', "line 3: base='flying'"),
    ("</robot>", '<snakegen version="1"/></robot>', "line 17: a second <snakegen>"),
]


def test_a_sound_element_is_read() -> None:
    found = from_urdf(URDF)
    assert found is not None and found.floating and found.lengths == {"base": 0.4}
    first, second = found.apparatuses[0].rotors
    assert (first.thrust_max, first.axis) == (16.0, (0.0, 0.0, 1.0))
    assert (second.thrust_min, second.axis) == (-4.0, (0.0, 0.0, -1.0))
    assert found.gain_sets["soft"]["force_p"] == (1.0, 2.0, 3.0)
    assert found.plant == {"downwash": 0.0, "delay": 0.005} and found.screws[0].blades == 6


@pytest.mark.parametrize(("good", "bad", "says"), FAULTS, ids=lambda text: str(text)[:24])
def test_a_mistake_is_one_line_with_its_place(good: str, bad: str, says: str) -> None:
    assert good in URDF
    with pytest.raises(DescriptionError, match=f"^<snakegen>, {says}") as caught:
        from_urdf(URDF.replace(good, bad, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("element", ["rotor", "vectoring_apparatus", "servo", "gains"])
def test_counts_are_limited(element: str) -> None:
    one = {
        "rotor": '<rotor link="x{}" thrust_min="0" thrust_max="1" drag_ratio="0"/>',
        "vectoring_apparatus": "<vectoring_apparatus/>",
        "servo": '<servo joint="x{}"/>',
        "gains": '<gains name="x{}"/>',
    }[element]
    before = {"rotor": "</vectoring_apparatus>", "gains": "</control>"}.get(element, "</snakegen>")
    many = "".join(one.format(i) for i in range(10_001))
    with pytest.raises(DescriptionError, match=rf"line \d+: 1000\d <{element}> elements; at most"):
        from_urdf(URDF.replace(before, many + before, 1))


def test_lists_of_a_modules_file_are_limited(tmp_path: Path) -> None:
    path = tmp_path / "modules.yaml"
    rotors = "\n".join(f"  - {{rotors: [{{link: r{i}, thrust_max: 1}}]}}" for i in range(2001))
    path.write_text(f"floating_root: base\napparatuses:\n{rotors}\n")
    with pytest.raises(DescriptionError, match="'apparatuses' has 2001 entries; at most 2000"):
        from_file(path, "base")


def test_a_robot_whose_element_is_wrong_is_refused() -> None:
    text = load("dragon4").urdf
    line = text[: text.index('thrust_max="16.0"')].count("\n") + 1
    with pytest.raises(DescriptionError, match=f"line {line}: <rotor thrust_max='nan'>"):
        from_urdf_text(text.replace('thrust_max="16.0"', 'thrust_max="nan"', 1), None)
