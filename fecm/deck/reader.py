"""The card reader: a deck's text in, its models and all errors out, not just the first."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

from fecm._memory import NotEnoughMemoryError, available, format_bytes, require
from fecm.deck import model, records
from fecm.deck.card import Card, Fields, Source, Value, capitals, read_values
from fecm.deck.findings import DeckError, Findings, Place
from fecm.deck.model import STOP, TITLE, Deck, Segment

MACROS = "MACR"
END = "END"
CONTROL_CARD = "(6I5): NUMNP, NUMEL, LAYER, NDM, NDF, NEN"
# Largest number of nodes or elements, and of layers; anything beyond is certainly a typo.
MOST = 1_000_000
MOST_LAYERS = 10_000
# Largest number of problems and segments of a file, and of cards of a macro program.
MOST_PROBLEMS = 1000
MOST_SEGMENTS = 20_000
MOST_MACRO_CARDS = 100_000
LARGEST_FILE = 1_000_000_000  # no deck needs more bytes
# Largest memory of a deck per byte of text and per line, measured at 10 MB.
BYTES_A_BYTE, BYTES_A_LINE = 12, 1100
# Line ends, see str.splitlines.  The last three are the last bytes of longer characters.
LINE_ENDS = b"\n\r\x0b\x0c\x1c\x1d\x1e\x85\xa8\xa9"
FIRST = 4096  # number of bytes that identify a binary file
STDIN = "<stdin>"  # name of the deck on standard input
HDF5 = b"\x89HDF\r\n\x1a\n"
TAKES_A_MESH = "`fecm new DECK --mesh FILE`, or fecm.Plate.from_mesh, takes a mesh from it"
# First lines of other programs' files, and hints.
OTHERS = {
    r"\*\*|\*[a-z]": ("an input file of Abaqus or CalculiX", TAKES_A_MESH),
    r"\$MeshFormat": ("a mesh of Gmsh", TAKES_A_MESH),
    r"feap\b": (
        "an input file of FEAP",
        "the first word is FECM here; COOR, ELEM and BOUN are read as FEAP reads them, MATE and "
        "the program of macros are those of this program",
    ),
}
# Keywords whose cards begin with a letter; they can be read without a control card.
WORDED = ("UNIT", "PATC", "PAGE")
_R = TypeVar("_R", bound=records.Record)


@dataclass
class ParsedProblem:
    """The readable part of a problem."""

    deck: Deck | None  # the model; None where the control card could not be read
    # Keywords of segments with unreadable cards, from which no conclusion can be drawn.
    unsound: set[str] = field(default_factory=set)


class Stream:
    """Cards in the order of the file, without the lines that are comments.

    With `blanks_are_zeros` blanks inside numbers are read as the zeros that they were on the
    report's machine; `keeps_values` keeps the fields and values of every card in `read`.
    """

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        self.lines = text.removeprefix("\ufeff").splitlines()
        numbered = enumerate(self.lines, start=1)
        self._cards = [(n, line) for n, line in numbered if not line.startswith("!")]
        self._blanks_are_zeros = blanks_are_zeros
        self._keeps_values = keeps_values
        self.position = 0  # number of cards taken
        self.findings = Findings()
        self.read: dict[int, tuple[Fields, list[Value]]] = {}  # by line number

    @property
    def at_end(self) -> bool:
        """Whether every card was taken."""
        return self.position == len(self._cards)

    def take(self) -> Card | None:
        """The next card; None at the end of the file or when findings are closed."""
        if self.at_end or self.findings.closed:
            return None
        self.position += 1
        return Card(*self._cards[self.position - 1])

    def take_filled(self) -> Card | None:
        """The next card that is not blank, or None as in :meth:`take`."""
        while not self.at_end and not self._cards[self.position][1].strip():
            self.position += 1
        while (card := self.take()) is not None and card.is_blank:
            pass
        return card

    def give_back(self) -> None:
        """Return the last card to the stream."""
        self.position -= 1

    def peek(self) -> Card | None:
        """The next card as :meth:`take` gives it, which stays in the stream."""
        if (card := self.take()) is not None:
            self.give_back()
        return card

    def take_data(self) -> Card | None:
        """The next card; None where that is a keyword card, which stays, or as in :meth:`take`."""
        card = self.take()
        if card is None or not card.is_keyword:
            return card
        self.give_back()
        return None

    def skip_data(self) -> None:
        """Skip cards up to the next keyword."""
        while self.take_data() is not None:
            pass

    def row(self, card: Card, fields: Fields) -> tuple[list[Value], Source] | None:
        """Values of a card and their source; None after an error, which is reported."""
        values = read_values(card, fields, self.findings, blanks_are_zeros=self._blanks_are_zeros)
        if values is None:
            return None
        if self._keeps_values:
            self.read[card.line] = (fields, values)
        return values, Source(card, fields)

    def record(self, card: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Record of a card; None after an error, which is reported."""
        row = self.row(card, fields or kind.fields)
        return None if row is None else kind.from_row(*row)


