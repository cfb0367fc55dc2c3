"""The grammar: every mistake is one line that names the place and the remedy; specs round-trip."""

import json
import math
from pathlib import Path

import pytest
import yaml

from snakegen.errors import SpecError
from snakegen.robot.modules import from_urdf
from snakegen.spec.loading import load_spec, presets, save, schema
from snakegen.spec.robot_spec import RobotSpec
from snakegen.spec.urdf import expand, urdf_text

SMALL = {"name": "small", "chain": {"links": 3, "length": 0.4, "mass": 1.0}}

MISTAKES = [
    ("chain.lnks=6", "no field 'chain.lnks'. Did you mean 'chain.links'?"),
    ("chian.links=6", "no field 'chian'. Did you mean 'chain'?"),
    ("joint.servo.stifness=3", "Did you mean 'joint.servo.stiffness'?"),
    ("control.gain_sets.paper.force_x=1", "'control.gain_sets.paper.force_p'"),
    ("chain=3", "'chain' is a section; set chain.links, "),
    ("chain.links=0", "'chain.links': input should be greater than or equal to 1 (got 0)"),
    ("chain.links=2.5", "'chain.links'"),
    ("chain.links=true", "a number is needed, not true or false"),
    ("chain.links=1001", "'chain.links': input should be less than or equal to 1000"),
    ("chain.length=-1", "'chain.length': input should be greater than 0 (got -1)"),
    ("chain.length=.nan", "'chain.length': input should be a finite number"),
    ("chain.length=.inf", "'chain.length': input should be a finite number"),
    ("chain.length=[0.4, 0.4]", "chain.length: 2 entries for 4 links"),
    ("chain.length=[0.4, -2, 0.4, 0.4]", "'chain.length[2]'"),
    ("chain.length.2=0.3", "'chain.length' is the one value 0.42; set 'chain.length' as a whole"),
    ("chain.wall=0.5", "chain.wall: 0.5 m is more than the radius 0.0125 m"),
    ("chain.inertia=[1, 1, 9]", "at most the sum of the other two"),
    ("chain.inertia=[1, 1]", "'chain.inertia[1]': three numbers in a list are needed (got 1)"),
    ("joint.axes=[pitch, pitch]", "one axis, or two different ones"),
    ("joint.axes=[ptch]", "input should be 'roll', 'pitch' or 'yaw' (got 'ptch')"),
    ("joint.lower=2", "joint.lower: 2.0 is not below joint.upper 1.65 (joint 1)"),
    ("joint.gap=[0.1, 0.1]", "joint.gap: 2 entries for 3 joints"),
    ("base=flying", "base: floating or fixed is needed (got 'flying')"),
    ("base=wall", "(got 'wall'); of a fixed one, write base.pose: wall."),
    ("base=Floor", "write base.pose: stand."),
    ("base.kind=wall", "base.kind: fixed is needed where a pose, rpy or height is given"),
    ("base={pose: floor}", "vertical or any is needed (got 'floor'); try 'stand'."),
    ("base.pose=wall", "base.kind: fixed is needed where a pose, rpy or height is given"),
    ("base={pose: roof}", "base.pose: stand, wall, ceiling, vertical or any is needed"),
    ("base={pose: any}", "base.rpy: pose any needs it"),
    ("base={pose: wall, rpy: [0, 1, 0]}", "base.rpy: pose wall has its own"),
    ("base={height: -1}", "'base.height': input should be greater than or equal to 0"),
    ("name=", "'name': input should be a valid string"),
    ("name=../up", "'name'"),
    ("vectoring_apparatus.at=9", "link 9 does not exist; the chain has 1…4"),
    ("vectoring_apparatus.at=0", "link 0 does not exist; links count from 1"),
    ("vectoring_apparatus.at=1@2", "'1@2' is off its link"),
    ("vectoring_apparatus.at=tail", "'tail' is no place; write a link number, or link@position"),
    ("vectoring_apparatus.at=[]", "empty; name a link, or leave the section out"),
    ("vectoring_apparatus.at=[{link: 1, psition: 0.3}]", "at[1].psition'. Did you mean"),
    ("vectoring_apparatus.thrust_min=20", "20.0 N is not below thrust_max 16.0 N"),
    ("vectoring_apparatus.rotors=3", "input should be 1 or 2 (got 3)"),
    ("vectoring_apparatus.spin=[[1, -1]]", "vectoring_apparatus.spin: 1 entries for 4 apparatuses"),
    ("vectoring_apparatus.spin=[[1],[1],[1],[1]]", "1 spins for 2 rotors"),
    ("control.gains=best", "gains must be one of paper (got 'best')"),
    ("payload.mass=1", "'payload.at' is needed"),
    ("nonsense", "write path=value"),
    ("chain.length=[1", "line 1: not YAML"),
    ("chain.length=!!python/name:os.system", "is not allowed; use plain values"),
    ("chain.length=!degrees 3", "is not allowed; use plain values"),
    ("about=&a x", "anchors and aliases"),
    ("about=*a", "anchors and aliases"),
    ("about='${1+1}'", "'${' is not allowed: a spec is data, not code"),
    ("about='$(arg spec)'", "'$(' is not allowed: a spec is data, not code"),
    ("control.gain_sets.${x}.force_p=[1, 1, 1]", "'${' in 'control.gain_sets' is not allowed"),
    ("${x}=1", "'${' is not allowed"),
    ("plant={thrust_mismatch: 0.1, thrust_mismatch: 0.2}", "'thrust_mismatch' stands twice"),
    ("plant={1: 2}", "key 1 is not a name"),
]


