"""Rank and margins of 1 to 5 apparatuses, straight, planar and spatial (THEORY A3's table).

python benchmarks/rank_table.py
"""

from dataclasses import dataclass

import numpy as np

from snakegen.analysis import actuation
from snakegen.analysis import wrench_margin as margin
from snakegen.analysis.actuation_result import Actuation
from snakegen.robot.posture import hover_gimbals
from snakegen.robot.robot import Robot, load

PLANAR = np.deg2rad(60.0)


@dataclass(frozen=True)
class Row:
    """One posture: ranks of Q_dual for three spin choices, of Q_force, of J_w for two offsets."""

    apparatuses: int
    posture: str
    dual: tuple[int, int, int]
    force: int
    jacobian: tuple[int, int]
    force_margin: float
    torque_margin: float
    wrench_margin: float


def plain_robot(n: int, *, offset: float, spin: str = "alternating", drag: float = 0.01) -> Robot:
    """Returns n identical links of 0.42 m and 2 kg, gimbals and crosses as good as massless."""
    speck = 1e-9
    return load(
        {
            "name": "plain",
            "chain": {"links": n, "length": 0.42, "mass": 2.0},
            "joint": {"axes": ["pitch", "yaw"], "gap": 0.0, "mass": speck, "upper": 1.6},
            "vectoring_apparatus": {
                "separation": 0.2,
                "offset": offset,
                "thrust_max": 32.0,
                "drag_ratio": drag,
                "spin": spin,
                "roll_mass": speck,
                "pitch_mass": speck,
            },
        }
    )


def posture(n: int, kind: str) -> dict[str, float]:
    """Returns the joint angles of ``straight``, ``planar`` or ``spatial``."""
    if kind == "straight":
        return {}
    out = {f"joint{i}_yaw": PLANAR if kind == "planar" else 0.8 for i in range(1, n)}
    if kind == "spatial":
        out |= {f"joint{i}_pitch": 0.6 * (-1) ** (i - 1) for i in range(1, n)}
    return out


def row(n: int, kind: str) -> Row:
    """Computes one row with the package's own analyses."""

    def ranks(**options: object) -> tuple[Actuation, Robot, np.ndarray]:
        robot = plain_robot(n, **options)  # type: ignore[arg-type]
        q = hover_gimbals(robot, robot.configuration(posture(n, kind)))
        return actuation.analyze(robot, q), robot, q

    base, robot, q = ranks(offset=0.0)
    same, _, _ = ranks(offset=0.0, spin="same")
    dragless, _, _ = ranks(offset=0.0, drag=0.0)
    raised, _, _ = ranks(offset=0.037)
    m = margin.analyze(robot, q, tolerance=1e-4).vectored  # to the printed digits
    return Row(
        n,
        kind,
        (base.rank_of("dual").rank, same.rank_of("dual").rank, dragless.rank_of("dual").rank),
        base.rank_of("force").rank,
        (base.rank_of("jacobian").rank, raised.rank_of("jacobian").rank),
        m["force"].value,
        m["torque"].value,
        m["wrench"].value,
    )


def main() -> None:
    """Prints the table."""
    print("Ñ posture   Q_dual alt/same/κ=0  Q_force  J_w o=0/37mm  force N  torque N·m  wrench")
    for n in range(1, 6):
        for kind in ("straight", "planar", "spatial") if n > 1 else ("straight",):
            r = row(n, kind)
            print(
                f"{r.apparatuses} {r.posture:<9} {'/'.join(map(str, r.dual)):>19}  {r.force:>7}"
                f"  {'/'.join(map(str, r.jacobian)):>12}  {r.force_margin:7.1f}"
                f"  {r.torque_margin:10.2f}  {r.wrench_margin:6.3f}"
            )


if __name__ == "__main__":
    main()
