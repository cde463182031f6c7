"""Errors of cards, and hints that show the card as it was meant."""

from __future__ import annotations

import pytest

from fecm.deck.findings import Finding
from fecm.problem.loading import load_deck
from tests.sound_plate import Edit, base, replaced, with_card


def errors(text: str) -> list[Finding]:
    """Errors of a text."""
    return [finding for finding in load_deck(text).findings if finding.severity == "error"]


def test_a_card_typed_with_blanks_has_one_error_whose_hint_has_commas() -> None:
    (error,) = errors("FECM\n4 1 1 2 5 4\nUNIT\nmm, N, s\nEND\nMACR\nEND\nSTOP\n")
    assert error.code == "E104"
    assert error.hint == "fields have 5 columns; or separate the values by commas: 4,1,1,2,5,4"
    (error,) = errors(replaced(r"^    1 45\.0     0\.184$", "1 45. 0.184")(base()))
    assert error.hint == "fields have fixed columns; or separate the values by commas: 1,45.,0.184"


@pytest.mark.parametrize(
    ("edit", "card"),
    [(with_card("DELA", "0,7879 1"), "0.7879,1"), (with_card("DAMP", "50,5"), "50.5,"),
     (replaced(r"^    1 45\.0     0\.184$", "1 45,0 0,184"), "1,45.0,0.184")],
)  # fmt: skip
def test_a_decimal_comma_is_named(edit: Edit, card: str) -> None:
    (error,) = errors(edit(base()))
    assert error.hint == f"a comma separates values; with decimal points the card is `{card}`"


def test_a_letter_on_a_card_of_full_columns_is_not_taken_for_missing_commas() -> None:
    actual = errors("FECM\n12345 1234  1x2 2345 1234 1234\n")
    (error,) = (one for one in actual if one.code == "E101")
    assert "commas" not in error.hint


@pytest.mark.parametrize("card", ["221,3, 100x", "221,3,1000.,5", "221,3,1000,5"])
def test_other_slips_on_a_card_with_commas_are_no_decimal_commas(card: str) -> None:
    (error,) = errors(with_card("ROD", card)(base()))
    assert "decimal" not in error.hint


def test_names_on_the_keyword_card_of_unit_are_sent_to_the_next_card() -> None:
    text = base().replace("UNIT\nmm N s\n", "UNIT mm, N, s\n")
    assert [(e.code, e.hint) for e in errors(text)][:1] == [
        ("E010", "put the names on the card after UNIT: mm N s")
    ]


def test_a_deck_of_feap_is_recognised() -> None:
    (error,) = errors("FEAP * * plate\n    4    1    1    2    5    4\n")
    assert error.code == "E013"
    assert "FEAP" in error.message
    assert "the first word is FECM here, and the third number" in error.hint


@pytest.mark.parametrize(
    ("text", "program", "hint"),
    [
        ("*KEYWORD\n*NODE\n       1   0.0   0.0   0.0\n", "LS-DYNA", "mm-ms-kg"),
        ("$# LS-DYNA Keyword file\n*KEYWORD\n", "LS-DYNA", "mm-ms-kg"),
        ("/PREP7\n*SET,A,1\n", "Ansys", "mapdl-archive"),
        ("! Parameters\na = 4\n/PREP7\nET,1,SHELL181\n", "Ansys", "Nastran"),
        ("*IF,A,EQ,1,THEN\n*ENDIF\nNBLOCK,6,SOLID\n", "Ansys", "Nastran"),
        ("$NOD\n4\n1 0 0 0\n", "MSH 1.0", "MSH 2.2"),
        ("    -1\n  2411\n         1\n", "UNV", "MSH 2.2"),
        ("Point(1) = {0, 0, 0, 1};\n", "script of Gmsh", "-format msh22"),
        ("ISO-10303-21;\nHEADER;\n", "CAD", "midsurface"),
        ("# vtk DataFile Version 3.0\n", "VTK", "takes a mesh"),
        ('<VTKFile type="UnstructuredGrid">\n', "VTK", "takes a mesh"),
        ("<html>\n", "XML", "--layup"),
        ('{"layup": "[0/90]s"}\n', "JSON", "lines of cards"),
        ("[\n  {}\n]\n", "JSON", "lines of cards"),
        ("SOL 101\nCEND\nBEGIN BULK\n", "Nastran", "takes a mesh"),
        ("BEGIN BULK\nGRID,1,,0.,0.,0.\n", "Nastran", "takes a mesh"),
        ("*NODE\n1, 0.0, 0.0\n", "Abaqus", "takes a mesh"),
        ("$ a plate\n$\nSOL 101\nCEND\n", "Nastran", "takes a mesh"),
        ("NASTRAN SYSTEM(151)=1\nID A,B\nSOL 101\n", "Nastran", "takes a mesh"),
        ("ID PLATE,TEST\nAPP DISP\nSOL 1,0\n", "Nastran", "takes a mesh"),
        ("ASSIGN OUTPUT2='a.op2'\n\nSOL SESTATIC\n", "Nastran", "takes a mesh"),
        ("GRID*                  1\n", "Nastran", "takes a mesh"),
        ("$ a ball\n$\n*KEYWORD\n", "LS-DYNA", "mm-ms-kg"),
        ("$ a ball\n*NODE\n", "LS-DYNA", "mm-ms-kg"),
        ("** a plate\n**\n*Heading\n", "Abaqus", "takes a mesh"),
        ("$MeshFormat\n4.1 0 8\n", "Gmsh", "takes a mesh"),
        ("! a plate\n\nnopr\nFEAP * * plate\n", "FEAP", "the first word is FECM here"),
        ('<?xml version="1.0" encoding="UTF-8"?>\n<elamx>\n', "eLamX", "--layup"),
    ],
)
def test_an_input_of_another_code_is_named_with_what_can_be_done(
    text: str, program: str, hint: str
) -> None:
    (error,) = errors(text)
    assert error.code == "E013"
    assert program in error.message
    assert hint in error.hint


def test_a_deck_with_a_line_above_its_title_is_not_taken_for_another_programs() -> None:
    assert "E013" not in {error.code for error in errors("$ a plate\n" + base())}


def test_a_large_result_marks_the_macro_that_stores_most() -> None:
    text = replaced(r"^FAIL .*", "FAIL\nPLYS")(replaced(r"^LOOP .*", "LOOP,,100000")(base()))
    (finding,) = (f for f in load_deck(text).findings if f.code == "W512")
    assert finding.place is not None
    assert finding.place.text.startswith("PLYS")
    assert finding.hint.startswith("PLYS stores every N steps")
