"""Contacts in which a scene starts: what touches at rest though nobody means it.

Rollers and casters meet the floor, and what lies on the floor touches it. Everything else that
starts in contact pushes the robot before anything acts on it.
"""

from dataclasses import dataclass

import mujoco

from snakegen.description.mjcf.neighbours import OVERLAP
from snakegen.description.mjcf.rolling_contact import GROUND_BIT

_ROUNDING = 1e-6  # m, of a body that lies on the floor


@dataclass(frozen=True)
class StartContact:
    """Two bodies that overlap when a scene starts.

    Attributes:
        state: ``qpos0``, or the keyframe.
        bodies: the pair; ``world`` where it is the floor or a support.
        geoms: names of the two geoms, "" where they have none.
        depth: m, how far one is inside the other.
    """

    state: str
    bodies: tuple[str, str]
    geoms: tuple[str, str]
    depth: float

    def __str__(self) -> str:
        first, second = (
            geom if body == "world" and geom else body
            for body, geom in zip(self.bodies, self.geoms, strict=True)
        )
        return (
            f"{first} and {second} start in contact, {1e3 * self.depth:.3g} mm deep "
            f"(state {self.state})"
        )


def start_contacts(model: mujoco.MjModel) -> tuple[StartContact, ...]:
    """Returns the unmeant contacts of a scene at qpos0 and at every keyframe, the deepest a pair.

    Meant are contacts of rollers and casters with the world, and those of a free robot that lies on
    the floor without being in it.

    Args:
        model: the compiled scene.
    """
    data = mujoco.MjData(model)
    out: dict[tuple[str, tuple[str, str]], StartContact] = {}
    for key in range(-1, model.nkey):
        if key < 0:
            mujoco.mj_resetData(model, data)
        else:
            mujoco.mj_resetDataKeyframe(model, data, key)
        state = "qpos0" if key < 0 else model.key(key).name
        mujoco.mj_forward(model, data)
        for k in range(data.ncon):
            contact = data.contact[k]
            if contact.dist < 0.0 and not _meant(model, contact):
                ids = sorted(contact.geom, key=lambda g: int(model.geom_bodyid[g]))
                names = tuple(model.body(model.geom_bodyid[g]).name for g in ids)
                geoms = tuple(model.geom(g).name for g in ids)
                found = StartContact(state, names, geoms, -float(contact.dist))  # type: ignore
                where = (state, found.bodies)
                if where not in out or out[where].depth < found.depth:
                    out[where] = found
    return tuple(out.values())


def _meant(model: mujoco.MjModel, contact: mujoco.MjContact) -> bool:
    first, second = contact.geom
    grounded = [model.geom_bodyid[g] == 0 for g in (first, second)]
    if not any(grounded):
        return False
    robot = second if grounded[0] else first
    rolls = model.geom_contype[robot] == 0 and model.geom_conaffinity[robot] == GROUND_BIT
    free = model.body_dofnum[model.body_rootid[model.geom_bodyid[robot]]] == 6
    return bool(free and (rolls or -contact.dist <= _ROUNDING))


def contact_warnings(model: mujoco.MjModel) -> tuple[str, ...]:
    """Returns a line for each pair of bodies that starts in contact, or would but for an exclude.

    Args:
        model: the compiled scene.
    """
    out = [str(contact) for contact in start_contacts(model)]
    for k in range(model.nexclude):
        if model.exclude(k).name.startswith(OVERLAP):
            signature = int(model.exclude_signature[k])
            first, second = (model.body(b).name for b in (signature >> 16, signature & 0xFFFF))
            out.append(f"{first} and {second} overlap at rest; contact between them is left out")
    return tuple(out)
