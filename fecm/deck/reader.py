"""Reader: turns the text of a deck into the models of its problems, and reports all errors."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from fecm._errors import OptionsError
from fecm._inputs import InputError, decoded
from fecm._machine import NotEnoughMemoryError, available_memory, format_bytes, require_memory
from fecm._typing import AnyFile
from fecm.deck.card import Card, CardSource, Control, capitals
from fecm.deck.findings import CardPlace, DeckError
from fecm.deck.macros import LoadTable, Macro, compile_program, with_outputs
from fecm.deck.mesh_cards import DOF_NAMES, NODES_AN_ELEMENT
from fecm.deck.model import END, MACROS, SEGMENTS, STOP, TITLE, Deck, Segment
from fecm.deck.segment import CardStream

LARGEST_FILE = 1_000_000_000  # no deck needs more bytes
# Memory of a deck, per byte of text and per line: upper bounds, measured at 10 MB.
BYTES_A_BYTE = 12
BYTES_A_LINE = 1100
PART = 1_000_000  # bytes that are read at once; Python allocates them before it reads
FIRST = 4096  # number of bytes that identify a binary file
HDF5 = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file
INLINE = "<text>"  # name of a deck from a text, or from a stream without a name


def load_text(path_or_text: str | Path | AnyFile) -> tuple[str, str]:
    """Return the text and the name of a deck; see :func:`fecm.read_deck`.

    Raises OptionsError if the argument is not a path, a text or an open file.
    """
    if isinstance(path_or_text, str) and ("\n" in path_or_text or not path_or_text.strip()):
        return path_or_text, INLINE
    if isinstance(path_or_text, str | Path):
        with Path(path_or_text).open("rb") as file:
            return _read_text(file, str(path_or_text)), str(path_or_text)
    if not hasattr(path_or_text, "read"):
        raise OptionsError(
            f"a deck is a path, a text, an open file or a Deck, not {path_or_text!r}"
        )
    name = getattr(path_or_text, "name", None)
    name = name if isinstance(name, str) else INLINE
    return _read_text(path_or_text, name), name


def _read_text(file: AnyFile, path: str) -> str:
    """Read the text of a deck from a file, or from a pipe, which may never end."""
    free = available_memory()
    most = LARGEST_FILE if free is None else min(LARGEST_FILE, free // BYTES_A_BYTE)
    head = _read_bytes(file, FIRST)
    if head.startswith(HDF5):
        raise InputError(f"{path} is an HDF5 file, not a deck; `fecm info {path}` shows a result")
    decoded(head, path)  # refuse a binary file before the rest is read
    parts, missing = [head], most + 1 - len(head)
    while missing > 0 and (part := _read_bytes(file, min(missing, PART))):
        parts.append(part)
        missing -= len(part)
    data = b"".join(parts)
    if len(data) > most:
        raise NotEnoughMemoryError(f"{path}: a deck of more than {format_bytes(most)} is not read")
    lines = data.count(b"\n") + data.count(b"\r") - data.count(b"\r\n")
    require_memory(BYTES_A_BYTE * len(data) + BYTES_A_LINE * lines, f"{path}: the deck")
    return decoded(data, path)


def _read_bytes(file: AnyFile, size: int) -> bytes:
    """Read from a file that is open as bytes or as text."""
    data = file.read(size)
    return data.encode("utf-8", "surrogateescape") if isinstance(data, str) else data


CONTROL_CARD = "(6I5): NUMNP, NUMEL, LAYER, NDM, NDF, NEN"
# Largest number of nodes or elements, and of layers. More are certainly a typo.
MOST = 1_000_000
MOST_LAYERS = 10_000
# Largest number of problems and of segments in a file, and of cards in a macro program.
MOST_PROBLEMS = 1000
MOST_SEGMENTS = 20_000
MOST_MACRO_CARDS = 100_000


class OtherFile(NamedTuple):
    """Input file of another program."""

    lines: str  # pattern of one or two of its first lines
    what: str
    hint: str  # for a deck
    export: str = ""  # how its mesh can be taken; empty if meshes are read from it, or it has none


FIRST_LINES = 20  # number of lines that identify the program of a file
TAKES_A_MESH = "`fecm new DECK --mesh FILE`, or fecm.Plate.from_mesh, takes a mesh from it"
SAVE_MSH = "open it in Gmsh and save the mesh as MSH 2.2 (`gmsh FILE -save -format msh22`)"


def _without_mesh(lines: str, what: str, export: str) -> OtherFile:
    return OtherFile(lines, what, f"{export}; `fecm new DECK --mesh FILE` takes that", export)


OTHER_FILES = (
    _without_mesh(
        r"/(prep7|batch|nopr|com|title|clear|solu|units|filname)\b|et,|[ne]block,|finish\b"
        r"|cdread,|wpstyle,|keyopt,|mp(data|temp)?,",
        "an input or an archive of Ansys",
        "write the model for the solver Nastran (bulk data), or convert its archive (CDWRITE) to "
        "VTK, as the Python package mapdl-archive does",
    ),
    _without_mesh(r"\$nod\b", "a mesh of Gmsh in the format MSH 1.0", SAVE_MSH),
    _without_mesh(r"-1[ \t]*\n\d{2,4}[ \t]*$", "a universal file (UNV)", SAVE_MSH),
    _without_mesh(
        r"(setfactory|point|line|rectangle|circle)\s*\(.*;",
        "a script of Gmsh",
        "let Gmsh make the mesh: `gmsh -2 -format msh22 FILE`",
    ),
    _without_mesh(
        r"iso-10303-21;|.*S {6}1[ \t]*$",
        "a CAD model (STEP or IGES)",
        "mesh the midsurface of the plate in Gmsh and save it as MSH 2.2",
    ),
    OtherFile(r"# vtk datafile|<vtkfile|<xdmf", "a mesh in the format VTK or XDMF", TAKES_A_MESH),
    OtherFile(
        r"\*keyword\b|\$#|\$(?!meshformat).*\n\*[a-z]",
        "an input file of LS-DYNA",
        "`fecm new --units mm-ms-kg` makes a deck in its units; `--mesh FILE` takes a mesh of "
        "Gmsh, Abaqus, Nastran or VTK",
    ),
    OtherFile(r"\$meshformat", "a mesh of Gmsh", TAKES_A_MESH),
    OtherFile(r"\*\*|\*[a-z]", "an input file of Abaqus or CalculiX", TAKES_A_MESH),
    OtherFile(
        r"sol +\d|cend\b|begin +bulk\b|nastran\b|id +\w|init +master|assign +\w|grid\*?[ ,\t]|\$",
        "an input file of Nastran",
        TAKES_A_MESH,
    ),
    OtherFile(
        r"<\?xml|<[!a-z]",
        "an XML file, such as eLamX writes",
        "`fecm new DECK --layup ... --ply ...` makes a deck from its layup and material",
    ),
    OtherFile(
        r"[{\[]\s*([\"{\[\]}]|$)",
        "a JSON file",
        "a deck has lines of cards: `fecm new DECK --layup ... --material ...` makes one",
    ),
    OtherFile(
        r"feap\b",
        "an input file of FEAP",
        "the first word is FECM here, and the third number of the next card counts the layers; "
        "COOR, ELEM and BOUN are read as FEAP reads them; MATE and the program, MACR to END, are "
        "those of this program",
    ),
)


@dataclass
class ParsedProblem:
    """Readable part of a problem."""

    deck: Deck | None  # the model; None if the control card is unreadable
    # Keywords of segments with unreadable cards. Checks that need these segments are skipped.
    unsound: set[str] = field(default_factory=set)


class Reader:
    """Reader of the cards of a file, problem by problem, with the options of :class:`CardStream`.

    Attributes
    ----------
    cards : CardStream
        The cards of the file.
    findings : Findings
        The findings so far.
    """

    def __init__(
        self,
        text: str,
        *,
        blanks_are_zeros: bool = False,
        keeps_values: bool = False,
        needs_program: bool = True,
    ) -> None:
        keywords = (*SEGMENTS, END)
        self.cards = CardStream(
            text, keywords, blanks_are_zeros=blanks_are_zeros, keeps_values=keeps_values
        )
        self.findings = self.cards.findings
        self._needs_program = needs_program  # whether a problem without one is an error
        self._segments = 0  # number of segments of the file
        self._counted = Counter[str]()  # total number of nodes and elements of the problems

    def problems(self) -> list[ParsedProblem]:
        """Read every problem of the file."""
        problems: list[ParsedProblem] = []
        stopped = False
        while (card := self.cards.take_filled()) is not None:
            if card.keyword == STOP:
                stopped = True
                break
            if card.keyword == TITLE:
                if len(problems) == MOST_PROBLEMS:
                    self._stop_at(f"The file contains more than {MOST_PROBLEMS} problems.", card)
                    break
                problems.append(self._read_problem(card))
            elif not (problems or self.findings) and (
                program := identify_program(self.cards.lines)
            ):
                message = f"This is {program.what}, not a deck."
                self.findings.add("E013", message, card.place, program.hint)
                self.findings.closed = True
                break
            else:
                self._report_stray(card, [TITLE, STOP])

        last = self.cards.last
        if not problems and not self.findings.errors:
            message = "The file contains no problem."
            self.findings.add("E001", message, None, "a problem starts with a FECM card")
        elif last is not None and not stopped and not self.findings.counts["E004"]:
            self.findings.add("W002", "The deck does not end with a STOP card.", last.place)
        return problems

    def _stop_at(self, message: str, card: Card) -> None:
        """Report a limit that a card exceeds, and stop reading."""
        self.findings.add("E012", message, card.place, "write several files")
        self.findings.closed = True

    def _read_problem(self, title: Card) -> ParsedProblem:
        first = self.cards.position - 1
        unsound: set[str] = set()
        self.cards.unsound = unsound
        control = self._read_control_card(title)
        segments = self._read_segments(title, control)
        macros = [] if self.cards.at_end else self._read_program(title)
        if control is None:
            return ParsedProblem(None, unsound)
        tables = self._read_tables(macros)
        deck = Deck(
            title=title.data[len(TITLE) :].strip(),
            control=control,
            segments=tuple(segments),
            macros=tuple(macros),
            tables=tuple(tables),
            text="\n".join([*self.cards.text_since(first), STOP, ""]),
            comments="\n".join(self.cards.comments_above(title)),
            source=CardSource(title),
        )
        return ParsedProblem(deck, unsound)

    def _read_control_card(self, title: Card) -> Control | None:
        if (card := self.cards.take_data()) is None:
            place = (self.cards.peek() or title).place
            self.findings.add("E003", "The control card is missing.", place, CONTROL_CARD)
            return None
        control = self.cards.record(card, Control)
        return control if control is not None and self._is_possible(control) else None

    def _is_possible(self, control: Control) -> bool:
        """Return whether all values of a control card are possible; report those that are not."""
        if control.nen == 0:
            named = zip(Control.fields, control.row(), strict=True)
            missing = [field.name for field, value in named if not value]
            verb = "is" if len(missing) == 1 else "are"
            message = f"{', '.join(missing)} {verb} missing on the control card."
            self.findings.add("E201", message, control.place(missing[0]), CONTROL_CARD)
            return False

        before = len(self.findings)
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

    def _read_segments(self, title: Card, control: Control | None) -> list[Segment]:
        cards = self.cards
        segments: list[Segment] = []
        if control is not None:
            cards.control = control
        while (card := cards.take_filled()) is not None:
            keyword = card.keyword
            if keyword == END:
                return segments
            if keyword in (MACROS, STOP, TITLE):
                cards.give_back()
                message = f"The mesh data are not ended by END before {keyword}."
                self.findings.add("E004", message, card.place)
                return segments
            kind = SEGMENTS.get(keyword)
            if kind is None or not card.is_keyword:
                self._report_stray(card, [*SEGMENTS, END])
                if not card.is_keyword:
                    cards.skip_data()
            elif control is None and not kind.is_worded:
                cards.skip_data()  # without counts the cards are ambiguous
            elif self._segments == MOST_SEGMENTS:
                self._stop_at(f"The file has more than {MOST_SEGMENTS} segments.", card)
            else:
                self._segments += 1
                if (segment := kind.read(card, cards)) is None:
                    cards.unsound.add(keyword)
                else:
                    segments.append(segment)
        self.findings.add("E004", "The mesh data are not ended by END.", title.place)
        return segments

    def _report_stray(self, card: Card, keywords: list[str]) -> None:
        """Report a card in place of a keyword, once for all cards up to the next keyword."""
        if card.is_keyword:
            near = _close_matches(card.keyword, keywords)
            self.cards.unsound.update(near)
            message = f"`{card.data.split()[0]}` is not a keyword here."
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(keywords)}"
            place = CardPlace(card.line, 1, min(4, len(card.data)), card.text)
            self.findings.add("E005", message, place, hint)
        elif card.data.lstrip()[:1].isalpha():
            word = card.data.split()[0]
            self.cards.unsound.update(_close_matches(word[:4].upper(), keywords))
            message = f"The keyword `{word}` does not start in column 1."
            self.findings.add("E005", message, card.place, "move it to the left")
        else:
            message = "A keyword is expected, not a card of data."
            why = "a segment has more cards than its counts say"
            hint = f"{why}, or a blank card ended it too early"
            self.findings.add("E006", message, card.place, hint)
        if keywords != [MACROS]:
            self.cards.skip_data()

    def _read_program(self, title: Card) -> list[Macro]:
        cards = self.cards
        while (card := cards.take_filled()) is not None:
            if card.keyword == MACROS:
                return self._read_macros(card)
            if card.keyword in (TITLE, STOP):
                cards.give_back()
                break
            if card.is_keyword and not _close_matches(card.keyword, [MACROS]):
                cards.give_back()
                message = "The MACR card before the macro program is missing."
                self.findings.add("E009", message, card.place)
                return self._read_macros(card)
            self._report_stray(card, [MACROS])
            if card.is_keyword:  # a misspelt MACR: the program follows nevertheless
                return self._read_macros(card)
        if self._needs_program:
            message = "The problem has no macro program."
            self.findings.add("E009", message, title.place, "it starts with a MACR card")
            cards.unsound.add(MACROS)
        return []

    def _read_macros(self, head: Card) -> list[Macro]:
        cards = self.cards
        macros: list[Macro] = []
        while (card := cards.take_filled()) is not None:
            if card.keyword == END:
                return macros
            if card.keyword in (STOP, TITLE):
                cards.give_back()
                break
            if len(macros) == MOST_MACRO_CARDS:
                self._stop_at(f"The macro program has more than {MOST_MACRO_CARDS} cards.", card)
                break
            if (macro := self._read_macro(card)) is None:
                cards.unsound.add(MACROS)
                continue
            if macro.word == END:  # not in column 1
                return macros
            if macro.word in (STOP, TITLE):
                cards.give_back()
                break
            macros.append(macro)
        self.findings.add("E004", "The macro program is not ended by END.", (card or head).place)
        cards.unsound.add(MACROS)
        return macros

    def _read_macro(self, card: Card) -> Macro | None:
        # In free format a number may stand in the place of the second word.
        is_short = card.data.partition(",")[2].lstrip()[:1] in tuple("0123456789.+-")
        row = self.cards.row(card, Macro.short_fields if is_short else Macro.fields)
        if row is None:
            return None
        (word, *option, value, second), source = row
        return Macro(
            word=capitals(str(word)),
            option=capitals("".join(map(str, option))),
            value=float(value),
            second=float(second),
            source=source,
        )

    def _read_tables(self, macros: list[Macro]) -> list[LoadTable]:
        """Read the load tables, one for each PROP with a number."""
        tables: list[LoadTable] = []
        for macro in macros:
            if macro.word != "PROP" or macro.value <= 0:
                continue
            card = self.cards.take_data()
            if card is None or card.is_blank:
                message = "The card of PROP's load table is missing after the macro program's END."
                hint = "(2I5,7F10.0): type, exponent, t_min, t_max, A1 to A5"
                self.findings.add("E011", message, macro.place("macro"), hint)
                break
            if (table := self.cards.record(card, LoadTable)) is None:
                self.cards.unsound.add(MACROS)
            else:
                tables.append(table)
        return tables


def identify_program(lines: Sequence[str]) -> OtherFile | None:
    """Identify the other program that a file belongs to by its first lines; None if unknown."""
    text = "\n".join(line.lstrip() for line in lines[:FIRST_LINES])
    if re.search(rf"^{TITLE}", text, re.MULTILINE):
        return None
    matches = (file for file in OTHER_FILES if re.search(f"^(?:{file.lines})", text, re.I | re.M))
    return next(matches, None)


def _close_matches(word: str, keywords: list[str]) -> list[str]:
    import difflib  # takes 1 ms; only a misspelt word needs it

    return difflib.get_close_matches(word, keywords, 1, 0.6)


def read_deck(path_or_text: str | Path | AnyFile) -> Deck | list[Deck]:
    r"""Read a deck.

    Parameters
    ----------
    path_or_text : str, Path or file
        Path of a file, text of a deck with at least one line end, or a file that is open as text or
        bytes, such as :class:`io.StringIO`.

    Returns
    -------
    Deck or list of Deck
        The problem, or a list of the problems if the file has several.

    Raises
    ------
    DeckError
        If the deck has errors. The exception has all of them.
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


