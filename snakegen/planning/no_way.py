"""Why no seed will do: what the best one lacks."""

from snakegen.planning.judgement import Judgement
from snakegen.planning.seeds import Seed
from snakegen.scene.schema import Scene


def no_way(scene: Scene, looked: list[tuple[float, Seed, Judgement]]) -> str:
    """Returns why none of the seeds will do."""
    _, one, found = looked[0]
    lacking = found.short(scene.demands)
    body, steep = one.chain.body, 0
    for pose in found.poses:
        steep = max(steep, int((body.at_pose(pose).upright < 0.35).sum()))
    units = {
        "clearance": f"{gap(found.clearance)} between {found.where} of "
        f"{1e3 * scene.demands.clearance:.0f} mm",
        "self-clearance": f"{gap(found.own)} between parts of the body",
        "force margin": f"a force margin of {found.force:.3g} N of {scene.demands.force_margin:g}",
        "torque margin": f"a torque margin of {found.torque:.3g} N·m of "
        f"{scene.demands.torque_margin:g}",
        "tracking": f"a clearance of {found.cover:.2g} standard deviations of the tracking error "
        f"to expect of {scene.demands.tracking_sigmas:g}",
    }
    if found.clearance < 0.0:
        units.pop("tracking")
    what = "; ".join(units[k] for k in lacking if k in units)
    what = what or f"rods that cut corners by {found.miss:.2f} m"
    text = f"{scene.name}: no way found in {len(looked)} tries: the best has {what}"
    if steep:
        text += f", with {steep} of {len(body.mounts.joint)} thrust links steeper than 70° at once"
    return text


def gap(distance: float) -> str:
    """Returns a clearance [m] in words."""
    if distance < 0.0:
        return f"{-1e3 * distance:.0f} mm of overlap instead of clearance"
    return f"{1e3 * distance:.0f} mm clearance"
