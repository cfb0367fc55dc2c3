"""Every code of the linter's catalogue has a faulty file here, and an entry in docs/lint.md."""

import struct
from pathlib import Path
from typing import Any

import pytest
from clean_urdf import GOOD

import snakegen
from snakegen import lint
from snakegen.errors import DescriptionError
from snakegen.linter.catalogue import RULES, page
from snakegen.linter.finding import Finding
from snakegen.linter.fixes import fix
from tests.test_lint import FAULTS, mutate

ROOT = Path(__file__).parent.parent
INERTIA = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>\n    </inertial>\n'
LIMIT = 'lower="-1" upper="1" effort="7" velocity="0.5"'
JOINT = '<joint name="joint1" type="revolute">'
CYLINDER = '<cylinder radius="0.01" length="0.4"/>'
TEXTURE = '<texture filename="rod.stl"/>'
DYNAMICS = '<dynamics damping="0.1" friction="0"/>'
NO_MESH = (
    '<visual><geometry><mesh filename="rod.stl"/></geometry><material name="grey"/></visual>',
    "",
)
MIMIC = '<mimic joint="joint1" multiplier="-1"/>'
SNAKEGEN = '<snakegen version="1"><whatever lies="within"/></snakegen>'


def changed(*pairs: tuple[str, str]) -> str:
    """Returns the clean URDF with texts replaced, once each; they have to be there."""
    text = GOOD
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def tensor(xx: float, yy: float, zz: float) -> tuple[str, str]:
    """Returns the replacement that gives link1 a diagonal inertia."""
    new = INERTIA.replace('"0.01"', f'"{xx}"', 1).replace('iyy="0.02"', f'iyy="{yy}"')
    return INERTIA, new.replace('izz="0.02"', f'izz="{zz}"')


def mesh(path: str) -> tuple[str, str]:
    return 'filename="rod.stl"', f'filename="{path}"'


