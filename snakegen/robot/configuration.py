"""A configuration q of a robot: validated once, its kinematics computed once, as asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from snakegen.base.geometry import (
    Floats,
    rotation_about,
    rotation_from_xyzw,
    rpy_from_rotation,
    skew,
)
from snakegen.errors import PostureError
from snakegen.robot.frames import ModelFrames

SHOWN = 6  # joints that `repr` names
T = TypeVar("T")


class Configuration(np.ndarray):
    """A configuration in Pinocchio's order that knows its robot.

    It is the array q, (nq,) float64, wherever an array is taken: ``np.asarray(c)``, Pinocchio's
    functions, indexing and arithmetic, whose results are plain arrays. Poses, CoG and Jacobians are
    computed when they are first asked for, kept, and dropped when an entry of q changes.

    What is kept cannot be written to.

    Attributes:
        robot: the robot whose configuration it is.

    Raises:
        PostureError: a wrong size, an entry that is not finite, a quaternion of norm 0.
    """

    robot: ModelFrames
    _known: dict[str, Any]
    _of: bytes
    __array_priority__ = -1.0  # results of numpy functions are plain arrays

    def __new__(cls, robot: ModelFrames, q: ArrayLike) -> Configuration:
        """Returns a copy of `q`, validated."""
        try:
            values = np.array(q, dtype=np.float64)
        except (TypeError, ValueError):
            raise PostureError(f"{robot.name}: q is not an array of numbers.") from None
        nq = int(robot.model.nq)
        if values.shape != (nq,):
            raise PostureError(f"{robot.name}: q has shape {values.shape}, ({nq},) needed.")
        out = values.view(cls)
        out.robot, out._known, out._of = robot, {}, b""
        out._validate()
        return out

    def __array_finalize__(self, source: Any) -> None:
        """Gives a copy its robot; a part of a configuration is none."""
        if isinstance(source, Configuration):
            self.robot, self._known, self._of = source.robot, {}, b""

    def __getitem__(self, key: Any) -> Any:
        """Returns entries of q as a number or a plain array."""
        return self.q[key]

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Computes with plain arrays; ``c += step`` changes c."""
        if "out" in options:
            options["out"] = tuple(_plain(x) for x in options["out"])
        found = getattr(ufunc, method)(*(_plain(x) for x in inputs), **options)
        return self if isinstance(found, np.ndarray) and np.shares_memory(found, self) else found

    def __reduce__(self) -> Any:
        """Pickles robot and values."""
        return Configuration, (self.robot, np.array(self.q))

    def __repr__(self) -> str:
        """Returns the robot and what differs from its neutral posture, in rad and m."""
        if self.ndim != 1:  # of a reshaped one
            return repr(self.q)
        parts = [f"{n}={_short(a)}" for n, a in self.posture().items()]
        if len(parts) > SHOWN:
            parts[SHOWN:] = [f"… {len(parts) - SHOWN} more"]
        return f"Configuration({', '.join([self.robot.name, *parts])})"

    __str__ = __repr__

    @property
    def q(self) -> Floats:
        """The same numbers as a plain array (nq,)."""
        return self.view(np.ndarray)

    def _validate(self) -> None:
        """Checks the numbers of q.

        Raises:
            PostureError: one that is not finite, or a quaternion of norm 0.
        """
        if not np.all(np.isfinite(self.q)):
            raise PostureError(f"{self.robot.name}: q holds NaN or infinity.")
        if self.robot.floating and not np.any(self.q[3:7]):
            raise PostureError(f"{self.robot.name}: q[3:7] is a quaternion; it has norm 0.")
        self._of = self.tobytes()

    def _kept(self, name: str, make: Callable[[], T]) -> T:
        """Returns what `make` gives for the numbers that q has now."""
        if self._of != self.tobytes():
            self._known.clear()
            self._validate()
        if name not in self._known:
            self._known[name] = _frozen(make())
        return cast(T, self._known[name])

    @property
    def angles(self) -> Floats:
        """Joint angles (n-1,) in the tree's order, rad; m where a joint slides."""
        return self._kept("angles", lambda: self.robot.angles_of(self.q))

    @property
    def base_rotation(self) -> Floats:
        """Attitude (3, 3) of the base in the world; the identity of a fixed base."""
        floating = self.robot.floating
        return self._kept(
            "base_rotation", lambda: rotation_from_xyzw(self.q[3:7]) if floating else np.eye(3)
        )

    @property
    def base_position(self) -> Floats:
        """Origin (3,) of the base in the world, m; 0 of a fixed base."""
        return np.array(self.q[:3]) if self.robot.floating else np.zeros(3)

    @property
    def body_poses(self) -> tuple[Floats, Floats]:
        """Attitudes (n, 3, 3) and origins (n, 3) [m] of the bodies of `robot.tree` in the world."""
        return self._kept("body_poses", self._forward)

    def _forward(self) -> tuple[Floats, Floats]:
        """Returns ``T_i = T_parent · (R_i, t_i) · exp(axis_i angle_i)`` of every body."""
        tree = self.robot.tree
        n = len(tree.parent)
        rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
        rotation[0], position[0] = self.base_rotation, self.base_position
        for i in range(1, n):
            above, angle = tree.parent[i], self.angles[i - 1]
            mount = rotation[above] @ tree.rotation[i]
            position[i] = position[above] + rotation[above] @ tree.translation[i]
            if tree.prismatic[i]:
                rotation[i] = mount
                position[i] += mount @ tree.axis[i] * angle
            else:
                rotation[i] = mount @ rotation_about(tree.axis[i], angle)
        return rotation, position

    def link_pose(self, link: str) -> tuple[Floats, Floats]:
        """Returns attitude (3, 3) and origin (3,) [m] of `link` in the world.

        Raises:
            DescriptionError: no such link.
        """
        body, turned, offset = self.robot.body_of_link(link)
        rotation, position = self.body_poses
        return rotation[body] @ turned, position[body] + rotation[body] @ offset

    @property
    def link_poses(self) -> dict[str, tuple[Floats, Floats]]:
        """Attitude (3, 3) and origin (3,) [m] of every link in the world, by name."""
        kind = pin.FrameType.BODY
        names = [f.name for f in self.robot.model.frames if f.type == kind and f.name != "universe"]
        return self._kept("link_poses", lambda: {name: self.link_pose(name) for name in names})

    @property
    def cog(self) -> Floats:
        """Centre of gravity (3,) of what moves, m, world: ``c = Σ m_i c_i / m``."""
        return self._kept("cog", self._centre)

    def _centre(self) -> Floats:
        tree = self.robot.tree
        rotation, position = self.body_poses
        places = position + np.einsum("nij,nj->ni", rotation, tree.com)
        return np.asarray(tree.mass @ places / tree.mass.sum())

    def jacobian(self, link: str) -> Floats:
        """Returns (6, nv): ``[linear; angular] = J v`` of `link`'s origin, world axes.

        Pinocchio's order of v; a floating base's velocity is along the base's own axes.

        Raises:
            DescriptionError: no such link.
        """
        body = self.robot.body_of_link(link)[0]
        return self._kept(f"jacobian {link}", lambda: self._at(body, self.link_pose(link)[1]))

    @property
    def cog_jacobian(self) -> Floats:
        """(3, nv) of the CoG: ``c' = J v = Σ m_i J_i v / m``, world axes."""
        return self._kept("cog_jacobian", self._cog_jacobian)

    def _cog_jacobian(self) -> Floats:
        tree = self.robot.tree
        rotation, position = self.body_poses
        places = position + np.einsum("nij,nj->ni", rotation, tree.com)
        parts = [m * self._at(i, places[i])[:3] for i, m in enumerate(tree.mass)]
        return np.asarray(sum(parts) / tree.mass.sum())

    def _at(self, body: int, point: Floats) -> Floats:
        """Returns the Jacobian (6, nv) of a `point` [m, world] that moves with `body`."""
        robot, (rotation, position) = self.robot, self.body_poses
        tree, shift = robot.tree, 6 if robot.floating else 0
        out = np.zeros((6, shift + len(tree.parent) - 1))
        if robot.floating:
            out[:3, :3] = out[3:, 3:6] = rotation[0]
            out[:3, 3:6] = -skew(point - position[0]) @ rotation[0]
        while body > 0:
            axis, column = rotation[body] @ tree.axis[body], shift + body - 1
            if tree.prismatic[body]:
                out[:3, column] = axis
            else:
                out[:, column] = *np.cross(axis, point - position[body]), *axis
            body = int(tree.parent[body])
        return out

    def posture(self) -> dict[str, Any]:
        """Returns what `Robot.configuration` makes this of: what is not 0, by name; rad, m."""
        names = zip(self.robot.joint_names, self.angles.tolist(), strict=True)
        out: dict[str, Any] = {name: angle for name, angle in names if angle != 0.0}
        rpy = rpy_from_rotation(self.base_rotation)
        for name, part in (("base_rpy", rpy), ("base_position", self.base_position)):
            if np.any(part):
                out[name] = part.tolist()
        return out


def _plain(value: Any) -> Any:
    return value.q if isinstance(value, Configuration) else value


def _frozen(value: Any) -> Any:
    """Returns `value`, its arrays read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, dict | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            _frozen(part)
    return value


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(f"{x:.4g}" for x in value) + "]"
    return f"{value:.4g}"
