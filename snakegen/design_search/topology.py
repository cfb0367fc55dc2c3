"""What designs with the same links, joints and apparatus links share; their postures."""

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from snakegen.base.geometry import Floats
from snakegen.design_search.body_arrays import Skeleton
from snakegen.design_search.grammar import why_not
from snakegen.design_search.study import Study, StudyError
from snakegen.kernels.core.types import Ints
from snakegen.robot.robot import load
from snakegen.spec.loading import load_spec


@dataclass(frozen=True, eq=False)
class Topology:
    """What designs with the same links, joints and apparatus links share.

    Attributes:
        data: spec as given, with the topology's choices.
        resolved: the same spelled out.
        skeleton: of its arrays.
        indices: (k,) of the chain's joints among the tree's angles.
        sets: postures (m, k) rad by name: "range", "motion", "certify".
    """

    data: dict[str, Any]
    resolved: dict[str, Any]
    skeleton: Skeleton
    indices: Ints
    sets: dict[str, Floats]


def robot_source(study: Study, folder: Path) -> str:
    """Returns the study's robot: a spec file beside the study, or what it names."""
    return str(folder / study.robot) if (folder / study.robot).is_file() else study.robot


def read_topology(study: Study, robot: str, fixed: dict[str, Any]) -> Topology:
    """Reads the robot with the fields `fixed` through the templates, and draws its postures.

    Raises:
        StudyError: it cannot hover, or a figure of the study does not apply to it.
    """
    overrides = [f"{path}={json.dumps(value)}" for path, value in fixed.items()]
    spec = load_spec(robot, overrides=overrides)
    resolved = json.loads(json.dumps(spec.resolved()))
    machine = load(spec)
    if not machine.floating or not machine.modules.apparatuses:
        raise StudyError(f"{study.name}: {machine.name} cannot hover; margins need rotors.")
    skeleton = Skeleton.of(machine, resolved)
    joints = skeleton.chain_joints
    free = bool(skeleton.arrays.shapes.balls.all())
    for name in (*study.objectives, *study.constraints):
        given = "plant.battery_energy" in study.variables and name == "flight_time_min"
        why = "" if given else why_not(name, len(joints), free, resolved)
        if why:
            raise StudyError(f"{study.name}: {name} does not apply to {machine.name}: {why}.")
    indices = np.array([skeleton.names.index(n) for n in joints], np.int64)
    data = spec.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    sets = {
        "range": _range_postures(
            study, skeleton, joints, study.postures.search, study.postures.seed
        ),
        "certify": _range_postures(
            study, skeleton, joints, study.postures.certify, study.postures.seed + 1
        ),
    }
    if study.postures.motion:
        sets["motion"] = _motion_postures(study, joints)
    return Topology(data, resolved, skeleton, indices, sets)


def _range_postures(
    study: Study, skeleton: Skeleton, joints: tuple[str, ...], count: int, seed: int
) -> Floats:
    """Returns (count, k) postures of a scrambled Sobol sequence within the study's range."""
    ask, at = study.postures, [skeleton.names.index(n) for n in joints]
    most = np.array(
        [{"yaw": ask.yaw, "pitch": ask.pitch}.get(n.split("_")[-1], np.pi) for n in joints]
    )
    low = np.maximum(-most, skeleton.arrays.low[at])
    high = np.minimum(most, skeleton.arrays.high[at])
    engine, kept = qmc.Sobol(len(joints), seed=seed), np.empty((0, len(joints)))
    for _ in range(20):
        drawn = low + (high - low) * engine.random_base2(int(np.ceil(np.log2(count))))
        kept = np.vstack([kept, drawn[np.linalg.norm(drawn, axis=1) >= ask.away]])
        if len(kept) >= count:
            return np.ascontiguousarray(kept[:count])
    raise StudyError(f"{study.name}: postures.away {ask.away:g} rad leaves too few postures.")


def _motion_postures(study: Study, joints: tuple[str, ...]) -> Floats:
    """Returns (m, k) instants of the motion, no joint moving more than a step between two."""
    points = []
    for k, waypoint in enumerate(study.postures.motion):
        unknown = [n for n in waypoint if n not in joints]
        if unknown:
            raise StudyError(
                f"{study.name}: postures.motion[{k + 1}]: no joint '{unknown[0]}' in a topology; "
                f"there are {', '.join(joints)}."
            )
        points.append([float(waypoint.get(n, 0.0)) for n in joints])
    rows = [np.array(points[:1])]
    for a, b in pairwise(points):
        step = np.subtract(b, a)
        count = max(1, int(np.ceil(np.abs(step).max(initial=0.0) / study.postures.step)))
        rows.append(np.array(a) + np.arange(1, count + 1)[:, None] / count * step)
    return np.ascontiguousarray(np.vstack(rows))
