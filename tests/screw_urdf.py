"""A screw drive's URDF written plainly, for tests that must not rest on the templates."""

from snakegen.spec.wheel_layout import wheel_layout

_LIMIT = '<limit lower="-0.7854" upper="0.7854" effort="30" velocity="1.0"/>'


def _link(name, mass, com, inertia, shape=""):
    ixx, iyy, izz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{com} 0 0"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
        f"{shape}</link>"
    )


def _joint(name, kind, parent, child, xyz, axis, limit="", rpy="0 0 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def _wheels(i, alpha, radius):
    layout, parts = wheel_layout(alpha, radius), []
    ball = f'<collision><geometry><sphere radius="{layout.radius}"/></geometry></collision>'
    for k in range(layout.blade.size):
        name = f"wheel{i}_{layout.blade[k]}_{layout.wheel[k]}"
        xyz, rpy = (" ".join(map(repr, v.tolist())) for v in (layout.position[k], layout.rpy[k]))
        parts.append(_link(name, 0.00625, 0, (3.6e-7,) * 3, ball))
        parts.append(_joint(name, "continuous", f"screw{i}", name, xyz, "0 0 1", rpy=rpy))
    return parts


def drive_urdf(alphas, radius=0.075, ahead=0.103, behind=0.123, screw_rate=6.0):
    """Returns the URDF of HA's chain: pitch and yaw joints, drums, wheels, a caster at the head."""
    parts, data = [], []
    length = ahead + behind
    for i, alpha in enumerate(alphas, 1):
        parts.append(_link(f"link{i}", 1.1, ahead, (0.001, 0.005, 0.005)))
        data.append(f'<link name="link{i}" length="{length}"/>')
        if i > 1:
            cross, back = f"joint{i - 1}_cross", f"link{i - 1}"
            parts.append(_link(cross, 0.05, 0, (1e-4,) * 3))
            parts.append(
                _joint(
                    f"joint{i - 1}_pitch", "revolute", back, cross, f"{length} 0 0", "0 1 0", _LIMIT
                )
            )
            parts.append(
                _joint(f"joint{i - 1}_yaw", "revolute", cross, f"link{i}", "0 0 0", "0 0 1", _LIMIT)
            )
            data += [
                f'<servo joint="joint{i - 1}_{axis}" stiffness="300" damping="6" armature="0.02"/>'
                for axis in ("pitch", "yaw")
            ]
        parts.append(_link(f"screw{i}", 0.7, 0, (0.0015,) * 3))
        spin = f'<limit effort="10" velocity="{screw_rate}"/>'
        parts.append(
            _joint(
                f"screw{i}", "continuous", f"link{i}", f"screw{i}", f"{ahead} 0 0", "1 0 0", spin
            )
        )
        parts += _wheels(i, alpha, radius)
        data.append(
            f'<screw_drive joint="screw{i}" link="link{i}" alpha="{alpha!r}" radius="{radius}"/>'
        )
    parts.append(_link("caster1", 0.05, 0, (1e-5,) * 3))
    parts.append(_joint("caster1_mount", "fixed", "link1", "caster1", f"0 0 {-radius}", "0 0 1"))
    data.append('<caster link="caster1"/>')
    return (
        f'<robot name="screw{len(alphas)}">{"".join(parts)}'
        f'<snakegen version="1" base="floating">{"".join(data)}</snakegen></robot>'
    )
