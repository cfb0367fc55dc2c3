"""Sampling planners of OMPL on the scenes that are shipped, against `snakegen plan`.

The state is a plan's pose: CoG, rotation vector, joints. Valid is what a plan has to prove of every
instant: clearance, self-clearance and margins as demanded. Start and goal are those of the motion
that `snakegen plan` finds, so that both do the same. What a planner finds in time is simplified,
timed and certified as plans are.

pip install ompl; python benchmarks/plan_ompl.py [--scene ceiling] [--seconds 60] [--seeds 2]
"""

import argparse
import time
from typing import Any

import numpy as np
from ompl import base, geometric, util

from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import certify
from snakegen.planning.motion import Motion, enough, expected, in_time
from snakegen.planning.motion_search import search
from snakegen.robot.robot import load
from snakegen.scene.schema import Demands, read_scene
from snakegen.spec.loading import templates_folder

PLANNERS = ("RRTConnect", "BKPIECE1", "BITstar")
ROOM = 2.0  # m, of CoGs beyond those of start and goal
STEP = 0.01  # share of the space between states that are looked at on an edge


class Checks:
    """Validity of states, counted and timed."""

    def __init__(self, body: PlannedBody, demands: Demands) -> None:
        """Keeps the body and what must hold."""
        self.body, self.demands, self.count, self.seconds = body, demands, 0, 0.0

    def __call__(self, state: Any) -> bool:
        """Tells whether a state meets the demands."""
        start = time.process_time()
        pose = np.array([state[k] for k in range(6 + len(self.body.names))])
        found = self._valid(pose)
        self.count += 1
        self.seconds += time.process_time() - start
        return found

    def _valid(self, pose: np.ndarray) -> bool:
        now, outer = self.body.at_pose(pose), self.body.shapes.outer
        gaps = self.body.distances(now.q)
        if gaps[:outer].min() - now.slack < self.demands.clearance or gaps[outer:].min() < 0.0:
            return False
        force, torque = self.body.margins(now.points[None])
        return bool(
            force[0] >= self.demands.force_margin and torque[0] >= self.demands.torque_margin
        )


def solve(motion: Motion, demands: Demands, name: str, seconds: float, seed: int) -> dict[str, Any]:
    """Returns how a planner fares between the ends of a motion, in so many seconds of CPU."""
    body, poses = motion.body, motion.path.poses
    checks = Checks(body, demands)
    size = poses.shape[1]
    space, bounds = base.RealVectorStateSpace(size), base.RealVectorBounds(size)
    low = np.concatenate([np.minimum(poses[0, :3], poses[-1, :3]) - ROOM, np.full(3, -np.pi),
                          body.low])  # fmt: skip
    high = np.concatenate([np.maximum(poses[0, :3], poses[-1, :3]) + ROOM, np.full(3, np.pi),
                           body.high])  # fmt: skip
    for k in range(size):
        bounds.setLow(k, float(min(low[k], poses[:, k].min())))
        bounds.setHigh(k, float(max(high[k], poses[:, k].max())))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(checks)
    setup.getSpaceInformation().setStateValidityCheckingResolution(STEP)
    ends = []
    for pose in (poses[0], poses[-1]):
        state = space.allocState()
        for k in range(size):
            state[k] = float(pose[k])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(getattr(geometric, name)(setup.getSpaceInformation()))
    begun = time.process_time()
    setup.solve(base.PlannerTerminationCondition(lambda: time.process_time() - begun > seconds))
    row: dict[str, Any] = {"planner": name, "seed": seed, "solved": setup.haveExactSolutionPath()}
    row["cpu"] = round(time.process_time() - begun, 1)
    row["checks"], row["in checks"] = checks.count, round(checks.seconds, 1)
    if row["solved"]:
        setup.simplifySolution(min(10.0, seconds))
        path = setup.getSolutionPath()
        path.interpolate(max(40, path.getStateCount()))
        found = np.array([[s[k] for k in range(size)] for s in path.getStates()])
        there = in_time(body, found, demands)
        proved = certify(body, there, enough=enough(demands))
        made = Motion(there, proved, expected(body, there), 0.0, body, 0, 0.0)
        row |= {"seconds": float(there.times[-1]), "unmet": made.unmet(demands)}
    return row


def main() -> None:
    """Prints one line a run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="dragon4")
    parser.add_argument("--scene", default="ceiling")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    util.RNG.setSeed(1)  # of all runs: OMPL takes a seed once
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    scene = read_scene(templates_folder() / "scenes" / f"{given.scene}.yaml")
    begun = time.process_time()
    motion = search(load(given.robot), scene, minutes=5.0)
    print(
        f"{given.scene}: snakegen plan {time.process_time() - begun:.1f} s of CPU, motion of "
        f"{motion.path.times[-1]:.1f} s, {motion.unmet(scene.demands) or 'certified'}"
    )
    for name in PLANNERS:
        for seed in range(given.seeds):
            print(solve(motion, scene.demands, name, given.seconds, seed), flush=True)


if __name__ == "__main__":
    main()
