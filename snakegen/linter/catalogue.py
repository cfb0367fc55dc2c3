"""Every kind of finding: its tier, its usual severity, what it means and what mends it.

**Error** is kept for what makes a model wrong or unloadable. What one parser ignores, what another
tool adds or a file that is not installed is a warning or a note. docs/lint.md holds this table.
"""

from snakegen.linter.catalogue_files import ASSETS, MJCF, PORTABILITY
from snakegen.linter.catalogue_form import SCHEMA, TOPOLOGY
from snakegen.linter.catalogue_physics import PHYSICS
from snakegen.linter.rule import Rule

RULES: dict[str, Rule] = SCHEMA | TOPOLOGY | PHYSICS | ASSETS | PORTABILITY | MJCF


def page() -> str:
    """Returns docs/lint.md: every code with its tier, severity, meaning and remedy."""
    lines = [
        "# Findings of `snakegen lint`",
        "",
        "Every code that a finding ends with. An **error** makes a model wrong or unloadable: "
        "`analyze`, `flight` and `build` stop at it. A **warning** is probably not meant, or some "
        "program refuses it. A **note** is harmless; `--all` prints it. Some rules lower their "
        "severity where the model is not changed, for instance an impossible inertia of a frame "
        "that is fixed to a sound link.",
        "",
        "This page is made of `RULES` in the linter's catalogue; a test keeps the two together.",
    ]
    for tier in ("schema", "topology", "physics", "assets", "portability"):
        lines += ["", f"## {tier.capitalize()}", "", "| code | severity | meaning | remedy |"]
        lines.append("|---|---|---|---|")
        lines += [
            f"| `{code}` | {rule.severity} | {rule.meaning} | {rule.remedy} |"
            for code, rule in RULES.items()
            if rule.tier == tier
        ]
    return "\n".join(lines) + "\n"
