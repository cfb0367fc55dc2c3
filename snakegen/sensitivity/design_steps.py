"""Effects of small design changes on a robot's margins, from exact derivatives (THEORY A9)."""

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.robot.robot import Robot
from snakegen.sensitivity.margin_gradient import DUAL, VIRTUAL, MarginGradient, margin_gradients
from snakegen.wrench_margins.design_steps import DesignStep, DesignSteps

CENTIMETRE, TEN_GRAMS, NEWTON = 0.01, 0.01, 1.0


def design_steps(robot: Robot, q: Floats, mode: str = VIRTUAL) -> DesignSteps:
    """Returns what small changes do to the margins at q, gimbals held at its angles.

    Moved apparatuses carry their masses along, longer links what is beyond them; masses and
    inertias stay as they are. Where directions tie, an effect is the least of theirs: the margin's
    own one-sided slope. Left out are margins that are 0 for lack of a direction, and, where
    hover is out of reach, force and torque.

    Raises:
        AnalysisError: a robot that cannot hover, or limited gimbals' optimum that was not found.
    """
    wrench = margin_gradients(robot, q, "wrench", mode)
    kinds = ("force", "torque") if wrench.value >= 0.0 else ()
    found = {k: margin_gradients(robot, q, k, mode) for k in kinds} | {"wrench": wrench}
    if mode == DUAL:
        found["attitude_altitude"] = margin_gradients(robot, q, "attitude_altitude", mode)
    found = {kind: g for kind, g in found.items() if g.pieces}
    if not found:
        bent = f": joint {robot.chain_joints[-1]} at 0.8 rad, say" if robot.chain_joints else ""
        raise AnalysisError(
            f"{robot.name}: all margins are 0 at this posture for lack of a direction; "
            f"bend it{bent}."
        )
    tables = {
        kind: [_changes(g, piece) for piece in range(len(g.pieces))] for kind, g in found.items()
    }
    steps = []
    for k, (change, _, either) in enumerate(next(iter(tables.values()))[0]):
        effect = {kind: min(t[k][1] for t in rows) for kind, rows in tables.items()}
        back = {kind: min(-t[k][1] for t in rows) for kind, rows in tables.items()}
        more = change.startswith("1 N more")
        steps.append(DesignStep(change, effect, either, more, back if either else {}))
    kinks = {kind: g.kink for kind, g in found.items() if g.kink}
    for kind, g in found.items():
        if len(g.pieces) > 1:
            kinks[kind] = f"{len(g.pieces)} directions tie: an effect is the least of theirs"
    return DesignSteps(mode, {kind: g.value for kind, g in found.items()}, tuple(steps), kinks)


def _changes(g: MarginGradient, piece: int) -> list[tuple[str, float, bool]]:
    """Returns each change, its effect on a piece of a margin, and whether it goes either way."""
    robot, out = g.robot, list[tuple[str, float, bool]]()
    tree, gimbals, n = robot.tree, robot.gimbals, robot.tree.mass.size
    by = g.tree(piece).translation
    masses, limits = g.by("masses", piece), g.by("thrust_limits", piece)
    place = "towards the tip" if robot.chain_joints else "along the body's +x"
    for j in range(gimbals.limit.size):
        gimbal = [b for b in (gimbals.roll_body[j], gimbals.pitch_body[j]) if b >= 0]
        if gimbal:
            first, along = min(gimbal), gimbals.link_rotation[j, :, 0]
            effect = float(by[first] @ along) * CENTIMETRE
            out.append((f"1 cm of apparatus {j + 1} {place}", effect, True))
    for name in robot.modules.lengths:
        body, rotation, origin = robot.body_of_link(name)
        beyond = [
            b
            for b in range(1, n)
            if tree.parent[b] == body and robot.joint_names[b - 1] in robot.chain_joints
            and float(rotation[:, 0] @ (tree.translation[b] - origin)) > 0.0
        ]  # fmt: skip
        if beyond:
            effect = float(sum(by[b] @ rotation[:, 0] for b in beyond)) * CENTIMETRE
            effect += (
                g.pieces[piece].by_scale[1] * robot.force_scale / len(robot.modules.lengths) / 100.0
            )
            out.append((f"1 cm longer {name}", effect, True))
    for name, length in robot.modules.lengths.items():
        body, rotation, origin = robot.body_of_link(name)
        middle = origin + rotation[:, 0] * 0.5 * length
        effect = _mass(g, piece, masses, body, middle)
        out.append((f"10 g more at the middle of {name}", effect, True))
    owner = robot.rotors.apparatus
    for j in range(gimbals.limit.size):
        mine = limits[owner == j].sum() if len(limits) == len(owner) else None
        share = float((owner == j).sum()) * limits[j] if mine is None else float(mine)
        text = f"1 N more from each rotor of apparatus {j + 1}"
        out.append((text, share * NEWTON, False))
    total = sum(v for text, v, _ in out if text.startswith("1 N more"))
    out.append(("1 N more from every rotor", total, False))
    return out


def _mass(g: MarginGradient, piece: int, masses: Floats, body: int, place: Floats) -> float:
    """Returns the effect of 10 g at a place of a body: its weight, and the CoG's motion."""
    tree, poses = g.robot.tree, g.poses
    total = g.pieces[piece].by_points.sum(axis=0)
    step = poses.rotation[body] @ (place - tree.com[body])  # from where `masses` puts it
    return float(masses[body] - total @ step / poses.mass) * TEN_GRAMS
