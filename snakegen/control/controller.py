"""A flight controller as a value: a robot's arrays, its gains and limits, and one tick.

The tick is pure: memory goes in and comes out (`State`), nothing is kept between calls.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from snakegen.control.gain_sets import axes_body, gain_set
from snakegen.control.gains import Gains
from snakegen.control.servos import gimbal_give, gimbal_limits, joint_limits
from snakegen.errors import SnakegenError, SpecError, near
from snakegen.kernels.control.control_tick import control_tick
from snakegen.kernels.control.types import DUAL, VIRTUAL, Command, Law, Measured, State, Target
from snakegen.kernels.core.types import Gimbals, Mechanism, Rotors, Tree
from snakegen.robot.robot import GRAVITY, Robot

MODES = {"virtual_single_rotor": VIRTUAL, "dual_rotor": DUAL}
INTERNAL_TIME = (0.5, 0.02)  # s; slow compared with the attitude loop; several ticks


class ControlRefused(SnakegenError):
    """A posture or a change of mode that the controller will not fly."""


@dataclass(frozen=True, eq=False)
class Controller:
    """Everything constant about a controller.

    Attributes:
        tree, rotors, gimbals: the robot.
        law: gains and limits as the kernels take them.
        mode: VIRTUAL or DUAL, the mode it starts in.
    """

    tree: Tree
    rotors: Rotors
    gimbals: Gimbals
    law: Law
    mode: int = VIRTUAL

    @property
    def mechanism(self) -> Mechanism:
        """The robot as the kernels take it."""
        return Mechanism(self.tree, self.rotors, self.gimbals)

    @property
    def apparatuses(self) -> int:
        """The number of vectoring apparatuses Ñ."""
        return int(self.gimbals.limit.size)

    def start(self, gimbals: Any = None) -> State:
        """Returns the memory before the first tick.

        Args:
            gimbals: (Ñ, 2) rad, roll and pitch now; 0 if not given (a cold start).
        """
        turns = np.zeros((self.apparatuses, 2))
        if gimbals is not None:
            turns[:] = gimbals
        none = np.full((2, self.apparatuses, 3), np.nan)
        unfiltered = np.full((2, 2, 3), np.nan)
        return State(
            np.zeros(3),
            np.zeros(3),
            turns,
            float(self.mode),
            0,
            none,
            unfiltered,
            np.full(len(self.rotors.body), np.nan),
            np.zeros(len(self.law.joints)),
        )

    def tick(
        self,
        measured: Measured,
        target: Target,
        state: State,
        dt: float,
        *,
        mode: int | None = None,
        force_dt: float | None = None,
    ) -> tuple[State, Command]:
        """Returns the memory after one tick, and the command.

        Args:
            measured: sensors now.
            target: where the CoG frame should be.
            state: memory of the tick before.
            dt: s since then.
            mode: VIRTUAL or DUAL; the controller blends into it. Its own if not given.
            force_dt: s of position error to integrate; `dt` unless the position loop is slower.
        """
        state, command = control_tick(
            self.mechanism,
            self.law,
            self.mode if mode is None else mode,
            measured,
            target,
            state,
            float(dt),
            float(dt if force_dt is None else force_dt),
        )
        return State(*state), Command(*command)

    def without(self, rotors: Sequence[int]) -> "Controller":
        """Returns the controller of the robot that has lost `rotors`.

        In dual-rotor mode their limits become 0. A virtual single rotor needs all rotors of its
        apparatus: one lost takes the whole apparatus out.
        """
        most, least = self.rotors.thrust_max.copy(), self.rotors.thrust_min.copy()
        limit = self.gimbals.limit.copy()
        most[list(rotors)] = least[list(rotors)] = 0.0
        limit[self.rotors.apparatus[list(rotors)]] = 0.0
        return replace(
            self,
            rotors=self.rotors._replace(thrust_max=most, thrust_min=least),
            gimbals=self.gimbals._replace(limit=limit),
        )

    def with_law(self, **changes: Any) -> "Controller":
        """Returns this controller with fields of its law replaced."""
        return replace(self, law=self.law._replace(**changes))


@dataclass(frozen=True)
class LawOptions:
    """Options of the control laws besides the gains; names as in `kernels.control.types.Law`.

    Attributes:
        gimbal_lower, gimbal_upper: rad, one number, (2,) or (Ñ, 2).
        gimbal_give: rad/(N·m), compliance of the gimbal servos.
        axes_body, axes_rotation: body whose axes the CoG frame has, and their rotation in it.
        gyroscopic: whether ω × Iω is cancelled.
        constrained: least norm within limits instead of the pseudo-inverse.
        sigma_min: below which dual-rotor allocation refuses.
        sweeps, newton, residual: of the solvers.
        blend_time: s, of a change of mode.
        gravity: m/s².
        length: m, lever by which torques are scaled.
        joints, joint_limit: bodies whose servo torque is limited, and to what [N·m].
        internal_time: s, time constants of the internal forces' low-pass.
        rate_filter: Hz, of measured rates; 0: none.
    """

    gimbal_lower: Any = -np.pi
    gimbal_upper: Any = np.pi
    gimbal_give: Any = 0.0
    axes_body: int = 0
    axes_rotation: Any = None
    gyroscopic: bool = True
    constrained: bool = False
    sigma_min: float = 0.02
    sweeps: int = 3
    newton: int = 10
    residual: float = 1e-6
    blend_time: float = 1.0
    gravity: float = GRAVITY
    length: float = 1.0
    joints: Any = ()
    joint_limit: Any = ()
    internal_time: Sequence[float] = INTERNAL_TIME
    rate_filter: float = 0.0


def law_of(gains: Gains, gimbals: Gimbals, options: LawOptions | None = None) -> Law:
    """Returns the kernels' form of gains and options."""
    o = options or LawOptions()
    n = int(gimbals.limit.size)
    return Law(
        np.stack([gains.force_p, gains.force_i, gains.force_d]),
        np.stack([gains.torque_p, gains.torque_i, gains.torque_d]),
        gains.force_integral_limit,
        gains.torque_integral_limit,
        np.array([gains.attitude_roll, gains.attitude_pitch], float),
        gains.vectoring(n),
        float(gains.tilt_limit),
        np.broadcast_to(np.asarray(o.gimbal_lower, float), (n, 2)).copy(),
        np.broadcast_to(np.asarray(o.gimbal_upper, float), (n, 2)).copy(),
        np.broadcast_to(np.asarray(o.gimbal_give, float), (n, 2)).copy(),
        int(o.axes_body),
        np.eye(3) if o.axes_rotation is None else np.array(o.axes_rotation, float),
        int(o.gyroscopic),
        int(o.constrained),
        float(o.sigma_min),
        int(o.sweeps),
        int(o.newton),
        float(o.residual),
        float(o.blend_time),
        float(o.gravity),
        float(o.length),
        np.array(o.joints, np.int64),
        np.array(o.joint_limit, float),
        np.array(o.internal_time, float),
        np.ones((2, 3)),
        float(o.rate_filter),
    )


