"""Drafts the modules file of a thrust-driven robot from its URDF, with the reason of each value."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.errors import DescriptionError
from snakegen.linter.finding import numbers
from snakegen.linter.lint import lint, refuse, refuse_mjcf
from snakegen.linter.xml_tree import parse_xml
from snakegen.robot.adoption.adopted_yaml import Drafted, to_yaml
from snakegen.robot.adoption.motor_plugins import MotorPlugin, motor_plugins
from snakegen.robot.adoption.rotor_evidence import RotorCandidate, UrdfTree, rotors, tilting
from snakegen.robot.adoption.rotor_frames import frames_left, with_peers
from snakegen.robot.adoption.rotor_layout import (
    alternating_spins,
    loses_an_axis,
    point_all_ways,
)
from snakegen.spec.urdf import read_urdf

_GRAVITY = 9.81  # m/s²
_LIFT = 2.0  # thrust over weight where nothing says how strong the rotors are (assumed)
_DRAG_RATIO = 0.016  # m, of small propellers (assumed)
_BY_SHAFT = "the direction of its shaft"
_DRAG_TAGS = ("m_f_rate", "drag_ratio")  # elements of a robot that hold one drag ratio for all


@dataclass(frozen=True)
class Adoption:
    """A drafted modules file.

    Attributes:
        data: as a modules file holds it.
        text: YAML with a comment on each value.
        guesses: what was assumed without evidence, a sentence each.
    """

    data: dict[str, Any]
    text: str
    guesses: tuple[str, ...]


def adopt(urdf: str | Path) -> dict[str, Any]:
    """Drafts the modules of a robot with rotors: `snakegen.load(urdf, modules=…)` takes them.

    Args:
        urdf: a URDF file.

    Returns:
        What a modules file of it would hold (docs/modules.md).

    Raises:
        DescriptionError: no sound URDF, or no rotor in it.
    """
    return draft(urdf).data


def draft(urdf: str | Path) -> Adoption:
    """Drafts the modules of a robot with rotors, with the reason of each value.

    Raises:
        DescriptionError: no sound URDF, or no rotor in it.
    """
    path = Path(urdf)
    text = read_urdf(path)
    refuse(lint(path, quick=True), str(path))
    refuse_mjcf(text, str(path))
    root = parse_xml(text)
    if root.find("snakegen") is not None:
        raise DescriptionError(f"{path}: its <snakegen> element names its modules already.")
    tree = UrdfTree(root)
    found = with_peers(tree, rotors(tree))
    if not found:
        raise DescriptionError(
            f"{path}: no rotor found by name, shaft or mesh; write the modules file by hand "
            "(docs/modules.md), with 'position' and 'axis' where a rotor has no link."
        )
    made = _Draft(tree, found, motor_plugins(root, text)).modules()
    yaml, guesses = to_yaml(made, path.name, frames_left(tree, found))
    return Adoption(_plain(made), yaml, guesses)


class _Draft:
    """Values of a modules file, rotor by rotor."""

    def __init__(
        self, tree: UrdfTree, found: list[RotorCandidate], plugins: list[MotorPlugin]
    ) -> None:
        self.tree, self.found = tree, found
        by_name = {p.joint: p for p in plugins} | {p.link: p for p in plugins}
        self.plugins = [
            by_name.get(c.link) or (by_name.get(c.shaft.name) if c.shaft else None) for c in found
        ]
        self.tilted = tilting(tree, found)
        self.all_ways = point_all_ways(tree, found, self.tilted)
        self.axes = [self._axis(c) for c in found]
        self.world = np.array(
            [
                tree.poses[c.link][:3, :3] @ axis.value
                for c, axis in zip(found, self.axes, strict=True)
            ]
        )
        self.points = np.array([tree.poses[c.link][:3, 3] for c in found])
        self.ratio = self._global_ratio()
        self.spins = self._spins()
        self.thrusts = self._thrusts()

    def modules(self) -> dict[str, Any]:
        """Returns the whole file, each value with its reason."""
        out: dict[str, Any] = {"floating_root": self._root()}
        if length := self._length():
            out["link_length"] = length
        spins = [spin.value for spin in self.spins]
        if loses_an_axis(self.tree, self.found, self.tilted, self.points, self.world, spins):
            why = "free gimbals leave an axis without force; unequal thrusts fly it"
            out["control"] = {"mode": Drafted("dual_rotor", why, True)}
        out["apparatuses"] = self._apparatuses()
        return out

    def _root(self) -> Drafted:
        top = self.tree.top
        if self.tree.mass_of(top) > 0.0:
            return Drafted(top, "the root link; a body with rotors flies", guess=True)
        return Drafted(top, "a dummy root without mass; a body with rotors flies", guess=True)

    def _length(self) -> Drafted | None:
        """Returns the lever of the torque scale of a body without links of its own."""
        if any(self.tree.moving(c.link) and c.shaft is None for c in self.found):
            return None
        joints = [n for n in self.tree.links if self.tree.moving(n)]
        shafts = {c.link for c in self.found if c.shaft}
        gimbals = {n for names in self.tilted.values() for n in names}
        if set(joints) - shafts - gimbals:
            return None  # a chain: its joints say how long its links are
        radius = float(np.linalg.norm(self.points - self.points.mean(axis=0), axis=1).mean())
        if radius < 1e-3:
            return None
        return Drafted(_short(radius), "m, the mean distance of the rotors from their centre", True)

    def _apparatuses(self) -> list[dict[str, Any]]:
        """Groups rotors behind the same gimbals; each other rotor is an apparatus of its own."""
        groups: dict[tuple[str, ...], list[int]] = {}
        for k, c in enumerate(self.found):
            groups.setdefault(self.tilted[c.link] or (c.link,), []).append(k)
        out = []
        for key, members in groups.items():
            entry: dict[str, Any] = {}
            links = self.tilted[self.found[members[0]].link]
            for place, link in self._gimbals(links):
                joint = self.tree.above[link]
                name = joint.attrib.get("name", "")
                entry[place] = Drafted(name, "turns rotors alone", True)
            if links:
                carrier = self.tree.parent(key[0]) or self.tree.top
                entry["link"] = Drafted(carrier, "carries the gimbal")
            entry["rotors"] = [self._rotor(k) for k in members]
            out.append(entry)
        return out

    def _gimbals(self, links: tuple[str, ...]) -> list[tuple[str, str]]:
        """Returns which joint is roll, which pitch: the outer of two, or by the axis of one."""
        if len(links) == 2:
            return [("roll", links[0]), ("pitch", links[1])]
        if not links:
            return []
        axis = numbers(self.tree.above[links[0]].find("axis"), "xyz", 3) or (1.0, 0.0, 0.0)
        return [("roll" if abs(axis[0]) >= abs(axis[1]) else "pitch", links[0])]

    def _rotor(self, k: int) -> dict[str, Any]:
        c, plugin = self.found[k], self.plugins[k]
        found = Drafted(c.link, "found by " + ", ".join(c.reasons), c.guess)
        out: dict[str, Any] = {"link": found}
        out["axis"] = Drafted([_clean(x) for x in self.axes[k].value], *self.axes[k].rest)
        low, high = self.thrusts[k]
        if low.value != 0.0:
            out["thrust_min"] = low
        out["thrust_max"] = high
        size, spin = self.ratio, self.spins[k]
        if plugin is not None and plugin.moment_constant:
            size = Drafted(plugin.moment_constant, "momentConstant")
        along = self._along(k)
        if spin.why == _BY_SHAFT and not size.guess and along is not None:
            value, why = size.value * along, f"m, {size.why} times the direction of its shaft"
        else:
            turn = "counter-clockwise" if spin.value > 0 else "clockwise"
            value, why = -abs(size.value) * spin.value, f"m, {size.why}; {turn}: {spin.why}"
        value = _short(value)
        out["drag_ratio"] = Drafted(value, why, size.guess or spin.guess)
        if plugin is not None and plugin.lag:
            out["lag"] = Drafted(plugin.lag, "s, timeConstantUp")
        return out

    def _axis(self, c: RotorCandidate) -> Drafted:
        """Returns the direction of thrust in the rotor's link: along the shaft, upwards."""
        turn = self.tree.poses[c.link][:3, :3]
        axis = np.array([0.0, 0.0, 1.0]) if c.shaft is None else c.shaft.axis
        along = "z of its link" if c.shaft is None else f"shaft '{c.shaft.name}'"
        up = float((turn @ axis)[2])
        if self.all_ways or abs(up) < 0.5:
            return Drafted(axis, f"along the {along}; nothing says which way", True)
        if up < 0:
            flipped = c.shaft is None
            return Drafted(-axis, f"against the {along}: upwards with all joints at 0", flipped)
        return Drafted(axis, f"along the {along}, upwards with all joints at 0", c.shaft is None)

    def _global_ratio(self) -> Drafted:
        for tag in _DRAG_TAGS:
            node = self.tree.root.find(tag)
            value = numbers(node, "value")
            if value and value[0] != 0.0:
                return Drafted(value[0], f"<{tag}>")
        return Drafted(_DRAG_RATIO, "of small propellers", True)

    def _spins(self) -> list[Drafted]:
        """Returns +1 (counter-clockwise about the thrust) or −1 of each rotor."""
        named = [self._named_spin(k) for k in range(len(self.found))]
        if None not in named:
            return [s for s in named if s is not None]
        shafts = [self._along(k) for k in range(len(self.found))]
        if None not in shafts and len(set(shafts)) == 2:
            return [Drafted(s or 1.0, _BY_SHAFT, self.ratio.guess) for s in shafts]
        groups = [self.tilted[c.link] for c in self.found]
        guessed = alternating_spins(groups, self.points)
        return [
            s or Drafted(g, "neighbours turn against each other", True)
            for s, g in zip(named, guessed, strict=True)
        ]

    def _along(self, k: int) -> float | None:
        """Returns whether the shaft of a rotor points along its thrust (+1) or against it (−1)."""
        shaft = self.found[k].shaft
        return None if shaft is None else float(np.sign(shaft.axis @ self.axes[k].value))

    def _named_spin(self, k: int) -> Drafted | None:
        c, plugin = self.found[k], self.plugins[k]
        if plugin is not None and plugin.spin:
            along = self._along(k) or 1.0
            return Drafted(plugin.spin * along, "turningDirection")
        for name in (c.link, c.shaft.name if c.shaft else "", *self.tree.mesh_names(c.link)):
            low = name.lower()
            if "ccw" in low or "counter" in low:
                return Drafted(1.0, f"name '{name}'")
            if "cw" in low or "clockwise" in low:
                return Drafted(-1.0, f"name '{name}'")
        return None

    def _thrusts(self) -> list[tuple[Drafted, Drafted]]:
        """Returns least and most thrust of each rotor."""
        known = [self._known_thrust(k) for k in range(len(self.found))]
        both_ways = self.all_ways
        lift = np.abs(self.world).sum(axis=0).min() if both_ways else self.world.sum(axis=0)[2]
        weight = self.tree.mass * _GRAVITY
        most = _LIFT * weight / max(float(lift), 0.2 * len(self.found))
        most = float(f"{most:.3g}") if most > 0 else 1.0
        why = f"N, {_LIFT:g} times the weight of {weight:.4g} N by all rotors"
        least = Drafted(-most, f"{why}; reversible, since they point all ways", True)
        guess = (least if both_ways else Drafted(0.0, why, True), Drafted(most, why, True))
        return [k or guess for k in known]

    def _known_thrust(self, k: int) -> tuple[Drafted, Drafted] | None:
        plugin, shaft = self.plugins[k], self.found[k].shaft
        if plugin is not None and plugin.thrust_max:
            why = "N, motorConstant times the square of maxRotVelocity"
            return Drafted(0.0, why), Drafted(_short(plugin.thrust_max), why)
        if shaft is None or shaft.limits is None:
            return None
        low, high = shaft.limits
        joint = self.tree.above[self.found[k].link]
        turning = joint.attrib.get("type") == "continuous"  # has no angle to limit
        newtons = turning or high > 2.0 * math.pi
        if not newtons or not max(low, 0.0) < high <= 1e4:
            return None
        why = f"N, limits of joint '{shaft.name}'"
        return Drafted(low, why), Drafted(high, why)


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def _clean(value: float) -> float:
    return round(float(value), 9) + 0.0


def _plain(made: Any) -> Any:
    """Returns the values without their reasons."""
    if isinstance(made, Drafted):
        return made.value
    if isinstance(made, dict):
        return {key: _plain(value) for key, value in made.items()}
    return [_plain(value) for value in made]
