"""Parts of a robot read from an MJCF of any tool."""

import math
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from snakegen.base.bounded_text import refuse_special
from snakegen.base.geometry import Floats
from snakegen.description.mjcf.files import load_model
from snakegen.errors import DescriptionError
from snakegen.pipeline.robot_parts import BASE, ActuatorPart, BodyPart, JointPart, RobotParts, Sum
from snakegen.spec.urdf import read_urdf

_KINDS = {
    mujoco.mjtJoint.mjJNT_FREE: "floating",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
    mujoco.mjtJoint.mjJNT_HINGE: "revolute",
}
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
_FILE = re.compile(r"""\bfile\s*=\s*["']([^"'<>]+)["']""")
_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"'<>]+)["']""")
_NO_LIMIT = np.array([-np.inf, np.inf])


def mjcf_parts(path: Path) -> RobotParts:
    """Reads an MJCF with MuJoCo.

    Raises:
        DescriptionError: MuJoCo cannot load it.
    """
    _refuse_special_parts(path)
    try:
        model = load_model(path)
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise DescriptionError(f"{path}: MuJoCo cannot load it ({reason}).") from None
    return _Reader(model).parts(str(path))


def _refuse_special_parts(path: Path) -> None:
    """Refuses an MJCF whose includes, meshes or textures are pipes or devices: they may not end.

    Raises:
        DescriptionError: names the file.
    """
    waiting, seen = [path], {path}
    folders = {Path()}
    while waiting:
        text = read_urdf(waiting.pop())
        folders |= {Path(word) for word in _FOLDER.findall(text)}
        for file in {path.parent / f / word for f in folders for word in _FILE.findall(text)}:
            if not file.exists():
                continue  # MuJoCo names it
            try:
                refuse_special(file)
            except OSError as error:
                raise DescriptionError(f"{path}: {file}: {error.strerror}.") from None
            if file.suffix == ".xml" and file not in seen:
                seen.add(file)
                waiting.append(file)


