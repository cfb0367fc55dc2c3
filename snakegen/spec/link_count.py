"""Another number of links for a spec whose links differ: the lists that stand in the way, all at
once, and what to write instead."""

import json
from collections import Counter
from typing import Any

from snakegen.errors import SpecError

# Fields whose one value is itself a list: only lists of lists are lists per link or joint.
_NESTED = ("inertia", "axes")


def refuse_lists(data: dict[str, Any], before: int, links: int, label: str) -> None:
    """Refuses another number of links where quantities are lists with an entry each.

    A paper's links differ (ZS24 Tables 2 and 4), and no rule says what the next one weighs; so a
    person has to say it, and is shown how: one value, the list's commonest, for all.

    Args:
        data: the spec, its overrides applied.
        before: its links before `links` was asked for.
        links: asked for.
        label: names the spec.

    Raises:
        SpecError: the lists, and the options that would work.
    """
    found: dict[str, Any] = {}
    for section, old, new in (("chain", before, links), ("joint", before - 1, links - 1)):
        fields = data.get(section)
        for name, value in fields.items() if isinstance(fields, dict) else ():
            if _per_part(name, value) and len(value) == old != new:
                found[f"{section}.{name}"] = _commonest(value)
    if not found:
        return
    first, *more = found
    section, count = first.split(".")[0], before
    what, wanted = "links", links
    if section == "joint":
        what, count, wanted = "joints", before - 1, links - 1
    also = f" (so {'has' if len(more) == 1 else 'have'} {_listed(more)})" if more else ""
    options = " ".join(_option(name, value) for name, value in found.items())
    raise SpecError(
        f"{label}: {first}: {count} entries for {wanted} {what}{also}; "
        f"one value for all would do: {options}"
    )


def _listed(names: list[str]) -> str:
    """Returns names as people list them: a, b and c."""
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _per_part(name: str, value: Any) -> bool:
    """Tells whether a field holds an entry for each link or joint."""
    if not isinstance(value, list) or not value:
        return False
    return name not in _NESTED or isinstance(value[0], list)


def _commonest(values: list[Any]) -> Any:
    """Returns the entry that stands there most often, the first such."""
    counted = Counter(json.dumps(v) for v in values)
    return json.loads(counted.most_common(1)[0][0])


def _option(name: str, value: Any) -> str:
    """Returns the option that sets one value for all, as a shell takes it."""
    if isinstance(value, list):
        text = ", ".join(str(v) for v in value)
        return f"--set '{name}=[{text}]'"
    return f"--set {name}={value}"
