"""A deck's cards one after the other, and the values that were read from them."""

from __future__ import annotations

from fecm.deck.card import Card, Fields, Source, Value, read_values
from fecm.deck.findings import Findings


class Stream:
    """Cards in the order of the file, without the lines that are comments.

    Parameters
    ----------
    text : str
        The whole file.
    blanks_are_zeros : bool
        Read blanks inside numbers as the zeros that they were on the report's machine.
    keeps_values : bool
        Keep the fields and values of every card in `read`.

    Attributes
    ----------
    findings : Findings
        Receives what is wrong.
    lines : list of str
        The file's lines.
    position : int
        Number of lines that were taken.
    read : dict
        By line number, the fields and values of every card that was read, if they are kept.
    """

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        self.lines = text.removeprefix("\ufeff").splitlines()
        self._blanks_are_zeros = blanks_are_zeros
        self._keeps_values = keeps_values
        self.position = 0
        self.findings = Findings()
        self.read: dict[int, tuple[Fields, list[Value]]] = {}

    @property
    def at_end(self) -> bool:
        """Whether every card was taken."""
        rest = range(self.position, len(self.lines))
        return all(_is_comment(self.lines[number]) for number in rest)

    @property
    def last(self) -> Card | None:
        """The last card of the file; None of an empty one."""
        for number in range(len(self.lines), 0, -1):
            if not _is_comment(self.lines[number - 1]):
                return Card(number, self.lines[number - 1])
        return None

    def take(self) -> Card | None:
        """The next card, or None at the end of the file or of what is kept of findings."""
        while self.position < len(self.lines) and not self.findings.closed:
            self.position += 1
            line = self.lines[self.position - 1]
            if not _is_comment(line):
                return Card(self.position, line)
        return None

    def give_back(self) -> None:
        """Let the last card be taken again."""
        self.position -= 1

    def text_since(self, position: int) -> str:
        """Text of the cards taken since a position."""
        taken = self.lines[position : self.position]
        return "\n".join(line.rstrip() for line in taken if not _is_comment(line))

    def skip_data(self) -> None:
        """Pass over cards up to the next keyword."""
        while (card := self.take()) is not None:
            if card.is_keyword:
                self.give_back()
                return

    def values(self, card: Card, fields: Fields) -> list[Value] | None:
        """Values of a card; None after an error, which is noted."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is not None and self._keeps_values:
            self.read[card.line] = (fields, values)
        return values

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], Source] | None:
        """Values of a card and where they stand; None after an error."""
        values = self.values(card, fields)
        return None if values is None else (values, Source(card, fields))


def _is_comment(line: str) -> bool:
    """Whether a line is no card."""
    return line.startswith("!")
