"""Random sweeps: laws, designs, Sobol' indices, probabilities, and what becomes of them."""

from __future__ import annotations

import ast
import csv
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm._errors import ResultFileError
from fecm.authoring.case import CasesError
from fecm.problem.loading import load_deck
from fecm.sweeps.distributions import ValueDistribution
from fecm.sweeps.plan import plan
from fecm.sweeps.random import DESIGNS, Design, DesignKind, matrix, random_cases, unit_samples
from fecm.sweeps.statistics import QUANTILES, Indices, indices, wilson
from tests.calls import Done, assert_unusable, call
from tests.decks import DATA, DATA_CARDS, small
from tests.pictures import footer_of

Floats = NDArray[np.float64]

# A rigid mass on a plate too heavy to move, through the loading branch of the law: Hertz's impact.
# Its peak force is k^0.4 (5/4 M v^2)^0.6.
HERTZ = """\
FECM RIGID MASS ON A PLATE THAT CANNOT MOVE
    9    1    1    2    5    9
COOR
    1    1       0.0       0.0
    3    0       2.0       0.0
    4    1       0.0       1.0
    6    0       2.0       1.0
    7    1       0.0       2.0
    9    0       2.0       2.0

ELEM
    1    1    3    9    7    2    6    8    4    5    1

BOUN
    1    1   -1   -1    0    0    0
    9    0    1    1    0    0    0

ROD
    5    3     115.0
PROJ
0,0,1.81E-4
EXPE
  1912000.        1.     0.094       2.0
MATE
    3    3   -3      .106
      1.E6       0.3 17500000.  1150000.   800000.   800000.   800000.
    1   0.     0.106
END
MACR
LMAS
DT        .4E-6
LOOP        400
TIME
RODP        400
NEXT
END
STOP
"""
# The same with fewer steps.
QUICK = HERTZ.replace("       .4E-6", "       2.E-6").replace("        400", "         90")
LAWS = {"k": "lognormal:1912000,0.15", "rod_mass": "lognormal:0.000181,0.02",
        "velocity": "lognormal:115,0.08"}  # fmt: skip
UNIFORM = ("--random", "k=uniform:1,2", "--samples", 16)
NORMAL = ("--random", "k=normal:1.9e6,1e6", "--samples", 64)
pytestmark = pytest.mark.filterwarnings("ignore::fecm.FecmWarning")


def tables() -> list[list[dict[str, str]]]:
    """Tables of the file of closed forms."""
    parts = (DATA / "lognormal_hertz.csv").read_text().strip().split("\n\n")
    return [list(csv.DictReader(part.splitlines())) for part in parts]


def exact_indices() -> Floats:
    """First-order and total indices of Hertz's peak force, (2, 3)."""
    names = ("first-order Sobol of F", "total Sobol of F")
    return np.array([[float(row[name]) for row in tables()[0]] for name in names])


def assert_inside(actual: Indices, exact: Floats) -> None:
    """The exact indices lie in the intervals of the estimated ones."""
    for interval, values in zip((actual.first_interval, actual.total_interval), exact, strict=True):
        low, high = interval.reshape(-1, 2).T
        assert ((low <= values) & (values <= high)).all()


def ishigami(kind: DesignKind, samples: int, seed: int) -> Indices:
    law = ValueDistribution("uniform", (-np.pi, np.pi))
    design = Design({f"x{i}": law for i in range(3)}, samples, seed, kind, sensitivity=True)
    x, y, z = matrix(design).T
    values = np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    return indices(values.reshape(1, 5, samples), seed)


