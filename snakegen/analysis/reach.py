"""Reach: where the tip can go, how well it follows a path, and where it has to give up.

Inverse kinematics of redundant chains (ZS24 eqs 3-5 as THEORY C reads them): damped right inverse,
closed loop, limits and a preferred posture in the null space; the body may have to pass a port.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from snakegen.base.geometry import Floats
from snakegen.errors import AnalysisError
from snakegen.inverse_kinematics.clear_path import follow_clear
from snakegen.inverse_kinematics.collisions import Collisions, Nearest, obstacles_of
from snakegen.inverse_kinematics.path_following import (
    Chain,
    Options,
    Port,
    Track,
    chain_of,
    place,
    reach_point,
)
from snakegen.inverse_kinematics.reach_reason import describe_track, port_text, stretched
from snakegen.inverse_kinematics.tip_paths import checked_path, circle, port, port_of, through
from snakegen.robot.robot import Robot
from snakegen.scene.solids import Solid
from snakegen.statics.joint_torques import finite
from snakegen.statics.tip import find_tip

__all__ = ["Options", "Port", "ReachResult", "analyze", "applies", "circle", "port"]

COMMAND = "reach"
ORDER = 70
EXAMPLE = "arm6 --port 1.25,0.08,0.08,1,0,0,0.06 --depth 0.25"


@dataclass(frozen=True)
class ReachResult:
    """What the tip can reach. Places are metres from the base origin, world axes.

    Attributes:
        joints: names of the joints that move the tip.
        tip: (3,) m, in the posture asked about.
        singular_values: (3,) of its position Jacobian, over the arm's length.
        rank: of it (tolerance 1e-6 σ1); `left_inverse` tells whether eq 4's inverse exists.
        left_inverse: see above: false for more joints than rows, always.
        lost: (3, k) unit directions in which the tip cannot move.
        reach: m, length of the stretched chain from its first joint: no point beyond it.
        started: distance [m] by which the path's first point was missed, 0 if reached.
        path: (m, 3) m, the path asked for.
        track: what became of the path, None if its first point was missed.
        why: one sentence: complete, or where and why the path was lost.
        nearest: least distance of the body from itself, the floor and obstacles along the track.
        thickest: m, largest radius of a link.
        tries: resting postures tried until one kept clear, or that there were.
    """

    joints: tuple[str, ...]
    tip: Floats
    singular_values: Floats
    rank: int
    left_inverse: bool
    lost: Floats
    reach: float
    started: float
    path: Floats
    track: Track | None
    why: str
    nearest: Nearest | None = None
    tries: int = 1
    thickest: float = 0.0

    @property
    def complete(self) -> bool:
        """Tells whether the whole path was followed and nothing touched on the way."""
        followed = self.track is not None and self.track.complete
        return followed and self.fits and (self.nearest is None or self.nearest.free)

    @property
    def fits(self) -> bool:
        """Tells whether the thickest link passes the port, if there is one."""
        return self.track is None or self.track.clearance >= self.thickest

    def rows(self) -> list[tuple[str, str]]:
        """Returns (label, text) pairs for people."""
        x = " ".join(f"{v:+.4f}" for v in self.tip)
        gone = " and ".join("[" + " ".join(f"{v + 0.0:.2f}" for v in u) + "]" for u in self.lost.T)
        out = [
            ("tip", f"{x} m from the base; {self.reach:.4g} m of chain beyond the first joint"),
            ("rank", f"{self.rank} of 3" + (f"; it cannot move along {gone}" if gone else "")),
            ("path", self.why),
        ]
        if self.track is not None:
            e = 1e3 * self.track.error
            rms = float(np.sqrt(np.mean(e**2)))
            out.append(("tip error", f"{e.max():.3g} mm at most, {rms:.3g} mm RMS"))
            if np.isfinite(self.track.clearance):
                out.append(("port", port_text(self.track.clearance, self.thickest)))
        if self.nearest is not None:
            word = "clearance" if self.nearest.free else "collision"
            more = f"; {self.tries} resting postures tried" if self.tries > 1 else ""
            out.append((word, self.nearest.text() + more))
        return out

    def to_json(self) -> dict[str, Any]:
        """Returns plain data; keys carry units."""
        track = self.track
        out: dict[str, Any] = {
            "joints": list(self.joints),
            "tip_m": self.tip.tolist(),
            "singular_values": self.singular_values.tolist(),
            "rank": self.rank,
            "left_inverse_exists": self.left_inverse,
            "lost_directions": self.lost.T.tolist(),
            "reach_m": self.reach,
            "start_missed_by_m": self.started,
            "complete": self.complete,
            "why": self.why,
        }
        if self.nearest is not None:
            out |= self.nearest.to_json() | {"postures_tried": self.tries}
        if track is not None:
            rms = float(np.sqrt(np.mean(track.error**2)))
            clear = track.clearance
            out["path"] = {
                "samples_reached": track.reached,
                "length_reached_m": track.length,
                "length_m": track.whole,
                "error_max_m": float(track.error.max()),
                "error_rms_m": rms,
                "rank_min": int(track.rank.min()),
                "sigma_min": float(track.sigma[:, -1].min()),
                "joints_at_limit": list(track.held),
                "port_clearance_m": clear if np.isfinite(clear) else None,
                "joints_end_rad": dict(zip(self.joints, track.angles[-1].tolist(), strict=True)),
            }
            if np.isfinite(clear):
                out["path"]["thickest_link_m"] = self.thickest
        return out


def applies(robot: Robot) -> bool:
    """An arm: a chain on a fixed base, no joint of which follows another (mimic)."""
    return not robot.floating and len(robot.chain_joints) > 0 and not robot.followers


def analyze(
    robot: Robot,
    q: ArrayLike,
    *,
    path: ArrayLike | None = None,
    tip: str | None = None,
    tip_point: ArrayLike | None = None,
    options: Options | None = None,
    radius: float = 0.05,
    depth: float = 0.2,
    duration: float = 10.0,
    dt: float = 0.01,
    gain: float = 10.0,
    corrections: int = 1,
    give_up: float = 1e-3,
    margin: float = 0.0,
    port: Port | str | None = None,
    obstacles: str | Path | Sequence[Solid] = (),
    tries: int = 8,
) -> ReachResult:
    """Returns what the tip can reach, and what becomes of a path that it is to follow.

    The base is held. Without a path the tip goes straight in through the port; without a port it
    draws a circle of `radius` round a point that lies an eighth of the reach behind its place.

    Args:
        robot: any robot with a chain joint.
        q: (nq,) posture it starts from; the tip first goes to the path's first point.
        options: the loop; made from `dt` … `port` if absent.

    Options:
        path: table (CSV, Parquet, YAML) of x,y,z [m] from the base origin, a row every dt;
            straight in through the port if absent, or a circle without one
        radius: m, of the circle
        depth: m, how far the tip goes in through the port
        duration: s, of the way in or once round
        dt: s, between samples
        gain: 1/s, of the closed loop; 0 integrates open loop and drifts
        corrections: Newton steps after each sample at most
        give_up: m, tip error at which the path counts as lost
        margin: rad, kept from the joints' limits
        port: x,y,z,ax,ay,az,radius: an opening that the body must pass
        obstacles: scene file (YAML) of what the body must not touch, in metres from the base
        tries: resting postures tried until one keeps clear of body, floor and obstacles
        tip: link that carries the tip; the last one if absent
        tip_point: x,y,z of the tip on that link, m

    Raises:
        AnalysisError: no chain joint, an invalid path or option.
    """
    q = robot.validate_configuration(q)
    chain = chain_of(robot, q, find_tip(robot, tip, tip_point))
    if not 0 <= margin < 0.5 * float(np.min(chain.upper - chain.lower)):
        raise AnalysisError(f"margin = {margin:g} rad leaves the joints no range.")
    chain = replace(chain, lower=chain.lower + margin, upper=chain.upper - margin)
    if options is None:
        options = Options(dt, gain, corrections, give_up=give_up, port=port_of(port))
    loop = _checked_options(options, len(chain.joints))
    full = robot.angles(q)
    start, J = place(chain, full)
    _, whole = stretched(chain)
    given = checked_path(path) if path is not None else None
    if given is None and loop.port is not None:
        given = through(loop.port, depth, duration, loop.dt)
    if given is None:
        given = _default_circle(chain, full, start, radius, duration, loop)
    u, s, _ = np.linalg.svd(J)
    rank = int(np.sum(s > 1e-6 * max(s[0], 1e-300)))
    names = tuple(robot.joint_names[j] for j in chain.joints)
    world = Collisions(robot, obstacles_of(obstacles))
    full, missed, track, nearest, tried = follow_clear(
        chain, full, given, loop, world, max(int(tries), 1)
    )
    return ReachResult(
        names,
        start,
        np.asarray(s / chain.scale),
        rank,
        len(names) <= 3 and rank == len(names),
        np.asarray(u[:, rank:]),
        whole,
        missed if track is None else 0.0,
        given,
        track,
        describe_track(chain, full, given, missed, track, loop),
        nearest,
        tried,
        world.thickest,
    )


def _default_circle(
    chain: Chain, full: Floats, start: Floats, radius: float, duration: float, loop: Options
) -> Floats:
    """Returns a circle round a point drawn back towards the first joint by an eighth of the reach.

    Its normal is the direction in which the tip moves least there, so that every chain of two
    joints or more can draw it: a planar one in its plane.
    """
    first, whole = stretched(chain)
    out = start - first
    far = float(np.linalg.norm(out))
    along = out / far if far > 1e-9 else np.array([1.0, 0.0, 0.0])
    centre = start - along * min(whole / 8, 0.5 * far)
    there = reach_point(chain, full, centre, loop)[0]
    normal = np.linalg.svd(place(chain, there)[1])[0][:, 2]
    return circle(centre, radius, normal, duration, loop.dt)


def _checked_options(options: Options, count: int) -> Options:
    """Returns `options` after a check of its numbers and of its posture's size."""
    for name in ("dt", "tolerance", "give_up"):
        if not getattr(options, name) > 0:
            raise AnalysisError(f"{name} = {getattr(options, name)}: a number above 0 is needed.")
    if options.posture is None:
        return options
    return replace(options, posture=finite(options.posture, (count,), "posture"))
