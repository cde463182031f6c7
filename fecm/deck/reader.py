"""The card reader: a deck's text in, models and findings out.

It reads on after an error, so that one run shows all of a deck's errors, and it does not draw
conclusions from what it could not read.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from fecm.deck.card import Card, Fields, Source, Value, read_values
from fecm.deck.findings import DeckError, Findings, Place
from fecm.deck.model import (
    STOP,
    TITLE,
    Boundary,
    Control,
    Coordinates,
    Deck,
    ElementNodes,
    Elements,
    Forces,
    Impact,
    Indentation,
    Integration,
    Layer,
    Macro,
    Material,
    NodeCodes,
    NodeValues,
    Page,
    Ply,
    PrintOption,
    Segment,
    code_fields,
    element_fields,
    force_fields,
    node_fields,
)

MACROS = "MACR"
END = "END"

# What a card's count may be at the most: beyond it a deck is a slip of the pen, and reading on
# would only exhaust the memory.
MOST = 5_000_000


@dataclass
class Problem:
    """A problem as far as it could be read.

    Attributes
    ----------
    deck : Deck or None
        The model; None where the control card could not be read.
    unsound : set of str
        Keywords of segments of which a card could not be read: nothing can be concluded from what
        such a segment lacks.
    """

    deck: Deck | None
    unsound: set[str] = field(default_factory=set)


class Reader:
    """Reads the cards of a file, problem by problem.

    Parameters
    ----------
    text : str
        The whole file.
    blanks_are_zeros : bool
        Read blanks inside numbers as the zeros that they were on the report's machine.
    """

    def __init__(self, text: str, *, blanks_are_zeros: bool = False) -> None:
        lines = text.removeprefix("\ufeff").splitlines()
        self._cards = [
            Card(number, line)
            for number, line in enumerate(lines, start=1)
            if not line.startswith("!")
        ]
        self._next = 0
        self._blanks_are_zeros = blanks_are_zeros
        self.findings = Findings()
        self._segments: dict[str, Callable[[Card], Segment | None]] = {
            "COOR": self._coordinates,
            "ELEM": self._elements,
            "BOUN": self._boundary,
            "MATE": self._material,
            "ROD": self._impact,
            "EXPE": self._indentation,
            "FORC": self._forces,
            "PRIN": lambda card: PrintOption(True, source=Source(card, ())),
            "NOPR": lambda card: PrintOption(False, source=Source(card, ())),
            "PAGE": self._page,
        }
        self._control: Control | None = None
        self._unsound: set[str] = set()

    # The file ------------------------------------------------------------------------------------

    def problems(self) -> list[Problem]:
        """Read every problem of the file."""
        problems: list[Problem] = []
        stopped = False
        while (card := self._take()) is not None:
            if card.is_blank:
                continue
            if card.keyword == STOP:
                stopped = True
                break
            if card.keyword == TITLE:
                problems.append(self._problem(card))
            else:
                self._stray(card, [TITLE, STOP])
        if not problems:
            self.findings.add(
                "E001", "The file holds no problem.", None, "a problem begins with a FECM card"
            )
        elif not stopped:
            self.findings.add(
                "W002", "The deck does not end with a STOP card.", self._cards[-1].place
            )
        return problems

    def _take(self) -> Card | None:
        """The next card, or None at the end of the file."""
        if self._next >= len(self._cards):
            return None
        self._next += 1
        return self._cards[self._next - 1]

    def _give_back(self) -> None:
        """Let the last card be taken again."""
        self._next -= 1

    def _problem(self, title: Card) -> Problem:
        """Read one problem, from its FECM card on."""
        first = self._next - 1
        self._control = None
        self._unsound = set()
        card = self._take()
        if card is None or card.is_keyword:
            if card is not None:
                self._give_back()
            self.findings.add(
                "E003",
                "The control card is missing.",
                (card or title).place,
                "(6I5): NUMNP, NUMEL, LAYER, NDM, NDF, NEN",
            )
        elif (values := self._values(card, Control.fields, "FECM")) is not None:
            self._control = Control(*map(int, values), source=Source(card, Control.fields))
            self._check_control(self._control)
        segments = self._mesh_and_data(title)
        macros = self._program(title) if self._next < len(self._cards) else []
        text = "\n".join(c.text.rstrip() for c in self._cards[first : self._next])
        deck = None
        if self._control is not None:
            deck = Deck(
                title.data[4:].strip(),
                self._control,
                tuple(segments),
                tuple(macros),
                f"{text}\n{STOP}\n",
                source=Source(title, ()),
            )
        return Problem(deck, self._unsound)

    def _check_control(self, control: Control) -> None:
        """Refuse counts and dimensions that no deck can have."""
        sound = True

        def refuse(name: str, message: str, hint: str = "") -> None:
            nonlocal sound
            sound = False
            self.findings.add("E201", message, control.place(name), hint)

        values = control.values()
        if values[-1] == 0:
            missing = [f.name for f, value in zip(Control.fields, values, strict=True) if not value]
            first = missing[0]
            are = "is" if len(missing) == 1 else "are"
            refuse(
                first,
                f"{', '.join(missing)} {are} missing on the control card.",
                "(6I5): NUMNP, NUMEL, LAYER, NDM, NDF, NEN",
            )
            self._control = None
            return
        for name, count in (
            ("NUMNP", control.numnp), ("NUMEL", control.numel), ("LAYER", control.layers)
        ):  # fmt: skip
            if not 1 <= count <= MOST:
                refuse(name, f"{name} is {count}; it must be between 1 and {MOST}.")
        if control.ndm != 2:
            refuse("NDM", f"NDM is {control.ndm}; the plate lies in 2 dimensions.")
        if control.ndf != 5:
            refuse(
                "NDF", f"NDF is {control.ndf}; a node has 5 unknowns.", "u, v, w and 2 rotations"
            )
        if not 4 <= control.nen <= 9:
            refuse("NEN", f"NEN is {control.nen}; an element has 4 to 9 nodes.")
        if not sound:
            self._control = None

    # Mesh and data -------------------------------------------------------------------------------

    def _mesh_and_data(self, title: Card) -> list[Segment]:
        """Read the segments up to their END."""
        segments: list[Segment] = []
        while (card := self._take()) is not None:
            if card.is_blank:
                continue
            keyword = card.keyword
            if keyword == END:
                return segments
            if keyword in (MACROS, STOP, TITLE):
                self._give_back()
                self.findings.add(
                    "E004", f"The mesh data are not ended by END before {keyword}.", card.place
                )
                return segments
            read = self._segments.get(keyword) if card.is_keyword else None
            if read is None:
                self._stray(card, [*self._segments, END])
            elif self._control is None:
                self._skip_data()  # without counts the data can't be told apart
            else:
                segment = read(card)
                if segment is None:
                    self._unsound.add(keyword)
                else:
                    segments.append(segment)
        self.findings.add("E004", "The mesh data are not ended by END.", title.place)
        return segments

    def _stray(self, card: Card, known: list[str]) -> None:
        """Report a card where a keyword should stand, once for all that follow it."""
        if card.is_keyword:
            near = _close(card.keyword, known)
            self._unsound.update(near)
            self.findings.add(
                "E005",
                f"`{card.data.split()[0]}` is no keyword here.",
                Place(card.line, 1, min(4, len(card.data)), card.text),
                f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}",
            )
            if near == [MACROS]:
                return
        elif card.keyword.lstrip()[:1].isalpha():
            self.findings.add(
                "E005",
                f"The keyword `{card.data.strip()}` does not begin in column 1.",
                card.place,
                "move it to the left",
            )
        else:
            self.findings.add(
                "E006",
                "A card of data stands where a keyword is expected.",
                card.place,
                "a segment has more cards than its counts say, or a blank card ended it too early",
            )
        self._skip_data()

    def _skip_data(self) -> None:
        """Pass over cards up to the next keyword."""
        while (card := self._take()) is not None:
            if card.is_keyword:
                self._give_back()
                return

    def _values(self, card: Card, fields: Fields, keyword: str) -> list[Value] | None:
        """Values of a card; marks the segment unsound where one can't be read."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is None:
            self._unsound.add(keyword)
        return values

    def _rows(self, keyword: str, fields: Fields, head: Card) -> list[tuple[list[Value], Source]]:
        """Rows of numbered cards up to the blank card that ends them."""
        rows: list[tuple[list[Value], Source]] = []
        while (card := self._take()) is not None:
            if card.is_blank:
                return rows
            if card.is_keyword:
                self._give_back()
                self.findings.add(
                    "E007",
                    f"The {keyword} cards are not ended by a blank card.",
                    card.place,
                    "put a blank card before this one",
                )
                return rows
            values = self._values(card, fields, keyword)
            if values is not None:
                rows.append((values, Source(card, fields)))
        self.findings.add("E007", f"The {keyword} cards are not ended by a blank card.", head.place)
        return rows

    def _counts(self) -> Control:
        """The control card, which `_mesh_and_data` has made sure of."""
        if self._control is None:
            raise LookupError("a segment is read before its control card")
        return self._control

    def _coordinates(self, head: Card) -> Segment:
        rows = self._rows("COOR", node_fields(self._counts().ndm), head)
        return Coordinates(tuple(_node_values(rows)), source=Source(head, ()))

    def _forces(self, head: Card) -> Segment:
        rows = self._rows("FORC", force_fields(self._counts().ndf), head)
        return Forces(tuple(_node_values(rows)), source=Source(head, ()))

    def _boundary(self, head: Card) -> Segment:
        rows = self._rows("BOUN", code_fields(self._counts().ndf), head)
        records = [
            NodeCodes(int(v[0]), int(v[1]), tuple(map(int, v[2:])), source=source)
            for v, source in rows
        ]
        return Boundary(tuple(records), source=Source(head, ()))

    def _elements(self, head: Card) -> Segment:
        """Read ELEM cards up to a blank card, or to the last element's card without one."""
        counts = self._counts()
        fields = element_fields(counts.nen)
        records: list[ElementNodes] = []
        while (card := self._take()) is not None and not card.is_blank:
            if card.is_keyword:
                self._give_back()
                if not records or records[-1].element < counts.numel:
                    self.findings.add(
                        "E007",
                        "The ELEM cards are not ended by a blank card.",
                        card.place,
                        "put a blank card before this one",
                    )
                break
            values = self._values(card, fields, "ELEM")
            if values is not None:
                number, *nodes, increment = map(int, values)
                records.append(
                    ElementNodes(number, tuple(nodes), increment, source=Source(card, fields))
                )
        return Elements(tuple(records), source=Source(head, ()))

    def _single(self, head: Card, fields: Fields, what: str) -> tuple[list[Value], Source] | None:
        """Values of a card that must be there; None if it is missing or can't be read."""
        card = self._take()
        if card is None or card.is_keyword:
            if card is not None:
                self._give_back()
            self.findings.add("E008", f"{what} is missing.", (card or head).place)
            return None
        values = self._values(card, fields, head.keyword)
        return None if values is None else (values, Source(card, fields))

    def _material(self, head: Card) -> Segment | None:
        rule = self._single(head, Integration.fields, "The first card of MATE")
        if rule is None and "MATE" not in self._unsound:
            return None
        ply = self._single(head, Ply.fields, "The card of the ply's constants")
        if ply is None and "MATE" not in self._unsound:
            return None
        layers: list[Layer] = []
        count = self._counts().layers
        for _ in range(count):
            card = self._take()
            if card is None or card.is_keyword or card.is_blank:
                if card is not None:
                    self._give_back()
                self._unsound.add("MATE")
                self.findings.add(
                    "E202",
                    f"MATE has {len(layers)} layer cards where the control card says {count}.",
                    (card or head).place if card is None or card.is_keyword else card.place,
                )
                return None
            values = self._values(card, Layer.fields, "MATE")
            if values is not None:
                number, angle, thickness = values
                layers.append(
                    Layer(
                        int(number), float(angle), float(thickness),
                        source=Source(card, Layer.fields),
                    )
                )  # fmt: skip
        if rule is None or ply is None or len(layers) < count:
            return None
        bending, shear, points, thickness, width = rule[0]
        integration = Integration(
            int(bending), int(shear), int(points), float(thickness), float(width), source=rule[1]
        )
        constants = Ply(*map(float, ply[0]), source=ply[1])
        return Material(integration, constants, tuple(layers), source=Source(head, ()))

    def _impact(self, head: Card) -> Segment | None:
        row = self._single(head, Impact.fields, "The card of the impact")
        if row is None:
            return None
        (node, dof, velocity), source = row
        return Impact(int(node), int(dof), float(velocity), source=source)

    def _indentation(self, head: Card) -> Segment | None:
        row = self._single(head, Indentation.fields, "The card of the indentation law")
        if row is None:
            return None
        return Indentation(*map(float, row[0]), source=row[1])

    def _page(self, head: Card) -> Segment:
        card = self._take()
        return Page("" if card is None else card.data[:4].rstrip(), source=Source(head, ()))

    # Macro program -------------------------------------------------------------------------------

    def _program(self, title: Card) -> list[Macro]:
        """Read the macro program from its MACR card to its END."""
        while (card := self._take()) is not None:
            if card.is_blank:
                continue
            if card.keyword == MACROS:
                return self._macros(card)
            if card.keyword in (TITLE, STOP):
                self._give_back()
                break
            if card.is_keyword and not _close(card.keyword, [MACROS]):
                self._give_back()
                self.findings.add(
                    "E009", "No MACR card stands before the macro program.", card.place
                )
                return self._macros(card)
            self._stray(card, [MACROS])
            if card.is_keyword:  # MACR misspelt: what follows is the program all the same
                return self._macros(card)
        self.findings.add(
            "E009", "The problem has no macro program.", title.place, "it begins with a MACR card"
        )
        self._unsound.add(MACROS)
        return []

    def _macros(self, head: Card) -> list[Macro]:
        macros: list[Macro] = []
        while (card := self._take()) is not None:
            if card.is_blank:
                continue
            if card.keyword == END:
                return macros
            if card.keyword in (STOP, TITLE):
                self._give_back()
                break
            values = self._values(card, Macro.fields, MACROS)
            if values is not None:
                word, option, value, second = values
                macros.append(
                    Macro(
                        str(word).upper(), str(option).strip().upper(), float(value), float(second),
                        source=Source(card, Macro.fields),
                    )
                )  # fmt: skip
        self.findings.add("E004", "The macro program is not ended by END.", (card or head).place)
        self._unsound.add(MACROS)
        return macros


