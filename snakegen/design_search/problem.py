"""A study made ready: topologies, posture sets, and what a design vector means."""

import copy
import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.design_search.body_arrays import BodyArrays
from snakegen.design_search.study import Study, StudyError
from snakegen.design_search.topology import Topology, read_topology, robot_source
from snakegen.errors import SnakegenError
from snakegen.spec.loading import load_spec

TOPOLOGY = ("chain.links", "vectoring_apparatus.at", "vectoring_apparatus.rotors", "joint.axes")
FREE = (
    "chain.length", "chain.mass", "chain.com", "joint.gap", "joint.mass", "joint.effort",
    "vectoring_apparatus.at", "vectoring_apparatus.separation", "vectoring_apparatus.offset",
    "vectoring_apparatus.thrust_max", "vectoring_apparatus.thrust_min",
    "vectoring_apparatus.drag_ratio", "vectoring_apparatus.roll_mass",
    "vectoring_apparatus.pitch_mass", "vectoring_apparatus.spin",
    "vectoring_apparatus.rotor_diameter", "plant.battery_energy",
)  # fmt: skip
PART_MASS = {"apparatus": "vectoring_apparatus.pitch_mass", "joint": "joint.mass"}
TOPOLOGIES = 200


@dataclass(frozen=True, eq=False)
class Problem:
    """A study ready to be searched.

    Attributes:
        study: as read.
        names: of the variables, in the order of a design vector.
        low, high: (d,) its bounds; of choices the first and the last index.
        whole: (d,) bool, which entries are choices.
        topologies: by the choices of the topology's variables.
    """

    study: Study
    names: tuple[str, ...]
    low: Floats
    high: Floats
    whole: Any
    topologies: dict[tuple[int, ...], Topology]

    @property
    def shape_variables(self) -> list[int]:
        """Places of the variables that choose the topology."""
        return [i for i, name in enumerate(self.names) if name in TOPOLOGY]

    def topology(self, x: Floats) -> Topology:
        """Returns the topology of a design vector."""
        return self.topologies[tuple(round(x[i]) for i in self.shape_variables)]

    def chosen(self, x: Floats) -> dict[str, Any]:
        """Returns the value of each variable: a number, a choice, or a part's name."""
        out: dict[str, Any] = {}
        for i, name in enumerate(self.names):
            v = self.study.variables[name]
            if v.choices is not None:
                out[name] = v.choices[round(x[i])]
            elif v.catalogue is not None:
                out[name] = v.catalogue[round(x[i])].name
            else:
                out[name] = float(x[i])
        return out

    def resolved(self, x: Floats) -> tuple[dict[str, Any], float]:
        """Returns a design's resolved spec, inertias apart, and its price."""
        topology = self.topology(x)
        out, price = _copied(topology.resolved), 0.0
        for i, name in enumerate(self.names):
            v = self.study.variables[name]
            if v.catalogue is not None:
                part = v.catalogue[round(x[i])]
                put(out, PART_MASS[v.of], part.mass)
                for path, value in part.set.items():
                    put(out, path, value)
                section = "vectoring_apparatus" if v.of == "apparatus" else "joint"
                count = len(out[section]["at" if v.of == "apparatus" else "gap"])
                price += part.price * count
            elif name not in TOPOLOGY:
                put(out, name, v.choices[round(x[i])] if v.choices else float(x[i]))
        _ordered(out["vectoring_apparatus"])
        return out, price

    def arrays(self, x: Floats) -> BodyArrays:
        """Returns a design's arrays, in closed form."""
        return self.topology(x).skeleton.fill(self.resolved(x)[0])

    def spec_data(self, x: Floats) -> dict[str, Any]:
        """Returns a design's spec as plain data, its numbers in it."""
        data, (resolved, _) = copy.deepcopy(self.topology(x).data), self.resolved(x)
        touched = set()
        for name in self.names:
            v = self.study.variables[name]
            paths = [name]
            if v.catalogue is not None:
                paths = [PART_MASS[v.of], *(p for part in v.catalogue for p in part.set)]
            touched |= {tuple(p.split(".")[:2]) for p in paths if p != "chain.links"}
        for section, field in sorted(touched):
            value = resolved[section][field]
            if field != "at" and isinstance(value, list) and all(a == value[0] for a in value):
                value = value[0]
            data.setdefault(section, {})[field] = value
        data["name"] = f"{self.study.name}_{data['name']}"
        return json.loads(json.dumps(data))


