"""All rules, and the page ``docs/findings.md`` that is generated from them.

``python -m fecm.problem.findings_page docs/findings.md`` generates the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

# Importing them declares their rules.
import fecm.deck.reader_rules
import fecm.problem.check  # noqa: F401
from fecm.deck.rules import RULES, Rule, Subject

__all__ = ["RULES", "all_rules", "findings_page"]

HEAD = """\
# Findings

`fecm check` and `fecm run` report what is wrong or doubtful in a deck as findings: `E` is an error, which a
run refuses, `W` a warning, `N` a note. Codes are stable. A finding names file, line and column, shows the card
with the field marked, and has a hint where there is a remedy. [Checking a deck](checking.md) says more.
"""  # noqa: E501
TABLE = ["| code | finding | remedy |", "|---|---|---|"]


def all_rules() -> list[Rule]:
    """Return every rule by number, and by severity where two rules share a number."""
    return sorted(RULES.values(), key=lambda rule: (rule.code[1:], "EWN".index(rule.code[0])))


def findings_page() -> str:
    """Return the page as Markdown: a table for each subject."""
    lines = [HEAD]
    for subject in Subject:
        lines += [f"## {subject}", "", *TABLE]
        lines += [_row(rule) for rule in all_rules() if rule.subject is subject]
        lines.append("")
    return "\n".join(lines)


def _row(rule: Rule) -> str:
    finding = f"{rule.summary} {rule.cause}".rstrip()
    return f"| [{rule.code}]{{#{rule.code.lower()}}} | {finding} | {rule.remedy} |"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(findings_page(), encoding="utf-8")
