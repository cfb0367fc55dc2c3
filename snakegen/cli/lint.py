"""`snakegen lint`: findings on a URDF or MJCF file."""

from collections import Counter
from pathlib import Path

import click

from snakegen.cli import HELP
from snakegen.cli.options import json_option, print_json
from snakegen.errors import DescriptionError

_UNREADABLE = ("unreadable", "too_large")


@click.command(context_settings=HELP)
@click.argument("file", metavar="FILE", type=click.Path())
@json_option
@click.option("--sarif", "as_sarif", is_flag=True, help="Print SARIF 2.1.0 for code review.")
@click.option("--fix", "mend", is_flag=True, help="Mend what is safe in the file, and say what.")
@click.option("--all", "everything", is_flag=True, help="Print every note and remedy.")
@click.option("--strict", is_flag=True, help="Exit with 3 on warnings too, as a hook may want it.")
def lint(
    file: str, as_json: bool, as_sarif: bool, mend: bool, everything: bool, strict: bool
) -> int:
    """List what is wrong, doubtful or unportable in a URDF or MJCF file.

    Errors make a model wrong or unloadable; warnings are probably not meant; notes are harmless.
    docs/lint.md explains every code. Exit code 3 where there is an error.

    \b
    Example:
      snakegen lint robot.urdf
      snakegen lint robot.urdf --fix
      snakegen lint robot.urdf --json
    """
    from snakegen.linter.lint import lint as findings

    if as_json and as_sarif:
        raise DescriptionError("JSON and SARIF are two formats; choose one.")
    path = Path(file)
    done = _mend(path) if mend else []
    found = findings(path)
    if found and found[0].code in _UNREADABLE:
        raise DescriptionError(f"{file}: {found[0].message}.")
    counts = Counter(finding.severity for finding in found)
    if as_sarif:
        from snakegen.linter.sarif import to_sarif

        print_json(to_sarif(path.as_posix(), found))
    elif as_json:
        rows = [finding.to_json() for finding in found]
        tally = {name: counts[name] for name in ("error", "warning", "note")}
        print_json({"file": file, "counts": tally, "fixed": done, "findings": rows})
    else:
        for text in done:
            click.echo(f"fixed    {text}")
        if mend and not done:
            click.echo("nothing to fix: --fix makes only edits that change no number")
        shown = [f for f in found if everything or f.severity != "note"]
        for finding in shown:
            click.echo(f"{finding.severity:<8} {finding}")
            if everything or finding.severity == "error":
                click.echo(f"{'':<9}{finding.remedy}")
        hidden = len(found) - len(shown)
        parts = [_count(counts[name], name) for name in ("error", "warning", "note")]
        more = " (--all prints them)" if hidden else ""
        click.echo(f"{file}: {', '.join(parts)}{more}")
    return 3 if counts["error"] or (strict and counts["warning"]) else 0


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _mend(path: Path) -> list[str]:
    """Mends the file in place, whole or not at all; returns what was done."""
    from snakegen.base.atomic_io import write_atomically
    from snakegen.linter.fixes import fix
    from snakegen.linter.lint import LARGEST
    from snakegen.linter.xml_text import as_utf8, read_xml
    from snakegen.linter.xml_tree import XmlFault

    try:
        text, encoding = read_xml(path, LARGEST)
        mended, done = fix(text, path.parent)
        if encoding:
            mended = as_utf8(mended)
            done.insert(0, f"line 1: saved as UTF-8; it was {encoding}")
    except XmlFault:
        return []  # the findings say where it is broken
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DescriptionError(f"{path}: cannot be read ({reason}).") from None
    if mended != text or encoding:
        write_atomically(path, mended)
    return done