class Reader(Stream):
    """Reads the cards of a file, problem by problem; the options are those of :class:`Stream`."""

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        super().__init__(text, blanks_are_zeros=blanks_are_zeros, keeps_values=keeps_values)
        self._control: records.Control  # of the problem that is read
        self._unsound: set[str] = set()  # keywords of its segments with unreadable cards
        self._segments = 0
        self._counted = Counter[str]()

    def problems(self) -> list[ParsedProblem]:
        """Read every problem of the file."""
        problems: list[ParsedProblem] = []
        stopped = False
        while (card := self.take_filled()) is not None:
            others = (kind for head, kind in OTHERS.items() if re.match(head, card.data, re.I))
            if not (problems or self.findings) and (other := next(others, None)):
                what, hint = other
                self.findings.add("E013", f"This is {what}, not a deck.", card.place, hint)
                self.findings.closed = True
                break
            if card.keyword == STOP:
                stopped = True
                break
            if card.keyword == TITLE:
                if len(problems) == MOST_PROBLEMS:
                    self._end(f"The file contains more than {MOST_PROBLEMS} problems.", card)
                    break
                problems.append(self._problem(card))
            else:
                self._stray(card, [TITLE, STOP])
        if not problems and not self.findings.errors:
            message = "The file contains no problem."
            self.findings.add("E001", message, None, "a problem begins with a FECM card")
        elif self._cards and not stopped and not self.findings.counts["E004"]:
            place = Card(*self._cards[-1]).place
            self.findings.add("W002", "The deck does not end with a STOP card.", place)
        return problems

    def _end(self, message: str, card: Card) -> None:
        """Report that a limit is exceeded, and stop reading."""
        self.findings.add("E012", message, card.place, "write several files")
        self.findings.closed = True

    def _problem(self, title: Card) -> ParsedProblem:
        first = self.position - 1
        self._unsound = set()
        control = self._control_card(title)
        segments = self._mesh_and_data(title, control)
        macros = [] if self.at_end else self._program(title)
        if control is None:
            return ParsedProblem(None, self._unsound)
        parts = tuple(segments), tuple(macros), tuple(self._tables(macros))
        lines = [line.rstrip() for _, line in self._cards[first : self.position]]
        text = "\n".join([*lines, STOP, ""])
        deck = Deck(title.data[4:].strip(), control, *parts, text, source=Source(title, ()))
        return ParsedProblem(deck, self._unsound)

    def _control_card(self, title: Card) -> records.Control | None:
        if (card := self.take_data()) is None:
            place = (self.peek() or title).place
            self.findings.add("E003", "The control card is missing.", place, CONTROL_CARD)
            return None
        control, before = self.record(card, records.Control), len(self.findings)
        if control is None:
            return None
        if control.nen == 0:
            named = zip(records.Control.fields, control.row(), strict=True)
            missing = [field.name for field, value in named if not value]
            verb = "is" if len(missing) == 1 else "are"
            message = f"{', '.join(missing)} {verb} missing on the control card."
            self.findings.add("E201", message, control.place(missing[0]), CONTROL_CARD)
            return None
        low, high = records.NODES_AN_ELEMENT
        for name, value, least, most, hint in (
            ("NUMNP", control.numnp, 1, MOST, ""),
            ("NUMEL", control.numel, 1, MOST, ""),
            ("LAYER", control.layers, 1, MOST_LAYERS, ""),
            ("NDM", control.ndm, 2, 2, "the plate lies in 2 dimensions"),
            ("NDF", control.ndf, 5, 5, f"a node has the dofs {', '.join(records.DOF_NAMES)}"),
            ("NEN", control.nen, low, high, "nodes per element"),
        ):
            if not least <= value <= most:
                must = f"{least}" if least == most else f"{least} to {most}"
                message = f"{name} is {value}; it must be {must}."
                self.findings.add("E201", message, control.place(name), hint)
        if len(self.findings) > before:
            return None
        self._counted.update(NUMNP=control.numnp, NUMEL=control.numel)
        for name, count in self._counted.items():
            if count > MOST:
                where = "The file's problems have together"
                message = f"{where} {name} {count}; at most {MOST} is allowed."
                hint = "put each problem in a separate file"
                self.findings.add("E201", message, control.place(name), hint)
        return control if len(self.findings) == before else None

    def _mesh_and_data(self, title: Card, control: records.Control | None) -> list[Segment]:
        segments: list[Segment] = []
        if control is not None:
            self._control = control
        while (card := self.take_filled()) is not None:
            keyword = card.keyword
            if keyword == END:
                return segments
            if keyword in (MACROS, STOP, TITLE):
                self.give_back()
                message = f"The mesh data are not ended by END before {keyword}."
                self.findings.add("E004", message, card.place)
                return segments
            if keyword not in READERS or not card.is_keyword:
                self._stray(card, [*READERS, END])
                if not card.is_keyword:
                    self.skip_data()
            elif control is None and keyword not in WORDED:
                self.skip_data()  # without counts the cards are ambiguous
            elif self._segments == MOST_SEGMENTS:
                self._end(f"The file has more than {MOST_SEGMENTS} segments.", card)
            else:
                self._segments += 1
                if (segment := READERS[keyword](self, card)) is None:
                    self._unsound.add(keyword)
                else:
                    segments.append(segment)
        self.findings.add("E004", "The mesh data are not ended by END.", title.place)
        return segments

    def _stray(self, card: Card, known: list[str]) -> None:
        """Report a card in place of a keyword, once for all cards up to the next keyword."""
        if card.is_keyword:
            near = _close(card.keyword, known)
            self._unsound.update(near)
            message = f"`{card.data.split()[0]}` is not a keyword here."
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            place = Place(card.line, 1, min(4, len(card.data)), card.text)
            self.findings.add("E005", message, place, hint)
        elif card.data.lstrip()[:1].isalpha():
            self._unsound.update(_close(card.data.split()[0][:4].upper(), known))
            message = f"The keyword `{card.data.split()[0]}` does not begin in column 1."
            self.findings.add("E005", message, card.place, "move it to the left")
        else:
            message = "A keyword is expected, not a card of data."
            why = "a segment has more cards than its counts say"
            hint = f"{why}, or a blank card ended it too early"
            self.findings.add("E006", message, card.place, hint)
        if known != [MACROS]:
            self.skip_data()

    def _program(self, title: Card) -> list[records.Macro]:
        while (card := self.take_filled()) is not None:
            if card.keyword == MACROS:
                return self._macros(card)
            if card.keyword in (TITLE, STOP):
                self.give_back()
                break
            if card.is_keyword and not _close(card.keyword, [MACROS]):
                self.give_back()
                message = "The MACR card before the macro program is missing."
                self.findings.add("E009", message, card.place)
                return self._macros(card)
            self._stray(card, [MACROS])
            if card.is_keyword:  # misspelt MACR: the program follows nevertheless
                return self._macros(card)
        message = "The problem has no macro program."
        self.findings.add("E009", message, title.place, "it begins with a MACR card")
        self._unsound.add(MACROS)
        return []

    def _macros(self, head: Card) -> list[records.Macro]:
        macros: list[records.Macro] = []
        while (card := self.take_filled()) is not None:
            if card.keyword == END:
                return macros
            if card.keyword in (STOP, TITLE):
                self.give_back()
                break
            if len(macros) == MOST_MACRO_CARDS:
                self._end(f"The macro program has more than {MOST_MACRO_CARDS} cards.", card)
                break
            # In free format a number may stand where the second word belongs.
            short = card.data.partition(",")[2].lstrip()[:1] in tuple("0123456789.+-")
            row = self.row(card, records.Macro.short_fields if short else records.Macro.fields)
            if row is None:
                self._unsound.add(MACROS)
            else:
                (word, *option, value, second), source = row
                name, text = (capitals(str(part)) for part in (word, "".join(map(str, option))))
                if name == END:  # not in column 1
                    return macros
                if name in (STOP, TITLE):
                    self.give_back()
                    break
                macros.append(records.Macro(name, text, float(value), float(second), source=source))
        self.findings.add("E004", "The macro program is not ended by END.", (card or head).place)
        self._unsound.add(MACROS)
        return macros

    def _tables(self, macros: list[records.Macro]) -> list[records.LoadTable]:
        """Read the cards of proportional loads, one for each PROP with a number."""
        tables: list[records.LoadTable] = []
        for macro in macros:
            if macro.word != "PROP" or macro.value <= 0:
                continue
            card = self.take_data()
            if card is None or card.is_blank:
                message = "The card of PROP's load table is missing after the macro program's END."
                hint = "(2I5,7F10.0): type, exponent, t_min, t_max, A1 to A5"
                self.findings.add("E011", message, macro.place("macro"), hint)
                break
            if (table := self.record(card, records.LoadTable)) is None:
                self._unsound.add(MACROS)
            else:
                tables.append(table)
        return tables

    def _records(self, head: Card, kind: type[_R], fields: Fields) -> tuple[_R, ...]:
        """Records of numbered cards up to a blank card, or up to the last element's card."""
        found: list[_R] = []
        while (card := self.take_data()) is not None and not card.is_blank:
            if (record := self.record(card, kind, fields)) is None:
                self._unsound.add(head.keyword)
            else:
                found.append(record)
        last = found[-1] if found else None
        complete = isinstance(last, records.ElementNodes) and last.element >= self._control.numel
        if card is None and not complete:
            following = self.peek()
            message = f"The {head.keyword} cards are not ended by a blank card."
            hint = f"put a blank card {'before this one' if following else 'at the end'}"
            self.findings.add("E007", message, (following or head).place, hint)
        return tuple(found)

    def _numbered(self, head: Card, kind: type[model.NumberedSegment[Any]]) -> Segment:
        cards = self._records(head, kind.record, kind.card_fields(self._control))
        return kind(cards, source=Source(head, ()))

    def _single(self, head: Card, kind: type[_R], fields: Fields | None = None) -> _R | None:
        """Record of a mandatory card; None if it is missing or unreadable."""
        card = self.take_data()
        if card is None and head.keyword not in self._unsound:
            message = f"A card of {head.keyword} is missing."
            hint = f"its fields are {', '.join(field.name for field in fields or kind.fields)}"
            self.findings.add("E008", message, (self.peek() or head).place, hint)
        record = None if card is None else self.record(card, kind, fields)
        if record is None:
            self._unsound.add(head.keyword)
        return record

    def _patch(self, head: Card) -> Segment | None:
        # The card begins with a word, but not with that of another segment.
        card = self.peek()
        if card is not None and card.keyword not in (*READERS, END):
            self.take()
            patch = self.record(card, model.Patch)
            return patch and replace(patch, shape=patch.shape.upper())
        hint = "a blank card takes a disc of 0.327 times the thickness at the node of ROD"
        self.findings.add("E008", "A card of PATC is missing.", (card or head).place, hint)
        return None

    def _allowables(self, head: Card) -> Segment | None:
        strengths = self._single(head, model.Allowables)
        card = self.take_data()
        row = None if card is None else self.row(card, model.Allowables.constants)
        if card is None or row is None or strengths is None:
            return strengths if card is None else None
        return model.Allowables.from_row([*strengths.row()[:7], *row[0]], strengths.source)

    def _shear(self, head: Card) -> Segment | None:
        words = head.data.replace(",", " ").upper().split()[1:]
        for word in words:
            if word not in model.Shear.WORDS:
                hint = "SHEA takes MITC (assumed strains) and EQUI (stiffness from equilibrium)"
                self.findings.add("E446", f"`{word}` after SHEA is unknown.", head.place, hint)
        assumed, equilibrium = (word in words for word in model.Shear.WORDS)
        following = self.peek()
        if words and (following is None or following.is_keyword or following.is_blank):
            return model.Shear(1.0, assumed, equilibrium, source=Source(head, ()))
        found = self._single(head, model.Shear)
        return found and replace(found, assumed=assumed, equilibrium=equilibrium)

    def _indentation(self, head: Card) -> Segment | None:
        word = " ".join(head.data.replace(",", " ").split()[1:]).upper()
        if word and word != model.Indentation.ACR:
            message = f"`{word}` after EXPE is not read: the law is that of equation 3-8."
            self.findings.add("W416", message, head.place, "EXPE ACR takes the law of equation 3-7")
            word = ""
        law = self._single(head, model.Indentation, model.Indentation.acr_fields if word else None)
        return law and replace(law, word=word)

    def _projectile(self, head: Card) -> Segment | None:
        projectile = self._single(head, model.Projectile)
        if projectile is None or not projectile.elements:
            return projectile
        diameters = self._records(head, records.RodDiameter, records.RodDiameter.fields)
        return replace(projectile, diameters=diameters)

    def _units(self, head: Card) -> Segment | None:
        card = self.take()
        if card is not None and len(names := card.data.replace(",", " ").split()) == 3:
            return model.Units(*names, source=Source(card, ()))
        if card is not None and card.keyword in (*READERS, END):
            self.give_back()
        message = "UNIT takes one card with three names: the units of length, force and time."
        place, hint = (card or head).place, "for example: in lbf s"
        if len(names := head.data.replace(",", " ").split()[1:]) == 3:
            place, hint = head.place, f"put the names on the card after UNIT: {' '.join(names)}"
        self.findings.add("E010", message, place, hint)
        return None

    def _page(self, head: Card) -> Segment:
        card = self.take()
        return model.Page("" if card is None else card.data[:4].rstrip(), source=Source(head, ()))

    def _material(self, head: Card) -> Segment | None:
        integration, ply = self._single(head, records.Integration), self._single(head, records.Ply)
        layers = self._layers(head) if integration or ply else None
        if integration is None or ply is None or layers is None:
            return None
        return model.Material(integration, ply, layers, source=Source(head, ()))

    def _layers(self, head: Card) -> tuple[records.Layer, ...] | None:
        """Layer cards, as many as the control card says; None if one is missing or unreadable."""
        count = self._control.layers
        layers: list[records.Layer] = []
        for number in range(count):
            card = self.take_data()
            if card is None or card.is_blank:
                message = f"MATE has {number} layer cards where the control card says {count}."
                self.findings.add("E202", message, (card or self.peek() or head).place)
                return None
            if (layer := self.record(card, records.Layer)) is not None:
                layers.append(layer)
        return tuple(layers) if len(layers) == count else None


