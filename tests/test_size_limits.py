"""Inputs too large to read are refused at once, with the size that would do."""

import os
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.base import memory, yaml_file
from snakegen.base.number_table import read_number_table
from snakegen.errors import AnalysisError, SnakegenError, SpecError
from snakegen.linter import lint
from snakegen.pipeline import build as pipeline
from snakegen.pipeline.build import build
from snakegen.robot.robot import load
from snakegen.spec.payload import locate
from snakegen.spec.urdf import MAX_BYTES


def sparse(path: Path, size: int) -> Path:
    """Makes a file of `size` bytes that takes none on the disk."""
    with path.open("wb") as file:
        file.truncate(size)
    return path


def test_a_million_numbers_in_yaml_are_refused_unparsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(yaml_file.yaml, "load", None)  # never reached
    path = tmp_path / "many.yaml"
    for text in ("[" + "1, " * 10**6 + "1]", "- 1\n" * 10**6, "a: 1\n" * 10**6):
        path.write_text(text)
        with pytest.raises(
            SpecError, match=r"many.yaml: some 100000. values; up to 500000 are read"
        ):
            yaml_file.read(path)
    with pytest.raises(SpecError, match="2000 MB; up to 16 MB are read"):
        yaml_file.read(sparse(tmp_path / "huge.yaml", 2_000_000_000))


def test_a_sparse_mesh_of_2_gb_is_refused_unread(tmp_path: Path) -> None:
    sparse(tmp_path / "big.stl", 2_000_000_000)
    with pytest.raises(ValueError, match=r"'big.stl' has 2000 MB; up to 10.0001 MB"):
        locate("big.stl", tmp_path)
    urdf = (
        '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" ixy="0" '
        'ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual><geometry>'
        '<mesh filename="big.stl"/></geometry></visual></link></robot>'
    )
    found = lint.lint(urdf, folder=tmp_path)
    errors = [f.code for f in found if f.severity == "error"]
    assert errors == ["large_mesh"]
    assert "2000 MB; up to 256 MB are read" in next(
        f.message for f in found if f.code == "large_mesh"
    )


def test_a_urdf_beyond_the_limit_is_refused_unread(tmp_path: Path) -> None:
    path = sparse(tmp_path / "big.urdf", MAX_BYTES + 1)
    with pytest.raises(SnakegenError, match=r"big.urdf: .* MB; up to 100 MB are read"):
        load(path)
    assert os.path.getsize(path) > MAX_BYTES


def test_a_table_of_2_gb_is_refused_unread(tmp_path: Path) -> None:
    path = sparse(tmp_path / "big.csv", 2 * 2**30)
    with pytest.raises(AnalysisError, match=r"2147 MB; up to 100 MB of CSV .* Parquet"):
        read_number_table(path)


def test_a_parquet_of_many_rows_in_few_bytes_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "many.parquet"
    pq.write_table(pa.table({"x": np.zeros(1_000_000)}), path)
    assert path.stat().st_size < 50_000 and len(read_number_table(path)) == 1_000_000
    monkeypatch.setattr(memory, "available", lambda: 10_000_000)
    with pytest.raises(AnalysisError, match=r"1,000,000 rows .* fewer rows or columns"):
        read_number_table(path)


def test_a_chain_too_deep_for_pinocchio_is_refused(tmp_path: Path) -> None:
    """Its parser recurses: at 4,000 links in a row the process would end by signal 11."""
    links = "".join(f'<link name="c{i}"/>' for i in range(3200))
    joints = "".join(
        f'<joint name="k{i}" type="fixed"><parent link="c{i}"/><child link="c{i + 1}"/></joint>'
        for i in range(3199)
    )
    mass = '<link name="end"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
    mass += 'ixz="0" iyz="0"/></inertial></link><joint name="last" type="fixed"><parent '
    path = tmp_path / "deep.urdf"
    text = (
        f'<robot name="deep">{links}{joints}{mass}link="{{}}"/><child link="end"/></joint></robot>'
    )
    path.write_text(text.format("c3199"))
    with pytest.raises(SnakegenError, match="3201 links in a row; Pinocchio reads up to 3000"):
        load(path)
    assert not [f for f in lint.lint(path) if f.severity == "error"]


@pytest.mark.parametrize("call", [load, snakegen.convert, snakegen.adopt])
def test_a_device_without_an_end_is_refused(call: Any, tmp_path: Path) -> None:
    """A link to /dev/zero: its size is 0, and reading it never ends."""
    path = tmp_path / "zero.urdf"
    path.symlink_to("/dev/zero")
    with pytest.raises(SnakegenError, match="Is a device"):
        call(path)
    (found,) = lint.lint(path)
    assert found.code == "unreadable" and "Is a device" in found.message


def test_a_chain_of_too_many_joints_is_refused_before_mujoco(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would be compiled for minutes; the folder stays away."""
    monkeypatch.setattr(pipeline, "MOST_JOINTS", 13)
    with pytest.raises(SpecError, match=r"dragon4: 14 moving joints; up to 13 are built"):
        build("dragon4", tmp_path / "out", picture=False)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(pipeline, "MOST_JOINTS", 14)
    assert build("dragon4", tmp_path / "out", picture=False).urdf.is_file()


def test_a_chain_deeper_than_mujoco_compiles_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four links, three crosses, and gimbal, arm and rotor of the last: counted along the tree."""
    made = build("dragon4", tmp_path / "made", picture=False)
    model = mujoco.MjModel.from_xml_path(str(made.mjcf))
    depth = np.zeros(model.nbody, int)
    for body in range(1, model.nbody):
        depth[body] = depth[model.body_parentid[body]] + 1
    deepest = int(depth.max())
    text = made.urdf.read_text(encoding="utf-8")
    monkeypatch.setattr(pipeline, "DEEPEST", deepest)
    pipeline.refuse_deep_chains(text, "dragon4")
    monkeypatch.setattr(pipeline, "DEEPEST", deepest - 1)
    with pytest.raises(SpecError, match=rf"dragon4: {deepest} links in a row"):
        build("dragon4", tmp_path / "out", picture=False)
    assert not (tmp_path / "out").exists()


def test_mujoco_compiles_as_many_bodies_in_a_row_as_a_build_takes() -> None:
    for count, fits in ((pipeline.DEEPEST, True), (pipeline.DEEPEST + 1, False)):
        spec = mujoco.MjSpec()
        body = spec.worldbody
        for _ in range(count):
            body = body.add_body()
            body.add_geom(size=[1.0, 1.0, 1.0])
        if fits:
            assert spec.compile().nbody == count + 1
        else:
            with pytest.raises(ValueError, match="depth"):
                spec.compile()
