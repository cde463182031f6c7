"""Indentation tests: the constants that made a curve come out of it, inside their errors."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm.api import prepare
from fecm.authoring.contacts import CONTACTS
from fecm.deck import Deck
from fecm.deck.formatting import format_deck
from fecm.deck.model import Indentation
from fecm.fitting.constants import Fit, fit
from fecm.fitting.cycles import divide
from fecm.fitting.estimates import Estimate
from fecm.indentation import CriticalConstants, hertz_coefficient
from fecm.results.result import Result
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, LONG, small

Floats = NDArray[np.float64]

# The report's 0.5 in indenter.
K, ALPHA_P, S_P, Q, ALPHA_CR = 1.330e6, 6.564e-4, 0.094, 2.5, 3.16e-3
PEAKS = (1.5e-3, 2.5e-3, 3.5e-3, 4e-3)
HALF_INCH = "  1330000. 0.0006564     0.094       2.5\n"
LAW_CARD = "  1912000. 0.0006564     0.094       2.0\n"


# Tests are made from the equations as the report prints them, not by the law's own code.


def stretch(begin: float, end: float, points: int, force: Callable[[Floats], Floats]) -> Floats:
    """Indentations and forces (2, points) after `begin` up to `end`."""
    a = np.linspace(begin, end, points + 1)[1:]
    return np.array([a, force(a)])


def make_test(
    peaks: tuple[float, ...] = PEAKS, q: float = Q, points: int = 100, s_p: float = S_P
) -> tuple[Floats, Floats]:
    """Load to each peak and unload to zero: equations 3-1, 3-3 with 3-8, and 3-11 with 3-12."""

    def loading(a: Floats) -> Floats:
        return np.asarray(K * a**1.5)

    parts = [np.zeros((2, 1))]
    last = left = 0.0
    for peak in peaks:
        if last:
            k_1 = K * (last / (last - left)) ** 1.5

            def back(a: Floats, k_1: float = k_1, left: float = left) -> Floats:
                return np.asarray(k_1 * np.maximum(a - left, 0.0) ** 1.5)

            parts.append(stretch(0.0, last, points, back))
        parts.append(stretch(last, peak, points, loading))
        left, last = max(0.0, s_p * (peak - ALPHA_P)), peak

        def fall(a: Floats, peak: float = peak, left: float = left) -> Floats:
            ratio = np.maximum(a - left, 0.0) / (peak - left)
            return np.asarray(K * peak**1.5 * ratio**q)

        parts.append(stretch(peak, 0.0, points, fall))
    a, f = np.concatenate(parts, axis=1)
    return a, f


def noisy(values: Floats, seed: int, part: float = 0.01) -> Floats:
    """Values with a scatter of a part of the largest one."""
    scatter = np.random.default_rng(seed).standard_normal(len(values))
    return np.asarray(values + part * values.max() * scatter)


def written(path: Path, indentation: Floats, force: Floats) -> Path:
    """A test as a file."""
    lines = [f"{a!r},{f!r}" for a, f in zip(indentation.tolist(), force.tolist(), strict=True)]
    path.write_text("\n".join(["indentation,force", *lines, ""]))
    return path


def constants(found: Fit) -> dict[str, tuple[Estimate, float]]:
    """Every estimate of a fit of `make_test()`, and the truth."""
    assert found.q is not None
    assert found.line is not None
    pairs = {
        "k": (found.k, K),
        "n": (found.free.n, 1.5),
        "k with n": (found.free.k, K),
        "q": (found.q, Q),
        "s_p": (found.line.s_p, S_P),
        "alpha_p": (found.line.alpha_p, ALPHA_P),
    }
    for n, (cycle, peak) in enumerate(zip(found.cycles, PEAKS, strict=True)):
        left = S_P * (peak - ALPHA_P)
        pairs[f"alpha_m {n}"] = (cycle.alpha_m, peak)
        pairs[f"alpha_0 {n}"] = (cycle.alpha_0, left)
        pairs[f"k_1 {n}"] = (cycle.k_1, K * (peak / (peak - left)) ** 1.5)
    return pairs


def deviations(*, indentation: float, proportional: bool = False) -> dict[str, Floats]:
    """Deviations from the truth in standard errors, of 50 seeds."""
    a, f = make_test()
    found: dict[str, list[float]] = {}
    for seed in range(50):
        random = np.random.default_rng(seed).standard_normal(len(f))
        force = f * (1.0 + 0.01 * random) if proportional else noisy(f, seed)
        path = noisy(a, 1000 + seed, indentation) if indentation else a
        for name, (estimate, truth) in constants(fit(path, force)).items():
            if estimate.error:  # a peak that was held has none
                deviation = (estimate.value - truth) / estimate.error
                found.setdefault(name, []).append(abs(deviation))
    return {name: np.array(values) for name, values in found.items()}


# Of 50 fair draws fewer than 23 or more than 44 within one error, or fewer than 43 within two, come
# about less than once in a thousand times.
def assert_fair(found: dict[str, Floats]) -> None:
    for name, values in found.items():
        assert len(values) >= 45
        assert 23 <= np.count_nonzero(values < 1.0) <= 44, name
        assert np.count_nonzero(values < 2.0) >= 43, name


# What the fit finds ------------------------------------------------------------------------------


def test_constants_lie_inside_their_errors_as_often_as_they_should() -> None:
    found = deviations(indentation=0.0)
    assert_fair(found)
    everything = np.concatenate(list(found.values()))
    assert np.mean(everything < 1.0) == pytest.approx(0.683, abs=0.06)
    assert np.mean(everything < 2.0) == pytest.approx(0.954, abs=0.03)


def test_errors_hold_for_a_scatter_that_grows_with_the_force() -> None:
    assert_fair(deviations(indentation=0.0, proportional=True))


def test_errors_hold_where_the_indentation_is_noisy_too() -> None:
    found = deviations(indentation=0.005)
    assert_fair(found)


def test_a_test_without_noise_gives_the_constants_themselves() -> None:
    for estimate, truth in constants(fit(*make_test())).values():
        assert estimate.value == pytest.approx(truth, rel=1e-6)


def test_a_fit_explains_what_noise_leaves() -> None:
    a, f = make_test()
    found = fit(a, noisy(f, 0))
    assert found.scatter == pytest.approx(0.01, rel=0.05)
    for kind in ("loading", "unloading", "reloading"):
        share = found.r_squared[kind]
        assert share is not None
        assert 0.99 < share < 1.0


def test_a_larger_peak_between_two_readings_is_found_where_the_curves_meet() -> None:
    a, f = make_test(points=40)
    keep = np.full(len(a), True)
    keep[np.isin(a, PEAKS)] = False  # no reading at the peaks themselves
    for cycle, peak in zip(fit(a[keep], f[keep]).cycles, PEAKS, strict=True):
        assert cycle.recorded < peak - 1e-5
        assert cycle.alpha_m.value == pytest.approx(peak, rel=1e-3)


def test_partial_unloadings_reload_from_an_origin_of_their_own() -> None:
    # Up to 3e-3, down to 2e-3, back up through the peak to 4e-3 and out; by READING's formula.
    peak, turn, left = 3e-3, 2e-3, S_P * (3e-3 - ALPHA_P)
    top = K * peak**1.5
    at_turn = top * ((turn - left) / (peak - left)) ** Q
    ratio = (at_turn / top) ** (2.0 / 3.0)
    origin = (turn - ratio * peak) / (1.0 - ratio)
    last = S_P * (4e-3 - ALPHA_P)
    a, f = np.concatenate(
        [
            np.zeros((2, 1)),
            stretch(0.0, peak, 100, lambda a: K * a**1.5),
            stretch(peak, turn, 50, lambda a: top * ((a - left) / (peak - left)) ** Q),
            stretch(turn, peak, 50, lambda a: top * ((a - origin) / (peak - origin)) ** 1.5),
            stretch(peak, 4e-3, 50, lambda a: K * a**1.5),
            stretch(4e-3, last, 100, lambda a: K * 4e-3**1.5 * ((a - last) / (4e-3 - last)) ** Q),
        ],
        axis=1,
    )
    found = fit(a, f)
    assert [cycle.alpha_0.value for cycle in found.cycles] == pytest.approx([left, last], rel=1e-5)
    measured = found.cycles[0].k_1_measured
    assert measured is not None
    assert measured.value == pytest.approx(K * (peak / (peak - origin)) ** 1.5, rel=1e-5)
    assert found.line is not None
    assert found.line.alpha_p.value == pytest.approx(ALPHA_P, rel=1e-4)


@pytest.mark.parametrize("part", [0.0, 0.005, 0.01])
@pytest.mark.parametrize("points", [40, 100, 1000])
def test_cycles_are_found_in_noisy_paths_of_few_and_many_points(part: float, points: int) -> None:
    a, _ = make_test(points=points)
    for seed in range(5):
        division = divide(noisy(a, seed, part) if part else a)
        recorded = [division.corners[n].indentation for n in division.peaks]
        assert recorded == pytest.approx(PEAKS, abs=8e-5)


def test_a_peak_reached_twice_is_one_cycle() -> None:
    a, f = make_test((2e-3,))
    left = S_P * (2e-3 - ALPHA_P)
    k_1 = K * (2e-3 / (2e-3 - left)) ** 1.5
    back = stretch(0.0, 2e-3, 100, lambda a: k_1 * np.maximum(a - left, 0.0) ** 1.5)
    again = np.concatenate([[a, f], back, [a[101:], f[101:]]], axis=1)
    found = fit(again[0], noisy(again[1], 0))
    assert len(found.cycles) == 1


def test_cycles_below_alpha_p_leave_nothing_and_do_not_bend_the_line() -> None:
    found = fit(*make_test((3e-4, 5e-4, 2e-3, 4e-3)))
    assert found.line is not None
    assert found.line.elastic == (0, 1)
    assert found.line.s_p.value == pytest.approx(S_P, rel=1e-6)
    assert found.line.alpha_p.value == pytest.approx(ALPHA_P, rel=1e-6)


def test_hertz_own_curve_has_no_peak_in_it_and_the_recorded_one_is_taken() -> None:
    found = fit(*make_test((2e-3,), q=1.5, s_p=0.0))
    assert found.q is not None
    assert found.q.value == pytest.approx(1.5, abs=1e-6)
    assert found.cycles[0].alpha_m == Estimate(2e-3, 0.0)


def test_permanent_indentations_off_the_line_enlarge_its_errors() -> None:
    # One specimen of four stays 30 % deeper: nothing that the forces' noise could do.
    parts = [make_test((peak,), s_p=S_P * (1.3 if n == 1 else 1.0)) for n, peak in enumerate(PEAKS)]
    both = [np.concatenate([part[axis] for part in parts]) for axis in (0, 1)]
    found = fit(both[0], noisy(both[1], 0, 1e-4))
    assert found.line is not None
    assert found.line.scatter > 3.0


def test_one_unloading_tells_alpha_cr() -> None:
    # Equation 3-7: above alpha_cr the rigidity is k/alpha_cr, whatever the peak.
    left = 5e-3 * (1.0 - (ALPHA_CR / 5e-3) ** 0.4)
    up = stretch(0.0, 5e-3, 200, lambda a: K * a**1.5)
    down = stretch(5e-3, left, 200, lambda a: K / ALPHA_CR * (a - left) ** 2.5)
    a, f = np.concatenate([np.zeros((2, 1)), up, down], axis=1)
    estimates = [fit(a, noisy(f, seed), acr=True).critical for seed in range(20)]
    values = [one.alpha_cr.value for one in estimates if one is not None]
    errors = [one.alpha_cr.error for one in estimates if one is not None]
    assert len(values) == 20
    assert np.std(values) == pytest.approx(np.mean(errors), rel=0.4)
    assert np.mean(values) == pytest.approx(ALPHA_CR, abs=3.0 * float(np.mean(errors)) / 20**0.5)


# The laws and their numbers ----------------------------------------------------------------------


def rigidities(tmp_path: Path, *options: str) -> list[list[float]]:
    """Table of ``--rigidity`` for the 0.5 in indenter, without its header."""
    deck = tmp_path / "half.inp"
    deck.write_text(LONG.read_text().replace(LAW_CARD, HALF_INCH))
    done = call("indent", "curve", deck, "--rigidity", *options)
    assert done.exit_code == 0
    rows = list(csv.reader(io.StringIO(done.stdout)))
    assert rows[0] == ["alpha_m", "s_3_9", "s_3_7"]
    return [[float(cell) for cell in row] for row in rows[1:]]


def test_rigidities_at_four_thousandths_are_the_reports(tmp_path: Path) -> None:
    peak, by_3_9, by_3_7 = rigidities(tmp_path, "--path", "3e-3,4e-3", "--points", "1")[1]
    assert peak == 4e-3
    assert by_3_9 / K == pytest.approx(306.7, abs=0.06)
    assert by_3_7 / K == pytest.approx(316.5, abs=0.05)


def test_the_two_rigidities_differ_most_at_alpha_cr_by_21_percent(tmp_path: Path) -> None:
    rows = rigidities(tmp_path, "--path", "0,4e-3", "--points", "400")
    peak, by_3_9, by_3_7 = max(rows, key=lambda row: abs(row[1] / row[2] - 1.0))
    assert peak == pytest.approx(3.16e-3, abs=1e-9)
    assert by_3_9 / by_3_7 - 1.0 == pytest.approx(0.21, abs=0.005)


def test_hertz_is_the_sphere_on_a_half_space() -> None:
    # A rigid sphere, E* = E_t: F = 4/3 E* R^1/2 alpha^3/2; equal moduli halve it at nu = 0.
    assert hertz_coefficient(4.0, 1e30, 0.3, 3.0) == pytest.approx(8.0, rel=1e-12)
    assert hertz_coefficient(4.0, 3.0, 0.0, 3.0) == pytest.approx(4.0, rel=1e-12)
    done = call("indent", "hertz", "--radius", 4, "--es", 3, "--nus", 0, "--et", 3)
    assert done.stdout.splitlines()[1].split() == ["4.0", "0.0", "0.0", "1.5"]


def test_the_alpha_cr_law_unloads_with_one_rigidity() -> None:
    law = CriticalConstants(K, ALPHA_CR)
    assert law.permanent(3.1e-3) == 0.0
    assert law.permanent(0.0) == law.permanent(-1.0) == 0.0
    peaks = np.array([3.2e-3, 4e-3, 8e-3])
    np.testing.assert_allclose(law.rigidity(peaks), K / ALPHA_CR, rtol=1e-12)
    expected = [a * (1.0 - (ALPHA_CR / a) ** 0.4) for a in peaks]
    np.testing.assert_allclose(law.permanent(peaks), expected, rtol=1e-12)
    assert law.permanent(4e-3) == pytest.approx(expected[1], rel=1e-12)


# EXPE ACR in a deck ------------------------------------------------------------------------------


def acr_deck(card: str, word: str = "ACR", program: str = "") -> str:
    """The small plate with another law."""
    data = DATA_CARDS.replace("EXPE\n" + LAW_CARD, f"EXPE {word}\n{card}\n")
    return small(program, data=data) if program else small(data=data)


def test_expe_acr_is_read_written_and_aligned() -> None:
    deck = fecm.read_deck(acr_deck("  1912000.   0.00316"))
    assert isinstance(deck, Deck)
    law = deck.need(Indentation)
    assert (law.k, law.alpha_p, law.word) == (1.912e6, 0.00316, "ACR")
    assert fecm.read_deck(deck.to_text()) == deck
    aligned = format_deck(acr_deck("1912000., 0.00316"))
    assert fecm.read_deck(aligned) == deck


def test_a_run_of_expe_acr_leaves_what_equation_3_7_says() -> None:
    program = "LMAS\nDT        .5E-6\nLOOP        200\nTIME\nRODP         50\nNEXT\n"
    result = fecm.run(acr_deck("  1912000.   0.0001", program=program))
    other = fecm.run(small(program))
    assert isinstance(result, Result)
    assert isinstance(other, Result)
    peak = result.indentation.max()
    assert peak > 2e-4
    assert result.indentation[-1] < peak
    left = float(result.history.attributes["permanent_indentation"])
    assert left == pytest.approx(peak * (1.0 - (1e-4 / peak) ** 0.4), rel=1e-12)
    assert np.abs(result.force - other.force).max() > 1.0
    top = int(result.indentation.argmax())
    falls = np.diff(result.indentation[top:]) < 0.0
    falling = top + 1 + np.arange(int(np.argmin(falls)))
    assert len(falling) > 3
    expected = 1.912e6 / 1e-4 * (result.indentation[falling] - left) ** 2.5
    np.testing.assert_allclose(result.force[falling], expected, rtol=0.03)


@pytest.mark.parametrize(
    ("card", "what"),
    [
        ("  1912000.       0.0", "critical indentation alpha_cr"),
        ("  1912000.   0.00316     0.094", "constant s_p"),
        ("  1912000.   0.00316       0.0       2.0", "unloading power q"),
        ("       0.0   0.00316", "contact coefficient k"),
    ],
)
def test_expe_acr_with_a_wrong_constant_is_an_error(card: str, what: str) -> None:
    (error,) = prepare(acr_deck(card)).errors()
    assert error.code == "E412"
    assert what in error.message


def test_another_word_behind_expe_is_warned_of_and_not_read() -> None:
    prepared = prepare(acr_deck(LAW_CARD.rstrip(), "ARC"))
    assert prepared.errors() == []
    assert "W416" in {finding.code for finding in prepared.findings}
    assert prepared.problems[0].deck.need(Indentation).word == ""


# Named contacts ----------------------------------------------------------------------------------


def test_named_contacts_have_the_coefficients_of_table_3_1() -> None:
    table = {
        "report-0.5": 1.330e6, "report-0.5a": 1.284e6, "report-0.5b": 1.376e6,
        "report-0.75": 1.912e6, "report-0.75a": 1.833e6, "report-0.75b": 1.990e6,
        "yang-0.5": 9.694e5,
    }  # fmt: skip
    assert {name: contact.law.k for name, contact in CONTACTS.items()} == table
    done = call("indent", "contacts", "--format", "json")
    listed = [json.loads(line) for line in done.stdout.splitlines()]
    assert {one["name"]: one["k"] for one in listed} == table


def test_contacts_convert_to_other_units() -> None:
    law = CONTACTS["report-0.5"].converted("mm-N-s")
    assert law.k == pytest.approx(1.330e6 * 4.4482216 / 25.4**1.5, rel=1e-5)
    assert law.alpha_p == pytest.approx(6.564e-4 * 25.4, rel=1e-5)
    assert (law.s_p, law.q) == (0.094, 2.5)


PLATE = ("new", "-", "--size", "6x4", "--mesh", "6x4", "--layup", "[0/90]s", "--ply-thickness",
         ".0265", "--velocity", "115", "--duration", "1e-5")  # fmt: skip


def test_a_new_deck_takes_a_named_contact_in_the_plys_units() -> None:
    done = call(*PLATE, "--material", "report", "--contact", "yang-0.5")
    deck = fecm.read_deck(done.stdout)
    assert isinstance(deck, Deck)
    assert deck.need(Indentation) == Indentation(9.694e5, 3.16e-3, 0.0, 2.5, "ACR")
    metric = call(*PLATE, "--material", "report", "--units", "m-N-s", "--contact", "report-0.75")
    deck = fecm.read_deck(metric.stdout)
    assert isinstance(deck, Deck)
    assert deck.need(Indentation).alpha_p == pytest.approx(6.564e-4 * 0.0254, rel=1e-5)


@pytest.mark.parametrize(
    "options",
    [
        ("--material", "report"),
        ("--material", "report", "--contact", "none"),
        ("--material", "report", "--contact", "yang-0.5", "--law", "1e6,0,0,2"),
        ("--ply", "1e-4,.3,2e7,1e6,8e5,8e5,8e5", "--contact", "yang-0.5"),
    ],
)
def test_a_new_deck_needs_one_law(options: tuple[str, ...]) -> None:
    done = call(*PLATE, *options)
    assert done.exit_code == 2
    assert "--contact" in done.stderr
    assert done.stdout == ""


# The commands ------------------------------------------------------------------------------------


def test_a_curve_of_the_deck_fits_back_to_the_decks_card(tmp_path: Path) -> None:
    made = call("indent", "curve", LONG, "--path", "1e-3,0,2e-3,8e-4,3e-3,0", "--points", 60)
    rows = list(csv.DictReader(io.StringIO(made.stdout)))
    assert len(rows) == 1 + 6 * 60
    at_peak = rows[60]
    assert float(at_peak["indentation"]) == 1e-3
    assert float(at_peak["force"]) == pytest.approx(1.912e6 * 1e-3**1.5, rel=1e-12)
    assert [rows[n]["branch"] for n in (60, 61, 149, 151, 200, 241)] == [
        "loading", "unloading", "reloading", "loading", "unloading", "reloading",
    ]  # fmt: skip
    (tmp_path / "test.csv").write_text(made.stdout)
    done = call("indent", "fit", tmp_path / "test.csv")
    assert done.exit_code == 0
    assert done.stdout.splitlines()[-2:] == ["EXPE", " 1912000.0 0.0006564     0.094       2.0"]


def test_a_fit_for_programs_has_every_value_with_its_error(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a, noisy(f, 0))
    found = json.loads(call("indent", "fit", file, "--format", "json").stdout)
    for name, truth in (("k", K), ("n", 1.5), ("q", Q), ("s_p", S_P), ("alpha_p", ALPHA_P)):
        assert abs(found[name]["value"] - truth) < 4.0 * found[name]["error"]
    assert len(found["cycles"]) == 4
    assert set(found["cycles"][0]) >= {"alpha_m", "alpha_0", "k_1"}
    assert found["card"].startswith("EXPE\n")


def test_a_test_that_never_unloads_tells_k_and_n_alone(tmp_path: Path) -> None:
    a, f = make_test()
    file = written(tmp_path / "test.csv", a[:101], noisy(f[:101], 0))
    done = call("indent", "fit", file)
    assert done.exit_code == 0
    assert "EXPE" not in done.stdout
    assert "never unloads" in done.stderr
    assert float(done.stdout.split(" k ")[1].split()[0]) == pytest.approx(K, rel=0.02)


def test_one_cycle_gives_no_card_but_one_of_alpha_cr(tmp_path: Path) -> None:
    file = written(tmp_path / "test.csv", *make_test((3e-3,)))
    done = call("indent", "fit", file)
    assert done.exit_code == 0
    assert "EXPE" not in done.stdout
    assert "--acr" in done.stderr
    assert call("indent", "fit", file, "--acr").stdout.splitlines()[-2] == "EXPE ACR"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "fewer than two rows"),
        ("indentation,force\n", "fewer than two rows"),
        ("a,b\n1,2\n", "there must be one called indentation"),
        ("indentation;force\n1;2\n", "there must be one called indentation"),
        ("force,force,indentation\n1,2,3\n", "there must be one called force"),
        ("indentation,force\n0,0\n1e-3,x1\n", ":3: force is 'x1'"),
        ("indentation,force\n0,0\n1e-3\n", ":3: force is nothing"),
        ("indentation,force\n0,nan\n0,0\n", ":2: force is 'nan'"),
        ("indentation,force\n" + "0.001,5\n" * 20, "never changes"),
        ("indentation,force\n1,1\n2,2\n", "too few"),
        ("indentation,force\n" + "".join(f"{n},{n}\n" for n in range(30, 0, -1)), "unloading"),
        ("indentation,force\n" + "".join(f"{n},{-n}\n" for n in range(30)), "never positive"),
        ("indentation,force\n" + "".join(f"{n}e90,{n}\n" for n in range(30)), "not between"),
    ],
)
def test_what_is_no_test_is_refused_in_one_line(tmp_path: Path, text: str, what: str) -> None:
    file = tmp_path / "test.csv"
    file.write_text(text)
    done = call("indent", "fit", file)
    assert_unusable(done)
    assert what in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("curve", LONG),
        ("curve", LONG, "--path", "a,b"),
        ("curve", LONG, "--path", "nan"),
        ("curve", LONG, "--path", "1e300"),
        ("curve", LONG, "--path", "1e-3", "--q", "2"),
        ("curve", LONG, "--rigidity", "--path", "1e-3"),
        ("curve", LONG, "--rigidity", "--plot", "rigidity.png"),
        ("curve", LONG.parent / "static-bending.inp", "--path", "1e-3"),
        ("curve", "nowhere.inp", "--path", "1e-3"),
        ("hertz", "--radius", "0", "--es", "1", "--nus", "0", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "1", "--nus", "1", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "nan", "--nus", "0", "--et", "1"),
        ("hertz", "--radius", "1", "--es", "1", "--nus", "0", "--et", "1", "--q", "inf"),
        ("contacts", "none"),
        ("fit", LONG),
    ],
)
def test_wrong_calls_are_refused(arguments: tuple[object, ...]) -> None:
    done = call("indent", *arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert "rror: " in done.stderr
    assert "Traceback" not in done.stderr


def test_a_deck_is_not_replaced_by_its_own_curve(tmp_path: Path) -> None:
    deck = tmp_path / "deck.inp"
    deck.write_text(LONG.read_text())
    done = call("indent", "curve", deck, "--path", "1e-3", "-o", deck, "--overwrite")
    assert_unusable(done)
    assert deck.read_text() == LONG.read_text()


def test_the_picture_of_a_fit_holds_every_point_and_the_line() -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.indentation import fit_picture as draw

    a, f = make_test()
    found = fit(a, noisy(f, 0))
    figure = draw(a, noisy(f, 0), found, {"length": "in", "force": "lbf"}).figure
    curves, line = figure.axes
    assert curves.get_xlabel() == "Indentation (10⁻³ in)"
    assert line.get_ylabel() == "Permanent indentation (10⁻³ in)"
    drawn = [np.asarray(one.get_xdata()) for one in curves.get_lines() if one.get_marker() == "."]
    assert sum(map(len, drawn)) == len(a) - 7  # all but the points at the turns
    x, y = map(np.asarray, line.get_lines()[-1].get_data())
    assert found.line is not None
    slope = (y[-1] - y[-2]) / (x[-1] - x[-2])
    assert slope == pytest.approx(found.line.s_p.value, rel=1e-9)


@pytest.mark.parametrize("options", [("--path", "2e-3,0"), ("--rigidity", "--q", "2.5")])
def test_curves_and_rigidities_are_drawn(tmp_path: Path, options: tuple[str, ...]) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "curve.svg"
    done = call("indent", "curve", LONG, *options, "--plot", picture)
    assert done.exit_code == 0
    assert "Indentation" in picture.read_text() or "indentation" in picture.read_text()
    again = call("indent", "curve", LONG, *options, "--plot", picture)
    assert_unusable(again)
