"""CURV in decks: how it is read, and what is refused or doubted, with which numbers."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import fecm
from fecm.deck import model
from fecm.deck.findings import Finding
from fecm.problem.loading import load_deck
from fecm.problem.memory import needed_bytes
from fecm.problem.rules.time_step import clamped_frequency
from fecm.verification import decks
from tests.curved_panels import mesh, panel, shortly

STATIC = "TANG FORM SOLV DISP"


def findings(deck: model.Deck) -> dict[str, Finding]:
    """Findings of a deck, written and read, by their codes."""
    return {finding.code: finding for finding in load_deck(deck.to_text()).findings}


def codes(*radii: float) -> set[str]:
    """Codes about CURV of the panel with some radii."""
    return {code for code in findings(panel(radii, STATIC, load=1.0)) if 521 <= int(code[1:]) < 529}


# Card --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("card", "radii"),
    [
        ("      500.", (500.0, 0.0, 0.0)),
        ("              -1.5E3", (0.0, -1500.0, 0.0)),
        (",,2000.", (0.0, 0.0, 2000.0)),
        (",,", (0.0, 0.0, 0.0)),
    ],
)
def test_a_card_gives_radii_and_a_blank_is_infinite(
    card: str, radii: tuple[float, float, float]
) -> None:
    text = panel((500.0,), STATIC).to_text()
    deck = fecm.read_one(re.sub("CURV\n.*\n", f"CURV\n{card}\n", text))
    (problem,) = load_deck(deck).problems
    actual = deck.require(model.Curvature)
    assert (actual.radius_x, actual.radius_y, actual.radius_xy) == radii
    wanted = tuple(1.0 / radius if radius else 0.0 for radius in radii)
    assert actual.curvatures == problem.plate.curvature == wanted


def test_listing_mode_refuses_the_card() -> None:
    actual = load_deck(panel((500.0,), STATIC).to_text(), "listing").errors()
    assert "The printed program has no CURV." in [finding.message for finding in actual]


# Findings ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("radii", "found"),
    [
        ((301.0, -201.0), set[str]()),  # rises of a/8R
        ((299.0,), {"W524"}),
        ((0.0, -199.0), {"W524"}),
        ((0.0, 0.0, 299.0), {"W524"}),
        ((301.0, 0.0, 700.0), {"W524"}),  # the slopes add up
        ((151.0,), {"W524"}),
        ((149.0,), {"E523"}),
        ((1e-320, 500.0), {"E523"}),
        ((0.0, -99.0), {"E523"}),
        ((), set[str]()),
    ],
)
def test_a_panel_that_rises_too_far_is_doubted_or_refused(
    radii: tuple[float, ...], found: set[str]
) -> None:
    assert codes(*radii) == (found or set())


def test_the_rise_is_told_in_numbers() -> None:
    message = findings(panel((200.0,), STATIC, load=1.0))["W524"].message
    assert "a slope of 0.75 at its edge, as an arc that rises by 0.188 of its side" in message


def test_a_radius_near_the_thickness_is_no_thin_shell() -> None:
    thick = decks.material(decks.isotropic(70e3, 0.3, 2.7e-9), (0.0,), 30.0)

    def thick_panel(radius: float) -> model.Deck:
        deck = panel((0.0, radius), STATIC, load=1.0)
        segments = (thick if isinstance(s, model.Material) else s for s in deck.segments)
        return replace(deck, control=replace(deck.control, layers=1), segments=tuple(segments))

    assert "Ry of CURV is 19.7 times the thickness" in findings(thick_panel(-590.0))["W525"].message
    assert "W525" not in findings(thick_panel(610.0))


@pytest.mark.parametrize(
    ("every", "words"), [("11", "u and v are"), ("10", "u is"), ("01", "v is"), ("00", "")]
)
def test_a_clamped_membrane_is_doubted(every: str, words: str) -> None:
    held = " ".join(every + code for code in ("000", "101", "110", "101", "110"))
    deck_findings = findings(panel((500.0,), STATIC, load=1.0, codes=held))
    assert ("W526" in deck_findings) == bool(words)
    if words:
        assert f"CURV, and {words} restrained at every node" in deck_findings["W526"].message
        flat = findings(panel((), STATIC, load=1.0, codes=held))
        assert "W526" not in flat


def test_a_line_of_symmetry_must_not_move_across_itself() -> None:
    """The left edge is a line of symmetry of bending: theta_x is held, but u is free."""
    open_line, held = "00000 00010 10110 01101 10110", "00000 10010 10110 01101 10110"
    assert "W495" in findings(panel((500.0,), STATIC, load=1.0, codes=open_line))
    assert "W495" not in findings(panel((500.0,), STATIC, load=1.0, codes=held))
    assert "W495" not in findings(panel((), STATIC, load=1.0, codes=open_line))


@pytest.mark.parametrize(
    ("forces", "refused"),
    [((-1.0, 0.0, 0.0), False), ((0.0, 1.0, 0.0), True), ((1.0, 0.0, 0.5), False)],
)
def test_a_preload_must_run_along_straight_lines(
    forces: tuple[float, float, float], refused: bool
) -> None:
    built = panel((0.0, 500.0), STATIC, load=1.0, others=(model.Preload(*forces),))
    assert ("E528" in findings(built)) == refused
    assert refused == (forces[1] != 0.0)


def test_a_preload_whose_parts_balance_is_taken() -> None:
    saddle = panel((500.0, -500.0), STATIC, load=1.0, others=(model.Preload(2.0, 2.0),))
    assert "E528" not in findings(saddle)
    dome = panel((500.0, 500.0), STATIC, load=1.0, others=(model.Preload(2.0, 2.0),))
    assert "= 0.008, a force per area" in findings(dome)["E528"].message


# Elsewhere ---------------------------------------------------------------------------------------


def test_waves_are_those_of_the_flat_laminate_and_say_so() -> None:
    flat, curved = (fecm.waves(shortly(radii)) for radii in ((), (0.0, 500.0)))
    assert "CURV is left out: these are waves of the flat laminate" in curved.notes
    assert not any("CURV" in note for note in flat.notes)


def test_damping_is_compared_with_the_frequency_of_the_panel() -> None:
    """With clamped edges and u, v held, R = 500 mm along y adds A22/R^2 to omega^2 rho h."""
    flat, curved = (load_deck(shortly(radii)).problems[0] for radii in ((), (0.0, 500.0)))
    added = clamped_frequency(curved) ** 2 - clamped_frequency(flat) ** 2
    laminate = flat.plate.laminate
    assert added == pytest.approx(laminate.A[1, 1] / 500.0**2 / laminate.mass, rel=1e-10)


def test_the_memory_of_a_static_solution_counts_the_moving_plane() -> None:
    flat, curved = (load_deck(panel(r, STATIC, mesh(24))).problems[0] for r in ((), (500.0,)))
    assert needed_bytes(curved) > 1.3 * needed_bytes(flat)
