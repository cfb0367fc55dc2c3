"""`snakegen missions`: what can be flown, driven or moved, by which robot, with which options."""

from collections.abc import Mapping
from typing import Any

import click

from snakegen.cli import HELP
from snakegen.cli.options import (
    Source,
    Stance,
    json_option,
    optional_robot_options,
    print_json,
    print_rows,
)


@click.command(context_settings=HELP)
@optional_robot_options
@click.argument("mission", required=False)
@json_option
def missions(source: Source, mission: str | None, as_json: bool) -> int:
    """List the missions; those that suit ROBOT, and what the others need; the options of one.

    \b
    Example:
      snakegen missions
      snakegen missions screw4
      snakegen missions dragon4 transform
    """
    from snakegen.errors import MissionError
    from snakegen.simulation.missions import missions as known

    if source.robot is None:
        if as_json:
            print_json(known())
        else:
            print_rows("missions (snakegen missions ROBOT: those that suit it)", [*known().items()])
        return 0
    if source.robot in known():
        raise MissionError(
            f"'{source.robot}' is a mission: its options are shown by "
            f"snakegen missions ROBOT {source.robot}."
        )
    robot = source.machine()
    if mission is None:
        return list_missions(robot, as_json)
    return list_options(mission, robot, as_json)


def list_missions(robot: Any, as_json: bool = False) -> int:
    """Prints the missions that suit `robot`, then what the others need."""
    from snakegen.simulation.missions import missions as known
    from snakegen.simulation.missions import needs

    lacks = {name: needs(name, robot) for name in known()}
    if as_json:
        rows = {
            name: {"shows": text, "applies": not lacks[name], "needs": lacks[name] or None}
            for name, text in known().items()
        }
        print_json({"robot": robot.name, "missions": rows})
        return 0
    suits = [(name, text) for name, text in known().items() if not lacks[name]]
    others = [(name, text) for name, text in lacks.items() if text]
    print_rows(f"missions for {robot.name} (its options: snakegen missions ROBOT MISSION)", suits)
    if others:
        print_rows(f"not for {robot.name}; they need", others)
    return 0


def list_options(name: str, robot: Any, as_json: bool = False) -> int:
    """Prints the options of a mission with their defaults, then what its docstring adds."""
    from snakegen.simulation.missions import mission as find
    from snakegen.simulation.missions.options import options_of

    module = find(name, robot)
    options = {k: o for k, o in options_of(module.Options).items() if not o.set_by}
    about = (module.__doc__ or "").strip()
    if as_json:
        found = {k: {"default": o.default, "meaning": o.meaning} for k, o in options.items()}
        print_json({"mission": name, "about": about, "options": found})
        return 0
    rows = [(f"{k}={_shown(o.default)}", o.meaning) for k, o in options.items()]
    print_rows(f"options of mission {name} (--option NAME=VALUE)", rows or [("", "none")])
    more = about.partition("\n")[2].strip().replace("``", "")
    if more:
        click.echo(f"\n{more}")
    return 0


def _shown(default: Any) -> str:
    if isinstance(default, bool):
        return str(default).lower()
    return "" if default is None else str(default)


def given_options(
    name: str, robot: Any, items: tuple[str, ...], more: Mapping[str, Any], stance: Stance
) -> tuple[Any, dict[str, Any]]:
    """Returns the robot and the options of a mission from ``name=value`` items, checked.

    Args:
        name: of the mission, or its file.
        robot: whose base the posture may mount.
        items: of ``--option``.
        more: options that the command line has an option of its own for; None where not given.
        stance: the posture asked for: the mission's ``posture``.

    Raises:
        MissionError: an option that the mission does not have, or a value that it cannot have.
        PostureError: a posture that the robot cannot take.
    """
    from pathlib import Path

    from snakegen.base import yaml_file
    from snakegen.errors import MissionError
    from snakegen.robot.posture import read_posture
    from snakegen.simulation.missions import is_file
    from snakegen.simulation.missions import mission as find
    from snakegen.simulation.missions.options import checked_options, options_of

    module = find(name, robot)
    known = options_of(module.Options)
    given: dict[str, Any] = {}
    for item in items:
        key, equals, value = item.partition("=")
        key = key.strip().replace("-", "_")
        if not equals:
            raise MissionError(f"--option '{item}': write name=value.")
        given[key] = yaml_file.parse(value, f"--option {key}")
    given |= {key: value for key, value in more.items() if value is not None}
    if "posture" in given and "posture" in known:
        given["posture"] = read_posture(Path(str(given["posture"])))
    robot, posture = stance.asked(robot)
    if posture:
        if "posture" not in known:
            raise MissionError(
                f"mission '{'path' if is_file(name) else name}' sets its own posture; "
                "--joint, --posture and --base-rpy are for those with an option 'posture'."
            )
        robot.configuration(posture)  # refused in the words of the posture, not of the mission
        if "base_rpy" in posture:
            posture["base_rpy"] = [float(x) for x in posture["base_rpy"]]
        given["posture"] = dict(given.get("posture") or {}) | posture
    checked_options(name, module.Options, given | ({"file": name} if is_file(name) else {}))
    return robot, given
