"""The breadth of the grammar: odd robots, built, weighed by hand, and passed through the gate."""

import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.description.mjcf.files import load_model
from snakegen.errors import SpecError
from snakegen.pipeline import equivalence
from snakegen.spec.loading import load_spec, templates_folder

AXES = {"roll": (1, 0, 0), "pitch": (0, 1, 0), "yaw": (0, 0, 1)}

ROBOTS = {
    "unequal": {
        "chain": {
            "links": 3,
            "length": [0.4, 0.3, 0.25],
            "mass": [0.6, 0.5, 0.3],
            "radius": [0.0125, 0.02, 0.01],
            "wall": [0.001, 0.02, 0.002],
            "com": [0.5, 0.3, 0.8],
        },
        "joint": {
            "axes": [["pitch", "yaw"], ["yaw"]],
            "gap": [0.05, 0.02],
            "mass": [0.12, 0.2],
            "lower": [-1.0, -0.2],
            "upper": [0.5, 1.3],
        },
        "vectoring_apparatus": {"at": [1, 3], "offset": [0.05, -0.03], "thrust_max": [20, 9]},
    },
    "crowded_link": {
        "chain": {"links": 2, "length": 0.6, "mass": 0.8},
        "vectoring_apparatus": {
            "at": "2@0.9,1@0,1@1,1@0.35",
            "rotors": [1, 2, 1, 2],
            "separation": [0.2, 0.25, 0.3, 0.15],
            "rotor_diameter": [0.05, 0.07, 0.1, 0.05],
            "pitch_mass": [0.5, 0.4, 0.3, 0.2],
            "spin": [[1], [-1, 1], [1], [-1, -1]],
        },
    },
    "one_axis_joints": {
        "chain": {"links": 4, "length": 0.3, "mass": [1, 2, 3, 4]},
        "joint": {"axes": [["roll"], ["pitch"], ["yaw"]], "mass": 0.9},
    },
    "odd_axis_pairs": {
        "chain": {"links": 4, "length": 0.3, "mass": 0.5},
        "joint": {"axes": [["roll", "pitch"], ["yaw", "roll"], ["yaw", "pitch"]], "gap": 0.04},
        "vectoring_apparatus": {"at": [4]},
    },
    "on_a_wall": {
        "base": "fixed",
        "chain": {"links": 3, "length": 0.3, "mass": [1, 2, 3]},
        "vectoring_apparatus": {"at": "1@0.2,3@1"},
        "payload": {"at": [1, "3@1"], "mass": [5, 0.7], "offset": [[0, 0.1, 0], [0.05, 0, -0.1]]},
    },
    "A_9_" + "x" * 60: {"chain": {"links": 1, "length": 0.5, "mass": 1.0}},
    "touching_ends": {
        "chain": {"links": 3, "length": 0.3, "mass": 0.5, "radius": 0.02},
        "vectoring_apparatus": {"at": "1@1,2@0,2@1,3@0"},
    },
    "carrier": {
        "chain": {"links": 2, "length": 0.4, "mass": 0.5},
        "payload": {"at": ["1@0.25", "2@1"], "mass": [0.3, 0.6], "radius": [0.02, 0.05]},
    },
}


def weigh(spec, angles):
    """Returns mass, centre of mass, and link origins by name: the grammar read once more, by hand.

    Bodies that a fixed base holds are left out of the sums.
    """
    chain, joint = spec["chain"], spec["joint"]
    turn, point, moving = Rotation.identity(), np.zeros(3), spec["base"] == "floating"
    parts, origins = [], {}

    def part(mass, at):
        if moving:
            parts.append((mass, at))

    def turned(axis, name):
        return Rotation.from_rotvec(angles[name] * np.array(AXES[axis]))

    for i in range(chain["links"]):
        origins[f"link{i + 1}"] = point
        length = chain["length"][i]
        part(chain["mass"][i], point + turn.apply([chain["com"][i] * length, 0, 0]))
        for j, at in enumerate(spec.get("payload", {}).get("at", [])):
            if at["link"] == i + 1:
                load = spec["payload"]
                place = np.array([at["position"] * length, 0, 0]) + load["offset"][j]
                part(load["mass"][j], point + turn.apply(place + load["com"][j]))
        still = moving
        for j, at in enumerate(spec.get("vectoring_apparatus", {}).get("at", [])):
            if at["link"] == i + 1:
                moving, a = True, spec["vectoring_apparatus"]
                foot = point + turn.apply([at["position"] * length, 0, 0])
                roll = turn * turned("roll", f"gimbal{j + 1}_roll")
                axle = foot + roll.apply([0, 0, a["offset"][j]])
                part(a["roll_mass"][j], foot)
                part(a["pitch_mass"][j], axle)
                pitch = roll * turned("pitch", f"gimbal{j + 1}_pitch")
                half = a["separation"][j] / 2 if a["rotors"][j] == 2 else 0.0
                origins[f"rotor{j + 1}_1"] = axle + pitch.apply([0, half, 0])
                moving = still
        if i + 1 < chain["links"]:
            still, moving = moving, True
            point = point + turn.apply([length, 0, 0])
            axes = joint["axes"][i]
            if len(axes) == 1:
                if joint["mass"][i] is not None:  # the block goes with the link before
                    moving = still
                    part(joint["mass"][i], point + turn.apply([joint["gap"][i] / 2, 0, 0]))
                    moving = True
                point = point + turn.apply([joint["gap"][i], 0, 0])
            turn = turn * turned(axes[0], f"joint{i + 1}_{axes[0]}")
            if len(axes) == 2:
                part(joint["mass"][i], point + turn.apply([joint["gap"][i] / 2, 0, 0]))
                point = point + turn.apply([joint["gap"][i], 0, 0])
                turn = turn * turned(axes[1], f"joint{i + 1}_{axes[1]}")
    mass = sum(m for m, _ in parts)
    centre = sum(m * p for m, p in parts) / mass
    return mass, centre, origins


