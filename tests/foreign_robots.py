"""Robots written in the style of other people's files, for the tests of adoption.

Each has the habits of its kind: dummy roots, massless frames, shafts with limits in newtons, motor
plugins, elements of another program's own, meshes that are not installed.
"""

from collections.abc import Iterator
from math import cos, pi, sin


def _link(name: str, mass: float = 0.0, size: tuple[float, float, float] = (0.1, 0.1, 0.05),
          extra: str = "", at: str = "0 0 0") -> str:  # fmt: skip
    if mass == 0.0:
        return f'  <link name="{name}">{extra}</link>\n'
    x, y, z = (s * s for s in size)
    ixx, iyy, izz = (mass * s / 12 for s in (y + z, x + z, x + y))
    return (
        f'  <link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx:.4e}" ixy="0" ixz="0" iyy="{iyy:.4e}" iyz="0" izz="{izz:.4e}"/>'
        f"</inertial>{extra}</link>\n"
    )


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str = "0 0 1",
           rpy: str = "0 0 0", rest: str = "") -> str:  # fmt: skip
    return (
        f'  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{rest}</joint>\n'
    )


def _limit(low: float, high: float, effort: float = 5.0, speed: float = 8.0) -> str:
    return f'<limit lower="{low}" upper="{high}" effort="{effort}" velocity="{speed}"/>'


def _around(count: int, radius: float, start: float = 0.0) -> Iterator[tuple[int, float, str]]:
    for k in range(count):
        angle = start + 2 * pi * k / count
        yield k, angle, f"{radius * cos(angle):.6f} {radius * sin(angle):.6f} 0.02"


def hexarotor() -> str:
    """A plain hexarotor: propellers on revolute shafts without torque, motor plugins, no limits."""
    body = _link("base_link", 1.5, (0.3, 0.3, 0.1)) + _link("imu_link")
    body += _joint("imu_joint", "fixed", "base_link", "imu_link", "0 0 0.05")
    file = "package://hexa_description/meshes/prop_{}.dae"
    mesh = f'<visual><geometry><mesh filename="{file}"/></geometry></visual>'
    for k, _, xyz in _around(6, 0.25):
        way = "ccw" if k % 2 == 0 else "cw"
        body += _link(f"rotor_{k}", 0.005, (0.2, 0.02, 0.005), mesh.format(way))
        limit = _limit(-1e16, 1e16, 0.0, 0.0)
        body += _joint(f"rotor_{k}_joint", "revolute", "base_link", f"rotor_{k}", xyz, rest=limit)
        body += (
            f'  <gazebo><plugin name="motor_{k}" filename="libgazebo_motor_model.so">'
            f"<jointName>rotor_{k}_joint</jointName><linkName>rotor_{k}</linkName>"
            f"<turningDirection>{way}</turningDirection><timeConstantUp>0.02</timeConstantUp>"
            "<maxRotVelocity>900</maxRotVelocity><motorConstant>9e-06</motorConstant>"
            "<momentConstant>0.017</momentConstant></plugin></gazebo>\n"
        )
    return f'<?xml version="1.0"?>\n<robot name="hexa">\n{body}</robot>\n'


def tilt_quadrotor() -> str:
    """Four arms whose motors tilt about the arm; propellers named by their direction."""
    body = _link("base_footprint") + _link("chassis", 1.6, (0.25, 0.25, 0.12))
    body += _joint("footprint_joint", "fixed", "base_footprint", "chassis", "0 0 0.1")
    for k, angle, xyz in _around(4, 0.22, pi / 4):
        way = "ccw" if k % 2 == 0 else "cw"
        body += _link(f"nacelle_{k}", 0.06, (0.04, 0.04, 0.04))
        body += _joint(f"arm_{k}_tilt", "revolute", "chassis", f"nacelle_{k}", xyz, "1 0 0",
                       f"0 0 {angle:.6f}", _limit(-1.8, 1.8))  # fmt: skip
        body += _link(f"propeller_{k}_{way}", 0.01, (0.2, 0.02, 0.005))
        body += _joint(f"spin_{k}", "continuous", f"nacelle_{k}", f"propeller_{k}_{way}",
                       "0 0 0.04", "0 0 1", rest='<limit effort="0" velocity="1000"/>')  # fmt: skip
    return f'<robot name="tilt_quad">\n{body}</robot>\n'


