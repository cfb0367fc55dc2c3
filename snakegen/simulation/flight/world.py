"""The simulated world of a run: a robot's MJCF on a floor, and where each quantity stands."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, wxyz_from_xyzw, xyzw_from_wxyz
from snakegen.description.mjcf.decorate import decorate
from snakegen.description.mjcf.rolling_contact import meet_rollers
from snakegen.robot.robot import Robot
from snakegen.scene.solids import Solid
from snakegen.simulation.flight.elastic import add_springs, split_links
from snakegen.simulation.flight.plan import Box
from snakegen.simulation.flight.scene_geoms import add_obstacle

Ints = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True, eq=False)
class World:
    """A compiled model and the addresses of the robot's quantities in it.

    Attributes:
        robot: from its URDF.
        model: MuJoCo's, visuals left out.
        qpos, qvel: (n-1,) addresses of the joints, in the tree's order.
        rotors: (n_rotors,) actuators.
        activation: (n_rotors,) addresses of the motors' lag in `act`, -1 where there is none.
        gimbals: (Ñ, 2) actuators of roll and pitch, -1 where the joint is absent.
        gimbal_joints: (Ñ, 2) indices into the tree's angles, -1 where absent.
        servos: (k,) actuators of the joints that shape the body.
        chain: (k,) indices of those joints into the tree's angles.
    """

    robot: Robot
    model: mujoco.MjModel
    qpos: Ints
    qvel: Ints
    rotors: Ints
    activation: Ints
    gimbals: Ints
    gimbal_joints: Ints
    servos: Ints
    chain: Ints

    @property
    def floating(self) -> bool:
        """Whether the base is free."""
        return self.robot.floating

    def posed(self, q: Floats) -> tuple[mujoco.MjData, Floats]:
        """Returns data of the kinematics at q (nq,), and the centre of gravity (3,) [m], world."""
        data = mujoco.MjData(self.model)
        self.set_state(data, q)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        return data, data.subtree_com[self.model.body(self.robot.root_link).id]

    def set_state(self, data: mujoco.MjData, q: Floats, v: Floats | None = None) -> None:
        """Writes a configuration (and velocity) in Pinocchio's order into `data`."""
        base, origin = self.robot.base_pose(q)
        velocity = np.zeros(self.robot.model.nv) if v is None else v
        start = 0
        if self.floating:
            data.qpos[:3], data.qpos[3:7] = origin, wxyz_from_xyzw(q[3:7])
            data.qvel[:3], data.qvel[3:6] = base @ velocity[:3], velocity[3:6]
            start = 6
        data.qpos[self.qpos] = self.robot.angles(q)
        data.qvel[self.qvel] = velocity[start:]

    def configurations(self, qpos: Floats) -> Floats:
        """Returns q (T, nq) in Pinocchio's order from rows of MuJoCo's qpos (T, ·)."""
        model = self.robot.model
        out = np.zeros((len(qpos), model.nq))
        if self.floating:
            out[:, :3], out[:, 3:7] = qpos[:, :3], xyzw_from_wxyz(qpos[:, 3:7])
        for name, address in zip(self.robot.joint_names, self.qpos, strict=True):
            joint = model.joints[model.getJointId(name)]
            angle = qpos[:, address]
            if joint.nq == 2:
                out[:, joint.idx_q], out[:, joint.idx_q + 1] = np.cos(angle), np.sin(angle)
            else:
                out[:, joint.idx_q] = angle
        return out


def make_world(
    robot: Robot,
    *,
    timestep: float = 0.001,
    floor: bool = True,
    obstacles: Sequence[Box | Solid] = (),
    link_stiffness: float = 0.0,
    link_damping: float = 0.0,
    motor_lag: bool = True,
    sensors: Collection[str] = (),
) -> World:
    """Returns the world of a run: the MJCF of the robot's URDF, without visuals, on a floor.

    Args:
        robot: any robot of the grammar.
        timestep: s.
        floor: whether there is ground at z = 0.
        obstacles: solids that stand in the way.
        link_stiffness: N·m/rad of a bending link; 0: links are rigid.
        link_damping: s, its damping over its stiffness.
        motor_lag: False: motors give at once what they are asked.
        sensors: names of the MJCF's sensors to keep; the flight loop reads the state itself.
    """
    lengths = robot.modules.lengths
    urdf = split_links(robot.urdf, lengths) if link_stiffness > 0 else robot.urdf
    spec = decorate(urdf, robot.modules, {}, visuals=False, folder=robot.folder)
    if link_stiffness > 0:
        add_springs(spec, lengths, link_stiffness, link_damping)
    if not motor_lag:
        for rotor in (r for a in robot.modules.apparatuses for r in a.rotors):
            spec.actuator(rotor.label).dyntype = mujoco.mjtDyn.mjDYN_NONE
        for key in list(spec.keys):  # they hold what motors give after their lag
            spec.delete(key)
    spec.option.timestep = timestep
    # a reset in mid-run would hide that the run has diverged
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for sensor in list(spec.sensors):  # each costs time in every step
        if sensor.name not in sensors:
            spec.delete(sensor)
    if floor:
        _add_floor(spec)
    for one in obstacles:
        add_obstacle(spec, one)
    if robot.modules.screws:
        meet_rollers(spec)
    model = spec.compile()
    names = list(robot.joint_names)
    joints = [model.joint(n).id for n in names]
    rotors = [model.actuator(r.label).id for a in robot.modules.apparatuses for r in a.rotors]
    pairs = [(a.roll, a.pitch) for a in robot.modules.apparatuses]
    driven = {s.joint for s in robot.modules.servos}
    chain = [n for n in robot.chain_joints if n in driven]
    return World(
        robot,
        model,
        np.array(model.jnt_qposadr[joints], np.int64),
        np.array(model.jnt_dofadr[joints], np.int64),
        np.array(rotors, np.int64),
        np.array([model.actuator_actadr[r] for r in rotors], np.int64),
        _table(pairs, lambda n: model.actuator(n).id),
        _table(pairs, names.index),
        np.array([model.actuator(n).id for n in chain], np.int64),
        np.array([names.index(n) for n in chain], np.int64),
    )


def _add_floor(spec: mujoco.MjSpec) -> None:
    """Adds ground at z = 0, and a sensor of the normal force [N] that acts below z = 5 cm."""
    world, kind = spec.worldbody, mujoco.mjtGeom
    world.add_geom(name="floor", type=kind.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    world.add_site(
        name="ground", type=kind.mjGEOM_BOX, pos=[0, 0, -0.95], size=[1e3, 1e3, 1.0], group=5
    )
    spec.add_sensor(
        name="ground",
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="ground",
    )


def _table(pairs: Sequence[tuple[str | None, str | None]], find: Any) -> Ints:
    rows = [[-1 if n is None else find(n) for n in pair] for pair in pairs]
    return np.array(rows, np.int64).reshape(-1, 2)


def rotation_of(wxyz: Floats) -> Floats:
    """Returns the (3, 3) rotation of a unit quaternion in MuJoCo's order."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, wxyz)
    return out.reshape(3, 3)
