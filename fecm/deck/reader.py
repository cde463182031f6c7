"""The card reader: a deck's text in, models and findings out.

It continues after an error, so that one run shows all errors of a deck, and draws no conclusions
from unreadable cards.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from fecm._memory import NotEnoughMemoryError, available, format_bytes, require
from fecm.deck.card import Card, Source
from fecm.deck.findings import DeckError, Findings, Place
from fecm.deck.model import STOP, TITLE, Deck, Segment
from fecm.deck.records import DOF_NAMES, NODES_AN_ELEMENT, Control, LoadTable, Macro
from fecm.deck.segments import READERS, SegmentReader, Stream

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

# No deck needs more bytes.
LARGEST_FILE = 1_000_000_000
# Largest memory of a deck per byte of text and per line, measured at 10 MB.
BYTES_A_BYTE, BYTES_A_LINE = 12, 1100
# Line ends, see str.splitlines.  The last three are the last bytes of longer characters.
LINE_ENDS = b"\n\r\x0b\x0c\x1c\x1d\x1e\x85\xa8\xa9"
# Number of bytes that identify a binary file.
FIRST = 4096
# Name of the deck on standard input.
STDIN = "<stdin>"
HDF5 = b"\x89HDF\r\n\x1a\n"
# First lines of other programs' files.
OTHERS = {
    r"\*\*|\*[a-z]": "an input file of Abaqus or CalculiX",
    r"\$MeshFormat": "a mesh of Gmsh",
}


@dataclass
class ParsedProblem:
    """The readable part of a problem."""

    deck: Deck | None  # the model; None where the control card could not be read
    # Keywords of segments with unreadable cards, from which no conclusion can be drawn.
    unsound: set[str] = field(default_factory=set)


class Reader:
    """Reads the cards of a file, problem by problem; the options are those of :class:`Stream`."""

    def __init__(
        self, text: str, *, blanks_are_zeros: bool = False, keeps_values: bool = False
    ) -> None:
        self.stream = Stream(text, blanks_are_zeros=blanks_are_zeros, keeps_values=keeps_values)
        self._unsound: set[str] = set()
        self._segments = 0
        self._counted = Counter[str]()

    @property
    def findings(self) -> Findings:
        """Findings about the file."""
        return self.stream.findings

    def problems(self) -> list[ParsedProblem]:
        """Read every problem of the file."""
        problems: list[ParsedProblem] = []
        stopped = False
        while (card := self.stream.take_filled()) is not None:
            first = not (problems or stopped or self.findings)
            if first and (other := _program_of(card.data)):
                message = f"This is {other}, not a deck."
                hint = "`fecm new DECK --mesh FILE`, or fecm.Plate.from_mesh, takes a mesh from it"
                self.findings.add("E013", message, card.place, hint)
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
        last = self.stream.last
        if not problems and not self.findings.errors:
            message = "The file contains no problem."
            self.findings.add("E001", message, None, "a problem begins with a FECM card")
        elif last is not None and not stopped and not self.findings.counts["E004"]:
            self.findings.add("W002", "The deck does not end with a STOP card.", last.place)
        return problems

    def _end(self, message: str, card: Card) -> None:
        """Report that a limit is exceeded, and stop reading."""
        self.findings.add("E012", message, card.place, "write several files")
        self.findings.closed = True

    def _problem(self, title: Card) -> ParsedProblem:
        """Read one problem, from its FECM card on."""
        first = self.stream.position - 1
        self._unsound = set()
        control = self._control(title)
        segments = self._mesh_and_data(title, control)
        macros = [] if self.stream.at_end else self._program(title)
        if control is None:
            return ParsedProblem(None, self._unsound)
        parts = tuple(segments), tuple(macros), tuple(self._tables(macros))
        text, source = f"{self.stream.text_since(first)}\n{STOP}\n", Source(title, ())
        deck = Deck(title.data[4:].strip(), control, *parts, text, source=source)
        return ParsedProblem(deck, self._unsound)

    # Control card --------------------------------------------------------------------------------

    def _control(self, title: Card) -> Control | None:
        """Read the control card; None if it is missing or invalid."""
        card = self.stream.take_data()
        if card is None:
            place = (self.stream.peek() or title).place
            self.findings.add("E003", "The control card is missing.", place, CONTROL_CARD)
            return None
        control = self.stream.record(card, Control)
        return control if control and self._is_sound(control) else None

    def _is_sound(self, control: Control) -> bool:
        """Whether counts and dimensions are valid; report those that are not."""
        before = len(self.findings)
        if control.nen == 0:
            named = zip(Control.fields, control.row(), strict=True)
            missing = [field.name for field, value in named if not value]
            verb = "is" if len(missing) == 1 else "are"
            message = f"{', '.join(missing)} {verb} missing on the control card."
            self.findings.add("E201", message, control.place(missing[0]), CONTROL_CARD)
            return False
        low, high = NODES_AN_ELEMENT
        for name, value, least, most, hint in (
            ("NUMNP", control.numnp, 1, MOST, ""),
            ("NUMEL", control.numel, 1, MOST, ""),
            ("LAYER", control.layers, 1, MOST_LAYERS, ""),
            ("NDM", control.ndm, 2, 2, "the plate lies in 2 dimensions"),
            ("NDF", control.ndf, 5, 5, f"a node has the dofs {', '.join(DOF_NAMES)}"),
            ("NEN", control.nen, low, high, "nodes per element"),
        ):
            if not least <= value <= most:
                must = f"{least}" if least == most else f"{least} to {most}"
                message = f"{name} is {value}; it must be {must}."
                self.findings.add("E201", message, control.place(name), hint)
        if len(self.findings) > before:
            return False
        self._counted.update(NUMNP=control.numnp, NUMEL=control.numel)
        for name, count in self._counted.items():
            if count > MOST:
                where = "The file's problems have together"
                message = f"{where} {name} {count}; at most {MOST} is allowed."
                hint = "put each problem in a separate file"
                self.findings.add("E201", message, control.place(name), hint)
        return len(self.findings) == before

    # Mesh and data -------------------------------------------------------------------------------

    def _mesh_and_data(self, title: Card, control: Control | None) -> list[Segment]:
        """Read the segments up to their END."""
        segments: list[Segment] = []
        reader = None if control is None else SegmentReader(self.stream, control)
        if reader is not None:
            self._unsound = reader.unsound
        while (card := self.stream.take_filled()) is not None:
            keyword = card.keyword
            if keyword == END:
                return segments
            if keyword in (MACROS, STOP, TITLE):
                self.stream.give_back()
                message = f"The mesh data are not ended by END before {keyword}."
                self.findings.add("E004", message, card.place)
                return segments
            if keyword not in READERS or not card.is_keyword:
                self._stray(card, [*READERS, END])
                if not card.is_keyword:
                    self.stream.skip_data()
            elif reader is None:
                self.stream.skip_data()  # without counts the cards are ambiguous
            elif self._segments == MOST_SEGMENTS:
                self._end(f"The file has more than {MOST_SEGMENTS} segments.", card)
            else:
                self._segments += 1
                if (segment := reader.read(card)) is not None:
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
            hint = (
                "a segment has more cards than its counts say, or a blank card ended it too early"
            )
            self.findings.add("E006", message, card.place, hint)
        if known != [MACROS]:
            self.stream.skip_data()

    # Macro program -------------------------------------------------------------------------------

    def _program(self, title: Card) -> list[Macro]:
        """Read the macro program from its MACR card to its END."""
        while (card := self.stream.take_filled()) is not None:
            if card.keyword == MACROS:
                return self._macros(card)
            if card.keyword in (TITLE, STOP):
                self.stream.give_back()
                break
            if card.is_keyword and not _close(card.keyword, [MACROS]):
                self.stream.give_back()
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

    def _macros(self, head: Card) -> list[Macro]:
        macros: list[Macro] = []
        card: Card | None = head
        while (card := self.stream.take_filled()) is not None:
            if card.keyword == END:
                return macros
            if card.keyword in (STOP, TITLE):
                self.stream.give_back()
                break
            if len(macros) == MOST_MACRO_CARDS:
                self._end(f"The macro program has more than {MOST_MACRO_CARDS} cards.", card)
                break
            short = _leaves_out_second_word(card)
            row = self.stream.row(card, Macro.short_fields if short else Macro.fields)
            if row is None:
                self._unsound.add(MACROS)
            else:
                (word, *option, value, second), source = row
                name, text = str(word).strip().upper(), "".join(map(str, option)).strip().upper()
                macros.append(Macro(name, text, float(value), float(second), source=source))
        self.findings.add("E004", "The macro program is not ended by END.", (card or head).place)
        self._unsound.add(MACROS)
        return macros

    def _tables(self, macros: list[Macro]) -> list[LoadTable]:
        """Read the cards of proportional loads, one for each PROP with a number."""
        tables: list[LoadTable] = []
        for macro in macros:
            if macro.word != "PROP" or macro.value <= 0:
                continue
            card = self.stream.take_data()
            if card is None or card.is_blank:
                message = "The card of PROP's load table is missing after the macro program's END."
                hint = "(2I5,7F10.0): type, exponent, t_min, t_max, A1 to A5"
                self.findings.add("E011", message, macro.place("macro"), hint)
                break
            if (table := self.stream.record(card, LoadTable)) is None:
                self._unsound.add(MACROS)
            else:
                tables.append(table)
        return tables


def _close(word: str, known: list[str]) -> list[str]:
    """The closest known word, if any."""
    import difflib

    return difflib.get_close_matches(word, known, 1, 0.6)


def _leaves_out_second_word(card: Card) -> bool:
    """Whether a macro card in free format has a number where the second word belongs."""
    _, comma, rest = card.data.partition(",")
    text = rest.partition(",")[0].strip()
    return bool(comma) and text[:1] in tuple("0123456789.+-")


def decode(data: bytes) -> str:
    """Text of a deck's bytes: UTF-8, or Latin-1 where it is not."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _program_of(line: str) -> str:
    """The kind of file that begins with a line, if it is another program's."""
    return next((kind for head, kind in OTHERS.items() if re.match(head, line, re.I)), "")


def load_text(path_or_text: str | Path | BinaryIO) -> tuple[str, str]:
    """Text and name of a deck, see :func:`read_deck`; of an open file it is standard input."""
    if isinstance(path_or_text, str) and ("\n" in path_or_text or not path_or_text.strip()):
        return path_or_text, "<text>"
    if not isinstance(path_or_text, str | Path):
        return decode(_bytes(path_or_text, STDIN)), STDIN
    with Path(path_or_text).open("rb") as file:
        return decode(_bytes(file, str(path_or_text))), str(path_or_text)


def _bytes(file: BinaryIO, path: str) -> bytes:
    """All bytes of a deck, which may be an endless pipe.

    Raises NotEnoughMemoryError if its cards need more memory than is free.  Raises OSError if it
    can't be read or is not text.
    """
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
    return data


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
