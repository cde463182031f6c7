"""Check of a deck without a run."""

from __future__ import annotations

from dataclasses import dataclass

from fecm._table import Table, html_table
from fecm.deck.findings import Finding, Severity
from fecm.listing.slips import Mode, active_slips
from fecm.problem.loading import AnyDeck, LoadedDeck, load_deck
from fecm.problem.summary import ProblemSummary, deck_summary, summary_table


@dataclass(frozen=True, eq=False)
class DeckCheck:
    """Findings and summaries of a deck before it runs; ``str()`` is what ``fecm check`` prints.

    Attributes
    ----------
    source : str
        Name of the deck's file.
    findings : tuple of Finding
        Errors, warnings and notes, in the deck's order.
    problems : tuple of ProblemSummary
        Size, stiffness, masses and time step of each problem; empty if the deck has errors.
    """

    source: str
    findings: tuple[Finding, ...]
    problems: tuple[ProblemSummary, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that make the deck unusable."""
        return self._of_severity(Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that are probably mistakes."""
        return self._of_severity(Severity.WARNING)

    @property
    def ok(self) -> bool:
        """Whether the deck has no errors."""
        return not self.errors

    def _of_severity(self, severity: Severity) -> tuple[Finding, ...]:
        return tuple(finding for finding in self.findings if finding.severity is severity)

    def to_dicts(self) -> list[dict[str, object]]:
        """Return the lines of ``fecm check --format json``: findings and problems."""
        lines = [{**finding.to_dict(self.source)} for finding in self.findings]
        head = {"kind": "summary", "file": self.source}
        return [*lines, *({**head, **problem.to_dict()} for problem in self.problems)]

    def __str__(self) -> str:
        texts = [finding.render(self.source) for finding in self.findings]
        return "\n".join([*texts, *(line for problem in self.problems for line in problem.lines())])

    def _repr_html_(self) -> str:
        """Return tables of the findings and of each problem, for notebooks."""
        rows = tuple((f"{item.severity} {item.code}", item.message) for item in self.findings)
        findings = Table(rows, title=repr(self)[1:-1])
        return html_table(findings, *map(summary_table, self.problems))

    def __repr__(self) -> str:
        counts = {"error": len(self.errors), "warning": len(self.warnings)}
        texts = (f"{count} {word}{'s' * (count != 1)}" for word, count in counts.items())
        return f"<fecm check of {self.source}: {', '.join(texts)}>"


def check_loaded(loaded: LoadedDeck) -> DeckCheck:
    """Summarise the problems of a loaded deck, if it has no errors."""
    problems = () if loaded.errors() else loaded.problems
    return DeckCheck(loaded.source, tuple(loaded.findings), tuple(map(deck_summary, problems)))


def check(deck: AnyDeck, mode: Mode = "report") -> DeckCheck:
    """Check a deck without running it.

    Parameters
    ----------
    deck : str, Path, file or Deck
        A file's path, a deck's text, an open file, or a model built in Python.
    mode : str
        ``"report"``, or ``"listing"``, which refuses what the printed program can't compute.

    Returns
    -------
    DeckCheck
        Findings, and a summary of each problem.  A deck with errors raises nothing.

    Raises
    ------
    OptionsError
        If the mode is unknown.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> import fecm
    >>> check = fecm.check(fecm.examples.path("impact-patch"))
    >>> check.ok, len(check.warnings)
    (True, 0)
    >>> (problem,) = check.problems
    >>> print(f"{problem.nodes} nodes, DT at most {problem.critical_time_step:.3g} s")
    609 nodes, DT at most 5.07e-07 s
    """
    active_slips(mode, ())  # refuses an unknown mode
    return check_loaded(load_deck(deck, mode))
