"""Laws of random values that are objects, and correlated values."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm._errors import ResultFileError
from fecm.authoring.case import CasesError
from fecm.sweeps.distributions import ValueDistribution
from fecm.sweeps.random import DESIGNS, Design, DesignKind, correlation_of, matrix
from tests.calls import call
from tests.decks import DATA_CARDS, small

NORMAL = ValueDistribution("normal", (0.0, 1.0))
PAIR = {"k": "normal:2e6,1e5", "velocity": "normal:100,5"}


def drawn(
    kind: DesignKind, rho: float, laws: tuple[ValueDistribution, ValueDistribution], samples: int
) -> NDArray[Any]:
    """Correlated draws of two laws, (2, samples)."""
    correlation = correlation_of(["a", "b"], {("a", "b"): rho})
    return matrix(
        Design(dict(zip("ab", laws, strict=True)), samples, 3, kind, correlation=correlation)
    ).T


@pytest.mark.parametrize("kind", DESIGNS)
@pytest.mark.parametrize("rho", [-0.9, 0.0, 0.6])
def test_correlated_normal_values_have_the_probabilities_of_quadrants(
    kind: DesignKind, rho: float
) -> None:
    a, b = drawn(kind, rho, (NORMAL, NORMAL), 2**14)
    # W. F. Sheppard, Phil. Trans. A 192 (1899) 101: of two standard normal values
    both = 0.25 + math.asin(rho) / (2.0 * math.pi)
    assert ((a > 0.0) & (b > 0.0)).mean() == pytest.approx(both, abs=4.0 * 0.5 / 2**7)
    assert np.corrcoef(a, b)[0, 1] == pytest.approx(rho, abs=4.0 / 2**7)


@pytest.mark.parametrize("kind", DESIGNS)
def test_correlated_values_keep_their_laws(kind: DesignKind) -> None:
    from scipy import stats

    a, b = drawn(
        kind,
        0.8,
        (ValueDistribution("weibull", (2.0, 3.0)), ValueDistribution("lognormal", (5.0, 0.4))),
        4096,
    )
    assert stats.kstest(a, stats.weibull_min(3.0, scale=2.0).cdf).pvalue > 0.01
    assert stats.kstest(b, stats.lognorm(0.4, scale=5.0).cdf).pvalue > 0.01
    # Pearson (1907): the rank correlation of two normal values, which monotone laws keep
    ranks = 6.0 / math.pi * math.asin(0.4)
    assert stats.spearmanr(a, b).statistic == pytest.approx(ranks, abs=4.0 / 64.0)


def test_a_correlated_latin_hypercube_has_one_sample_in_each_interval() -> None:
    uniform = ValueDistribution("uniform", (0.0, 64.0))
    for values in drawn("lhs", 0.9, (uniform, uniform), 64):
        np.testing.assert_array_equal(np.sort(values.astype(int)), range(64))


def test_the_variance_of_a_sum_is_that_of_correlated_values() -> None:
    names = ["x", "y", "z"]
    covariance = np.array([[4.0, 3.0, -1.0], [3.0, 9.0, 0.0], [-1.0, 0.0, 1.0]])
    sd = np.sqrt(covariance.diagonal())
    correlation = correlation_of(names, covariance / np.outer(sd, sd))
    laws = {
        name: ValueDistribution("normal", (0.0, size)) for name, size in zip(names, sd, strict=True)
    }
    values = matrix(Design(laws, 2**14, 1, "sobol", correlation=correlation))
    weights = np.array([1.0, -2.0, 3.0])
    exact = weights @ covariance @ weights
    assert (values @ weights).var() == pytest.approx(exact, rel=0.02)


def test_pairs_a_matrix_and_a_named_table_are_the_same_correlations() -> None:
    pandas = pytest.importorskip("pandas")
    names = ["k", "q", "velocity"]
    rows = [[1.0, 0.0, 0.3], [0.0, 1.0, -0.5], [0.3, -0.5, 1.0]]
    table = pandas.DataFrame(rows, names, names).loc[["velocity", "k", "q"], ["q", "velocity", "k"]]
    for given in ({("k", "velocity"): 0.3, ("velocity", "q"): -0.5}, np.array(rows), table):
        assert correlation_of(names, given) == tuple(map(tuple, rows))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], "not positive definite.* eigenvalue is -1$"),
        ([[1.0, 0.5], [0.4, 1.0]], "symmetric"),
        ([[2.0, 0.5], [0.5, 1.0]], "1 on its diagonal"),
        ([[1.0, math.nan], [math.nan, 1.0]], "2 x 2 numbers"),
        ([1.0, 0.5], "2 x 2 numbers, one row for each of k, velocity"),
        ("high", "write NAME,NAME=RHO"),
        ({("k", "q"): 0.5}, r"\('k', 'q'\) is not a pair of random names \(k, velocity\)"),
        ({"k": 0.5}, "'k' is not a pair"),
        ({("k", "k"): 0.5}, "k, k is one name"),
        ({("k", "velocity"): 0.5, ("velocity", "k"): 0.5}, "velocity, k .*twice"),
        ({("k", "velocity"): 1.0}, "between -1 and 1, not 1.0"),
        ({("k", "velocity"): "much"}, "between -1 and 1, not much"),
    ],
)
def test_correlations_that_no_values_have_are_refused(given: Any, message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), random=PAIR, samples=16, correlation=given)


def test_indices_of_correlated_values_are_refused() -> None:
    given: Any = {("k", "velocity"): 0.5}
    with pytest.raises(CasesError, match="Sobol' indices need independent values"):
        fecm.sweep(small(), random=PAIR, samples=16, correlation=given, sensitivity=True)
    with pytest.raises(CasesError, match=r"`correlation` needs `random`"):
        fecm.sweep(small(), {"k": [1e6]}, correlation=given)


class Measured:
    """A law through three measured quantiles."""

    def ppf(self, probabilities: NDArray[Any]) -> NDArray[Any]:
        """Return quantiles."""
        return np.asarray(np.interp(probabilities, [0.0, 0.5, 1.0], [90.0, 99.0, 120.0]))


def test_an_object_with_quantiles_is_a_law(tmp_path: Path) -> None:
    from scipy import stats

    random: dict[str, Any] = {
        "k": stats.weibull_min(5, scale=2e6),
        "velocity": Measured(),
    }
    text = {**random, "k": "weibull:2e6,5"}
    swept = fecm.sweep(small(), random=random, samples=16, output=tmp_path / "s.h5")
    same = fecm.sweep(small(), random=text, samples=16)
    np.testing.assert_allclose(swept["k"], same["k"], rtol=1e-12)
    assert np.median(swept["velocity"]) == pytest.approx(99.0, abs=1.0)
    assert swept.random is not None
    assert str(swept.random.design.laws["k"]) == "weibull_min(5, scale=2000000.0)"
    assert str(swept.random.design.laws["velocity"]) == "Measured"
    loaded = fecm.load_sweep(tmp_path / "s.h5").random
    assert loaded is not None
    assert loaded.design == swept.random.design == pickle.loads(pickle.dumps(swept)).random.design
    with pytest.raises(CasesError, match=r"the draws of weibull_min.*, not the law"):
        matrix(loaded.design)


def test_a_new_distribution_of_scipy_is_a_law() -> None:
    from scipy import stats

    class Inverse:
        """A law with the quantiles of N(2e6, 1e5) under the new name of scipy.stats."""

        icdf = staticmethod(stats.norm(2e6, 1e5).ppf)

    laws: list[Any] = [Inverse()]
    if hasattr(stats, "Normal"):  # since scipy 1.15
        laws.append(stats.Normal(mu=2e6, sigma=1e5))
    wanted = fecm.sweep(small(), random={"k": "normal:2e6,1e5"}, samples=16)
    for law in laws:
        swept = fecm.sweep(small(), random={"k": law}, samples=16)
        np.testing.assert_allclose(swept["k"], wanted["k"], rtol=1e-12)


def test_a_distribution_without_parameters_is_refused() -> None:
    from scipy import stats

    # Its mean 0 and deviation 1 made half of all stiffnesses negative.
    with pytest.raises(CasesError, match="k: norm has no parameters; call it with them first"):
        fecm.sweep(small(), random={"k": stats.norm}, samples=16)
    with pytest.raises(CasesError, match="k: Measured has no parameters"):
        fecm.sweep(small(), random={"k": Measured}, samples=16)  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("ppf", "message"),
    [
        (lambda p: 1.0 / 0.0, "k: ppf of .* failed: float division by zero"),
        (lambda p: p[1:], r"k: ppf of .* values of the shape \(15,\) for probabilities \(16,\)"),
        (lambda p: p * math.nan, "k: ppf of .* values that are not finite"),
    ],
)
def test_what_is_wrong_with_an_object_is_told_of_it(ppf: Any, message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), random={"k": SimpleNamespace(ppf=ppf)}, samples=16)


def test_a_file_has_the_correlations_and_the_command_shows_them(tmp_path: Path) -> None:
    import h5py

    (tmp_path / "small.inp").write_text(small(data=DATA_CARDS))
    laws = [word for name, law in PAIR.items() for word in ("--random", f"{name}={law}")]
    rho = ("--correlation", "velocity, k=-0.7")
    done = call("sweep", "small.inp", *laws, *rho, "--samples", 16, "-o", "s.h5", cwd=tmp_path)
    assert "  correlation       k, velocity -0.7\n" in done.stdout
    again = fecm.sweep(
        tmp_path / "small.inp", random=PAIR, samples=16, correlation=[[1.0, -0.7], [-0.7, 1.0]]
    )
    loaded = fecm.load_sweep(tmp_path / "s.h5")
    np.testing.assert_array_equal(loaded["k"], again["k"])
    assert loaded.random is not None
    assert loaded.random.design.correlation == ((1.0, -0.7), (-0.7, 1.0))
    with h5py.File(tmp_path / "s.h5", "r+") as file:
        file["design"].attrs["correlation"] = np.ones((2, 2))
    with pytest.raises(ResultFileError, match="incomplete"):
        fecm.load_sweep(tmp_path / "s.h5")


def test_a_sweep_without_correlations_says_nothing_of_them(tmp_path: Path) -> None:
    import h5py

    fecm.sweep(small(), random=PAIR, samples=16, output=tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        assert "correlation" not in file["design"].attrs


def test_a_shape_that_looks_like_a_scale_is_noted() -> None:
    with pytest.warns(fecm.FecmWarning, match=r"SHAPE of weibull:5,2000000 is .* 6.4e-07 SCALE"):
        fecm.sweep(small(), random={"k": "weibull:5,2e6"}, samples=16)
