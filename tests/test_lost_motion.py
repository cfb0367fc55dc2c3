"""The clause for a lost rank names what is lost and a reason that holds when it is undone."""

import numpy as np
import pytest

import snakegen
from snakegen.analysis import actuation
from snakegen.control.lost_motion import dual_loss
from snakegen.kernels.core.types import Rotors

UP = np.array([0.0, 0.0, 1.0])
CROSS = np.array([[0.2, 0.2, 0.0], [-0.2, 0.2, 0.0], [-0.2, -0.2, 0.0], [0.2, -0.2, 0.0]])
LINE = np.array([[-0.3, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]])
TURNED = np.array([1.0, -1.0, 1.0, -1.0])


def loss(points: np.ndarray, drag: np.ndarray, axes: np.ndarray = UP) -> str:
    """Returns the clause for rotors of 5 N, one an apparatus, on a body of 1 kg."""
    n = len(points)
    u = np.broadcast_to(axes, (n, 3))
    dual = np.vstack([u.T, (np.cross(points, u) + drag[:, None] * u).T])
    bodies = np.zeros(n, np.int64)
    rotors = Rotors(bodies, points, u, drag, np.zeros(n), np.full(n, 5.0), np.arange(n))
    return dual_loss(dual, rotors, up=UP, length=0.3, weight=9.81, least=1e-6)


def test_nothing_lost_is_no_clause() -> None:
    assert loss(CROSS, 0.016 * TURNED) == ""


@pytest.mark.parametrize(
    ("points", "drag", "lost", "reason"),
    [
        (CROSS, np.zeros(4), "yaw", "every drag ratio κ is 0"),
        (CROSS, np.full(4, 0.016), "yaw, with", "spins that alternate would part the two"),
        (LINE, 0.016 * TURNED, "roll about the body axis", "all rotors are on one line"),
        (
            CROSS[:3],
            0.016 * TURNED[:3],
            "rotation about (+0.08 +0.08 +0.99)",
            "3 rotors set at most 3",
        ),
        (CROSS[:1], np.array([0.016]), "yaw; rotation", "1 rotor sets at most 1"),
    ],
)
def test_what_is_lost_and_why(points, drag, lost: str, reason: str) -> None:
    clause = loss(points, drag)
    names, _, why = clause.partition(": ")
    assert lost in names and reason in why
    for other in {"every drag ratio", "alternate would part", "one line", "at most"} - {reason}:
        assert other in reason or other not in why


def test_no_reason_is_made_up() -> None:
    """Thrusts that all pass the vertical through the CoG turn nothing, whatever the spins."""
    points = np.array([[0.0, 0.0, h] for h in (0.1, 0.2, 0.3, 0.4)])
    clause = loss(points, np.zeros(4))
    assert clause.startswith("no thrust works on ") and "drag" not in clause
    assert "spins" not in clause


@pytest.mark.parametrize(
    ("directions", "rank"), [((2, 2), 5), ((1, 1), 4), ((0, 0), 2), ((1, 0), 3)]
)
def test_q_force_counts_the_forces_that_gimbals_reach(directions, rank, tmp_path) -> None:
    """Two rotors on a bar along x: balls, discs across x or y, segments."""
    links, joints, apparatuses = "", "", []
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    for j, axes in enumerate(directions):
        parent, names = "bar", []
        for k in range(2):
            child, kind = f"part{j}_{k}", "revolute" if k < axes else "fixed"
            links += (
                f'<link name="{child}"><inertial><mass value="0.1"/>{inertia}</inertial></link>'
            )
            at = f'<origin xyz="{0.3 - 0.6 * j} 0 0"/>' if k == 0 else ""
            joints += (
                f'<joint name="turn{j}_{k}" type="{kind}"><parent link="{parent}"/>'
                f'<child link="{child}"/>{at}<axis xyz="{1 - k} {k} 0"/>'
                '<limit lower="-3" upper="3" effort="1" velocity="9"/></joint>'
            )
            names += [f"{('roll', 'pitch')[k]}: turn{j}_{k}"] if k < axes else []
            parent = child
        rotor = f"rotors: [{{link: {parent}, thrust_max: 20, drag_ratio: 0}}]"
        apparatuses.append("{" + ", ".join([*names, rotor]) + "}")
    body = f'<link name="bar"><inertial><mass value="1"/>{inertia}</inertial></link>'
    (tmp_path / "bar.urdf").write_text(f'<robot name="bar">{body}{links}{joints}</robot>')
    (tmp_path / "m.yaml").write_text(
        f"floating_root: bar\nlink_length: 0.3\napparatuses: [{', '.join(apparatuses)}]\n"
    )
    robot = snakegen.load(tmp_path / "bar.urdf", modules=tmp_path / "m.yaml")
    q = robot.configuration()
    found = actuation.analyze(robot, q).rank_of("force")
    points = [0.3, -0.3]
    reach = [(np.eye(3), np.diag([0.0, 1.0, 1.0]), np.diag([0.0, 0.0, 1.0]))[2 - n]
             for n in directions]  # fmt: skip
    expected = np.hstack(
        [np.vstack([P, np.cross([x, 0.0, 0.0], P.T).T]) for x, P in zip(points, reach, strict=True)]
    )
    assert np.linalg.matrix_rank(expected) == found.rank == rank
