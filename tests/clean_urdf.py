"""A URDF without a finding, which tests break in one place."""

GOOD = """<?xml version="1.0" encoding="utf-8"?>
<robot name="two">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base"/>
  <link name="link1">
    <inertial>
      <origin xyz="0.1 0 0" rpy="0 0 0"/>
      <mass value="1.2"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>
    </inertial>
    <visual><geometry><mesh filename="rod.stl"/></geometry><material name="grey"/></visual>
    <collision><geometry><cylinder radius="0.01" length="0.4"/></geometry></collision>
  </link>
  <link name="cross"/>
  <link name="link2">
    <inertial>
      <mass value="0.8"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>
    </inertial>
    <visual><geometry><box size="0.1 0.1 0.2"/></geometry></visual>
  </link>
  <joint name="joint1" type="revolute">
    <origin xyz="0 0 0.1" rpy="0 0 0"/>
    <parent link="base"/>
    <child link="link1"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="7" velocity="0.5"/>
    <dynamics damping="0.1" friction="0"/>
  </joint>
  <joint name="weld" type="fixed"><parent link="cross"/><child link="link2"/></joint>
  <joint name="joint2" type="continuous">
    <parent link="link1"/>
    <child link="cross"/>
    <axis xyz="0 1 0"/>
    <mimic joint="joint1" multiplier="-1"/>
  </joint>
  <snakegen version="1"><whatever lies="within"/></snakegen>
  <mujoco><compiler discardvisual="false"/></mujoco>
  <gazebo reference="link1"/>
  <transmission name="t"/>
  <ros2_control name="r"/>
  <sensor name="imu"/>
</robot>
"""