@pytest.mark.parametrize(("override", "expected"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_mistakes_are_one_line(override: str, expected: str) -> None:
    """Each mistake names its place and what works, on one line without pydantic's words."""
    with pytest.raises(SpecError) as caught:
        load_spec("dragon4", overrides=[override])
    message = str(caught.value)
    assert expected in message
    assert "\n" not in message and len(message) < 400
    assert "pydantic" not in message and "Value error" not in message


def test_unknown_sources(tmp_path: Path) -> None:
    """A preset that is nearly right is suggested; a missing file and a list are refused."""
    with pytest.raises(SpecError, match=r"no preset and no file 'dragn4'.*Did you mean 'dragon4'"):
        load_spec("dragn4")
    with pytest.raises(SpecError, match=r"no such file"):
        load_spec(tmp_path / "none.yaml")
    with pytest.raises(SpecError, match=r"a spec is a mapping"):
        load_spec(_file(tmp_path, "- 1\n- 2\n"))
    with pytest.raises(SpecError, match=r"cannot be read as UTF-8"):
        path = tmp_path / "bytes.yaml"
        path.write_bytes(b"\xff\xfe\x00name")
        load_spec(path)
    with pytest.raises(SpecError, match=r"line 2: .*anchors"):
        load_spec(_file(tmp_path, "name: a\nchain: &c {links: 2}\n"))
    with pytest.raises(SpecError, match=r"'chain' is needed"):
        load_spec(_file(tmp_path, "name: a\n"))
    with pytest.raises(SpecError, match=r"nested too deeply"):
        load_spec(_file(tmp_path, "[" * 5000))


def _file(folder: Path, text: str) -> Path:
    path = folder / "spec.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_overrides_reach_every_depth() -> None:
    """Sections, list entries (from 1), links and apparatus can be replaced."""
    spec = load_spec(
        "dragon3", overrides=["chain.length.3=0.3", "control.gain_sets.tuned.torque_p.1=31"]
    )
    assert spec.chain.length == [0.40, 0.40, 0.3]
    assert spec.control.gain_sets["tuned"].torque_p == (31.0, 18.0, 10.0)
    spec = load_spec("dragon4", links=6, apparatus="1,3@0.25,3@0.75")
    at = spec.resolved()["vectoring_apparatus"]["at"]
    assert [(p["link"], p["position"]) for p in at] == [(1, 0.5), (3, 0.25), (3, 0.75)]
    with pytest.raises(SpecError, match=r"chain.length: 3 entries for 5 links"):
        load_spec("dragon3", links=5)


def test_apparatuses_count_from_the_root() -> None:
    """However listed, apparatuses are ordered by link, then position, with their values."""
    spec = load_spec(
        "dragon4",
        overrides=[
            "vectoring_apparatus.at=[3, 1@0.8, 1@0.2]",
            "vectoring_apparatus.thrust_max=[30, 10, 20]",
            "vectoring_apparatus.spin=[[1, -1], [-1, 1], [1, 1]]",
        ],
    )
    part = spec.resolved()["vectoring_apparatus"]
    assert part["thrust_max"] == [20, 10, 30]
    assert part["spin"] == [[1, 1], [-1, 1], [1, -1]]
    found = from_urdf(urdf_text(spec))
    assert found is not None
    assert [a.rotors[0].thrust_max for a in found.apparatuses] == [20, 10, 30]
    assert [a.link for a in found.apparatuses] == ["link1", "link1", "link3"]


def test_alternating_spins() -> None:
    """(+,−) on odd and (−,+) on even apparatuses; the URDF's drag ratio has the body's sign −κs."""
    found = from_urdf(urdf_text(load_spec("dragon4")))
    assert found is not None
    signs = [[-math.copysign(1, r.drag_ratio) for r in a.rotors] for a in found.apparatuses]
    assert signs == [[1, -1], [-1, 1], [1, -1], [-1, 1]]


@pytest.mark.parametrize("name", sorted(presets()))
def test_resolved_is_a_spec_and_stable(name: str, tmp_path: Path) -> None:
    """Resolving again changes nothing; the resolved file builds the same URDF body."""
    spec = load_spec(name)
    once = spec.resolved()
    again = RobotSpec.model_validate(json.loads(json.dumps(once)))
    assert again.resolved() == once
    assert urdf_text(again) == urdf_text(spec)


@pytest.mark.parametrize("name", sorted(presets()))
def test_saved_specs_load_back_equal(name: str, tmp_path: Path) -> None:
    """`--save-spec` writes what was given, overrides included, and no defaults."""
    spec = load_spec(name, overrides=["plant.delay=0.02", 'about="an arm & a <leg>: mixed"'])
    save(spec, tmp_path / "saved.yaml")
    back = load_spec(tmp_path / "saved.yaml")
    assert back == spec
    assert back.resolved() == spec.resolved()
    written = yaml.safe_load((tmp_path / "saved.yaml").read_text(encoding="utf-8"))
    given = yaml.safe_load(presets()[name].read_text(encoding="utf-8"))
    assert set(written) == set(given) | {"plant"}
    assert set(written["plant"]) == set(given.get("plant", {})) | {"delay"}


def test_code_in_a_spec_never_runs(tmp_path: Path) -> None:
    """Text that xacro would run is refused by file, mapping, RobotSpec and templates alike."""
    trap = tmp_path / "ran"
    code = f"${{open('{trap}', 'w').close()}}"
    for data in (
        SMALL | {"about": code},
        SMALL | {"control": {"gain_sets": {code: {}, "paper": {}}}},
        SMALL | {"joint": {"axes": [code]}},
    ):
        with pytest.raises(SpecError, match=r"not allowed"):
            load_spec(data)
        with pytest.raises(SpecError, match=r"not allowed"):
            load_spec(_file(tmp_path, yaml.safe_dump(data)))
        with pytest.raises(ValueError, match=r"not allowed"):
            RobotSpec.model_validate(data)
    resolved = load_spec(SMALL).resolved() | {"about": code}
    with pytest.raises(SpecError, match=r"not allowed"):
        expand(_file(tmp_path, yaml.safe_dump(resolved)))
    assert not trap.exists()


def test_schema_is_the_grammar() -> None:
    """The JSON Schema names every section, and refuses unknown fields as the reader does."""
    found = json.loads(schema())
    assert set(found["properties"]) == set(RobotSpec.model_fields)
    assert found["additionalProperties"] is False
    assert found["$defs"]["Chain"]["additionalProperties"] is False


# --- random specs -------------------------------------------------------------------------------


def test_a_changed_spec_has_a_folder_of_its_own() -> None:
    """What overrides change does not write over the folder of the preset."""
    for overrides, name in (
        ({}, "dragon4"),
        ({"links": 4}, "dragon4"),  # as it is
        ({"links": 6}, "dragon4-links6"),
        ({"links": 6, "apparatus": "1,3,5@0.3"}, "dragon4-links6-apparatus1-3-5@0.3"),
        ({"overrides": ["chain.mass=2.5"]}, "dragon4-chain.mass2.5"),
        ({"overrides": ["name=six", "chain.mass=2.5"]}, "six-chain.mass2.5"),
    ):
        assert load_spec("dragon4", **overrides).variant == name
    six = load_spec("dragon4", links=6)
    assert load_spec(six) is six
    assert load_spec(six, overrides=["chain.mass=3"]).variant == "dragon4-links6-chain.mass3"
    long = [f"chain.mass=[{m}, 2, 2, 2]" for m in (2.001, 2.002)]
    names = {
        load_spec("dragon4", overrides=[text, "plant.delay=0.0123456789"]).variant for text in long
    }
    assert len(names) == 2 and all(len(n) <= 60 for n in names)