CASES: dict[str, str] = {
    "late_declaration": "\n" + GOOD,
    "attribute_blanks": changed((' xyz="0 0 1"', ' xyz="0 0\t1"')),
    "undeclared_prefix": changed(("</robot>", "<gazebo><sensor:ray/></gazebo></robot>")),
    "default_namespace": changed(("<robot ", '<robot xmlns="http://www.ros.org" ')),
    "misspelt_tag": changed(("<inertial>", "<inertail>"), ("</inertial>", "</inertail>")),
    "shapeless_geometry": changed((CYLINDER, '<plane normal="0 0 1"/>')),
    "misspelt_attribute": changed((' xyz="0 0 1"', ' xzy="0 0 1"')),
    "fixed_mimic": changed(
        ('<joint name="joint1" type="revolute">', '<joint name="joint1" type="fixed">')
    ),
    "mimic_range": changed(
        ('name="joint2" type="continuous"', 'name="joint2" type="revolute"'),
        (MIMIC, MIMIC + '<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/>'),
    ),
    "mimic_zero": changed(('multiplier="-1"', 'multiplier="0"')),
    "no_mass": "<robot name='plane'><link name='ground'/></robot>",
    "multi_axis_joint": changed(('name="joint2" type="continuous"', 'name="joint2" type="planar"')),
    "massless_frame": changed(
        ('<link name="base"/>', '<link name="base"><inertial><mass value="0"/><inertia ixx="0" '
         'ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>')
    ),
    "massless": changed(
        ('<joint name="weld" type="fixed">', '<joint name="weld" type="continuous">'),
    ),
    "point_inertia": changed(tensor(4e-18, 4e-18, 4e-18)),
    "gyration_small": changed(NO_MESH, tensor(1.0e-9, 1.2e-9, 1.2e-9)),
    "unknown_attribute": changed(('<link name="cross"/>', '<link name="cross" shade="red"/>')),
    "gyration_large": changed(
        NO_MESH,
        tensor(4.0, 5.0, 5.0),
    ),
    "identity_inertia": changed(('mass value="1.2"', 'mass value="1.0"'), tensor(1, 1, 1)),
    "com_outside": changed(
        NO_MESH,
        ('<origin xyz="0.1 0 0" rpy="0 0 0"/>', '<origin xyz="40 0 0" rpy="0 0 0"/>'),
    ),
    "density": changed(('size="0.1 0.1 0.2"', 'size="0.001 0.001 0.2"')),
    "mass_range": changed(('mass value="1.2"', 'mass value="12000"'), tensor(100, 200, 200)),
    "size_range": changed(('xyz="0 0 0.1"', 'xyz="0 0 100"')),
    "neutral_outside": changed((LIMIT, 'lower="0.1" upper="1" effort="7" velocity="0.5"')),
    "degrees_for_radians": changed((LIMIT, 'lower="-90" upper="90" effort="7" velocity="0.5"')),
    "no_effort": changed((LIMIT, 'lower="-1" upper="1" effort="0" velocity="0.5"')),
    "no_velocity": changed((LIMIT, 'lower="-1" upper="1" effort="7" velocity="0"')),
    "effort_placeholder": changed((LIMIT, 'lower="-1" upper="1" effort="1e9" velocity="1"')),
    "friction_above_effort": changed((DYNAMICS, '<dynamics damping="0.1" friction="8"/>')),
    "soft_limits": changed(
        (DYNAMICS, DYNAMICS + '<safety_controller soft_lower_limit="-2" k_velocity="1"/>')
    ),
    "thrust_to_weight": changed(
        (SNAKEGEN, '<snakegen version="1"><rotor link="x" thrust_max="3"/></snakegen>')
    ),
    "drag_ratio": changed(
        (SNAKEGEN, '<snakegen version="1"><rotor link="x" thrust_max="99" drag_ratio="12.5"/>'
         "</snakegen>")
    ),
    "missing_texture": changed(
        ('<color rgba="0.5 0.5 0.5 1"/>', '<texture filename="gone.png"/>')
    ),
    "unresolved_package": changed(mesh("package://gone/rod.stl")),
    "backslash_path": changed(mesh("meshes\\rod.stl")),
    "case_mismatch": changed(mesh("ROD.stl")),
    "mesh_format": changed(mesh("rod.dae")),
    "empty_mesh": changed(mesh("empty.stl")),
    "mesh_scale": changed(mesh("millimetres.stl")),
    "link_named_world": changed(('<link name="cross"/>', '<link name="world"/>'),
                                ('parent link="cross"', 'parent link="world"'),
                                ('child link="cross"', 'child link="world"')),
    "odd_name": changed(('<joint name="weld"', '<joint name="the weld"')),
    "capsule_shape": changed((CYLINDER, '<capsule radius="0.01" length="0.4"/>')),
    "quaternion_origin": changed(
        ('<origin xyz="0 0 0.1" rpy="0 0 0"/>', '<origin xyz="0 0 0.1" quat_xyzw="0 0 0 1"/>')
    ),
    "mirrored_mesh": changed(
        ('filename="rod.stl"', 'filename="rod.stl" scale="1 -1 1"')
    ),
}  # fmt: skip
MUJOCO = '<mujoco><compiler angle="radian"{}/><worldbody>{}</worldbody>{}</mujoco>'
BODY = (
    '<body name="b"><joint name="j"{}/><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body>'
)
MJCF: dict[str, str] = {
    "mjcf_default_density": MUJOCO.format("", '<body><geom size="1"/></body>', ""),
    "mjcf_massless": MUJOCO.format("", '<body><joint name="j"/></body>', ""),
    "mjcf_range_ignored": MUJOCO.format("", BODY.format(' range="-1 1" limited="false"'), ""),
    "mjcf_degrees": MUJOCO.format("", BODY.format(' range="-9 9"'), "").replace("radian", "degree"),
    "mjcf_inertia_overridden": MUJOCO.format(' inertiafromgeom="true"', BODY.format(""), ""),
    "mjcf_inertia_altered": MUJOCO.format(' balanceinertia="true"', BODY.format(""), ""),
    "mjcf_unlimited_actuator": MUJOCO.format(
        "", BODY.format(""), '<actuator><motor joint="j"/></actuator>'
    ),
    "mjcf_implicit_fuse": MUJOCO.format(' fusestatic="true"', BODY.format(""), ""),
}  # fmt: skip


