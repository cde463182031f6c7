"""Texts of the codes for faults in cards: frame of the file, numbers, counts, macros.

The reader, the cards and the grammar of the macros report these codes. Only modules that show the
texts import this module.
"""

from __future__ import annotations

from fecm.deck.rules import Subject, declare

# Frame of the file.
declare(
    "E000",
    Subject.FRAME,
    "There are 1000 errors or more.",
    cause="The rest of the file is not checked.",
    remedy="Correct the first ones.",
)
declare(
    "W000",
    Subject.FRAME,
    "There are more warnings than are shown.",
    remedy="Correct the first ones.",
)
declare(
    "E001",
    Subject.FRAME,
    "The file has no problem.",
    remedy="A problem starts with a FECM card.",
)
declare(
    "W002",
    Subject.FRAME,
    "The deck does not end with STOP.",
    remedy="Add the card.",
)
declare(
    "E003",
    Subject.FRAME,
    "The control card is missing.",
    remedy="(6I5): NUMNP, NUMEL, LAYER, NDM, NDF, NEN.",
)
declare(
    "E004",
    Subject.FRAME,
    "The mesh data or the macro program are not ended by END.",
    remedy="Add the card.",
)
declare(
    "E005",
    Subject.FRAME,
    "A word is not a keyword here, or does not start in column 1.",
    remedy="Correct the word. The hint names the closest one.",
)
declare(
    "E006",
    Subject.FRAME,
    "A card of data is in place of a keyword.",
    remedy="A segment has more cards than its counts say, or a blank card ended it too early.",
)
declare(
    "E007",
    Subject.FRAME,
    "The cards of a segment are not ended by a blank card.",
    remedy="Add a blank card.",
)
declare(
    "E008",
    Subject.FRAME,
    "A card of a segment is missing.",
    remedy="The hint names its fields.",
)
declare(
    "E009",
    Subject.FRAME,
    "The macro program, or its MACR card, is missing.",
    remedy="Add MACR, the macros and END.",
)
declare(
    "E010",
    Subject.FRAME,
    "UNIT needs a card with three names.",
    remedy="`in lbf s`, `mm N s`.",
)
declare(
    "E011",
    Subject.FRAME,
    "The card of PROP's load table after END is missing.",
    remedy="(2I5,7F10.0): type, exponent, t_min, t_max, A1 to A5.",
)
declare(
    "E012",
    Subject.FRAME,
    "There are too many problems, segments, macros, nodes or gages.",
    cause="The nodes are those that cards generate. See [limits](limits.md).",
    remedy="Several files; generate each node once.",
)
declare(
    "E013",
    Subject.FRAME,
    "The file is an input of another program.",
    cause="Abaqus, Ansys, CalculiX, eLamX, FEAP, Gmsh, LS-DYNA and Nastran, and files in UNV, VTK, "
    "XML, JSON, STEP and IGES, are known by their beginning.",
    remedy=(
        "`fecm new --mesh FILE` takes a mesh; the hint says how to export one. FEAP: "
        "[what to change](other-files.md#decks-of-feap)."
    ),
)

# Numbers.
declare(
    "E101",
    Subject.NUMBERS,
    "A field is not a number, or a whole number has a decimal point.",
    remedy="Correct the field. The caret marks it.",
)
declare(
    "E103",
    Subject.NUMBERS,
    "A tab makes the columns ambiguous.",
    remedy="Blanks instead of tabs.",
)
declare(
    "E104",
    Subject.NUMBERS,
    "There is a blank inside or after a number.",
    cause="The report's machine read it as a zero.",
    remedy="Right-justify the number. The hint shows the card.",
)
declare(
    "W104",
    Subject.NUMBERS,
    "In listing mode a blank inside a number was read as a zero.",
    remedy="Right-justify the number.",
)
declare(
    "E105",
    Subject.NUMBERS,
    "A number straddles two fields, or crosses the end of its field.",
    remedy="Right-justify it, or separate the values by commas.",
)
declare(
    "E106",
    Subject.NUMBERS,
    "A card with commas has more values than fields.",
    remedy="Remove the values.",
)
declare(
    "W106",
    Subject.NUMBERS,
    "Text beyond the last field is not read.",
    remedy="Put `!` before a comment.",
)
declare(
    "E107",
    Subject.NUMBERS,
    "A number is too large.",
    remedy="Correct the exponent.",
)
declare(
    "E108",
    Subject.NUMBERS,
    "There is a character between two fields.",
    remedy="The hint names the next field.",
)
declare(
    "E109",
    Subject.NUMBERS,
    "A word or number has too many characters.",
    remedy="Separate values by commas.",
)

# Counts and words of segments.
declare(
    "E201",
    Subject.SEGMENTS,
    "A count of the control card is missing or out of range.",
    remedy="NDM 2, NDF 5, NEN 3 to 12, the others positive.",
)
declare(
    "E202",
    Subject.SEGMENTS,
    "Layer cards are fewer than LAYER says, or not as many as a laminate of LAMS.",
    remedy="Correct the number of layers, or the layer cards.",
)
declare(
    "W416",
    Subject.IMPACT,
    "An unknown word follows EXPE.",
    remedy="`EXPE ACR` takes equation 3-7.",
)
declare(
    "E446",
    Subject.POINTS,
    "An unknown word follows SHEA.",
    remedy="MITC, EQUI or both.",
)

# Grammar of the macro program.
declare(
    "E501",
    Subject.PROGRAM,
    "A word is not a macro.",
    remedy="The hint names the closest one.",
)
declare(
    "E502",
    Subject.PROGRAM,
    "A LOOP is not closed by a NEXT.",
    remedy="Add NEXT.",
)
declare(
    "E503",
    Subject.PROGRAM,
    "A NEXT has no LOOP.",
    remedy="Remove it.",
)
declare(
    "E504",
    Subject.PROGRAM,
    "A macro lacks others before it.",
    remedy="The hint names them: LMAS and DT before RODP, TANG before SOLV.",
)
declare(
    "E505",
    Subject.PROGRAM,
    "The number of a macro is out of range.",
    remedy="See [macros](macros.md).",
)
declare(
    "E506",
    Subject.PROGRAM,
    "Loops are nested too deeply.",
    remedy="Fewer loops.",
)
declare(
    "W507",
    Subject.PROGRAM,
    "A loop steps without TIME.",
    cause="Time-dependent loads do not advance.",
    remedy="TIME before the step.",
)
declare(
    "E513",
    Subject.PROGRAM,
    "A macro is outside any loop.",
    remedy="Put it between LOOP and NEXT.",
)
declare(
    "E514",
    Subject.PROGRAM,
    "A macro has a word or number that it does not take.",
    remedy="Remove it. Numbers of more than five digits go after a comma.",
)