# Readers of the segments, by keyword.
READERS: dict[str, Callable[[Reader, Card], Segment | None]] = {
    "COOR": lambda reader, head: reader._numbered(head, model.Coordinates),
    "ELEM": lambda reader, head: reader._numbered(head, model.Elements),
    "BOUN": lambda reader, head: reader._numbered(head, model.Boundary),
    "MATE": Reader._material,
    "ROD": lambda reader, head: reader._single(head, model.Impact),
    "EXPE": Reader._indentation,
    "FORC": lambda reader, head: reader._numbered(head, model.Forces),
    "PROJ": Reader._projectile,
    "SHEA": Reader._shear,
    "PATC": Reader._patch,
    "ALLO": Reader._allowables,
    "DELA": lambda reader, head: reader._single(head, model.Delamination),
    "DAMP": lambda reader, head: reader._single(head, model.Damping),
    "GAGE": lambda reader, head: reader._numbered(head, model.Gages),
    "UNIT": Reader._units,
    "PRIN": lambda _, head: model.PrintOption(True, source=Source(head, ())),
    "NOPR": lambda _, head: model.PrintOption(False, source=Source(head, ())),
    "PAGE": Reader._page,
}


def _close(word: str, known: list[str]) -> list[str]:
    import difflib

    return difflib.get_close_matches(word, known, 1, 0.6)


