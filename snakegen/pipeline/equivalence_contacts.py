"""Contact geometry of drums, wheels and casters in an MJCF against what the modules declare."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats, rotation_from_xyzw, xyzw_from_wxyz
from snakegen.description.mjcf.rolling_contact import GROUND_BIT
from snakegen.pipeline.equivalence_actuators import Actuation
from snakegen.pipeline.equivalence_pairs import Pairs, pairs
from snakegen.robot.modules import Caster, Screw
from snakegen.spec.wheel_layout import WheelLayout, wheel_layout

_GEOM = mujoco.mjtGeom
_SHAPES = {
    "ring_sphere": _GEOM.mjGEOM_SPHERE,
    "helix_capsule": _GEOM.mjGEOM_CAPSULE,
    "ellipsoid": _GEOM.mjGEOM_ELLIPSOID,
}
_COLUMNS = {
    "contact shape": ("shape (mjtGeom)", "contact type", "contact affinity", "contact dimension"),
    "contact size": ("size 1 [m]", "size 2 [m]", "size 3 [m]", "x [m]", "y [m]", "z [m]"),
    "contact axis": ("x", "y", "z"),
    "contact friction": ("sliding", "torsional [m]", "rolling [m]"),
}


def contacts(at: Actuation, rollers: str | None) -> Iterator[Pairs]:
    """Yields shape, place, friction and masks of all that rolls or slides on the ground.

    Args:
        at: robot and MJCF.
        rollers: how drums touch the ground, in place of the modules' own.
    """
    for number, screw in enumerate(at.robot.modules.screws):
        yield from _drum(at, number, screw, rollers or screw.rollers)
    for caster in at.robot.modules.casters:
        yield from _caster(at, caster)


def _drum(at: Actuation, number: int, screw: Screw, rollers: str) -> Iterator[Pairs]:
    friction = (screw.friction, 0.0, 0.0)
    if at.on_ball(screw):
        row = _row(_GEOM.mjGEOM_SPHERE, (screw.radius,), np.zeros(3), friction, 3)
        yield from _compared(at, screw.joint, [row])
        joint = at.model.joint(screw.joint)
        found = at.model.dof_armature[joint.dofadr[0] : joint.dofadr[0] + 3]
        yield pairs("armature", (screw.joint,), tuple("xyz"), [screw.armature] * 3, found)
        found = at.model.dof_frictionloss[joint.dofadr[0] : joint.dofadr[0] + 3]
        yield pairs("joint friction", (screw.joint,), tuple("xyz"), [0.0] * 3, found)
        return
    layout = wheel_layout(
        screw.alpha, screw.radius, screw.blades, screw.wheels_per_blade, rollers, screw.wheel_radius
    )
    row = _row(_SHAPES[rollers], _size(rollers, layout), np.zeros(3), friction, 3)
    for blade, wheel in zip(layout.blade, layout.wheel, strict=True):
        yield from _compared(at, f"wheel{number + 1}_{blade}_{wheel}", [row])


def _size(rollers: str, layout: WheelLayout) -> tuple[float, ...]:
    radius, half = layout.radius, layout.half_length
    return {
        "ring_sphere": (radius,),
        "helix_capsule": (radius, half),
        "ellipsoid": (radius, radius, half),
    }[rollers]


def _caster(at: Actuation, caster: Caster) -> Iterator[Pairs]:
    """Yields the two frictionless balls that touch z = 0 of the caster's frame at y = ±track/2."""
    sides = [np.array([0.0, s * caster.track / 2, caster.radius]) for s in (1.0, -1.0)]
    ball = _GEOM.mjGEOM_SPHERE
    friction = (np.nan,) * 3  # a contact of one dimension has none
    rows = [_row(ball, (caster.radius,), side, friction, 1) for side in sides]
    yield from _compared(at, caster.link, rows)


def _row(
    shape: int, size: tuple[float, ...], place: Floats, friction: tuple[float, ...], condim: int
) -> Floats:
    sizes = np.pad(np.array(size, float), (0, 3 - len(size)))
    axis = [np.nan] * 3 if shape == _GEOM.mjGEOM_SPHERE else [0.0, 0.0, 1.0]
    return np.array([int(shape), 0, GROUND_BIT, condim, *sizes, *place, *axis, *friction])


def _compared(at: Actuation, body: str, declared: list[Floats]) -> Iterator[Pairs]:
    """Yields the solid geoms of a body beside the declared ones; NaN is not compared."""
    model: Any = at.model
    number = model.body(body).id
    solid = (model.geom_bodyid == number) & ((model.geom_contype | model.geom_conaffinity) != 0)
    geoms = [int(g) for g in np.flatnonzero(solid)]
    if len(geoms) != len(declared):
        yield pairs("solid geoms", (body,), ("count",), [len(declared)], [len(geoms)])
        return
    found = np.array([_found(model, g) for g in geoms])
    wanted = np.array(declared)
    wanted = np.where(np.isnan(wanted), found, wanted)
    names = [model.geom(g).name or f"{body} geom {k + 1}" for k, g in enumerate(geoms)]
    first = 0
    for quantity, columns in _COLUMNS.items():
        part = slice(first, first + len(columns))
        yield pairs(quantity, names, columns, wanted[:, part], found[:, part])
        first += len(columns)


def _found(model: Any, geom: int) -> Floats:
    axis = rotation_from_xyzw(xyzw_from_wxyz(model.geom_quat[geom]))[:, 2]
    sizes = np.array(model.geom_size[geom])
    if model.geom_type[geom] != _GEOM.mjGEOM_ELLIPSOID:
        sizes[2] = 0.0
    masks = model.geom_contype[geom], model.geom_conaffinity[geom], model.geom_condim[geom]
    shape = model.geom_type[geom]
    place, friction = model.geom_pos[geom], model.geom_friction[geom]
    return np.array([shape, *masks, *sizes, *place, *axis, *friction])