def put(resolved: dict[str, Any], path: str, value: Any) -> None:
    """Sets a field of a resolved spec; one value serves a whole list, numbers count from 1."""
    *way, last = path.split(".")
    at: Any = resolved
    for key in way:
        at = at[int(key) - 1] if isinstance(at, list) else at[key]
    place: Any = int(last) - 1 if isinstance(at, list) else last
    old = at[place]
    at[place] = (
        [value] * len(old) if isinstance(old, list) and not isinstance(value, list) else value
    )


def _copied(resolved: dict[str, Any]) -> dict[str, Any]:
    """Returns a resolved spec whose chain, joints and apparatuses may be changed."""
    out = dict(resolved)
    for section in ("chain", "joint", "vectoring_apparatus", "plant"):
        out[section] = {
            k: list(v) if isinstance(v, list) else v for k, v in resolved[section].items()
        }
    places = out["vectoring_apparatus"]["at"]
    out["vectoring_apparatus"]["at"] = [dict(p) for p in places]
    return out


def _ordered(unit: dict[str, Any]) -> None:
    """Sorts apparatuses by link and position, as a spec's resolution does; spins stay theirs."""
    places = unit["at"]
    order = sorted(range(len(places)), key=lambda j: (places[j]["link"], places[j]["position"]))
    if order != list(range(len(places))):
        for key, value in unit.items():
            if isinstance(value, list) and len(value) == len(order) and key != "spin":
                unit[key] = [value[j] for j in order]


def prepare(study: Study, folder: Path) -> Problem:
    """Makes a study ready: reads the robot once a topology, draws the postures.

    Args:
        study: as read.
        folder: of the study's file, where its robot may stand.

    Raises:
        StudyError: fields that cannot vary, or do not exist in some topology.
    """
    names = tuple(study.variables)
    for name, v in study.variables.items():
        head = ".".join(name.split(".")[:2])
        if v.catalogue is None and head not in (*FREE, *TOPOLOGY):
            known = ", ".join(sorted({*FREE, *TOPOLOGY}))
            raise StudyError(f"{study.name}: variables.{name} cannot vary; these can: {known}.")
        if name in TOPOLOGY and v.choices is None:
            raise StudyError(f"{study.name}: variables.{name} takes 'choices'.")
    low = np.array([v.range[0] if v.range else 0.0 for v in study.variables.values()])
    sizes = [len(v.choices or v.catalogue or []) - 1 for v in study.variables.values()]
    pairs = zip(study.variables.values(), sizes, strict=True)
    high = np.array([v.range[1] if v.range else n for v, n in pairs], float)
    whole = np.array([v.range is None for v in study.variables.values()])
    shape = [names.index(n) for n in names if n in TOPOLOGY]
    combos = list(product(*(range(sizes[i] + 1) for i in shape)))
    if len(combos) > TOPOLOGIES:
        raise StudyError(f"{study.name}: {len(combos)} topologies; {TOPOLOGIES} at most.")
    robot = robot_source(study, folder)
    topologies, refused = {}, ""
    for combo in combos:
        fixed = dict(study.fixed)
        for i, k in zip(shape, combo, strict=True):
            fixed[names[i]] = (study.variables[names[i]].choices or [])[k]
        try:
            topologies[combo] = read_topology(study, robot, fixed)
        except SnakegenError as error:
            if len(combos) == 1:
                raise
            refused = str(error).removeprefix(f"{study.name}: ")
    if not topologies:
        raise StudyError(f"{study.name}: no topology can be built: {refused}")
    problem = Problem(study, names, low, high, whole, topologies)
    if len(topologies) < len(combos):
        raise StudyError(f"{study.name}: a topology cannot be built: {refused}")
    for x in (low, high):
        for combo in topologies:
            point = x.copy()
            point[shape] = combo
            _check_fields(problem, point)
    return problem


def _check_fields(problem: Problem, x: Floats) -> None:
    """Tells which field of a corner of the study is wrong."""
    for name in problem.names:
        v = problem.study.variables[name]
        paths = [p for part in v.catalogue for p in part.set] if v.catalogue else [name]
        for path in paths:
            if path in TOPOLOGY:
                continue
            try:
                put(_copied(problem.topology(x).resolved), path, 0.0)
            except (KeyError, IndexError, ValueError, TypeError):
                raise StudyError(
                    f"{problem.study.name}: variables.{name}: the spec has no '{path}' in every "
                    "topology; lists count from 1."
                ) from None
    load_spec(problem.spec_data(x))