class _Reader:
    """Reads a compiled model with all joint coordinates at 0."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        for j in range(model.njnt):  # coordinates, not displacements from qpos0
            if model.jnt_type[j] in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
                self.data.qpos[model.jnt_qposadr[j]] = 0.0
        mujoco.mj_kinematics(model, self.data)
        self.keys = self._keys()

    def parts(self, source: str) -> RobotParts:
        """Returns all parts."""
        model = self.model
        first = next((j for j in range(model.njnt) if model.jnt_type[j] == 0), -1)
        floating = first >= 0 and self._joint_key(first) == BASE
        frames = {}
        for body in range(model.nbody):
            if model.body(body).name:
                pose = np.eye(4)
                pose[:3, :3] = self.data.xmat[body].reshape(3, 3)
                pose[:3, 3] = self.data.xpos[body]
                frames[model.body(body).name] = pose
        others = model.neq - len(self._couplings())
        notes = [f"{model.ntendon} tendons"] if model.ntendon else []
        notes += [f"{others} equality constraints that couple no joints"] if others else []
        curved = np.any(model.dof_dampingpoly) or np.any(model.jnt_stiffnesspoly)
        notes += ["damping or stiffness that grows with its argument"] if curved else []
        return RobotParts(
            source, "MJCF", floating, frames, self._joints(), self._bodies(),
            self._actuators(), tuple(notes),
        )  # fmt: skip

    def _joint_key(self, joint: int) -> str:
        """Returns the key of the body that a joint moves; the first free root is the base."""
        model = self.model
        free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        if len(free) and joint == free[0] and model.body_parentid[model.jnt_bodyid[joint]] == 0:
            return BASE
        return model.joint(joint).name or f"joint {joint}"

    def _keys(self) -> list[str]:
        """Returns the key of the moving body that each MuJoCo body belongs to."""
        model, keys = self.model, [BASE] * self.model.nbody
        for body in range(1, model.nbody):
            count, start = int(model.body_jntnum[body]), int(model.body_jntadr[body])
            parent = keys[int(model.body_parentid[body])]
            keys[body] = self._joint_key(start + count - 1) if count else parent
        return keys

    def _bodies(self) -> dict[str, BodyPart]:
        model, data = self.model, self.data
        sums: dict[str, Sum] = {BASE: Sum("")}
        for j in range(model.njnt):  # of several joints on one body only the last carries mass
            key = self._joint_key(j)
            sums.setdefault(key, Sum(model.body(int(model.jnt_bodyid[j])).name))
        for body in range(1, model.nbody):
            total = sums[self.keys[body]]
            total.link = total.link or model.body(body).name
            turn = data.ximat[body].reshape(3, 3)
            inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
            total.add(float(model.body_mass[body]), np.array(data.xipos[body]), inertia)
        return {key: total.body() for key, total in sums.items()}

    def _joints(self) -> dict[str, JointPart]:
        model, couplings = self.model, self._couplings()
        out = {}
        for j in range(model.njnt):
            key = self._joint_key(j)
            if key == BASE:
                continue
            body, dof = int(model.jnt_bodyid[j]), int(model.jnt_dofadr[j])
            first = j == int(model.body_jntadr[body])
            carrier = self.keys[int(model.body_parentid[body])] if first else self._joint_key(j - 1)
            kind = _KINDS[mujoco.mjtJoint(int(model.jnt_type[j]))]
            axial = kind in ("revolute", "prismatic")
            out[key] = JointPart(
                kind,
                carrier,
                model.body(body).name,
                np.array(self.data.xaxis[j]) if axial else np.zeros(3),
                np.array(self.data.xanchor[j]),
                np.array(model.jnt_range[j]) if model.jnt_limited[j] and axial else _NO_LIMIT,
                self._effort(j),
                math.nan,
                np.array(
                    [
                        model.dof_damping[dof],
                        model.dof_frictionloss[dof],
                        model.dof_armature[dof],
                        model.jnt_stiffness[j],
                    ]
                ),
                couplings.get(j),
            )
        return out

    def _couplings(self) -> dict[int, tuple[str, float, float]]:
        """Returns leader, multiplier and offset of each joint that an equality makes follow."""
        model, out = self.model, {}
        for e in range(model.neq):
            joint = model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT
            if joint and model.eq_active0[e] and model.eq_obj2id[e] >= 0:
                follower, leader = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
                constant, slope = (float(x) for x in model.eq_data[e][:2])
                if not np.any(model.eq_data[e][2:5]):  # y - y0 = a + b (x - x0)
                    x0 = float(model.qpos0[model.jnt_qposadr[leader]])
                    y0 = float(model.qpos0[model.jnt_qposadr[follower]])
                    offset = y0 + constant - slope * x0
                    out[follower] = (model.joint(leader).name, slope, offset)
        return out

    def _effort(self, j: int) -> Floats:
        """Returns the force range of a joint: its own limit, or what its actuators can do."""
        model = self.model
        if model.jnt_actfrclimited[j]:
            return np.array(model.jnt_actfrcrange[j])
        total, driven = np.zeros(2), False
        for a in range(model.nu):
            kind = model.actuator_trntype[a]
            if kind != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_trnid[a, 0] != j:
                continue
            driven = True
            ends = model.actuator_gear[a, 0] * _force_range(model, a)
            total = total + np.array([ends.min(), ends.max()])
        return total if driven else np.array(_NO_LIMIT)

    def _actuators(self) -> dict[str, ActuatorPart]:
        model = self.model
        return {
            model.actuator(a).name or f"actuator {a}": self._actuator(a) for a in range(model.nu)
        }

    def _actuator(self, a: int) -> ActuatorPart:
        model, data = self.model, self.data
        kind, target = (
            mujoco.mjtTrn(int(model.actuator_trntype[a])),
            int(model.actuator_trnid[a, 0]),
        )
        gear, point = np.array(model.actuator_gear[a]), np.zeros(3)
        if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
            named = f"joint {model.joint(target).name}"
        elif kind == mujoco.mjtTrn.mjTRN_SITE and model.actuator_trnid[a, 1] < 0:
            named = f"body {self.keys[int(model.site_bodyid[target])]}"
            turn, point = data.site_xmat[target].reshape(3, 3), np.array(data.site_xpos[target])
            gear = np.concatenate([turn @ gear[:3], turn @ gear[3:]])
        else:
            named = f"{kind.name.removeprefix('mjTRN_').lower()} {target}"
        dyn = int(model.actuator_dyntype[a])
        lag = float(model.actuator_dynprm[a, 0]) if dyn in _FILTERS else 0.0
        bias = model.actuator_biasprm[a, :3]
        biased = model.actuator_biastype[a] != mujoco.mjtBias.mjBIAS_NONE
        return ActuatorPart(
            named,
            gear,
            point,
            float(model.actuator_gainprm[a, 0]),
            np.array(bias) if biased else np.zeros(3),
            _range(model.actuator_ctrllimited[a], model.actuator_ctrlrange[a]),
            _range(model.actuator_forcelimited[a], model.actuator_forcerange[a]),
            lag if dyn != int(mujoco.mjtDyn.mjDYN_USER) else math.nan,
        )


def _range(limited: Any, ends: Any) -> Floats:
    return np.array(ends, float) if limited else np.array(_NO_LIMIT)


def _force_range(model: mujoco.MjModel, a: int) -> Floats:
    """Returns the force (2,) that an actuator can make before its gear."""
    force = _range(model.actuator_forcelimited[a], model.actuator_forcerange[a])
    if model.actuator_biastype[a] != mujoco.mjtBias.mjBIAS_NONE:
        return force
    command = _range(model.actuator_ctrllimited[a], model.actuator_ctrlrange[a])
    ends = np.sort(float(model.actuator_gainprm[a, 0]) * command)
    return np.array([max(force[0], ends[0]), min(force[1], ends[1])])
