"""Mass, centre of mass and inertia of a spec's robot, added up by hand."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import snakegen
from snakegen.description.mjcf.files import load_model

AXES = {"roll": (1, 0, 0), "pitch": (0, 1, 0), "yaw": (0, 0, 1)}


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