def with_program(
    deck: Deck,
    macros: str | Sequence[Macro] | None = None,
    *,
    every: int | None = None,
    plies: int | bool | tuple[int, int] | None = None,
    failure: int | bool | None = None,
) -> Deck:
    """Return a deck with another macro program; see :meth:`fecm.Deck.with_program`."""
    if isinstance(macros, str):
        deck = with_cards(deck, macros)
    elif macros is not None:
        deck = replace(deck, macros=tuple(macros))
    program = with_outputs(deck.macros, every=every, plies=plies, failure=failure)
    return replace(deck, macros=program, text="")


def with_cards(deck: Deck, cards: str) -> Deck:
    """Return the deck with another macro program: the cards between MACR and END.

    END and the load tables of PROP may follow. Without END the load tables of the deck stay. Raises
    DeckError if the cards are not a macro program.
    """
    lines = [TITLE, deck.control.to_card(), END, MACROS, *cards.rstrip("\n").split("\n")]
    if END not in map(str.strip, lines[4:]):
        lines += [END, *(table.to_card() for table in deck.tables)]
    reader = Reader("\n".join([*lines, STOP, ""]))
    decks = [problem.deck for problem in reader.problems() if problem.deck is not None]
    for parsed in decks:
        compile_program(parsed.macros, reader.findings)
    if errors := reader.findings.errors:
        raise DeckError(errors, "<macros>")
    return replace(deck, macros=decks[0].macros, tables=decks[0].tables)