def check_by_hand(spec, made):
    """Holds the built URDF and MJCF against `weigh` in three postures."""
    robot, model = snakegen.load(made.urdf), load_model(made.mjcf)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(7)
    low, high, _ = robot.limits(robot.joint_names)
    for _ in range(3):
        angles = dict(zip(robot.joint_names, rng.uniform(low, high), strict=True))
        mass, centre, origins = weigh(spec.resolved(), angles)
        for name, angle in angles.items():
            data.joint(name).qpos = angle
        if robot.floating:  # it starts at rest on the floor
            data.qpos[:3] = 0.0
        mujoco.mj_forward(model, data)
        moving = model.body_weldid != 0
        assert robot.mass == pytest.approx(mass, rel=1e-12)
        assert model.body_mass[moving].sum() == pytest.approx(mass, rel=1e-12)
        found = model.body_mass[moving] @ data.xipos[moving] / mass
        assert np.allclose(found, centre, atol=1e-12)
        for name, origin in origins.items():
            assert np.allclose(data.body(name).xpos, origin, atol=1e-12), name


@pytest.mark.parametrize("name", ROBOTS)
def test_odd_robots(name, tmp_path):
    spec = load_spec({"name": name, **ROBOTS[name]})
    made = snakegen.build(spec, tmp_path / "robot", picture=False)
    assert made.equivalence.worst < 1e-12
    check_by_hand(spec, made)
    model = load_model(made.mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0  # at rest nothing pushes


def test_gate_sees_a_shifted_body(tmp_path):
    made = snakegen.build(load_spec("dragon4", links=2), tmp_path / "robot", picture=False)
    robot, model = snakegen.load(made.urdf), load_model(made.mjcf)
    assert equivalence.compare(robot, model).passed
    faults = {"body_pos": "frames", "body_mass": "mass", "body_inertia": "mass_matrix"}
    for field, figure in faults.items():
        spoiled = load_model(made.mjcf)
        getattr(spoiled, field)[spoiled.body("link2").id] *= 1 + 1e-6
        found = equivalence.compare(robot, spoiled)
        assert not found.passed
        assert getattr(found, figure) > 1e-9
    spoiled = load_model(made.mjcf)
    spoiled.dof_armature[-1] += 1e-6
    assert equivalence.compare(robot, spoiled).mass_matrix > 1e-9


@pytest.mark.parametrize("base", ["floating", "fixed"])
def test_own_kernels_see_what_pinocchio_sees(base):
    """Above nv = 200 the gate trusts snakegen's kernels; here both answer for one robot."""
    robot = snakegen.load(load_spec("dragon3", overrides=[f"base={base}", "joint.effort=5"]))
    rng = np.random.default_rng(3)
    q = robot.configuration({n: rng.uniform(-1, 1) for n in robot.joint_names})
    v = rng.normal(size=robot.model.nv)
    pairs = zip(
        equivalence._Pinocchio(robot).evaluate(q, v),
        equivalence._Own(robot).evaluate(q, v),
        strict=True,
    )
    for a, b in pairs:
        assert np.allclose(a, b, rtol=0, atol=1e-12 * max(1.0, np.abs(a).max()))


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
        ("lost.stl", "does not exist"),
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


def test_fans_of_different_size_are_drawn_so(tmp_path):
    spec = load_spec(
        "dragon4", overrides=["vectoring_apparatus.rotor_diameter=[0.05,0.07,0.1,0.07]"]
    )
    made = snakegen.build(spec, tmp_path / "robot", picture=False)
    model = load_model(made.mjcf)
    widths = {}
    for g in range(model.ngeom):
        body = model.body(model.geom_bodyid[g]).name
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH and body.endswith("pitch_module"):
            mesh = model.geom_dataid[g]
            start = model.mesh_vertadr[mesh]
            points = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
            widths[body] = float(np.ptp(points, axis=0).max())
    assert [round(widths[f"gimbal{j}_pitch_module"], 3) for j in (1, 2, 3, 4)] == [
        pytest.approx(d, rel=0.02) for d in (0.05, 0.07, 0.1, 0.07)
    ]


def test_stock_xacro_gives_the_same_bytes(tmp_path):
    spec = load_spec("dragon4", links=20, apparatus="1,2@0.3,2@0.8,5,6,7,8,9,20@1")
    made = snakegen.build(spec, tmp_path / "robot", picture=False)
    run = subprocess.run(
        [
            str(Path(sys.executable).with_name("xacro")),
            str(templates_folder() / "snake.urdf.xacro"),
            f"spec:={made.spec}",
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    theirs, ours = run.stdout.splitlines(), made.urdf.read_text().splitlines()
    assert [line[:5] for line in theirs[1:5]] == ["<!-- "] * 4
    assert ours[2:] == theirs[5:]
