"""Pipes, devices and very long comments: answered at once, for reading and for writing."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import snakegen
from snakegen.base.atomic_io import check_writable, write_atomically
from snakegen.base.bounded_text import read_bounded
from snakegen.base.number_table import read_number_table
from snakegen.cli import cli
from snakegen.design_search.study import read_study
from snakegen.errors import SnakegenError
from snakegen.linter import xml_tree
from snakegen.linter.lint import lint
from snakegen.linter.xml_tree import XmlFault, parse_xml, short_of_comments
from snakegen.log.read import read as read_log
from snakegen.scene.schema import read_scene
from snakegen.simulation.flight.run import run
from snakegen.spec.payload import locate

ARM = Path(__file__).parent / "data" / "foreign.urdf"


@pytest.fixture(autouse=True)
def _awake() -> Iterator[None]:
    """Ends a test that hangs in an open or a read."""

    def late(*_: object) -> None:
        raise TimeoutError("blocked on a pipe")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def _included(pipe: Path) -> object:
    mjcf = pipe.parent / "whole.xml"
    mjcf.write_text(f'<mujoco><include file="{pipe.name}"/></mujoco>')
    return snakegen.compare(ARM, mjcf)


def _meshed(pipe: Path) -> object:
    mjcf = pipe.parent / "whole.xml"
    mesh = f'<asset><mesh name="m" file="{pipe.name}"/></asset>'
    mjcf.write_text(f'<mujoco><compiler meshdir="."/>{mesh}</mujoco>')
    return snakegen.compare(ARM, mjcf)


READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "load": ("a.urdf", snakegen.load),
    "spec": ("a.yaml", snakegen.load),
    "convert": ("a.urdf", snakegen.convert),
    "adopt": ("a.urdf", snakegen.adopt),
    "compare first": ("a.urdf", lambda p: snakegen.compare(p, ARM)),
    "compare second": ("a.xml", lambda p: snakegen.compare(ARM, p)),
    "include": ("a.xml", _included),
    "mjcf mesh": ("a.stl", _meshed),
    "modules": ("a.yaml", lambda p: snakegen.load(ARM, modules=p)),
    "scene": ("a.yaml", read_scene),
    "study": ("a.yaml", read_study),
    "mission": ("a.yaml", lambda p: run(snakegen.load("dragon4"), str(p))),
    "csv": ("a.csv", read_number_table),
    "parquet": ("a.parquet", read_number_table),
    "log": ("a.rrd", read_log),
    "payload": ("a.stl", lambda p: locate(p.name, p.parent)),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_without_a_writer_is_refused_at_once(reader: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    pipe = tmp_path / name
    os.mkfifo(pipe)
    with pytest.raises((SnakegenError, ValueError), match=r"[Ii]s a named pipe, not a file"):
        read(pipe)


@pytest.mark.parametrize("word", ["lint {}", "lint {} --fix", "analyze {}", "convert {} -o out"])
def test_commands_name_a_pipe_in_one_line(word: str, tmp_path: Path) -> None:
    pipe = tmp_path / "a.urdf"
    os.mkfifo(pipe)
    done = CliRunner().invoke(cli, word.format(pipe).split())
    assert isinstance(done.exception, SnakegenError), done.exception
    assert "Is a named pipe, not a file" in str(done.exception)
    assert "\n" not in str(done.exception)


@pytest.mark.parametrize("kind", ["named pipe", "folder", "link to nothing"])
def test_a_mesh_that_is_no_file_is_named(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    if kind == "folder":
        path.mkdir()
    elif kind == "named pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("gone.stl")
    shape = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'
    found = lint(f'<robot name="r"><link name="a">{shape}</link></robot>', folder=tmp_path)
    assert any(f"is a {kind}" in f.message for f in found), found


def test_a_pipe_of_a_shell_is_read(tmp_path: Path) -> None:
    """`snakegen lint <(xacro robot.xacro)`: no name in a folder, and a writer at its end."""
    end, start = os.pipe()
    os.write(start, ARM.read_bytes()[:30000])
    os.close(start)
    try:
        assert read_bounded(Path(f"/dev/fd/{end}"), 10**6).startswith("<?xml")
    finally:
        os.close(end)


def test_pipes_and_devices_are_not_replaced_by_files(tmp_path: Path) -> None:
    pipe = tmp_path / "out.yaml"
    os.mkfifo(pipe)
    link = tmp_path / "null"
    link.symlink_to("/dev/null")
    for target in (pipe, link):
        for write in (check_writable, lambda p: write_atomically(p, "text")):
            with pytest.raises(SnakegenError, match="cannot be written"):
                write(target)
    assert pipe.is_fifo() and Path("/dev/null").is_char_device()


def test_comments_keep_lines_and_offsets(monkeypatch: pytest.MonkeyPatch) -> None:
    text = '<?x <!-- ?><r>\n<!-- é\n<a> --><b k="1"/><c><![CDATA[<!-- no\n -->]]></c>\n<d/></r>'
    plain = parse_xml(text)
    monkeypatch.setattr(xml_tree, "LONGEST", 40)
    assert b"<a>" not in xml_tree._without_comments(text.encode())  # expat sees none of it
    blanked = parse_xml(text)
    assert [(n.tag, n.line, n.start, n.end) for n in plain.children] == [
        (n.tag, n.line, n.start, n.end) for n in blanked.children
    ]
    short = short_of_comments(text)
    assert "é" not in short and "<!-- no" in short
    assert [n.line for n in parse_xml(short).children] == [n.line for n in plain.children]


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ('<robot name="r">\n\n<gazebo v="{}"/></robot>', "too_large", 3),
        ('<robot name="r">\n<!-- {} -- --></robot>', "malformed_xml", 2),
        ('<robot name="r">\n<!-- {}</robot>', "malformed_xml", 2),
    ],
)
def test_long_tags_and_faulty_comments_are_named_with_their_line(
    text: str, code: str, line: int
) -> None:
    with pytest.raises(XmlFault) as caught:
        parse_xml(text.format("q" * 1_100_000))
    assert (caught.value.code, caught.value.line) == (code, line)


def test_millions_of_elements_are_refused_before_they_are_built(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(xml_tree, "MOST_ELEMENTS", 1000)
    with pytest.raises(XmlFault, match="more than 1000 elements"):
        parse_xml(f'<robot name="r">{"<a/>" * 2000}</robot>')


@pytest.mark.parametrize("name", ["loop", "loop/out"])
def test_links_in_a_circle_are_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    target = tmp_path / name
    for write in (check_writable, lambda p: write_atomically(p, ""), _convert_into):
        with pytest.raises(SnakegenError, match=r"cannot be written \(Too many levels"):
            write(target)
    with pytest.raises(SnakegenError, match="Too many levels"):
        snakegen.load(tmp_path / "loop" / "a.urdf")


def _convert_into(folder: Path) -> object:
    return snakegen.convert(ARM, folder)
