"""Stiffness of edges from natural frequencies: the tap test of `fecm modes --measured`.

elastic_edges.csv are the results of a program with p-elements that shares no code with fecm.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm.authoring.plate import Support
from fecm.deck.model import Boundary, Deck, NodeCodes, NodeValues, Springs
from fecm.problem.generate import generate
from tests.builders import table
from tests.calls import call

PLY = fecm.Ply(1.57e-9, 0.32, 171420.0, 9080.0, 5290.0, 5290.0, 3242.9)
ROWS = {
    (float(r["k_r_Nmm_per_rad_mm"]), float(r["k_w_N_per_mm2"])): r
    for r in table("elastic_edges.csv")
}
COARSE, FINE = (12, 8), (48, 32)
WITNESSES = [((1e4, np.inf), ["kr"]), ((1e4, 10.0), ["kr", "kw"])]


def plate(
    support: Support = "simple", mesh: tuple[int, int] = COARSE, units: str = "mm-N-s"
) -> Deck:
    """The plate of elastic_edges.csv."""
    return fecm.plate_deck(
        fecm.Plate.rectangle((300.0, 200.0), mesh, support=support),
        fecm.Laminate("[0/90/0/90/0]s", PLY, 0.2),
        "LMAS\nEIGE,,1",
        units=units,
        shear_factor=1.0,
    )


def frequencies(row: tuple[float, float], count: int = 6) -> list[float]:
    """The frequencies of edges of these stiffnesses."""
    return [float(ROWS[row][f"f{n}_Hz"]) for n in range(1, count + 1)]


def values(fit: fecm.EdgeFit) -> dict[str, float]:
    """The fitted values; none is a bound."""
    assert not any(k.bound for k in fit.stiffness)
    return {k.name: k.value for k in fit.stiffness}


@pytest.mark.parametrize("mesh", [COARSE, pytest.param(FINE, marks=pytest.mark.long)])
@pytest.mark.parametrize(("row", "free"), WITNESSES)
def test_the_stiffness_of_another_program_is_found_from_its_frequencies(
    row: tuple[float, float], free: list[str], mesh: tuple[int, int]
) -> None:
    fit = fecm.fit_edges(plate(mesh=mesh), frequencies(row), free)
    found = values(fit)
    assert found["kr"] == pytest.approx(1e4, rel=0.02)
    if "kw" in free:
        assert found["kw"] == pytest.approx(10.0, rel=0.05)
    assert fit.misfit < 1e-3
    assert fit.computed == pytest.approx(fit.measured, rel=2e-3)


@pytest.mark.parametrize(("row", "free"), WITNESSES)
@pytest.mark.long
def test_two_standard_errors_hold_the_stiffness_of_noisy_frequencies(
    row: tuple[float, float], free: list[str]
) -> None:
    exact, deck = np.array(frequencies(row, 4)), plate()
    inside = dict.fromkeys(free, 0)
    for seed in range(100):
        noise = 0.005 * np.random.default_rng(seed).standard_normal(4)
        fit = fecm.fit_edges(deck, sorted(exact * (1.0 + noise)), free)
        for k, true in zip(fit.stiffness, row, strict=False):
            inside[k.name] += not k.bound and abs(k.value - true) <= 2.0 * k.error
    assert min(inside.values()) >= 90


@pytest.mark.parametrize(("row", "sign"), [((np.inf, np.inf), ">"), ((0.0, np.inf), "<")])
def test_a_stiffness_that_no_frequency_feels_is_a_bound(
    row: tuple[float, float], sign: str
) -> None:
    (kr,) = fecm.fit_edges(plate(), frequencies(row)).stiffness
    assert kr.bound == sign
    assert np.isnan(kr.error)
    assert str(kr).startswith(f"{sign} ")
    # At the bound the frequencies are those of the end, within the resolution of a tap test.
    if sign == ">":
        assert kr.value > 1e5
    else:
        assert kr.value < 10.0


def test_a_bound_leaves_the_other_value_its_error() -> None:
    fit = fecm.fit_edges(plate(), frequencies((0.0, 10.0)), ["kr", "kw"])
    kr, kw = fit.stiffness
    assert kr.bound == "<"
    assert kw.value == pytest.approx(10.0, rel=0.02)
    assert 0.0 < kw.error < 1.0
    assert np.isnan(fit.correlation)


def test_the_cards_give_the_deck_the_measured_frequencies(tmp_path: Path) -> None:
    measured = frequencies((1e4, 10.0))
    fit = fecm.fit_edges(plate(), measured, ["kr", "kw"])
    lines = plate("free").to_text().splitlines()
    end = lines.index("END")
    path = tmp_path / "on-springs.inp"
    path.write_text("\n".join([*lines[:end], *fit.cards, *lines[end:], ""]))
    assert fecm.modes(path).frequency == pytest.approx(fit.computed, rel=1e-4)
    assert fecm.modes(path).frequency == pytest.approx(measured, rel=1e-3)


def test_what_holds_the_chosen_edges_does_not_matter() -> None:
    measured = frequencies((1e4, np.inf), 4)
    held, clamped = (fecm.fit_edges(plate(s), measured) for s in ("simple", "clamped"))
    assert values(clamped)["kr"] == pytest.approx(values(held)["kr"], rel=1e-4)


def test_springs_on_the_edges_are_replaced_and_others_stay() -> None:
    ends = [(1, 25, 4), (401, 425, 4), (1, 401, 3), (25, 425, 3)]
    along_edges = [
        NodeValues(a, b, tuple(5000.0 if dof == n else 0.0 for n in range(5))) for a, b, dof in ends
    ]
    middle = Springs((NodeValues(213, 0, (0.0, 0.0, 20.0, 0.0, 0.0)),))
    deck = plate()
    segments = (*deck.segments, Springs(tuple(along_edges), word="LINE"), middle)
    supported = replace(deck, segments=segments, text="")
    measured = fecm.modes(supported, 4).frequency.tolist()
    assert values(fecm.fit_edges(supported, measured))["kr"] == pytest.approx(5000.0, rel=1e-4)


def test_modes_that_were_not_measured_are_left_out() -> None:
    measured = [frequencies((1e4, np.inf))[n - 1] for n in (1, 3, 4)]
    fit = fecm.fit_edges(plate(), measured, of=[1, 3, 4])
    assert values(fit)["kr"] == pytest.approx(1e4, rel=0.02)
    assert fit.number == (1, 3, 4)


def test_edges_that_are_not_named_keep_their_supports() -> None:
    # Springs on the left edge alone, three clamped edges: made by the program, fitted from clamped.
    text = plate("clamped")
    fit = fecm.fit_edges(text, [370.0, 620.0], edges=["left"])
    (kr,) = fit.stiffness
    assert not kr.bound
    assert len(fit.cards) == 3  # SPRI LINE, one edge, a blank card
    assert fecm.modes(text, 1).frequency[0] > 370.0


@pytest.mark.parametrize(
    ("measured", "options", "words"),
    [
        ([300.0], {"free": ["kr", "kw"]}, "2 parameters need as many frequencies"),
        ([170.0, 395.0], {}, "mode 1 is 6.6% below the one without springs"),
        ([182.0, 700.0], {}, "mode 2 is 7.* above the one of rigid edges"),
        ([300.0, 200.0], {}, "positive and ascend"),
        ([300.0], {"free": ["kx"]}, "free is kx; choose from kr, kw"),
        ([300.0], {"edges": ["north"]}, "edges is north; choose from left"),
        ([300.0], {"of": [1, 2]}, "of has the number of the mode of each frequency"),
    ],
)
def test_what_can_not_be_fitted_is_an_error(
    measured: list[float], options: dict[str, Any], words: str
) -> None:
    with pytest.raises(fecm.FecmError, match=words):
        fecm.fit_edges(plate(), measured, **options)


def test_plates_without_such_edges_are_refused() -> None:
    deck = plate("free")
    places = generate(deck).coordinates
    codes = np.zeros((len(places), 5), dtype=int)
    codes[np.isclose(places[:, 0], 300.0), 3] = 1  # the slope across x = 300
    rows = tuple(NodeCodes(n, 0, tuple(c)) for n, c in enumerate(codes.tolist(), start=1))
    half = replace(deck, segments=(*deck.segments, Boundary(rows)), text="")
    with pytest.raises(fecm.FecmError, match="the right edge is held as a line of symmetry is"):
        fecm.fit_edges(half, [300.0])
    disc = Path(__file__).parent / "data" / "circle-quad9.msh"
    round_plate = fecm.plate_deck(
        fecm.Plate.from_mesh(disc), fecm.Laminate("[0]4", PLY, 0.2), "LMAS\nEIGE,,1", units="mm-N-s"
    )
    with pytest.raises(fecm.FecmError, match="the left side of the plate is not a straight edge"):
        fecm.fit_edges(round_plate, [300.0])


def test_the_command_prints_what_python_finds(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(plate().to_text())
    measured = frequencies((1e4, np.inf), 4)
    asked = ("modes", "d.inp", "--measured", ",".join(map(str, measured)))
    done = call(*asked, "--format", "json", cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    document = json.loads(done.stdout)
    fit = fecm.fit_edges(plate(), measured)
    assert document["stiffness"][0]["value"] == pytest.approx(fit.stiffness[0].value, rel=1e-6)
    page = call(*asked, cwd=tmp_path).stdout
    assert "w and the rotation along them held" in page
    assert "SPRI LINE" in page
    refused = call(*asked, "-o", "m.h5", cwd=tmp_path)
    assert refused.exit_code == 2
    assert "--output is not for --measured" in refused.stderr
    assert call("modes", "d.inp", "--of", "1", cwd=tmp_path).exit_code == 2
