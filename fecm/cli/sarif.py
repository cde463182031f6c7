"""Findings as SARIF 2.1.0, which code hosts and editors read."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fecm._version import __version__
from fecm.deck.findings import Finding

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
HOME = "https://fecm.readthedocs.io"


def sarif(checked: Mapping[Path, Sequence[Finding]], failures: Sequence[str]) -> dict[str, Any]:
    """Log of a check: findings by deck, and messages about decks that could not be read."""
    codes = sorted({finding.code for findings in checked.values() for finding in findings})
    severities = {f.code: f.severity for findings in checked.values() for f in findings}
    rules = [
        {
            "id": code, "helpUri": f"{HOME}/page/findings.html#{code.lower()}",
            "defaultConfiguration": {"level": severities[code]},
        }
        for code in codes
    ]  # fmt: skip
    driver = {"name": "fecm", "version": __version__, "informationUri": HOME, "rules": rules}
    notifications = [{"level": "error", "message": {"text": text}} for text in failures]
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {"executionSuccessful": not failures, "toolExecutionNotifications": notifications}
        ],
        "results": [
            {
                "ruleId": finding.code,
                "ruleIndex": codes.index(finding.code),
                "level": finding.severity,
                "message": {"text": finding.message + (finding.hint and f" Hint: {finding.hint}.")},
                "locations": [{"physicalLocation": _location(deck, finding)}],
            }
            for deck, findings in checked.items()
            for finding in findings
        ],
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _location(deck: Path, finding: Finding) -> dict[str, Any]:
    """File and region; without a place the region is the first line."""
    uri = deck.as_uri() if deck.is_absolute() else quote(os.fsencode(deck.as_posix()))
    region: dict[str, Any] = {"startLine": 1}
    if place := finding.place:
        region = {
            "startLine": place.line,
            "startColumn": place.first,
            "endColumn": max(place.first, place.last) + 1,
            "snippet": {"text": place.text},
        }
    return {"artifactLocation": {"uri": uri}, "region": region}
