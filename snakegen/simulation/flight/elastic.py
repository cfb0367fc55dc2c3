"""Elastic links: each one split at its middle, the halves tied by springs (pseudo-rigid bodies).

Only the simulated robot bends; URDF, analyses and controller keep believing in rigid links.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np

from snakegen.base.geometry import Floats
from snakegen.description.mjcf.neighbours import exclude_welded
from snakegen.errors import DescriptionError

_AXES = {"pitch": (0.0, 1.0, 0.0), "yaw": (0.0, 0.0, 1.0)}
_SLENDER = 0.9  # most of a link's inertia that may become distance between its halves


def tip_name(link: str) -> str:
    """Returns the name of the outer half of `link`."""
    return f"{link}_tip"


def split_links(urdf: str, lengths: dict[str, float]) -> str:
    """Returns the URDF with every link of `lengths` [m] in two halves, welded for now.

    Mass, centre of mass and inertia of the two together stay those of the link: halves of m/2 at
    ``c ± d`` with ``(I − m d² diag(0, 1, 1)) / 2`` each, d = L/4. What is mounted beyond the
    middle moves to the outer half.
    """
    robot = ET.fromstring(urdf)
    for name, length in lengths.items():
        link = next((e for e in robot.iterfind("link") if e.get("name") == name), None)
        if link is None:
            raise DescriptionError(f"there is no link '{name}' to be elastic.")
        tip = ET.SubElement(robot, "link", name=tip_name(name))
        _split_inertia(link, tip, 0.5 * length)
        _split_rod(link, tip, length)
        for joint in robot.iterfind("joint"):
            parent, origin = joint.find("parent"), joint.find("origin")
            if parent is None or origin is None or parent.get("link") != name:
                continue
            place = _numbers(origin, "xyz")
            if place[0] > 0.5 * length + 1e-9:
                parent.set("link", tip_name(name))
                origin.set("xyz", _text(place - [0.5 * length, 0.0, 0.0]))
        weld = ET.SubElement(robot, "joint", name=f"{tip_name(name)}_weld", type="fixed")
        ET.SubElement(weld, "parent", link=name)
        ET.SubElement(weld, "child", link=tip_name(name))
        ET.SubElement(weld, "origin", xyz=_text([0.5 * length, 0.0, 0.0]), rpy="0 0 0")
    return ET.tostring(robot, encoding="unicode")


def add_springs(
    spec: mujoco.MjSpec, links: Iterable[str], stiffness: float, damping: float
) -> None:
    """Lets the halves of `links` bend up and sideways.

    Args:
        spec: decorated, of a URDF from `split_links`.
        links: names.
        stiffness: N·m/rad, EI/L of the rod.
        damping: s, damping over stiffness.
    """
    for key in list(spec.keys):  # their configurations lack the springs
        spec.delete(key)
    exclude_welded(spec)
    for link in links:
        body = spec.body(tip_name(link))
        for name, axis in bend_axes(link).items():
            joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
            joint.stiffness[0], joint.damping[0] = stiffness, damping * stiffness


def bend_axes(link: str) -> dict[str, Floats]:
    """Returns the axes (3,) about which an elastic link bends, by the names of their joints."""
    return {f"{link}_bend_{way}": np.array(axis) for way, axis in _AXES.items()}


def modal_frequencies(model: mujoco.MjModel, qpos: Floats) -> Floats:
    """Returns the natural frequencies [Hz], rising, of springs and servos at rest in `qpos`.

    From ``K v = ω² M v``: K holds the springs' and the position servos' stiffness; the rigid
    motions of a free base are left out.
    """
    return elastic_modes(model, qpos, np.arange(model.nv))[0]


def elastic_modes(model: mujoco.MjModel, qpos: Floats, dofs: Any) -> tuple[Floats, Floats]:
    """Returns natural frequencies (m,) [Hz], rising, and shapes (e, m), ``φᵀ M φ = 1``.

    Args:
        model: of a robot on a free or fixed base.
        qpos: where it is at rest.
        dofs: (e,) degrees of freedom that may move, with those of a free base; others are held.
    """
    from scipy.linalg import eigh

    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    spring, base = stiffnesses(model), np.arange(model.nv)
    free = np.flatnonzero(np.isin(base, dofs) | (spring == 0.0))
    squares, shapes = eigh(np.diag(spring[free]), mass[np.ix_(free, free)])
    kept = slice(int(np.sum(spring[free] == 0.0)), None)
    rows = np.searchsorted(free, dofs)
    return np.sqrt(np.maximum(squares[kept], 0.0)) / (2.0 * np.pi), shapes[rows, kept]


def stiffnesses(model: mujoco.MjModel) -> Floats:
    """Returns the stiffness (nv,) [N·m/rad] of each degree of freedom: spring and servo."""
    spring = np.zeros(model.nv)
    for j in range(model.njnt):
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE:
            spring[model.jnt_dofadr[j]] = np.ravel(model.jnt_stiffness[j])[0]
    for i in range(model.nu):
        if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT:
            dof = model.jnt_dofadr[model.actuator_trnid[i, 0]]
            spring[dof] += -model.actuator_biasprm[i, 1]
    return spring


def _split_inertia(link: ET.Element, tip: ET.Element, half: float) -> None:
    inertial = link.find("inertial")
    mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
    if inertial is None or mass is None or inertia is None:
        raise DescriptionError(f"link '{link.get('name')}' has no mass; elastic links need it.")
    origin = inertial.find("origin")
    m = float(mass.get("value", 0.0))
    com = np.zeros(3) if origin is None else _numbers(origin, "xyz")
    rpy = "0 0 0" if origin is None else origin.get("rpy", "0 0 0")
    moments = {k: float(inertia.get(k, 0.0)) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    apart = min((0.5 * half) ** 2, _SLENDER * min(moments["iyy"], moments["izz"]) / m)
    for key in ("iyy", "izz"):
        moments[key] -= m * apart
    step = np.array([np.sqrt(apart), 0.0, 0.0])
    link.remove(inertial)
    for body, place in ((link, com - step), (tip, com + step - [half, 0.0, 0.0])):
        part = ET.SubElement(body, "inertial")
        ET.SubElement(part, "origin", xyz=_text(place), rpy=rpy)
        ET.SubElement(part, "mass", value=repr(0.5 * m))
        ET.SubElement(part, "inertia", {k: repr(0.5 * v) for k, v in moments.items()})


def _split_rod(link: ET.Element, tip: ET.Element, length: float) -> None:
    """Cuts the collision cylinder that represents the whole rod; other shapes stay."""
    for shape in link.findall("collision"):
        rod, origin = shape.find("geometry/cylinder"), shape.find("origin")
        if rod is None or origin is None or float(rod.get("length", 0.0)) < 0.99 * length:
            continue
        link.remove(shape)
        for body in (link, tip):
            part = ET.SubElement(body, "collision")
            ET.SubElement(
                part, "origin", xyz=_text([0.25 * length, 0, 0]), rpy=origin.get("rpy", "")
            )
            geometry = ET.SubElement(part, "geometry")
            size = {"radius": rod.get("radius", ""), "length": repr(0.5 * length)}
            ET.SubElement(geometry, "cylinder", size)


def _numbers(element: ET.Element, key: str) -> Floats:
    return np.array([float(x) for x in element.get(key, "0 0 0").split()])


def _text(values: Any) -> str:
    return " ".join(repr(float(v)) for v in values)