def check_mounts(
    tree: Tree, rotors: Rotors, gimbals: Gimbals, names: Sequence[str] | None = None
) -> None:
    """Refuses gimbals that the laws cannot turn.

    Args:
        tree, rotors, gimbals: of the robot.
        names: of the apparatuses, for the error; their numbers if absent.

    Raises:
        ControlRefused: gimbal joints of an apparatus that do not follow one another, rotors that
            stand elsewhere than on the last of them, or that are not parallel.
    """
    names = names or [f"apparatus {j + 1}" for j in range(gimbals.limit.size)]
    for j in range(gimbals.limit.size):
        joints = sorted(b for b in (gimbals.roll_body[j], gimbals.pitch_body[j]) if b >= 0)
        if len(joints) == 2 and tree.parent[joints[1]] != joints[0]:
            raise ControlRefused(
                f"{names[j]}: another joint stands between its gimbal joints; "
                "name the two joints next to each other as roll and pitch."
            )
        if joints and gimbals.thrust_body[j] != joints[-1]:
            raise ControlRefused(
                f"{names[j]}: its rotors are not on the body that its last gimbal turns."
            )
        mine = rotors.axis[rotors.apparatus == j]
        if np.any(mine @ gimbals.thrust_axis[j] < 1.0 - 1e-6):
            raise ControlRefused(
                f"{names[j]}: its rotors are not parallel; make them apparatuses of their own."
            )


def flight_controller(
    robot: Robot,
    gains: str | Gains | None = None,
    *,
    allocator: str = "paper",
    mode: str | None = None,
    axes: str | None = None,
    **options: Any,
) -> Controller:
    """Returns the controller that a robot's `<control>` element describes.

    Args:
        robot: a floating robot with vectoring apparatuses.
        gains: the name of one of its gain sets, or gains; its own choice if not given.
        allocator: "paper" (pseudo-inverse) or "constrained".
        mode: "virtual_single_rotor" or "dual_rotor".
        axes: whose axes the CoG frame has: "root", "middle" or "auto".
        **options: further fields of `LawOptions`.

    Raises:
        ControlRefused: no apparatus, or gimbals that the laws cannot turn.
        SpecError: an unknown gain set, mode, allocator or axes.
    """
    control = robot.modules.control
    if not robot.modules.apparatuses:
        raise ControlRefused(f"{robot.name} carries no vectoring apparatus: it cannot fly.")
    check_mounts(robot.tree, robot.rotors, robot.gimbals, robot.apparatus_names)
    _among(allocator, ("paper", "constrained"), "allocator")
    mode = str(mode or control.get("mode", "virtual_single_rotor"))
    _among(mode, tuple(MODES), "mode")
    axes = str(axes or control.get("axes", "auto"))
    _among(axes, ("auto", "root", "middle"), "axes")
    body, turn = axes_body(robot, axes)
    lower, upper = gimbal_limits(robot)
    bodies, torque = joint_limits(robot)
    own = {"sigma_min": 0.02, "rate_filter": 0.0}
    options = {k: float(control.get(k, v)) for k, v in own.items()} | options
    chosen = LawOptions(
        gimbal_lower=lower,
        gimbal_upper=upper,
        gimbal_give=gimbal_give(robot),
        axes_body=body,
        axes_rotation=turn,
        constrained=allocator == "constrained",
        length=robot.link_length,
        joints=bodies,
        joint_limit=torque,
        **options,
    )
    law = law_of(gain_set(robot, gains), robot.gimbals, chosen)
    arrays = (robot.tree, robot.rotors, robot.gimbals)
    return Controller(*arrays, law, MODES[mode])


def _among(value: str, known: Sequence[str], what: str) -> None:
    if value not in known:
        raise SpecError(f"{what} '{value}' is unknown.{near(value, known)}")
