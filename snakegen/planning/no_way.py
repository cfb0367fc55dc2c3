"""Why no seed will do: what the best one lacks, and how much wider an opening would have to be."""

from dataclasses import replace

import numpy as np

from snakegen.planning.body import PlannedBody
from snakegen.planning.judgement import COARSE, MISS, Judgement, judge
from snakegen.planning.seeds import Seed
from snakegen.scene.schema import Scene


def no_way(scene: Scene, looked: list[tuple[float, Seed, Judgement]]) -> str:
    """Returns why none of the seeds will do, and how much wider an opening would."""
    _, one, found = looked[0]
    lacking = found.short(scene.demands)
    body, steep = one.chain.body, 0
    for pose in found.poses:
        steep = max(steep, int((body.at_pose(pose).upright < 0.35).sum()))
    units = {
        "clearance": f"{1e3 * found.clearance:.0f} mm clearance between {found.where} of "
        f"{1e3 * scene.demands.clearance:.0f} mm",
        "self-clearance": f"{1e3 * found.own:.0f} mm between parts of the body",
        "force margin": f"a force margin of {found.force:.3g} N of {scene.demands.force_margin:g}",
        "torque margin": f"a torque margin of {found.torque:.3g} N·m of "
        f"{scene.demands.torque_margin:g}",
        "tracking": f"a clearance of {found.cover:.2g} standard deviations of the tracking error "
        f"to expect of {scene.demands.tracking_sigmas:g}",
    }
    what = "; ".join(units[k] for k in lacking) or f"rods that cut corners by {found.miss:.2f} m"
    text = f"{scene.name}: no way found in {len(looked)} tries: the best has {what}"
    if steep:
        text += f", with {steep} of {len(body.mounts.joint)} thrust links steeper than 70° at once"
    wider = wider_opening(scene, looked) if "clearance" in lacking else None
    return text + (f"; {wider}." if wider else ".")


def wider_opening(scene: Scene, looked: list[tuple[float, Seed, Judgement]]) -> str:
    """Returns which opening, how much wider, lets one of the best seeds through; "" if none."""
    names = looked[0][2].where
    hit = [w for w in scene.openings if f"and {w.name}." in names or names.endswith(w.name)]
    if not hit:
        return ""
    for more in np.arange(1, 13) * 0.05:
        made, _ = hit[0].widened(float(more))
        kept = [s for s in scene.solids if s.name.partition(".")[0] != hit[0].name]
        body = PlannedBody(looked[0][1].chain.body.robot, (*kept, *made))
        for _, one, _ in looked[:3]:
            chain = replace(one.chain, body=body.turned(one.chain.body.heading))
            found = judge(replace(one, chain=chain), COARSE, scene.demands)
            if not found.short(scene.demands) and found.miss < MISS:
                size = " by ".join(f"{x + more:.2f}" for x in hit[0].size)
                old = " by ".join(f"{x:.2f}" for x in hit[0].size)
                return f"an opening of {size} m in {hit[0].name} instead of {old} m would do"
    return ""
