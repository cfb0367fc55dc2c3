"""One kind of finding of the linter: tier, usual severity, meaning and remedy."""

from typing import Literal, NamedTuple

Severity = Literal["error", "warning", "note"]
Tier = Literal["schema", "topology", "physics", "assets", "portability"]


class Rule(NamedTuple):
    """One kind of finding: what it means and what mends it."""

    tier: Tier
    severity: Severity
    meaning: str
    remedy: str


def rules_of(tier: Tier, rows: dict[str, tuple[Severity, str, str]]) -> dict[str, Rule]:
    """Returns the rules of a tier by code, from (severity, meaning, remedy)."""
    return {code: Rule(tier, *row) for code, row in rows.items()}
