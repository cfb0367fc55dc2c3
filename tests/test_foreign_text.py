"""Files as other people save them: encodings, blanks, prefixes, endings, folders that hold them."""

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import snakegen
from snakegen.cli import cli
from snakegen.errors import SnakegenError
from snakegen.linter.lint import lint
from snakegen.linter.xml_text import conforming, decode_xml

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" '
    'izz="0.01"/></inertial>'
)


def arm(
    *,
    head: str = "",
    root: str = '<robot name="arm">',
    tip: str = "tip",
    origin: str = "0 0 0.1",
    extra: str = "",
) -> str:
    return (
        f'{head}{root}\n<link name="base">{INERTIAL}</link>\n<link name="{tip}">{INERTIAL}</link>\n'
        f'<joint name="j" type="revolute"><origin xyz="{origin}"/><parent link="base"/>'
        f'<child link="{tip}"/><axis xyz="0 1 0"/>'
        f'<limit lower="-1" upper="1" effort="9" velocity="3"/></joint>\n{extra}</robot>\n'
    )


def codes(path: Path) -> list[str]:
    return [f.code for f in lint(path) if f.severity != "note"]


@pytest.mark.parametrize(
    ("encoding", "declared", "called"),
    [
        ("utf-16", ' encoding="UTF-16"', "UTF-16"),
        ("utf-16-le", "", "UTF-16-LE"),
        ("utf-32", ' encoding="UTF-32"', "UTF-32"),
        ("latin-1", ' encoding="ISO-8859-1"', "ISO-8859-1"),
        ("latin-1", "", "ISO-8859-1"),
        ("latin-1", ' encoding="UTF-8"', "ISO-8859-1"),
        ("cp1251", ' encoding="windows-1251"', "CP1251"),
    ],
)
def test_other_encodings_are_read_named_and_mended(
    encoding: str, declared: str, called: str, tmp_path: Path
) -> None:
    tip = "рука" if encoding == "cp1251" else "Öse"
    path = tmp_path / "arm.urdf"
    text = arm(head=f'<?xml version="1.0"{declared}?>\n', tip=tip)
    path.write_bytes(text.encode(encoding))
    (found,) = [f for f in lint(path) if f.severity != "note"]
    assert (found.code, found.message) == ("foreign_encoding", f"its text is {called}, not UTF-8")
    assert tip in snakegen.load(path).urdf
    made = snakegen.convert(path, tmp_path / "out")
    assert snakegen.compare(path, made.mjcf).same and tip in made.urdf.read_text(encoding="utf-8")
    done = CliRunner().invoke(cli, ["lint", str(path), "--fix"])
    assert f"saved as UTF-8; it was {called}" in done.output
    assert codes(path) == [] and tip in path.read_text(encoding="utf-8")
    assert "encoding" not in path.read_text(encoding="utf-8") or 'encoding="UTF-8"' in (
        path.read_text(encoding="utf-8")
    )


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x1f\x8b\x08rest", "compressed .gzip.; unpack it first"),
        (b"PK\x03\x04rest", "compressed .zip.; unpack it first"),
        (b"", "the file is empty"),
        (b" \n\t", "the file is empty"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "run git lfs pull"),
        (b"<!DOCTYPE html>\n<html><body>404</body></html>", "a page of HTML"),
        (b'{"robot": 1}', "does not begin with '<'"),
        (b"\xff\xfe\x3c\xd8\x00", "is no UTF-16"),
    ],
)
def test_what_is_no_description_is_called_what_it_is(
    data: bytes, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.urdf"
    path.write_bytes(data)
    (found,) = [f for f in lint(path) if f.severity == "error"]
    assert found.code == "unreadable"
    for call in (snakegen.load, snakegen.convert, snakegen.adopt):
        with pytest.raises(SnakegenError, match=words):
            call(path)


PREFIXES = [
    '<gazebo><sensor:camera name="c"><x/></sensor:camera></gazebo>',
    '<gazebo xacro:macro="1"/>',
    '<gazebo xmlns:a="u"><a:x/></gazebo><gazebo><a:y b:z="1"/></gazebo>',
]


@pytest.mark.parametrize("extra", PREFIXES)
@pytest.mark.parametrize("root", ['<robot name="arm">', '<robot xmlns:xi="http://x" name="arm">'])
def test_prefixes_that_nobody_declared_are_warned_of_and_read(
    extra: str, root: str, tmp_path: Path
) -> None:
    path = tmp_path / "arm.urdf"
    head = '<?xml version="1.0"?>\n<!-- <robot name="no"> é -->\n'
    path.write_text(arm(head=head, root=root, extra=extra), encoding="utf-8")
    assert set(codes(path)) == {"undeclared_prefix"}
    made = snakegen.convert(path, tmp_path / "out")
    assert snakegen.compare(path, made.mjcf).same


@pytest.mark.parametrize("space", ['xmlns="http://www.ros.org"', "xmlns='http://ros'"])
def test_a_default_namespace_is_noted_and_read(space: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(arm(root=f'<robot {space} name="arm">'), encoding="utf-8")
    assert [f.code for f in lint(path)] == ["default_namespace"]
    assert snakegen.convert(path, tmp_path / "out").equivalence.worst < 1e-9


@pytest.mark.parametrize("origin", ["0\t0\t0.1", "\n   0 0\n   0.1\n", "0 0 0.1\r\n"])
def test_vectors_over_several_lines_are_read_and_mended(origin: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_bytes(arm(origin=origin).encode())
    assert codes(path) == ["attribute_blanks"]
    robot = snakegen.load(path)
    assert robot.model.jointPlacements[1].translation[2] == 0.1
    done = CliRunner().invoke(cli, ["lint", str(path), "--fix"])
    assert "on one line" in done.output and codes(path) == []
    assert 'xyz="0 0 0.1"' in path.read_text()


def test_conforming_text_is_left_as_it_is() -> None:
    text = arm(head='<?xml version="1.0" encoding="UTF-8"?>\n', extra="<gazebo>a: b:c</gazebo>")
    assert conforming(text) == text
    assert conforming("<robot <a:b") == "<robot <a:b"
    assert decode_xml(b"\xef\xbb\xbf<a/>") == ("\ufeff<a/>", "")


@pytest.mark.parametrize("name", ["arm.URDF", "arm", "arm.robot", "arm.urdf.xacro", "arm.xml"])
def test_a_urdf_of_any_ending_is_read_as_one(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(arm())
    assert snakegen.load(path).joint_names == ("j",)
    done = CliRunner().invoke(cli, ["analyze", "mass", str(path)])
    assert done.exit_code == 0 and "2.000 kg" in done.output


def test_a_robot_without_a_name_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(arm(root='<robot name="">'))
    assert codes(path) == ["missing_attribute"]
    assert snakegen.convert(path, tmp_path / "out").mjcf.name == "robot.xml"


@pytest.mark.parametrize("name", ["scene", "Scene"])
def test_a_robot_named_scene_does_not_meet_the_scene(name: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(arm(root=f'<robot name="{name}">'))
    made = snakegen.convert(path, tmp_path / "out")
    assert made.mjcf.name == f"{name}_robot.xml" and made.equivalence.worst < 1e-9
    with pytest.raises(SnakegenError, match="the name of the scene's file"):
        snakegen.build(
            {"name": name, "chain": {"links": 2, "length": 0.3, "mass": 1}}, tmp_path / "built"
        )


def _beside(folder: Path) -> tuple[Path, Path, Any]:
    path = folder / "arm.urdf"
    path.write_text(arm())
    return path, folder, None


def _meshed(folder: Path) -> tuple[Path, Path, Any]:
    (folder / "meshes").mkdir()
    (folder / "urdf").mkdir()
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    (folder / "meshes/m.obj").write_text(f"{corners}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    shape = '<visual><geometry><mesh filename="../meshes/m.obj"/></geometry></visual>'
    path = folder / "urdf/my.urdf"
    path.write_text(arm().replace('name="tip">', f'name="tip">{shape}', 1))
    return path, folder, None


def _modules(folder: Path) -> tuple[Path, Path, Any]:
    (folder / "in").mkdir()
    path, modules = folder / "in/arm.urdf", folder / "scene.xml"
    path.write_text(arm())
    modules.write_text("floating_root: base\n")
    return path, folder, modules


@pytest.mark.parametrize("case", [_beside, _meshed, _modules])
def test_convert_overwrites_nothing_that_it_read(case: Any, tmp_path: Path) -> None:
    path, target, modules = case(tmp_path)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    with pytest.raises(SnakegenError, match="would be overwritten"):
        snakegen.convert(path, target, modules=modules)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_convert_may_be_repeated_into_its_folder(tmp_path: Path) -> None:
    path, _, _ = _beside(tmp_path)
    for _ in range(2):
        made = snakegen.convert(path, tmp_path / "out")
    assert made.mjcf.is_file()
