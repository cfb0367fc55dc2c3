"""A planned motion: a seed in time, what is proved of it, and the demands that it meets."""

from dataclasses import dataclass

import numpy as np

from snakegen.base.geometry import Floats
from snakegen.planning.body import PlannedBody
from snakegen.planning.certificate import Certificate, certify
from snakegen.planning.hover_actuation import actuator_use, battery_share
from snakegen.planning.judgement import FINE, judge
from snakegen.planning.plan_file import PlanFile
from snakegen.planning.seeds import Seed
from snakegen.planning.timing import rates_of, slowed, smoothed, timed
from snakegen.planning.tracking import Cover, Tracking
from snakegen.planning.trajectory import Trajectory
from snakegen.scene.schema import Demands, Scene

EVERY = 0.2  # s, between instants at which tracking errors of a motion are looked at


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion through a scene.

    Attributes:
        path: over time.
        certificate: its proved bounds.
        tracking: what hardware leaves of its clearance.
        battery: share of the battery's energy that it takes; 0 if that is endless.
        body: among the scene's solids.
        tried: seeds looked at.
        seconds: spent.
        advice: which wider openings would do, where demands are not met.
    """

    path: Trajectory
    certificate: Certificate
    tracking: Cover
    battery: float
    body: PlannedBody
    tried: int
    seconds: float
    advice: str = ""

    def file(self, scene: Scene) -> PlanFile:
        """Returns the mission file that flies it."""
        return PlanFile(
            self.body.robot.name,
            self.body.names,
            self.path,
            scene.solids,
            self.certificate.to_json(),
            vars(scene.demands),
            tracking=self.tracking.to_json(),
        )

    def unmet(self, demands: Demands) -> list[str]:
        """Returns the demands that the certificate does not prove."""
        c = self.certificate
        pairs = (
            ("clearance", c.clearance.lower, demands.clearance, "m"),
            ("self-clearance", c.self_clearance.lower, 0.0, "m"),
            ("force margin", c.force_margin.lower, demands.force_margin, "N"),
            ("torque margin", c.torque_margin.lower, demands.torque_margin, "N·m"),
            ("clearance over its tracking error", self.tracking.sigmas, demands.tracking_sigmas,
             "standard deviations"),
        )  # fmt: skip
        out = [f"{n} {v:.4g} < {d:g} {u}" for n, v, d, u in pairs if not v >= d]
        if self.battery > demands.battery_share:
            quicker = demands.joint_rate * self.battery / demands.battery_share
            out.append(
                f"its {self.path.times[-1]:.0f} s take {self.battery:.2f} of the battery, "
                f"{demands.battery_share:g} may be taken (joint_rate {quicker:.2g} rad/s would do "
                "where joints set the pace)"
            )
        return out


def certified(seed: Seed, demands: Demands) -> tuple[Trajectory, Certificate, Cover, float]:
    """Returns a seed's motion over time, what is proved of it, its tracking and its energy."""
    body = seed.chain.body
    path = in_time(body, smoothed(judge(seed, FINE, demands).poses), demands)
    proved = certify(body, path, enough=enough(demands))
    return path, proved, expected(body, path), battery_share(body, path)


def in_time(body: PlannedBody, poses: Floats, demands: Demands) -> Trajectory:
    """Returns the trajectory through poses (m, 6 + k) within all limits of rate."""
    rates = rates_of(body, demands)
    path = timed(poses, rates, body.heading)
    return slowed(path, rates, lambda p: actuator_use(body, p, demands))


def expected(body: PlannedBody, path: Trajectory) -> Cover:
    """Returns the least clearance along a path in standard deviations of the tracking error."""
    times = np.linspace(0.0, path.times[-1], max(int(path.times[-1] / EVERY), 2))
    poses = path.at(times)
    tracking = Tracking(body)
    return tracking.cover(tracking.errors(poses, times), poses, times)


def enough(demands: Demands) -> dict[str, float]:
    """Returns bounds by name that need no bettering: twice the demanded margins."""
    return {
        "self_clearance": 0.01,
        "force_margin": 2.0 * demands.force_margin,
        "torque_margin": 2.0 * demands.torque_margin,
    }
