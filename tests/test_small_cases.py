"""Small descriptions in the manner of other people's, one for each kind of fault met in them."""

import os

import numpy as np
import pytest

import snakegen
from snakegen.analysis import statics
from snakegen.simulation.flight.run import run

BOX = '<collision><geometry><box size="0.3 0.3 0.05"/></geometry></collision>'
INERTIA = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.02"/>'
ROTORS = ((0.15, 0.15, -1), (-0.15, 0.15, 1), (-0.15, -0.15, -1), (0.15, -0.15, 1))


def quadrotor(folder, *, shape=BOX, extra="", joint="fixed", rest=""):
    """Writes a quadrotor and its modules; returns it loaded."""
    text = f'<link name="body"><inertial><mass value="1"/>{INERTIA}</inertial>{shape}</link>'
    modules = "floating_root: body\nlink_length: 0.3\napparatuses:\n"
    for k, (x, y, spin) in enumerate(ROTORS):
        mass = '<inertial><mass value="0.01"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" '
        mass += 'iyz="0" izz="2e-5"/></inertial>'
        text += (
            f'<link name="rotor_{k}">{mass if joint != "fixed" else ""}</link>'
            f'<joint name="shaft_{k}" type="{joint}"><parent link="body"/>'
            f'<child link="rotor_{k}"/><origin xyz="{x} {y} 0.05"/><axis xyz="0 0 1"/>{rest}'
            "</joint>"
        )
        modules += f"  - {{link: body, rotors: [{{link: rotor_{k}, thrust_max: 6, "
        modules += f"drag_ratio: {0.016 * spin}}}]}}\n"
    (folder / "quad.urdf").write_text(f'<robot name="quad">{extra}{text}</robot>')
    (folder / "modules.yaml").write_text(modules)
    return snakegen.load(folder / "quad.urdf", modules=folder / "modules.yaml")


def test_a_revolute_rotor_shaft_without_effort_has_no_servo_and_flies(tmp_path):
    limit = '<limit lower="-1e16" upper="1e16" effort="0" velocity="0"/>'
    robot = quadrotor(tmp_path, joint="revolute", rest=limit)
    found = statics.analyze(robot, robot.configuration())
    assert dict(found.rows())["rotor shafts"].startswith("shaft_0, shaft_1, shaft_2, shaft_3:")
    assert not found.overloaded
    flown = run(robot, "hover", options={"duration": 1.0})
    assert flown.verdict.passed


def test_a_mesh_in_millimetres_is_found_from_any_folder(tmp_path, monkeypatch):
    corners = [[x, y, z] for x in (0, 200) for y in (0, 200) for z in (0, 40)]
    import trimesh

    (tmp_path / "meshes").mkdir()
    trimesh.convex.convex_hull(np.array(corners, float)).export(tmp_path / "meshes" / "body.stl")
    shape = '<collision><origin xyz="-0.1 -0.1 -0.02"/><geometry><mesh filename="meshes/body.stl" '
    shape += 'scale="0.001 0.001 0.001"/></geometry></collision>'
    robot = quadrotor(tmp_path, shape=shape)
    monkeypatch.chdir(os.sep)
    flown = run(robot, "hover", options={"duration": 1.0})
    assert flown.verdict.passed and flown.metrics["floor_contact_after_takeoff_s"] == 0.0


def test_a_description_with_a_mujoco_element_of_its_own_flies(tmp_path):
    own = '<mujoco><compiler angle="degree" balanceinertia="true"/><option timestep="0.01"/>'
    robot = quadrotor(tmp_path, extra=f"{own}</mujoco>")
    assert run(robot, "hover", options={"duration": 1.0}).verdict.passed


@pytest.mark.parametrize(
    ("given", "code"),
    [
        ('ixx="4e-18" ixy="0" ixz="0" iyy="4e-18" iyz="0" izz="4e-18"', "point_inertia"),
        ('ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"', "point_inertia"),
        ('ixx="0.01" ixy="0" iyx="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"', "unknown_attribute"),
    ],
)
def test_inertias_that_no_body_has_and_misspelt_ones_are_named(given, code, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<robot name="arm"><link name="base"><inertial><mass value="1"/>{INERTIA}</inertial>'
        f'</link><link name="finger"><inertial><mass value="2"/><inertia {given}/></inertial>'
        '</link><joint name="j" type="revolute"><parent link="base"/><child link="finger"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="1"/></joint></robot>'
    )
    (found,) = [f for f in snakegen.lint(path) if f.code == code]
    assert "finger" in f"{found.element} {found.message}"
    assert found.severity == ("error" if code == "point_inertia" else "warning")


def test_a_visual_mesh_that_is_not_installed_is_a_warning(tmp_path):
    mesh = '<visual><geometry><mesh filename="meshes/gone.stl"/></geometry></visual>'
    robot = quadrotor(tmp_path, shape=mesh + BOX)
    codes = {f.code: f.severity for f in snakegen.lint(tmp_path / "quad.urdf")}
    assert codes["missing_mesh"] == "warning" and "error" not in codes.values()
    assert robot.mass == pytest.approx(1.0)
