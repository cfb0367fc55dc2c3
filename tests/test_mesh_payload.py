"""Payloads and tools from mesh files, and paths to meshes for ROS."""

import numpy as np
import pytest
import trimesh
from hand_weights import check_by_hand
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.description.mjcf.files import load_model
from snakegen.errors import SpecError
from snakegen.spec.loading import load_spec


@pytest.fixture
def tool(tmp_path):
    """A spec with a mesh payload, and the mesh: a box, turned and off its origin."""
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    turn = Rotation.from_euler("xyz", [0.3, 0.2, 0.1])
    box.apply_transform(np.block([[turn.as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]]))
    box.apply_translation([0.01, 0.02, -0.03])
    (tmp_path / "tool.stl").write_bytes(box.export(file_type="stl"))
    (tmp_path / "holder.yaml").write_text(
        "name: holder\n"
        "chain: {links: 2, length: 0.4, mass: 0.5}\n"
        "payload: {at: ['1@0.3', '2@1'], mass: [0.2, 0.5], mesh: tool.stl, offset: [0, 0, -0.05]}\n"
    )
    return tmp_path / "holder.yaml", turn


def test_mesh_payload(tool, tmp_path):
    file, turn = tool
    spec = load_spec(file)
    made = snakegen.build(spec, tmp_path / "out", picture=False)
    assert made.equivalence.worst < 1e-12
    check_by_hand(spec, made)
    assert (tmp_path / "out/meshes/tool.stl").read_bytes() == (tmp_path / "tool.stl").read_bytes()
    model = load_model(made.mjcf)
    body = model.body("payload2")
    x, y, z = 0.1**2, 0.06**2, 0.04**2
    hand = np.diag([y + z, x + z, x + y]) * 0.5 / 12
    hand = turn.as_matrix() @ hand @ turn.as_matrix().T
    frame = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    assert np.allclose(frame @ np.diag(body.inertia) @ frame.T, hand, atol=1e-9)
    assert np.allclose(body.ipos, [0.01, 0.02, -0.03], atol=1e-7)
    again = snakegen.build(made.spec, tmp_path / "again", picture=False)
    assert again.spec.read_bytes() == made.spec.read_bytes()
    assert again.mjcf.read_bytes() == made.mjcf.read_bytes()


@pytest.mark.parametrize(
    ("mesh", "says"),
    [
        ("/tool.stl", "outside"),
        ("../tool.stl", "outside"),
        ("C:tool.stl", "outside"),
        ("package://a/tool.stl", "outside"),
        ("tool.dae", "neither"),
        ("lost.stl", "no such file"),
        ("ducted_fan.stl", "cannot be used"),
        ("text.stl", "binary"),
        ("open.stl", "closed"),
    ],
)
def test_meshes_that_are_refused(tool, mesh, says):
    file, _ = tool
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    (file.parent / "text.stl").write_text(box.export(file_type="stl_ascii"))
    box.update_faces(np.arange(len(box.faces)) > 0)
    (file.parent / "open.stl").write_bytes(box.export(file_type="stl"))
    with pytest.raises(SpecError, match=says):
        load_spec(file, overrides=[f"payload.mesh={mesh}"])


def test_mesh_behind_a_link_out_of_the_folder(tool, tmp_path):
    file, _ = tool
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "tool.stl").symlink_to(file.parent / "tool.stl")
    (inner / "holder.yaml").write_text(file.read_text())
    with pytest.raises(SpecError, match="outside"):
        load_spec(inner / "holder.yaml")


def test_package_paths_for_ros(tmp_path):
    made = snakegen.build("dragon3", tmp_path / "ros", picture=False, mesh_uri="package")
    text = made.urdf.read_text()
    assert 'filename="package://dragon3/meshes/ducted_fan.stl"' in text
    plain = snakegen.build("dragon3", tmp_path / "plain", picture=False)
    assert text.replace("package://dragon3/", "") == plain.urdf.read_text()
    assert made.mjcf.read_bytes() == plain.mjcf.read_bytes()
