"""A URDF that snakegen did not write: analysed with a modules file, flown, mistakes named."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import snakegen
from snakegen.analysis import actuation, attitude, control, hover, statics
from snakegen.analysis.allocation import allocation
from snakegen.description.mjcf.decorate import decorate
from snakegen.errors import SnakegenError
from snakegen.pipeline.equivalence import compare
from snakegen.simulation.flight.world import make_world

DATA = Path(__file__).parent / "data"
URDF, MODULES = DATA / "foreign.urdf", DATA / "foreign.modules.yaml"
NAMES = {"hinge": "joint1_yaw", "swing_a": "gimbal1_roll", "nod_a": "gimbal1_pitch"}
FIELDS = ("mass", "cog", "inertia", "rotor_positions", "rotor_axes", "dual", "virtual", "force")
NAMES["nod_b"] = "gimbal2_pitch"

TWIN = {  # the same robot in snakegen's grammar; the second roll module weighs next to nothing
    "name": "twin",
    "chain": {
        "links": 2,
        "length": [0.5, 0.4],
        "mass": [1.2, 1.0],
        "inertia": [[0.001, 0.03, 0.03], [0.001, 0.014, 0.014]],
    },
    "joint": {"axes": ["yaw"]},
    "vectoring_apparatus": {
        "at": "1,2@0.3",
        "separation": 0.2,
        "offset": 0.04,
        "thrust_max": 20,
        "drag_ratio": 0.025,
        "roll_mass": [0.3, 1e-11],
        "roll_inertia": [[0.0003, 0.0002, 0.0003], [1e-14, 1e-14, 1e-14]],
        "pitch_mass": 0.44,
        "pitch_inertia": [[0.00242, 0.00042, 0.00244], [0.0024, 0.00042, 0.00244]],
    },
}


@pytest.fixture(scope="module")
def stranger():
    return snakegen.load(URDF, modules=MODULES)


def posture(robot, rng, names):
    angles = {n: rng.uniform(-1.4, 1.4) for n in NAMES}
    given = {names[n]: a for n, a in angles.items()}
    return robot.configuration(given, base_rpy=rng.uniform(-1, 1, 3))


def test_it_is_what_its_twin_is(stranger):
    twin = snakegen.load(TWIN)
    rng, again = np.random.default_rng(1), np.random.default_rng(1)
    for _ in range(5):
        a = allocation(stranger, posture(stranger, rng, {n: n for n in NAMES}))
        b = allocation(twin, posture(twin, again, NAMES))
        columns = [0, 1, 2, 4, 5]  # λ1 λ2 φ1 θ1 θ2: the stranger has no φ2
        assert not a.jacobian[:, 3].any()
        assert np.allclose(a.jacobian[:, columns], b.jacobian[:, columns], atol=1e-9)
        for field in FIELDS:
            assert np.allclose(getattr(a, field), getattr(b, field), atol=1e-9), field
        assert np.allclose(a.hover_wrench, b.hover_wrench, atol=1e-9)


def test_a_shaft_does_not_move_its_rotor(stranger):
    q = stranger.configuration({"hinge": 0.4, "swing_a": 0.2})
    turned = stranger.configuration({"hinge": 0.4, "swing_a": 0.2, "shaft_a_left": 2.0})
    assert np.allclose(allocation(stranger, q).dual, allocation(stranger, turned).dual, atol=1e-12)
    assert {"shaft_a_left", "shaft_a_right"}.isdisjoint(stranger.chain_joints)
    assert stranger.chain_joints == ("hinge",)


def test_mujoco_pushes_as_the_allocation_says(stranger):
    """Thrust and drag act on what carries the shafts; nothing turns the shafts themselves."""
    model = decorate(stranger.urdf, stranger.modules, {}, visuals=False).compile()
    assert compare(stranger, model).worst < 1e-12
    world = make_world(stranger, floor=False)
    world.model.opt.gravity[:] = 0.0
    data = mujoco.MjData(world.model)
    q = posture(stranger, np.random.default_rng(2), {n: n for n in NAMES})
    world.set_state(data, q)
    at = allocation(stranger, q)
    base, _ = stranger.base_pose(q)
    shafts = [world.qvel[b - 1] for b in stranger.spinners]
    assert len(shafts) == 2
    for k, activation in enumerate(world.activation):
        data.act[:] = 0.0
        data.act[activation] = 3.0
        mujoco.mj_forward(world.model, data)
        force = base.T @ data.qfrc_actuator[:3]
        moment = data.qfrc_actuator[3:6] - np.cross(at.cog, force)
        assert np.allclose(np.concatenate([force, moment]), 3.0 * at.dual[:, k], atol=1e-12)
        assert np.abs(at.dual[3:, k]).max() > 0.01
        assert not data.qfrc_actuator[shafts].any()


def test_command_line():
    from click.testing import CliRunner

    from snakegen.cli import cli

    arguments = ["analyze", str(URDF), "--modules", str(MODULES), "--json", "--joint", "hinge=0.5"]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found["robot"] == "stranger"
    assert found["mass"]["mass_kg"] == pytest.approx(1.2 + 1.0 + 0.3 + 0.44 + 0.44)


def test_it_flies(stranger):
    from snakegen.simulation.flight.run import run

    flown = run(stranger, "hover", options={"duration": 3.0}, seed=1)
    assert flown.verdict.passed, flown.verdict.summary()


TWO = (
    "apparatuses: [{{rotors: [{{link: tip_b_left, thrust_max: 3}}, {{link: {}, thrust_max: 3}}]}}]"
)
MISTAKES = {
    "floating_root: torso": "floating_root 'torso' is not the URDF's root link 'body'",
    "floatin_root: body": "no field 'floatin_root'. Did you mean 'floating_root'",
    "link_length: 0": "link_length 0 m is no length",
    "link_length: long": "link_length: 'long' is not a number",
    "apparatuses: {roll: a}": "'apparatuses' is a list",
    "apparatuses: [{roll: swing_a}]": "apparatuses[1]: 'rotors' is needed",
    "apparatuses: [{rol: swing_a}]": "apparatuses[1] has no field 'rol'. Did you mean 'roll'",
    "apparatuses: [{rotors: [{thrust_max: 3}]}]": "apparatuses[1].rotors[1]: 'link' is needed",
    "apparatuses: [{rotors: [{link: tip_b_left}]}]": "'thrust_max' is needed",
    "apparatuses: [{rotors: [{link: tip_b_lef, thrust_max: 3}]}]": "Did you mean 'tip_b_left'",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: big}]}]": "'big' is not a number",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: .nan}]}]": "nan is not a number",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: 3, thrust_min: 4}]}]": "are no range",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: 3, axis: [0, 0, 0]}]}]": "no direction",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: 3, axis: up}]}]": "no direction",
    "apparatuses: [{rotors: [{link: tip_b_left, thrust_max: 3, lag: -1}]}]": "lag: -1 is negative",
    "apparatuses: [{roll: 3, rotors: [{link: tip_b_left, thrust_max: 3}]}]": "3 is no name",
    "apparatuses: [{roll: swung, rotors: [{link: tip_b_left, thrust_max: 3}]}]": "no joint 'swung'",
    "apparatuses: [{roll: nod_a, rotors: [{link: tip_b_left, thrust_max: 3}]}]": "does not turn",
    "apparatuses: [{link: tale, rotors: [{link: tip_b_left, thrust_max: 3}]}]": "no link 'tale'",
    "apparatuses: [{rotors: [{link: prop_a_left, thrust_max: 3, axis: [1, 0, 0]}]}]": "not turn",
    TWO.format("prop_a_left"): "different moving bodies",
    TWO.format("tip_b_left"): "names 'tip_b_left'",
    "servos: [{joint: hing}]": "Did you mean 'hinge'",
    "servos: [{stiffness: 3}]": "servos[1]: 'joint' is needed",
    "servos: [{joint: hinge, stiffness: -3}]": "stiffness: -3 is negative",
    "servos: [{joint: hinge, stifness: 3}]": "Did you mean 'stiffness'",
    "control: {mode: both}": "mode",
    "control: {mod: dual_rotor}": "Did you mean 'mode'",
    "control: {gains: mine}": "gains",
    "plant: {delay: -1}": "delay",
    "- a list": "write 'floating_root:'",
    "a: !!python/object:os.system x": "not allowed",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_named(text, tmp_path):
    file = tmp_path / "modules.yaml"
    root = "" if text.startswith(("float", "- ", "a:")) else "floating_root: body\n"
    file.write_text(root + text + "\n")
    with pytest.raises(SnakegenError) as caught:
        snakegen.load(URDF, modules=file)
    message = str(caught.value)
    assert MISTAKES[text] in message
    assert "\n" not in message


FIXED = "floating_root: body\napparatuses:\n" + "".join(
    f"  - rotors: [{{link: tip_b_{side}, thrust_max: 40, drag_ratio: {ratio}}}]\n"
    for side, ratio in (("left", 0.02), ("right", -0.02))
)


def test_rotors_without_gimbals_fly_in_dual_rotor_mode_alone(tmp_path):
    """Nothing turns them: no rule about vectoring, no loop that needs it, no free force."""
    file = tmp_path / "fixed.yaml"
    file.write_text(FIXED)
    robot = snakegen.load(URDF, modules=file)
    assert robot.modules.control["mode"] == "dual_rotor"
    q = robot.configuration()
    classes = actuation.analyze(robot, q)
    assert [m.mode for m in classes.modes] == ["dual_rotor"]
    assert "Ñ" not in json.dumps(classes.to_json()) + str(classes.rows())
    assert "paper's rule" not in str(classes.rows())
    loops = control.analyze(robot, q)
    assert not loops.loops and loops.own[1] == "dual_rotor"
    assert "2 rotors set at most 2" in loops.refused["dual_rotor"]
    assert sum("(flown)" in label for label, _ in loops.rows()) == 1
    hovering = hover.analyze(robot, q)
    assert not hovering.virtual_feasible
    assert "virtual-single-rotor" not in str(hovering.rows())
    assert statics.analyze(robot, q).support != "hover"  # a force that nothing turns is not free
    file.write_text(FIXED + "control: {sigma_min: 0.05}\n")
    said = snakegen.load(URDF, modules=file).modules.control
    assert (said["mode"], said["sigma_min"]) == ("dual_rotor", 0.05)
    file.write_text(FIXED + "control: {mode: virtual_single_rotor}\n")
    with pytest.raises(SnakegenError, match="'virtual_single_rotor' turns gimbals"):
        snakegen.load(URDF, modules=file)


def test_slow_poles_keep_their_digits_and_gimbals_keep_both_modes(stranger):
    found = control.analyze(stranger)
    assert {mode for _, mode in found.loops} == {"dual_rotor"}
    assert list(found.refused) == ["virtual_single_rotor"]  # two apparatuses never can
    slow = found.loops["own", "dual_rotor"][0]
    pole = replace(slow, poles=np.array([-1.7e-4 + 0j, -3.0 + 0j]))
    shown = replace(found, loops={("own", "dual_rotor"): (pole,)}, refused={})
    assert "slowest pole -0.00017 1/s" in shown.rows()[-1][1]


@pytest.mark.parametrize(
    ("margin", "unit"),
    [("force_margin", "N"), ("dual_torque_margin", "N·m"), ("wrench_margin", "scaled")],
)
def test_the_best_attitude_says_in_which_unit(stranger, margin, unit):
    found = attitude.analyze(stranger, stranger.configuration(), margin=margin, samples=4)
    assert found.unit == found.to_json()["unit"] == unit
    assert found.rows()[0][
        1
    ] == f"{found.level:.4g} {unit} as it stands, {found.best:.4g} {unit}" + (" at best")


def test_without_modules_it_is_a_fixed_chain():
    robot = snakegen.load(URDF)
    assert not robot.floating
    assert robot.rotors.body.size == 0
    assert robot.mass == pytest.approx(1.0 + 0.3 + 0.44 + 0.44)  # the root does not move


def test_missing_files_are_named(tmp_path):
    with pytest.raises(SnakegenError, match="no such file"):
        snakegen.load(URDF, modules=tmp_path / "none.yaml")
    with pytest.raises(SnakegenError, match="no such file"):
        snakegen.load(tmp_path / "none.urdf", modules=MODULES)