def tilt_hexarotor() -> str:
    """Six arms with tilting motors that are frames without mass, under a floating joint."""
    body = _link("world") + _link("hull", 2.4, (0.4, 0.4, 0.1))
    body += _joint("floating_base", "floating", "world", "hull", "0 0 1")
    for k, angle, xyz in _around(6, 0.3):
        body += _link(f"servo_horn_{k}", 0.05, (0.03, 0.05, 0.03))
        body += _joint(f"tilt_servo_{k}", "revolute", "hull", f"servo_horn_{k}", xyz, "1 0 0",
                       f"0 0 {angle:.6f}", _limit(-pi / 2, pi / 2, 3.0))  # fmt: skip
        body += _link(f"thruster_{k}")
        body += _joint(
            f"thruster_{k}_fixed", "fixed", f"servo_horn_{k}", f"thruster_{k}", "0 0 .03"
        )
    return f'<robot name="tilt_hexa">\n{body}</robot>\n'


def omni_octorotor() -> str:
    """Eight rotors on the corners of a cube that point all ways; limits of shafts in newtons."""
    body = _link("frame", 1.2, (0.3, 0.3, 0.3))
    a, b, c = 0.5 + 3**-0.5 / 2, 0.5 - 3**-0.5 / 2, 3**-0.5
    axes = [(-a, b, c), (b, a, -c), (-b, -a, -c), (a, -b, c),
            (a, -b, c), (-b, -a, -c), (b, a, -c), (-a, b, c)]  # fmt: skip
    for k in range(8):
        corner = [0.15 if k & bit else -0.15 for bit in (4, 2, 1)]
        axis = " ".join(f"{x:.9f}" for x in axes[k])
        body += _link(f"rotor{k + 1}", 0.012, (0.02, 0.02, 0.005))
        body += _joint(f"rotor_joint{k + 1}", "continuous", "frame", f"rotor{k + 1}",
                       " ".join(f"{x}" for x in corner), axis, rest=_limit(-9, 9, 0.0))  # fmt: skip
    return f'<robot name="omni">\n{body}</robot>\n'


def dragon(links: int = 4) -> str:
    """A snake of links with dual rotors on two-axis gimbals, a dummy root and one drag ratio."""
    body = (
        '  <baselink name="link2"/>\n  <thrust_link name="thrust"/>\n  <m_f_rate value="-0.012"/>\n'
    )
    body += _link("root")
    body += _joint("root_joint", "fixed", "root", "link1", "0 0 0")
    for i in range(1, links + 1):
        mesh = (
            '<visual><geometry><mesh filename="package://snake/mesh/link.dae"/></geometry></visual>'
        )
        body += _link(f"link{i}", 1.0, (0.42, 0.06, 0.06), mesh, "0.212 0 0")
        if i < links:
            body += _link(f"inter_joint{i}", 0.1, (0.04, 0.04, 0.04))
            limit = _limit(-1.57, 1.57, 7.0)
            body += _joint(f"joint{i}_pitch", "revolute", f"link{i}", f"inter_joint{i}",
                           "0.424 0 0", "0 1 0", rest=limit)  # fmt: skip
            body += _joint(f"joint{i}_yaw", "revolute", f"inter_joint{i}", f"link{i + 1}",
                           "0 0 0", "0 0 1", rest=limit)  # fmt: skip
        body += _link(f"gimbal{i}_roll_module", 0.08, (0.05, 0.1, 0.05))
        body += _joint(f"gimbal{i}_roll", "continuous", f"link{i}", f"gimbal{i}_roll_module",
                       "0.212 0 0", "1 0 0", rest='<limit effort="3" velocity="6"/>')  # fmt: skip
        body += _link(f"gimbal{i}_pitch_module", 0.2, (0.05, 0.2, 0.05))
        body += _joint(f"gimbal{i}_pitch", "continuous", f"gimbal{i}_roll_module",
                       f"gimbal{i}_pitch_module", "0 0 0", "0 1 0",
                       rest='<limit effort="3" velocity="6"/>')  # fmt: skip
        for k, side in ((1, 1), (2, -1)):
            body += _link(f"thrust{i}_{k}", 0.02, (0.01, 0.08, 0.01))
            body += _joint(f"rotor{i}_{k}", "continuous", f"gimbal{i}_pitch_module",
                           f"thrust{i}_{k}", f"0 {0.09 * side} 0", f"0 0 {side}",
                           rest=_limit(0.0, 18.0, 0.0, 0.0))  # fmt: skip
    head = '<?xml version="1.0" ?>\n<!-- made by a macro -->\n'
    return f'{head}<robot name="serpent">\n{body}</robot>\n'


ROBOTS = {
    "hexa": hexarotor,
    "tilt_quad": tilt_quadrotor,
    "tilt_hexa": tilt_hexarotor,
    "omni": omni_octorotor,
    "serpent": dragon,
}