def stl(points: list[tuple[float, float, float]]) -> bytes:
    triangles = b"".join(
        struct.pack("<12fH", 0, 0, 1, *points[i], *points[i + 1], *points[i + 2], 0)
        for i in range(0, len(points), 3)
    )
    return b" " * 80 + struct.pack("<I", len(points) // 3) + triangles


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rod.stl").write_bytes(b"mesh")
    (tmp_path / "rod.dae").write_bytes(b"mesh")
    (tmp_path / "empty.stl").write_bytes(stl([]))
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/rod.stl").write_bytes(b"mesh")
    (tmp_path / "millimetres.stl").write_bytes(stl([(0, 0, 0), (420, 0, 0), (0, 25, 0)]))
    return tmp_path


@pytest.mark.parametrize("code", [*CASES, *MJCF])
def test_each_rule_sees_its_fault_and_nothing_else(code: str, folder: Path) -> None:
    found = lint((CASES | MJCF)[code], folder=folder)
    (mine,) = [f for f in found if f.code == code][:1]
    assert (mine.tier, mine.severity) == (RULES[code].tier, RULES[code].severity)
    assert mine.remedy
    company = {
        "unresolved_package": {"package_mesh"},
        "misspelt_tag": {"massless_tip", "massless"},
        "shapeless_geometry": {"unknown_tag"},
    }
    assert {f.code for f in found} <= {code} | company.get(code, set())


def test_every_rule_has_a_faulty_file() -> None:
    elsewhere = {"unreadable", "too_large", "doctype", "no_root", "unknown_tag", "large_mesh"}
    elsewhere |= {"foreign_encoding"}
    elsewhere |= {"large_texture"} | {c for c in RULES if c.startswith("mesh_") and c not in CASES}
    covered = {row[2] for row in FAULTS.values()} | CASES.keys() | MJCF.keys() | elsewhere
    assert covered >= RULES.keys()
    assert len(covered & RULES.keys()) >= 45


def test_a_file_beyond_the_size_limit(tmp_path: Path) -> None:
    big = tmp_path / "big.urdf"
    with big.open("wb") as file:
        file.truncate(101_000_000)
    assert [f.code for f in lint(big)] == ["too_large"]
    with (tmp_path / "rod.stl").open("wb") as file:
        file.truncate(257_000_000)
    assert [f.code for f in lint(GOOD, folder=tmp_path)] == ["large_mesh"]
    painted = changed(mesh("gone.stl"), ('<color rgba="0.5 0.5 0.5 1"/>', TEXTURE))
    assert "large_texture" in [f.code for f in lint(painted, folder=tmp_path)]


def test_the_page_lists_the_catalogue() -> None:
    assert (ROOT / "docs/lint.md").read_text(encoding="utf-8") == page()


@pytest.mark.parametrize(
    "attribute,severity",
    [
        ('ixy="0" iyx="0"', "warning"),  # what parsers read is not changed
        ('ixy="0" iyx="0.003"', "error"),  # two values for one number
        ('iyx="0"', "error"),  # the true one is missing
    ],
)
def test_a_misspelt_attribute_counts_by_what_it_changes(attribute: str, severity: str) -> None:
    text = changed(('ixy="0"', attribute))
    assert max((f.severity for f in lint(text)), key=["note", "warning", "error"].index) == severity


def test_inertia_of_a_welded_frame_counts_in_the_sum() -> None:
    frame = (
        '<link name="camera"><inertial><mass value="0.001"/><inertia ixx="0" ixy="0" ixz="0" '
        'iyy="0" iyz="0" izz="0"/></inertial></link><joint name="mount" type="{}">'
        '<parent link="link1"/><child link="camera"/><axis xyz="0 0 1"/></joint>'
        '<link name="cross"/>'
    )
    for kind, severity in (("fixed", "note"), ("continuous", "error")):
        found = lint(changed(('<link name="cross"/>', frame.format(kind))))
        assert [(f.code, f.severity) for f in found] == [("point_inertia", severity)]


def test_printed_digits_are_forgiven() -> None:
    plate = tensor(0.0033, 0.0167, 0.0201)  # a flat plate, each moment printed with four places
    assert lint(changed(plate)) == []
    assert [f.code for f in lint(changed(tensor(0.0033, 0.0167, 0.0206)))] == ["inertia_triangle"]


def test_fix_mends_what_is_safe_and_is_done_after_once(folder: Path) -> None:
    text = changed(
        (' xyz="0 0 1"', ' xyz="0 0 2"'),
        ('lower="-1"', 'lowr="-1"'),
        ("<inertial>", "<inertail>"),
        ("</inertial>", "</inertail>"),
        (
            '<link name="cross"/>',
            '<link name="cross"><inertial><mass value="0"/></inertial></link>',
        ),
        mesh("meshes\\rod.stl"),
    )
    mended, done = fix("\n" + text, folder)
    assert lint(mended, folder=folder) == []
    assert fix(mended, folder) == (mended, [])
    assert len(done) == 7  # the misspelt tag is mended at both ends
    assert 'xyz="0 0 1"' in mended and 'lower="-1"' in mended and "inertail" not in mended
    assert fix(GOOD, folder) == (GOOD, [])


def test_fix_shortens_paths_inside_the_folder_only(folder: Path, tmp_path_factory) -> None:
    outside = tmp_path_factory.mktemp("elsewhere") / "rod.stl"
    outside.write_bytes(b"mesh")
    inside = changed(mesh(str(folder / "meshes/rod.stl")))
    assert 'filename="meshes/rod.stl"' in fix(inside, folder)[0]
    assert fix(changed(mesh(str(outside))), folder)[1] == []


def test_findings_are_plain_data() -> None:
    found = lint(mutate("negative mass"))[0]
    assert isinstance(found, Finding)
    assert set(found.to_json()) == {
        "severity", "tier", "code", "element", "line", "message", "remedy"
    }  # fmt: skip


@pytest.mark.parametrize("call", [snakegen.load, snakegen.adopt, snakegen.convert])
def test_a_refusal_names_the_remedy(tmp_path: Path, call: Any) -> None:
    path = tmp_path / "model.urdf"
    path.write_text(
        '<robot name="r" xmlns:xacro="x"><xacro:property name="m" value="1"/>'
        '<link name="a"/></robot>'
    )
    with pytest.raises(DescriptionError, match=r"xacro_left\].* xacro model.urdf.xacro > model"):
        call(path)
