"""`snakegen plan`: a certified motion of a flying body through a scene, as a mission file."""

from pathlib import Path
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import (
    Source,
    at_least,
    check_ending,
    json_option,
    note,
    optional_robot_options,
    print_json,
)

_UNITS = {"clearance": "m", "self_clearance": "m", "force_margin": "N", "torque_margin": "N·m"}


@click.command(context_settings=HELP)
@optional_robot_options
@click.argument("scene", metavar="SCENE.yaml", type=click.Path(), required=False)
@click.option("-o", "--out", metavar="PLAN.yaml", type=click.Path(), help="The plan to write.")
@click.option(
    "--seed", type=int, default=0, show_default=True, callback=at_least(0),
    help="Of the trial flight; the search draws nothing at random.",
)  # fmt: skip
@click.option(
    "--minutes",
    type=float,
    default=2.0,
    show_default=True,
    help="After which the search ends; without a way as many again go into sizes that would do.",
)
@click.option(
    "--picture", metavar="FILE.png", type=click.Path(), help="Draw the motion at eight instants."
)
@click.option(
    "--example",
    is_flag=True,
    help="Print a commented scene instead; to SCENE.yaml where that is given.",
)
@json_option
def plan(
    source: Source,
    scene: str | None,
    out: str | None,
    seed: int,
    minutes: float,
    picture: str | None,
    example: bool,
    as_json: bool,
) -> int:
    """Plan a motion of ROBOT through a scene: link by link, hovering at every instant.

    SCENE.yaml names obstacles, start, goal and demands; the name of a shipped scene (ceiling,
    doorway, pipe, bent_pipe, two_openings) does too. Clearance and margins are proved between
    waypoints; a motion is flown once with the usual noise, and planned again where it fails. The
    plan is a mission file for `snakegen analyze flight`. Exit code 3 where no motion could be
    certified, or none flies: nothing is written then.

    \b
    Example:
      snakegen plan dragon4 ceiling -o plan.yaml
      snakegen plan --example > my.yaml
    """
    from snakegen.base.atomic_io import check_writable, write_atomically
    from snakegen.errors import PlanError
    from snakegen.planning.strobe_instants import draw_motion
    from snakegen.scene.schema import read_scene
    from snakegen.simulation.trial_flight import search_and_fly

    check_ending("-o", out, ".yaml", ".yml")
    check_ending("--picture", picture, ".png")
    if example and scene is None:
        click.echo(_shipped()["ceiling"].read_text(encoding="utf-8"), nl=False)
        return 0
    if source.robot is None or scene is None:
        raise PlanError("plan needs ROBOT and SCENE; --example prints a scene to start from.")
    path = Path(scene)
    if example:
        check_ending("SCENE", scene, ".yaml", ".yml")
        if path.exists():
            raise PlanError(f"{scene}: is there already; name a new file for the example.")
        write_atomically(path, _shipped()["ceiling"].read_text(encoding="utf-8"))
        click.echo(path)
        return 0
    if not minutes > 0.0:
        raise PlanError(f"--minutes {minutes:g}: more than 0 is needed.")
    path = _shipped().get(scene, path)
    target = Path(out) if out else Path(f"{path.stem}.plan.yaml")
    robot = source.machine()
    place = read_scene(path)
    check_writable(target)
    said = None if as_json else note
    motion, trial = search_and_fly(
        robot, place, seed=seed, progress=said, minutes=minutes, advise=True
    )
    unmet = motion.unmet(place.demands)
    flies = trial is not None and trial.passed
    if flies:
        motion.file(place).write(target)
    if picture is not None:
        draw_motion(Path(picture), motion, place)
    result = {
        "robot": robot.name,
        "scene": place.name,
        "certified": not unmet,
        "unmet": unmet,
        "would_do": motion.advice or None,
        "trial_flight": None if trial is None else trial.to_json(),
        "plan": str(target) if flies else None,
        "duration_s": float(motion.path.times[-1]),
        "waypoints": len(motion.path.times),
        "seeds_tried": motion.tried,
        "search_s": round(motion.seconds, 2),
        "certificate": motion.certificate.to_json(),
        "tracking": motion.tracking.to_json(),
        "battery_share": round(motion.battery, 4),
    }
    if as_json:
        print_json(result)
    else:
        _print(result, motion)
    return 0 if flies else 3


def _print(result: dict[str, Any], motion: Any) -> None:
    """Prints what was found and proved."""
    click.echo(
        f"{result['scene']}: a motion of {result['duration_s']:.1f} s for {result['robot']}, found "
        f"in {result['search_s']:.1f} s ({result['seeds_tried']} seeds)"
    )
    for name, bound in motion.certificate.bounds().items():
        between = f", {bound.between[0]} and {bound.between[1]}" if bound.between[0] else ""
        click.echo(
            f"  {name.replace('_', ' '):<15} ≥ {bound.lower:.4g} {_UNITS[name]} at every instant "
            f"(least seen {bound.seen:.4g} at {bound.time:.2f} s{between})"
        )
    cover = motion.tracking
    if cover.between[0]:
        click.echo(
            f"  tracking        {1e3 * cover.error:.2g} mm of error to expect (one standard "
            f"deviation over hardware) at {cover.time:.2f} s toward {cover.between[1]}: the "
            f"clearance there is {cover.sigmas:.3g} times that"
        )
    if motion.battery > 0.0:
        click.echo(f"  battery         {100 * motion.battery:.0f} % of its energy")
    trial = result["trial_flight"]
    if result["plan"]:
        click.echo(
            f"  trial flight    passed every check (noise and mismatch of seed {trial['seed']})"
        )
        click.echo(f"certified for hover along the path: {result['plan']}")
        click.echo(
            "not covered by the certificate: tracking errors, wind, the air that rotors stir; "
            f"fly it: snakegen analyze flight {result['robot']} --mission {result['plan']}"
        )
    elif trial is not None:
        ended = f"; {trial['stopped']}" if trial["stopped"] else ""
        click.echo(
            f"certified for hover, but its trial flight fails {', '.join(trial['failed'])}{ended}; "
            "nothing was written: a scene that demands a larger torque_margin keeps the body bent"
        )
    else:
        reasons = [*result["unmet"], *([motion.advice] if motion.advice else [])]
        click.echo(f"not certified: {'; '.join(reasons)}; nothing was written")


def _shipped() -> dict[str, Path]:
    """Returns the scenes that come with snakegen, by name."""
    from snakegen.spec.loading import templates_folder

    return {p.stem: p for p in sorted((templates_folder() / "scenes").glob("*.yaml"))}
