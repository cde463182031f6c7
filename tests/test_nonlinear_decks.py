"""Decks with NONL: Newton's method, modes, reactions, and impacts on a stretched plate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fecm
from tests.calls import call
from tests.decks import MESH, ready, small
from tests.decks import model as deck_of
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_to

THICKNESS = 0.05
# A symmetric plate of one layer.
MATERIAL = """\
MATE
    3    3   -3       .05
1.E-3, .3, 1.E7, 1.E7, 3846154., 3846154., 3846154.
    1   0.     .025
    2   0.     .025
SHEA MITC
"""
STRUCK = """\
ROD
   13    3     300.0
EXPE
  1912000. 0.0006564     0.094       2.0
"""
SUPPORTS = {"both": (1, 1), "free": (0, 0)}  # codes of u and v on the edges
EDGE = (1, 2, 3, 4, 5, 6, 10, 11, 15, 16, 20, 21, 22, 23, 24, 25)


def mesh(*, held: str) -> str:
    """The small plate of 2 x 2, whose edges do not deflect and hold u and v or not."""
    u, v = SUPPORTS[held]
    cards = [f"{node:5d}    0{u:5d}{v:5d}    1    0    0" for node in EDGE]
    return MESH.split("BOUN")[0] + "BOUN\n" + "\n".join(cards) + "\n\n"


def forces(value: float, strain: tuple[float, float] = (0.0, 0.0)) -> str:
    """FORC: a force in the middle, and displacements of the edges, u = x times the strain."""
    places = np.stack(np.meshgrid(np.arange(5) / 2.0, np.arange(5) / 2.0), axis=-1).reshape(-1, 2)
    cards = [f"13, 0, 0, 0, {value!r}"]
    if any(strain):
        u = ((places - 1.0) * strain).tolist()
        cards += [f"{node}, 0, {u[node - 1][0]!r}, {u[node - 1][1]!r}" for node in EDGE]
    return "FORC\n" + "\n".join(cards) + "\n\n"


NEWTON = "LOOP         20\nTANG\nFORM\nSOLV\nCONV\nNEXT\n"
STEPS = "LMAS\nDT        4.E-7\nLOOP        200\nTIME\nRODP         50\nDISP         50\nNEXT\n"


def text(program: str, *, held: str = "both", data: str = "", words: str = "NONL\n") -> str:
    """A deck of the plate."""
    return small(program, mesh=mesh(held=held), data=MATERIAL + words + data)


def result(*args: str, **kwargs: str) -> fecm.Result:
    """Result of the deck."""
    return fecm.run_one(deck_of(text(*args, **kwargs)))


def test_newtons_method_ends_in_equilibrium_with_the_supports() -> None:
    actual = result(NEWTON + "DISP\nREAC\n", data=forces(2000.0))
    w = actual.tape3.w[0, 12]
    linear = result("TANG\nFORM\nSOLV\nDISP\n", data=forces(2000.0), words="").tape3.w[0, 12]
    assert 2.0 * THICKNESS < w < 0.5 * linear
    force = actual.reactions.force[0]
    inside = np.setdiff1d(np.arange(25), np.array(EDGE) - 1)
    assert np.abs(force[inside]).max() < 1e-8
    assert force[:, 2].sum() == pytest.approx(-2000.0, rel=1e-9)
    # The plate pulls its edges inwards.
    assert force[[9, 14], 0].sum() > 1000.0


def test_a_plate_that_is_free_in_its_plane_needs_no_supports_there() -> None:
    by_name = {name: result(NEWTON + "DISP\n", held=name, data=forces(2000.0)) for name in SUPPORTS}
    free, held = by_name["free"].tape3, by_name["both"].tape3
    assert free.w[0, 12] > 1.2 * held.w[0, 12]
    u = free.displacement[0, :, 0].reshape(5, 5)
    np.testing.assert_allclose(u[2, 0] - u[2, 4], 2.0 * (u[2, 0] - u[2, 2]), rtol=1e-6)
    assert u[2, 0] > u[2, 4]


@pytest.mark.parametrize("held", SUPPORTS)
def test_pinned_rigid_motion_is_noted(held: str, tmp_path: Path) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(text(NEWTON + "DISP\n", held=held, data=forces(2000.0)))
    done = call("run", str(deck), "-o", str(tmp_path / "plate.h5"))
    assert done.exit_code == 0
    assert ("TANG pins the rigid motion" in done.stderr) == (held == "free")


def test_loops_that_end_without_equilibrium_are_an_error_that_names_the_load(
    tmp_path: Path,
) -> None:
    deck = tmp_path / "plate.inp"
    deck.write_text(text(NEWTON.replace("20", " 2") + "DISP\n", data=forces(1e4)))
    done = call("run", str(deck), "-o", str(tmp_path / "plate.h5"))
    assert done.exit_code == 1
    assert "no equilibrium after 2 passes at the load factor 1" in done.stderr
    assert "smaller steps" in done.stderr
    assert not (tmp_path / "plate.h5").exists()


def test_modes_are_those_about_the_stretched_state() -> None:
    strain = (4e-3, -5e-4)
    A = ready(text("EIGE,,3\n")).plate.laminate.A
    n_x, n_y, _ = (A @ [*strain, 0.0]).tolist()
    stretched = result(NEWTON + "LMAS\nEIGE,,3\n", data=forces(0.0, strain)).modes
    card = f"NONL\nPREL\n{n_x!r}, {n_y!r}\n"
    preloaded = result("LMAS\nEIGE,,3\n", words=card).modes
    plain = result("LMAS\nEIGE,,3\n").modes
    np.testing.assert_allclose(stretched.angular_frequency, preloaded.angular_frequency, rtol=1e-9)
    assert preloaded.angular_frequency[0] > 1.5 * plain.angular_frequency[0]


def test_an_impact_on_displaced_edges_is_that_on_the_preload_of_the_card() -> None:
    strain = (4e-3, -5e-4)
    A = ready(text("EIGE,,3\n")).plate.laminate.A
    n_x, n_y, _ = (A @ [*strain, 0.0]).tolist()
    by_edges = result(NEWTON + STEPS, data=STRUCK + forces(0.0, strain))
    by_card = result(STEPS, data=STRUCK, words=f"NONL\nPREL\n{n_x!r}, {n_y!r}\n")
    peak = by_card.history.force.max()
    np.testing.assert_allclose(by_edges.history.force, by_card.history.force, atol=1e-9 * peak)
    without = result(STEPS, data=STRUCK)
    assert np.abs(without.history.force - by_card.history.force).max() > 1e-3 * peak
    # The balance is as good as that of the linear plate.
    linear = np.abs(result(STEPS, data=STRUCK, words="").energy.balance_error).max()
    for actual in (by_edges, by_card, without):
        assert np.abs(actual.energy.balance_error).max() < 1.05 * linear


# Macro 14 is the last FORM: its SOLV belongs to the resumed run.
@pytest.mark.parametrize("each", [7, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("macros", [True, pytest.param(False, marks=pytest.mark.long)])
def test_a_stretched_plate_stopped_anywhere_goes_on_to_the_same_bytes(
    tmp_path: Path, macros: bool, each: int
) -> None:
    deck = text(
        NEWTON + "EIGE,,2\n" + STEPS.replace("200", "  9").replace(" 50", "  4"),
        data=STRUCK + forces(3.0, (4e-3, -5e-4)),
    )
    whole, path = tmp_path / "whole.h5", tmp_path / "stopped.h5"
    looks = run_to(deck, whole, macros=macros)
    assert looks > 8
    for stop in range(each, looks + 1, each):
        with pytest.raises(StoppedError):
            run_to(deck, path, stop, macros=macros)
        run_to(deck, path, resume=True, macros=macros)
        assert path.read_bytes() == whole.read_bytes(), f"stopped at {stop}"
        path.unlink()
