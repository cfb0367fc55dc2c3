"""A made-up flight of a two-link robot: what the tests of recordings and logs feed them."""

import numpy as np
from scipy.spatial.transform import Rotation

from snakegen.simulation.recording.recording import Event, Recording, channel

_LINK = """
 <link name="{name}">
  <inertial><origin xyz="0.21 0 0"/><mass value="1"/>
   <inertia ixx="0.0015" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0.21 0 0" rpy="0 1.5707963267948966 0"/>
   <geometry><cylinder radius="0.0125" length="0.42"/></geometry></visual>
  <collision><origin xyz="0.21 0 0"/><geometry><box size="0.42 0.03 0.03"/></geometry></collision>
 </link>"""

_APPARATUS = """
 <link name="roll{j}"><visual><geometry><box size="0.05 0.05 0.03"/></geometry></visual></link>
 <joint name="gimbal{j}_roll" type="revolute"><parent link="link{j}"/><child link="roll{j}"/>
  <origin xyz="0.21 0 0"/><axis xyz="1 0 0"/>
  <limit lower="-3.15" upper="3.15" effort="3" velocity="12.5"/></joint>
 <link name="pitch{j}"><visual><geometry><box size="0.03 0.2 0.01"/></geometry></visual></link>
 <joint name="gimbal{j}_pitch" type="revolute"><parent link="roll{j}"/><child link="pitch{j}"/>
  <origin xyz="0 0 0.037"/><axis xyz="0 1 0"/>
  <limit lower="-3.15" upper="3.15" effort="3" velocity="12.5"/></joint>"""

_ROTOR = """
 <link name="rotor{j}_{k}"><visual><geometry><cylinder radius="0.035" length="0.03"/></geometry>
  <material name="fan"><color rgba="0.2 0.45 0.9 1"/></material></visual></link>
 <joint name="rotor{j}_{k}_joint" type="fixed"><parent link="pitch{j}"/><child link="rotor{j}_{k}"/>
  <origin xyz="0 {y} 0"/></joint>"""

URDF = (
    '<robot name="two_link"><snakegen version="1"/>'
    + _LINK.format(name="link1")
    + _LINK.format(name="link2")
    + '<joint name="joint1_yaw" type="revolute"><parent link="link1"/><child link="link2"/>'
    '<origin xyz="0.42 0 0"/><axis xyz="0 0 1"/>'
    '<limit lower="-1.6" upper="1.6" effort="7" velocity="1"/></joint>'
    + "".join(
        _APPARATUS.format(j=j) + _ROTOR.format(j=j, k=1, y=0.11) + _ROTOR.format(j=j, k=2, y=-0.11)
        for j in (1, 2)
    )
    + "</robot>"
)
# Pinocchio's order: depth first, children by joint name.
JOINTS = ("gimbal1_roll", "gimbal1_pitch", "joint1_yaw", "gimbal2_roll", "gimbal2_pitch")
ROTORS = ("rotor1_1", "rotor1_2", "rotor2_1", "rotor2_2")
BASE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def flight(seconds: float = 4.0, rate: float = 200.0, seed: int = 0) -> Recording:
    """Returns a wobbling ascent: every channel moves, none is smooth to the last bit."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    ticks = len(time)

    def wobble(columns: int, size: float) -> np.ndarray:
        phase = rng.uniform(0, 6, columns)
        swing = np.sin(np.outer(time, rng.uniform(0.5, 2.0, columns)) + phase)
        return size * (swing + 0.03 * rng.standard_normal((ticks, columns)))

    target = np.column_stack([0.3 * np.sin(0.5 * time), 0 * time, 1.0 + 0.1 * time])
    position = target + wobble(3, 0.02)
    turn_target = Rotation.from_rotvec(np.outer(0.2 * np.sin(0.4 * time), [0, 0, 1]))
    turn = turn_target * Rotation.from_rotvec(wobble(3, 0.02))
    joint_command = 0.8 * np.sin(0.5 * time)[:, None]
    joint = joint_command + wobble(1, 0.01)
    gimbal_command = wobble(4, 0.3)
    gimbal = gimbal_command + wobble(4, 0.01)
    base = position - turn.apply(np.tile([0.42, 0.0, 0.0], (ticks, 1)))
    q = np.column_stack([base, turn.as_quat(), gimbal[:, :2], joint, gimbal[:, 2:]])
    thrust = np.array([8.0, 9.0, 14.0, 15.5]) + wobble(4, 0.6)
    slow = time[::10]
    push = np.zeros((ticks, 6))
    push[(time > 1.0) & (time < 0.8 * seconds), 1] = 6.0
    gimbals = ("gimbal1_roll", "gimbal1_pitch", "gimbal2_roll", "gimbal2_pitch")
    channels = {
        "position": channel("position", position),
        "position_target": channel("position_target", target),
        "attitude": channel("attitude", turn.as_quat()),
        "attitude_target": channel("attitude_target", turn_target.as_quat()),
        "q": channel("q", q, BASE + JOINTS),
        "thrust": channel("thrust", thrust, ROTORS),
        "thrust_command": channel("thrust_command", thrust + wobble(4, 0.1), ROTORS),
        "gimbal_angle": channel("gimbal_angle", gimbal, gimbals),
        "gimbal_command": channel("gimbal_command", gimbal_command, gimbals),
        "gimbal_torque": channel("gimbal_torque", wobble(4, 0.5), gimbals),
        "joint_angle": channel("joint_angle", joint, ("joint1_yaw",)),
        "joint_command": channel("joint_command", joint_command, ("joint1_yaw",)),
        "joint_torque": channel("joint_torque", wobble(1, 3.0), ("joint1_yaw",)),
        "disturbance": channel("disturbance", push),
        "power": channel("power", 900.0 + wobble(1, 50.0)),
        "sigma_min": channel("sigma_min", 0.2 + 0.05 * np.sin(slow), time=slow),
        "force_margin": channel("force_margin", 20.0 + np.sin(slow), time=slow),
        "torque_margin": channel("torque_margin", 3.0 + np.sin(slow), time=slow),
        "floor_distance": channel("floor_distance", 0.9 + 0.1 * slow, time=slow),
        "self_distance": channel("self_distance", 0.1 + 0.01 * np.sin(slow), time=slow),
    }
    meta = {
        "robot": "two_link",
        "mission": "wobble",
        "mode": "fully actuated",
        "seed": seed,
        "urdf": URDF,
        "weight_n": 40.0,
        "rotors": [{"link": name, "axis": [0.0, 0.0, 1.0]} for name in ROTORS],
        "limits": {
            "thrust_min": 0.0,
            "thrust_max": 16.0,
            "joint_torque": [7.0],
            "gimbal_torque": 3.0,
        },
    }
    events = (Event(0.5, "INFO", "took off"), Event(1.0, "WARN", "gust begins"))
    return Recording(time, channels, events, meta, "# Wobble\n\nA made-up flight.")
