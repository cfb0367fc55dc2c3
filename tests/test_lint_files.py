"""Lint of whole files: entities, deep nesting, unreadable ones, other tags, random sound chains."""

from pathlib import Path

import pytest
from clean_urdf import GOOD
from hypothesis import given, settings
from hypothesis import strategies as st

from snakegen.errors import DescriptionError
from snakegen.linter.lint import check, lint


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rod.stl").write_bytes(b"mesh")
    (tmp_path / "good.urdf").write_text(GOOD, encoding="utf-8")
    return tmp_path


def test_entities_are_refused() -> None:
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12)
    )
    (finding,) = lint(f'<?xml version="1.0"?>\n{bomb}]><robot name="&m;"/>')
    assert (finding.code, finding.line) == ("doctype", 2)
    (finding,) = lint('<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot name="x"/>')
    assert finding.code == "doctype"
    (finding,) = lint('<robot name="&a;"/>')
    assert finding.code == "malformed_xml"


def test_deep_nesting_is_no_trap() -> None:
    (finding,) = lint('<robot name="x"><link name="a"/>' + "<gazebo>" * 50_000)
    assert finding.code == "malformed_xml"
    text = "<robot name='x'><link name='a'/>" + "<gazebo>" * 50_000 + "</gazebo>" * 50_000
    assert [f.code for f in lint(text + "</robot>")] == ["no_mass"]


def test_unreadable_files(tmp_path: Path) -> None:
    (tmp_path / "bin.urdf").write_bytes(b"\x1f\x8b packed")
    for path in (tmp_path / "gone.urdf", tmp_path, tmp_path / "bin.urdf"):
        (finding,) = lint(path)
        assert (finding.severity, finding.code) == ("error", "unreadable")
    with pytest.raises(DescriptionError, match=r"gone\.urdf: line 1: cannot be read"):
        check(tmp_path / "gone.urdf")


def test_check_counts_the_others(folder: Path) -> None:
    text = GOOD.replace('value="1.2"', 'value="-1"').replace('xyz="0 0 1"', 'xyz="0 0 0"')
    with pytest.raises(DescriptionError, match=r"line 8, link 'link1'.*\(and 1 more error\)"):
        check(text)


def test_foreign_tags_can_be_allowed() -> None:
    text = GOOD.replace("<gazebo ", "<loop_joint/><gazebo ")
    assert [f.code for f in lint(text)] == ["unknown_tag"]
    assert lint(text, extensions=["loop_joint"]) == []


sizes = st.floats(1e-3, 10)


@st.composite
def chains(draw: st.DrawFn) -> str:
    """A random sound chain: inertias are those of solid boxes, axes are unit vectors."""
    count = draw(st.integers(1, 6))
    parts = []
    for i in range(count):
        mass, (a, b, c) = draw(sizes), draw(st.tuples(sizes, sizes, sizes))
        xx, yy, zz = (mass / 12 * s for s in (b * b + c * c, a * a + c * c, a * a + b * b))
        parts.append(
            f'<link name="l{i}"><inertial><mass value="{mass!r}"/><inertia ixx="{xx!r}" ixy="0" '
            f'ixz="0" iyy="{yy!r}" iyz="0" izz="{zz!r}"/></inertial><visual><geometry>'
            f'<box size="{a!r} {b!r} {c!r}"/></geometry></visual></link>'
        )
    for i in range(1, count):
        kind = draw(st.sampled_from(["revolute", "prismatic", "continuous", "fixed", "floating"]))
        x, y, z = draw(st.sampled_from([(1, 0, 0), (0, -1, 0), (0, 0, 1), (0.6, 0, -0.8)]))
        low = draw(st.floats(-3, 3))
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{draw(st.integers(0, i - 1))}"/>'
            f'<child link="l{i}"/><axis xyz="{x} {y} {z}"/><limit lower="{low!r}" '
            f'upper="{low + draw(sizes)!r}" effort="{draw(sizes)!r}" velocity="{draw(sizes)!r}"/>'
            "</joint>"
        )
    order = draw(st.permutations(parts))
    return f'<robot name="r">{"".join(order)}</robot>'


@settings(max_examples=100, deadline=None)
@given(chains())
def test_sound_chains_have_no_errors(text: str) -> None:
    assert [f for f in lint(text) if f.severity == "error"] == []
