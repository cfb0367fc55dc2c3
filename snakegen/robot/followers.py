"""Joints that follow another one (URDF's ``<mimic>``): ``q = multiplier · leader + offset``."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError

Follower = tuple[str, float, float]  # leader, multiplier, offset (rad or m)


def followers_of(urdf: str, names: Sequence[str]) -> dict[str, Follower]:
    """Returns leader, multiplier and offset of each joint that follows one of its own.

    A follower of a follower follows the first leader. One whose leader does not move, or that
    follows itself through others, is left out: it moves on its own.

    Args:
        urdf: sound URDF text.
        names: the joints that move.
    """
    if "<mimic" not in urdf:
        return {}
    given: dict[str, Follower] = {}
    for joint in ET.fromstring(urdf).iterfind("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("name") in names and mimic.get("joint") in names:
            ratio = float(mimic.get("multiplier", 1.0))
            offset = float(mimic.get("offset", 0.0))
            given[str(joint.get("name"))] = (str(mimic.get("joint")), ratio, offset)
    out: dict[str, Follower] = {}
    for name in given:
        leader, ratio, offset = given[name]
        seen = {name}
        while leader in given and leader not in seen:
            seen.add(leader)
            upper, more, shift = given[leader]
            leader, ratio, offset = upper, ratio * more, ratio * shift + offset
        if leader not in seen:
            out[name] = (leader, ratio, offset)
    return out


def coupling(names: Sequence[str], followers: dict[str, Follower]) -> Floats:
    """Returns G (n, n) with ``v = G v_free``: all rates from those of the leaders.

    Rows are joints, columns too; a follower's column is 0. Joint torques become ``Gᵀ τ``: a
    follower has none of its own, its load goes through the ratio to its leader. A Jacobian J
    becomes ``J G``.
    """
    out = np.eye(len(names))
    index = {name: i for i, name in enumerate(names)}
    for name, (leader, ratio, _) in followers.items():
        out[index[name], index[name]] = 0.0
        out[index[name], index[leader]] = ratio
    return out


def refuse_followers(name: str, followers: dict[str, Follower], what: str) -> None:
    """Refuses what moves every joint on its own.

    Raises:
        AnalysisError: names the first follower.
    """
    if followers:
        first, (leader, _, _) = next(iter(followers.items()))
        raise AnalysisError(
            f"{name}: joint '{first}' follows '{leader}' (mimic), and {what} moves every joint on "
            "its own; fix the follower in the URDF, or use statics, mass and postures."
        )
