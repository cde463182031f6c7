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

    Attributes
    ----------
    findings : Findings
        Receives what is wrong.
    lines : list of str
        The file's lines.
    read : dict
        By line number, the fields and values of every card that was read.
    """

    def __init__(self, text: str, *, blanks_are_zeros: bool = False) -> None:
        self.lines = text.removeprefix("\ufeff").splitlines()
        self._cards = [
            Card(number, line)
            for number, line in enumerate(self.lines, start=1)
            if not line.startswith("!")
        ]
        self._blanks_are_zeros = blanks_are_zeros
        self.position = 0
        self.findings = Findings()
        self.read: dict[int, tuple[Fields, list[Value]]] = {}

    @property
    def at_end(self) -> bool:
        """Whether every card was taken."""
        return self.position >= len(self._cards)

    @property
    def last(self) -> Card | None:
        """The last card of the file; None of an empty one."""
        return self._cards[-1] if self._cards else None

    def take(self) -> Card | None:
        """The next card, or None at the end of the file."""
        if self.at_end:
            return None
        self.position += 1
        return self._cards[self.position - 1]

    def give_back(self) -> None:
        """Let the last card be taken again."""
        self.position -= 1

    def text_since(self, position: int) -> str:
        """Text of the cards taken since a position."""
        return "\n".join(card.text.rstrip() for card in self._cards[position : self.position])

    def skip_data(self) -> None:
        """Pass over cards up to the next keyword."""
        while (card := self.take()) is not None:
            if card.is_keyword:
                self.give_back()
                return

    def values(self, card: Card, fields: Fields) -> list[Value] | None:
        """Values of a card; None after an error, which is noted."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is not None:
            self.read[card.line] = (fields, values)
        return values

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], Source] | None:
        """Values of a card and where they stand; None after an error."""
        values = self.values(card, fields)
        return None if values is None else (values, Source(card, fields))