def load_text(path_or_text: str | Path | BinaryIO) -> tuple[str, str]:
    """Text and name of a deck, see :func:`read_deck`; of an open file it is standard input."""
    if isinstance(path_or_text, str) and ("\n" in path_or_text or not path_or_text.strip()):
        return path_or_text, "<text>"
    if not isinstance(path_or_text, str | Path):
        return _text(path_or_text, STDIN), STDIN
    with Path(path_or_text).open("rb") as file:
        return _text(file, str(path_or_text)), str(path_or_text)


def _text(file: BinaryIO, path: str) -> str:
    """Text of a deck, which may be an endless pipe: UTF-8, or Latin-1 where it is not."""
    free = available()
    most = LARGEST_FILE if free is None else min(LARGEST_FILE, free // BYTES_A_BYTE)
    begin = file.read(FIRST)
    if begin.startswith(HDF5):
        raise OSError(f"{path} is an HDF5 file, not a deck; `fecm info {path}` shows a result")
    if b"\0" in begin:
        raise OSError(f"{path} is a binary file or UTF-16 text, not a deck in UTF-8 or Latin-1")
    data = begin + file.read(max(0, most + 1 - len(begin)))
    if len(data) > most:
        raise NotEnoughMemoryError(f"{path}: a deck of more than {format_bytes(most)} is not read")
    lines = len(data) - len(data.translate(None, LINE_ENDS)) - data.count(b"\r\n")
    require(BYTES_A_BYTE * len(data) + BYTES_A_LINE * lines, f"{path}: the deck")
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
        The problem, or a list if the file contains several.

    Raises
    ------
    DeckError
        If the deck has errors; it carries all of them.
    OSError
        If the file can't be read.

    Examples
    --------
    >>> from fecm.deck.model import Impact
    >>> deck = read_deck("decks/appendix.inp")
    >>> deck.require(Impact).velocity
    115.0
    """
    text, name = load_text(path_or_text)
    reader = Reader(text)
    decks = [problem.deck for problem in reader.problems() if problem.deck is not None]
    if reader.findings.errors:
        raise DeckError(list(reader.findings), name)
    return decks[0] if len(decks) == 1 else decks