def _close(word: str, known: list[str]) -> list[str]:
    """The known word that a misspelt one most likely means, or nothing."""
    return difflib.get_close_matches(word, known, 1, 0.6)


def _node_values(rows: list[tuple[list[Value], Source]]) -> list[NodeValues]:
    """COOR or FORC records of their rows."""
    return [
        NodeValues(int(v[0]), int(v[1]), tuple(map(float, v[2:])), source=source)
        for v, source in rows
    ]


def decode(data: bytes) -> str:
    """Text of a deck's bytes: UTF-8, or Latin-1 where it is not."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_deck(path_or_text: str | Path) -> Deck | list[Deck]:
    r"""Read a deck.

    Parameters
    ----------
    path_or_text : str or Path
        A file's path, or the deck's text: a string with a line end in it is text.

    Returns
    -------
    Deck or list of Deck
        The problem, or a list where the file holds several.

    Raises
    ------
    DeckError
        If the deck has errors; it carries all of them.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> deck = read_deck("decks/appendix.inp")
    >>> deck.need(Impact).velocity
    115.0
    """
    text, name = load_text(path_or_text)
    reader = Reader(text)
    decks = [problem.deck for problem in reader.problems()]
    if reader.findings.errors:
        raise DeckError(list(reader.findings), name)
    sound = [deck for deck in decks if deck is not None]
    return sound[0] if len(sound) == 1 else sound


def load_text(path_or_text: str | Path) -> tuple[str, str]:
    """Text of a deck and the name to call it by: see :func:`read_deck`."""
    if isinstance(path_or_text, str) and ("\n" in path_or_text or not path_or_text.strip()):
        return path_or_text, "<text>"
    return decode(Path(path_or_text).read_bytes()), str(path_or_text)
