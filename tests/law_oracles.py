"""The dynamics of a tree by Pinocchio and by MuJoCo, each built from the tree's own arrays."""

import mujoco
import numpy as np
import pinocchio as pin

from snakegen.base.geometry import quaternion_xyzw, wxyz_from_xyzw

GRAVITY = np.array([0.3, -0.4, -9.7])


def in_pinocchio(tree, floating):
    """The same robot in Pinocchio, joint by joint, and the rows of its joints in v."""
    model = pin.Model()
    model.gravity.linear = GRAVITY
    ids = [0]
    if floating:
        ids = [model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")]
        base = pin.Inertia(tree.mass[0], tree.com[0], tree.inertia[0])
        model.appendBodyToJoint(ids[0], base, pin.SE3.Identity())
    for i in range(1, len(tree.parent)):
        slides = tree.prismatic[i]
        kind = pin.JointModelPrismaticUnaligned if slides else pin.JointModelRevoluteUnaligned
        place = pin.SE3(tree.rotation[i], tree.translation[i])
        ids.append(model.addJoint(ids[tree.parent[i]], kind(tree.axis[i]), place, f"j{i}"))
        body = pin.Inertia(tree.mass[i], tree.com[i], tree.inertia[i])
        model.appendBodyToJoint(ids[i], body, pin.SE3.Identity())
    rows = [*range(6)] * floating + [model.joints[i].idx_v for i in ids[1:]]
    return model, model.createData(), ids, np.array(rows, int)


def by_pinocchio(tree, robot, s, floating):
    model, data, ids, rows = robot
    rotation, angles, v, a, armature, wrenches = s
    q, vp, ap = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    first = 6 if floating else 0
    if floating:
        q[3:7] = quaternion_xyzw(rotation)
    for i, joint in enumerate(ids[1:]):
        q[model.joints[joint].idx_q] = angles[i]
    vp[rows], ap[rows] = v[6 - first :], a[6 - first :]
    turning = np.zeros(model.nv)
    turning[rows[first:]] = armature
    model.armature = turning
    pin.forwardKinematics(model, data, q)
    forces = [pin.Force.Zero() for _ in range(model.njoints)]
    for body, joint in enumerate(ids):
        back = data.oMi[joint].rotation.T
        forces[joint] = pin.Force(back @ wrenches[body, :3], back @ wrenches[body, 3:])
    vector = pin.StdVec_Force()
    vector.extend(forces)
    return pin.rnea(model, data, q, vp, ap, vector)[rows]


def in_mujoco(tree, floating):
    """The same robot in MuJoCo, written as nested bodies."""
    children = [[] for _ in tree.parent]
    for i, j in enumerate(tree.parent[1:], 1):
        children[j].append(i)

    def numbers(x):
        return " ".join(repr(float(v)) for v in np.ravel(x))

    def body(i):
        quat = wxyz_from_xyzw(quaternion_xyzw(tree.rotation[i]))
        kind = "slide" if tree.prismatic[i] else "hinge"
        joint = f'<joint name="j{i}" type="{kind}" axis="{numbers(tree.axis[i])}"/>'
        six = tree.inertia[i][[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        inertial = (
            f'<inertial pos="{numbers(tree.com[i])}" mass="{numbers(tree.mass[i])}" '
            f'fullinertia="{numbers(six)}"/>'
        )
        inside = "".join(body(k) for k in children[i])
        if i == 0 and not floating:
            return inside
        return (
            f'<body name="b{i}" pos="{numbers(tree.translation[i])}" quat="{numbers(quat)}">'
            f"{inertial}{'<freejoint/>' if i == 0 else joint}{inside}</body>"
        )

    text = (
        f'<mujoco><compiler angle="radian"/><option gravity="{numbers(GRAVITY)}"/>'
        f"<worldbody>{body(0)}</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    names = [model.joint(f"j{i}").id for i in range(1, len(tree.parent))]
    return model, mujoco.MjData(model), np.array(names, int)


def by_mujoco(tree, robot, s, floating):
    model, data, joints = robot
    rotation, angles, v, a, armature, wrenches = s
    rows = model.jnt_dofadr[joints]
    model.dof_armature[rows] = armature
    data.qpos[model.jnt_qposadr[joints]] = angles
    data.qvel[rows], data.qacc[rows] = v[6:], a[6:]
    if floating:  # MuJoCo's free joint: linear rows in world axes, angular in the body's
        data.qpos[:3] = 0.0
        data.qpos[3:7] = wxyz_from_xyzw(quaternion_xyzw(rotation))
        data.qvel[:3], data.qvel[3:6] = rotation @ v[:3], v[3:6]
        data.qacc[:3] = rotation @ (a[:3] + np.cross(v[3:6], v[:3]))
        data.qacc[3:6] = a[3:6]
    mujoco.mj_inverse(model, data)
    out = data.qfrc_inverse.copy()
    for i in range(0 if floating else 1, len(tree.parent)):
        k = model.body(f"b{i}").id
        push = np.zeros(model.nv)
        mujoco.mj_applyFT(model, data, wrenches[i, :3], wrenches[i, 3:], data.xpos[k], k, push)
        out -= push
    base = np.concatenate([rotation.T @ out[:3], out[3:6]]) if floating else np.zeros(0)
    return np.concatenate([base, out[rows]])


def error(a, b):
    return np.max(np.abs(a - b)) / np.max(np.abs(b))
