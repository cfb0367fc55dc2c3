"""Findings as SARIF 2.1.0, the format that code-review tools show beside the lines of a file."""

from collections.abc import Sequence
from typing import Any

from snakegen import __version__
from snakegen.linter.catalogue import RULES
from snakegen.linter.finding import Finding

_LEVELS = {"error": "error", "warning": "warning", "note": "note"}
_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def to_sarif(path: str, found: Sequence[Finding]) -> dict[str, Any]:
    """Returns one SARIF log of the findings of the file at `path`."""
    codes = sorted({finding.code for finding in found})
    rules = [
        {
            "id": code,
            "shortDescription": {"text": RULES[code].meaning},
            "help": {"text": RULES[code].remedy},
            "properties": {"tier": RULES[code].tier},
        }
        for code in codes
    ]
    results = [
        {
            "ruleId": finding.code,
            "ruleIndex": codes.index(finding.code),
            "level": _LEVELS[finding.severity],
            "message": {"text": " ".join(filter(None, (finding.element, finding.message)))},
            "locations": [
                {
                    "physicalLocation": {
                        "artifactLocation": {"uri": path},
                        "region": {"startLine": finding.line},
                    }
                }
            ],
        }
        for finding in found
    ]
    driver = {"name": "snakegen", "version": __version__, "rules": rules}
    return {
        "$schema": _SCHEMA,
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "results": results}],
    }