def ishigami_exact() -> Floats:
    with (DATA / "ishigami.csv").open() as file:
        rows = dict(list(csv.reader(file))[1:])
    return np.array([[float(rows[f"{kind}{i}"]) for i in (1, 2, 3)] for kind in "ST"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("random")
    (built / "small.inp").write_text(QUICK)
    options = ("--random", "k=uniform:1e6,3e6", "--random", "velocity=normal:115,9")
    done = call(
        "sweep",
        "small.inp",
        *options,
        "--samples",
        32,
        "--sensitivity",
        "--exceed",
        "peak_force=600",
        "-o",
        "one.h5",
        cwd=built,
    )
    assert done.exit_code == 0
    return built


def sweep(folder: Path, *options: object) -> Done:
    return call("sweep", "small.inp", *options, "-o", "new.h5", "--overwrite", cwd=folder)


def test_laws_are_those_of_scipy() -> None:
    from scipy import stats

    unit = np.linspace(0.001, 0.999, 99)
    for law, exact in (
        (ValueDistribution("normal", (3.0, 0.5)), stats.norm(3.0, 0.5)),
        (ValueDistribution("lognormal", (3.0, 0.5)), stats.lognorm(0.5, scale=3.0)),
        (ValueDistribution("weibull", (3.0, 0.5)), stats.weibull_min(0.5, scale=3.0)),
        (ValueDistribution("weibull", (2.5e3, 20.0)), stats.weibull_min(20.0, scale=2.5e3)),
        (
            ValueDistribution("truncnormal", (3.0, 0.5, 2.9, 4.0)),
            stats.truncnorm(-0.2, 2.0, 3.0, 0.5),
        ),
        (ValueDistribution("truncnormal", (0.0, 1.0, 5.0, 6.0)), stats.truncnorm(5.0, 6.0)),
        (ValueDistribution("truncnormal", (0.0, 1.0, -5.0, -4.0)), stats.truncnorm(-5.0, -4.0)),
        (ValueDistribution("uniform", (-1.0, 3.0)), stats.uniform(-1.0, 4.0)),
        (ValueDistribution("triangular", (-1.0, 0.5, 3.0)), stats.triang(0.375, -1.0, 4.0)),
        (ValueDistribution("triangular", (0.0, 0.0, 3.0)), stats.triang(0.0, 0.0, 3.0)),
        (ValueDistribution("triangular", (0.0, 3.0, 3.0)), stats.triang(1.0, 0.0, 3.0)),
    ):
        np.testing.assert_allclose(law.values(unit), exact.ppf(unit), rtol=1e-12)


@pytest.mark.parametrize("kind", ["lhs", "sobol"])
def test_a_design_has_one_sample_in_each_of_n_equal_intervals(kind: DesignKind) -> None:
    unit = unit_samples(kind, 64, 6, 3)
    np.testing.assert_array_equal(np.sort((64 * unit).astype(int), axis=0).T, [range(64)] * 6)


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_seed_decides_the_design(kind: DesignKind) -> None:
    first, again, other = (unit_samples(kind, 32, 2, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


def test_the_mixed_matrices_are_a_with_one_column_of_b() -> None:
    laws = {name: ValueDistribution("uniform", (0.0, 1.0)) for name in ("k", "q", "velocity")}
    a, b, *mixed = matrix(Design(laws, 16, sensitivity=True)).reshape(5, 16, 3)
    for column, actual in enumerate(mixed):
        kept = [other for other in range(3) if other != column]
        np.testing.assert_array_equal(actual[:, column], b[:, column])
        np.testing.assert_array_equal(actual[:, kept], a[:, kept])
    assert not np.isin(a, b).any()


def test_the_indices_of_ishigamis_function_are_the_exact_ones() -> None:
    actual, exact = ishigami("sobol", 4096, 0), ishigami_exact()
    assert_inside(actual, exact)
    np.testing.assert_allclose([actual.first[0], actual.total[0]], exact, atol=2e-3)


@pytest.mark.long
def test_95_percent_of_the_intervals_cover_the_exact_indices() -> None:
    exact = ishigami_exact()
    covered = []
    for seed in range(200):
        built = ishigami("mc", 1024, seed)
        for interval, values in zip(
            (built.first_interval, built.total_interval), exact, strict=True
        ):
            covered.append((interval[0, :, 0] <= values) & (values <= interval[0, :, 1]))
    assert np.mean(covered) == pytest.approx(0.95, abs=0.02)


def test_a_constant_quantity_has_no_indices() -> None:
    values = np.random.default_rng(0).normal(size=(3, 3, 64))
    values[1] = 4.2
    values[2, 2, 5] = np.nan
    actual = indices(values, 0)
    assert np.isfinite(actual.total_interval[0]).all()
    assert all(np.isnan(part[1]).all() for part in actual)
    assert np.isnan(actual.total[2]).all()


def test_resamples_without_variance_and_infinite_values_give_no_interval_and_no_warning() -> None:
    values = np.ones((2, 4, 32))
    values[0, 2, 3] = values[0, 0, 5] = 2.0  # a resample may lack row 5 and have row 3
    values[1, 0] = np.linspace(0.0, 1.0, 32)
    values[1, 2, 3] = np.inf
    with warnings.catch_warnings(action="error"):
        actual = indices(values, 0)
    assert np.isfinite(actual.total[0]).all()
    assert np.isnan(actual.total_interval[0]).all()
    assert all(np.isnan(part[1]).all() for part in actual)


def test_the_interval_of_a_probability_is_wilsons() -> None:
    from scipy import stats

    for hits, count in ((0, 16), (3, 40), (4004, 4096), (64, 64)):
        exact = stats.binomtest(hits, count).proportion_ci(method="wilson")
        actual = wilson(np.array(hits), np.array(count))
        np.testing.assert_allclose(actual, [exact.low, exact.high], rtol=1e-9, atol=1e-15)


def test_random_masses_hit_as_in_their_own_runs() -> None:
    values = [1.5e-4, 1.8e-4, 2.4e-4]
    swept = fecm.sweep(fecm.read_one(HERTZ), {"rod_mass": values})
    for mass, peak in zip(values, swept["peak_force"], strict=True):
        assert peak == pytest.approx(1912000**0.4 * (1.25 * mass * 115.0**2) ** 0.6, rel=4e-5)
    plate = fecm.read_one(small(data=f"PROJ\n0,0,2e-4\n{DATA_CARDS}"))
    swept = fecm.sweep(plate, {"rod_mass": values}, history=True)
    assert swept.force is not None
    for mass, force in zip(values, swept.force, strict=True):
        own = fecm.run_one(plate.with_(rod_mass=mass)).force
        np.testing.assert_allclose(force, own, rtol=1e-12)


def check_hertz(swept: fecm.SweepResult) -> None:
    """Compare a sensitivity study of Hertz's impact with the closed forms."""
    random = swept.random
    assert random is not None
    assert_inside(random.sensitivity["peak_force"], exact_indices())
    peak_force = random.statistics["peak_force"]
    moments, limits, quantiles = tables()[1:]
    error = float(moments[0]["standard deviation"]) / np.sqrt(peak_force.draws)
    assert peak_force.mean == pytest.approx(float(moments[0]["mean"]), abs=2.0 * float(error))
    for row, q, value in zip(quantiles, QUANTILES, peak_force.quantiles, strict=True):
        assert float(row["quantile"]) == q
        spread = float(moments[0]["standard deviation"]) * np.sqrt(q * (1.0 - q) / peak_force.draws)
        density = max(0.05, 4.0 * q * (1.0 - q) * 0.4)  # at least that of a normal law, times SD
        assert value == pytest.approx(float(row["F"]), abs=2.0 * float(spread) / density)
    exact = {float(row["threshold lb"]): float(row["P(F > threshold)"]) for row in limits}
    for limit, low, high in zip(
        random.exceedance.limit, random.exceedance.lower, random.exceedance.upper, strict=True
    ):
        assert low <= exact[limit] <= high


def test_a_small_study_of_hertzs_impact_agrees_with_the_closed_forms() -> None:
    check_hertz(
        fecm.sweep(
            fecm.read_one(QUICK),
            random=LAWS,
            samples=256,
            design="sobol",
            sensitivity=True,
            exceed={"peak_force": [500.0, 600.0]},
        )
    )


@pytest.mark.long
def test_4096_samples_of_hertzs_impact_agree_with_the_closed_forms() -> None:
    check_hertz(
        fecm.sweep(
            fecm.read_one(HERTZ),
            random=LAWS,
            samples=4096,
            design="sobol",
            sensitivity=True,
            exceed={"peak_force": [450.0, 500.0, 550.0, 600.0]},
        )
    )


def test_the_same_seed_gives_the_same_bytes(folder: Path) -> None:
    options = ("--random", "k=uniform:1e6,3e6", "--random", "velocity=normal:115,9",
               "--samples", 32, "--sensitivity", "--exceed", "peak_force=600")  # fmt: skip
    assert sweep(folder, *options).exit_code == 0
    first = (folder / "one.h5").read_bytes()
    assert (folder / "new.h5").read_bytes() == first
    assert sweep(folder, *options, "--seed", 1).exit_code == 0
    assert (folder / "new.h5").read_bytes() != first


def test_the_cases_of_a_design_identify_an_interrupted_sweep() -> None:
    problem = load_deck(fecm.read_one(small())).problems[0]
    by_name = {
        seed: plan(problem, random_cases(design, [{}]), design=design).fingerprint()
        for seed in (0, 1)
        for design in [Design({"k": ValueDistribution("uniform", (1e6, 2e6))}, 16, seed)]
    }
    assert by_name[0] != by_name[1]


def test_a_file_gives_back_the_results_of_the_sweep(folder: Path) -> None:
    loaded = fecm.load_sweep(folder / "one.h5")
    again = fecm.sweep(
        folder / "small.inp",
        random={"k": "uniform:1e6,3e6", "velocity": "normal:115,9"},
        samples=32,
        sensitivity=True,
        exceed={"peak_force": 600},
    )
    assert loaded.random is not None
    assert again.random is not None
    assert loaded.random.design == again.random.design
    pairs: list[tuple[Any, Any]] = [(loaded.random.exceedance, again.random.exceedance)]
    for name in again.random.statistics:
        pairs.append((loaded.random.statistics[name], again.random.statistics[name]))
        pairs.append((loaded.random.sensitivity[name], again.random.sensitivity[name]))
    for a, b in pairs:
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)


def test_the_statistics_are_those_of_the_draws(folder: Path) -> None:
    loaded = fecm.load_sweep(folder / "one.h5")
    assert loaded.random is not None
    force = loaded["peak_force"][:64]  # 128 cases, of which A and B are independent
    peak_force = loaded.random.statistics["peak_force"]
    assert peak_force.draws == 64
    assert peak_force.mean == force.mean()
    assert peak_force.standard_deviation == pytest.approx(force.std(ddof=1), rel=1e-12)
    np.testing.assert_array_equal(peak_force.quantiles, np.quantile(force, QUANTILES))
    assert loaded.random.exceedance.probability == [(force > 600.0).mean()]


def test_info_diff_and_export_read_the_file(folder: Path) -> None:
    stdout = call("info", "one.h5", cwd=folder).stdout
    assert "  design            lhs, 32 samples, seed 0\n" in stdout
    assert "  law = uniform\n  parameters = [1e+06, 3e+06]\n" in stdout
    assert call("diff", "one.h5", "one.h5", cwd=folder).exit_code == 0
    done = call("export", "one.h5", "--to", "csv", "-o", "-", cwd=folder)
    assert done.stdout.startswith("case,k,velocity,peak_force,")
    assert len(done.stdout.splitlines()) == 129


def test_the_axes_of_the_file_are_named(folder: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    group = "sensitivity/peak_force"
    with xarray.open_dataset(folder / "one.h5", group=group, engine="h5netcdf") as actual:
        assert actual.first_interval.dims == ("random_name", "bound")


def test_every_combination_of_varied_values_gets_the_same_draws(folder: Path) -> None:
    random = {"k": "normal:1.9e6,1e5"}
    swept = fecm.sweep(
        folder / "small.inp",
        {"velocity": [50.0, 115.0]},
        random=random,
        samples=16,
        exceed={"peak_force": [500.0, 600.0]},
        output=folder / "two.h5",
    )
    np.testing.assert_array_equal(swept["k"][:16], swept["k"][16:])
    np.testing.assert_array_equal(swept["velocity"], np.repeat([50.0, 115.0], 16))
    assert swept.random is not None
    force = swept["peak_force"].reshape(2, 16)
    np.testing.assert_array_equal(swept.random.statistics["peak_force"].mean, force.mean(axis=1))
    exceeded = np.column_stack([(force > limit).mean(axis=1) for limit in (500.0, 600.0)])
    np.testing.assert_array_equal(swept.random.exceedance.probability, exceeded)
    loaded = fecm.load_sweep(folder / "two.h5").random
    assert loaded is not None
    assert loaded.label(1) == "velocity 115.0"


def test_a_threshold_of_the_deck_is_a_limit(folder: Path) -> None:
    (folder / "dela.inp").write_text(QUICK.replace("EXPE", "DELA\n1.\nEXPE"))
    options = ("--random", "velocity=uniform:20,115", "--samples", 64, "--exceed")
    call("sweep", "dela.inp", *options, "peak_force=threshold", "-o", "dela.h5", cwd=folder)
    swept = fecm.load_sweep(folder / "dela.h5")
    assert swept.random is not None
    above = swept["peak_force"] > swept["threshold_force"]
    assert 0.0 < above.mean() < 1.0
    assert swept.random.exceedance.probability == [above.mean()]
    assert swept.random.exceedance.limit == swept["threshold_force"][:1]


@pytest.mark.parametrize(
    ("law", "ends"), [("velocity=uniform:20,115", 1), ("giic=uniform:0.5,1.5", 2)]
)
def test_the_picture_draws_the_thresholds_of_the_deck_without_being_asked(
    law: str, ends: int
) -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.pictures import draw

    deck = QUICK.replace("EXPE", "DELA\n1.\nEXPE")
    swept = fecm.sweep(deck, random=[law], samples=16)
    picture = draw("exceedance", {"one": swept})
    (axes,) = picture.figure.axes
    marks: Any = [line for line in axes.get_lines() if "delamination" in str(line.get_label())]
    drawn = [line.get_xdata()[0] for line in marks if len(line.get_xdata())]
    for area in axes.patches:
        drawn += area.get_extents().transformed(axes.transData.inverted()).intervalx.tolist()
    thresholds = swept["threshold_force"]
    assert drawn == pytest.approx([thresholds.min(), thresholds.max()][:ends])
    share = (swept["peak_force"] > thresholds).mean()
    assert f") = {share:.4g} (" in picture.notes[0]
    assert picture.notes[0].split(" (")[0] in " ".join(footer_of(picture.figure).split())


def test_impossible_draws_are_failed_cases_and_their_share_is_told(folder: Path) -> None:
    done = sweep(folder, *NORMAL)
    failed = int((fecm.load_sweep(folder / "new.h5")["k"] <= 0.0).sum())
    assert failed > 0
    assert f"failed share      {failed / 64:.3%} of the draws\n" in done.stdout
    assert f"{failed / 64:.3%} of the draws failed" in done.stderr
    assert done.exit_code == 1
    assert sweep(folder, *NORMAL, "--allow-failed").exit_code == 0


def test_impossible_draws_are_refused_before_a_sensitivity_study(folder: Path) -> None:
    done = sweep(folder, *NORMAL, "--sensitivity")
    assert_unusable(done)
    assert "lognormal" in done.stderr


def test_the_cost_is_told_beforehand(folder: Path) -> None:
    done = sweep(folder, "--random", "e1=normal:17.5e6,5e5", "--samples", 16, "--design", "mc")
    assert "16 draws need 16 plates, because e1 is random" in done.stderr
    done = sweep(folder, "--random", "k=uniform:1e6,2e6", "--samples", 17, "--design", "sobol")
    assert "17 draws share 1 plate" in done.stderr
    assert "17 samples are not a power of 2" in done.stderr
    assert "take 16" in done.stderr
    done = sweep(folder, "--random", "velocity=lognormal:50,2", "--samples", 16, "--design", "mc")
    assert "of the logarithm; a standard deviation of 2 is SIGMA 0.04\n" in done.stderr


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--random", "k=normal:1e6,0", "--samples", 16), "SD must be positive"),
        (("--random", "k=uniform:2,1", "--samples", 16), "A must be less than B"),
        (("--random", "k=triangular:1,3,2", "--samples", 16), "MODE must be from A to B"),
        (("--random", "k=lognormal:1e6", "--samples", 16), "lognormal:MEDIAN,SIGMA"),
        (("--random", "k=lognormal:1e6,nan", "--samples", 16), "lognormal:MEDIAN,SIGMA"),
        (("--random", "k=gauss:1,2", "--samples", 16), "the laws are normal:MEAN,SD"),
        (("--random", "k=weibull:2e6,-5", "--samples", 16), "SCALE and SHAPE must be positive"),
        (("--random", "k=weibull:2e6,1e-3", "--samples", 16), "beyond the range"),
        (("--random", "k=truncnormal:2e6,1,3e6,2e6", "--samples", 16), "A less than B"),
        (("--random", "k=truncnormal:2e6,1,3e6,4e6", "--samples", 16), "1e-06 or more"),
        (("--random", "k=truncnormal:2e6,1,3e6", "--samples", 16), "truncnormal:MEAN,SD,A,B"),
        ((*UNIFORM, "--correlation", "k=0.5"), "NAME,NAME=RHO"),
        ((*UNIFORM, "--correlation", "k,q=x"), "RHO of k,q must be a finite number"),
        ((*UNIFORM, "--correlation", "k,q=0.5"), "is not a pair of random names (k)"),
        (("--vary", "k=1e6", "--correlation", "k,q=0.5"), "--correlation needs --random"),
        (("--random", "k", "--samples", 16), "NAME=LAW"),
        (("--random", "layup=uniform:1,2", "--samples", 16), "the names are velocity"),
        (("--random", "kk=uniform:1,2", "--samples", 16), "did you mean k?"),
        (("--random", "k=uniform:1e6,2e6", "--samples", 15), "at least 16"),
        (("--random", "k=uniform:1e6,2e6"), "needs --samples"),
        (("--random", "k=lognormal:42000,8000", "--samples", 16),
         "of the logarithm; a standard deviation of 8000 is SIGMA 0.19; it is at most 3"),
        (("--random", "k=lognormal:1e308,3", "--samples", 16), "beyond the range"),
        (("--random", "k=uniform:1e6,2e6", "--samples", 16, "--seed", -1), "seed"),
        (("--random", "k=uniform:1e6,2e6", "--samples", 2_000_000), "at most 1000000"),
        (("--random", "k=uniform:1,2", "--random", "k=uniform:1,2", "--samples", 16), "twice"),
        (("--random", "k=uniform:1,2", "--vary", "k=1e6", "--samples", 16), "varied and random"),
        (("--random", "k=uniform:1,2", "--cases", "small.inp", "--samples", 16), "--vary"),
        (("--vary", "k=1e6", "--samples", 16), "--samples needs --random"),
        (("--vary", "k=1e6", "--sensitivity"), "--sensitivity needs --random"),
        ((*UNIFORM, "--exceed", "f=1"), "no quantity `f`"),
        ((*UNIFORM, "--exceed", "contacts"), "QUANTITY=NUMBER"),
        ((*UNIFORM, "--exceed", "contacts=x"), "finite number"),
        ((*UNIFORM, "--exceed", "peak_force=threshold"), "DELA"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(folder: Path, options: tuple[object, ...], told: str) -> None:
    done = sweep(folder, *options)
    assert_unusable(done)
    assert told in done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"samples": 16}, "random values"),
        ({"random": {}}, "random is"),
        ({"random": {"k": "uniform:1,2"}}, "`random` needs `samples`"),
        ({"random": {"k": 3.0}, "samples": 16}, "not a law"),
        ({"random": {"k": "uniform:1,2"}, "samples": 16, "seed": 0.5}, "seed of random values"),
        ({"random": {"k": "uniform:1,2"}, "samples": 16, "exceed": [3]}, "exceed is"),
        ({"random": {"k": "uniform:1,2"}, "samples": 16, "exceed": {"q": None}}, "not `None`"),
        (
            {
                "random": {"k": "uniform:1,2"},
                "samples": 16,
                "exceed": {"contakts": 1},
                "measure": "max_deflection",
            },
            "no quantity `contakts`",
        ),
        ({"random": {"k": "uniform:1,2"}, "samples": 16, "design": "halton"}, ", ".join(DESIGNS)),
        ({"random": {"k": "uniform:1,2"}, "cases": [{"q": 2.0}]}, "`cases` excludes `random`"),
        ({"random": {"case": "uniform:1,2"}, "samples": 16, "build": len}, "name of the results"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], told: str) -> None:
    deck = None if "build" in arguments else fecm.read_one(small())
    with pytest.raises(CasesError, match=told):
        fecm.sweep(deck, **arguments)


def test_the_mapping_that_the_message_about_random_shows_is_one() -> None:
    with pytest.raises(CasesError) as refused:
        fecm.sweep(small(), random={})
    shown = ast.literal_eval(str(refused.value).partition("such as ")[2])
    swept = fecm.sweep(small(), random=shown, samples=16)
    assert swept.random is not None


def test_an_incomplete_file_is_refused(folder: Path) -> None:
    import h5py

    copy = folder / "damaged.h5"
    for damage in ("statistics/peak_force", "sensitivity", "random/k"):
        copy.write_bytes((folder / "one.h5").read_bytes())
        with h5py.File(copy, "r+") as file:
            del file[damage]
        with pytest.raises(ResultFileError, match="incomplete"):
            fecm.load_sweep(copy)


def test_pictures_need_a_random_sweep(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    kinds = "exceedance", "sensitivity", "scatter"
    asked = [word for kind in kinds for word in ("--kind", kind)]
    assert call("plot", "one.h5", *asked, "-o", tmp_path, cwd=folder).exit_code == 0
    call("sweep", folder / "small.inp", "--vary", "k=1e6,2e6", "-o", "plain.h5", cwd=tmp_path)
    for kind in kinds:
        done = call("plot", "plain.h5", "--kind", kind, cwd=tmp_path)
        assert_unusable(done)
        assert "no random values" in done.stderr


@pytest.mark.parametrize("kind", ["exceedance", "sensitivity", "scatter"])
@pytest.mark.parametrize("width", ["column", "full"])
@pytest.mark.few(1)  # of 6, 0.3 s each
def test_the_line_of_doubtful_draws_is_not_cut(
    folder: Path, kind: str, width: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.pictures import draw

    words = "beyond the linear plate and a few other limits of the model (w > 0.3 h)"
    monkeypatch.setattr(
        "fecm.plot.random_sweep.beyond", lambda _, rows: {words: np.ones(len(rows), bool)}
    )
    options: Any = {"width": width}
    loaded = fecm.load_sweep(folder / "one.h5")
    figure = draw(kind, {"one": loaded}, **options).figure
    text = " ".join(footer_of(figure).split())
    assert re.fullmatch(rf"(P\(.*\) )?{re.escape(words)}: (\d+) of \2 cases", text)


def test_the_picture_of_exceedance_goes_through_the_probabilities(folder: Path) -> None:
    pytest.importorskip("matplotlib")
    from fecm.plot.pictures import draw

    loaded = fecm.load_sweep(folder / "one.h5")
    assert loaded.random is not None
    picture = draw("exceedance", {"one": loaded})
    curve = picture.figure.axes[0].get_lines()[0]
    x, y = np.asarray(curve.get_xdata(), float), np.asarray(curve.get_ydata(), float)
    assert np.interp(600.0, x, y) == pytest.approx(loaded.random.exceedance.probability, abs=1 / 64)
    assert picture.notes[0].startswith("P(peak_force > 600) = ")
    (named,) = picture.figure.legends[0].get_texts()
    assert named.get_text().split()[:2] == ["limit", "600"]
