"""Contact coefficient of a laminate from elastic constants."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fecm import Ply
from fecm.deck.catalogue import poissons_ratio_across, read_plies
from fecm.mechanics.contact_law import hertz_coefficient
from fecm.mechanics.half_space import (
    PlyError,
    effective_stiffness,
    indentation_modulus,
    ply_stiffness,
)
from tests.builders import REPORT_PLY, isotropic_ply, table
from tests.calls import call

T300 = Ply(1.0, 0.28, 181e9, 10.3e9, 7.17e9, 7.17e9, 3.68e9)
LAYUPS = {"[0/45/-45/90]": (0.0, 45.0, -45.0, 90.0), "[0]": (0.0,)}


def test_the_modulus_of_an_isotropic_solid_is_hertzs() -> None:
    assert indentation_modulus(ply_stiffness(isotropic_ply(), 0.3)) == pytest.approx(
        1.0 / (1.0 - 0.3**2), rel=1e-12
    )


@pytest.mark.parametrize("layup", LAYUPS)
def test_effective_stiffness_and_modulus_are_those_of_the_reference(layup: str) -> None:
    (row,) = (
        row
        for row in table("laminate_contact.csv")
        if row["layup"] == layup and row["ply"].startswith("T300/5208")
    )
    angles = LAYUPS[layup]
    C = effective_stiffness(T300, angles, [1.0] * len(angles), 0.4)
    expected = [float(row[name]) for name in ("C11", "C13", "C33", "C44", "C55")]
    values = [C[0, 0], C[0, 2], C[2, 2], C[3, 3], C[4, 4]]
    np.testing.assert_allclose(values, expected, rtol=5e-6)
    assert 1.0 / np.linalg.inv(C)[2, 2] == pytest.approx(float(row["E3 effective"]), rel=5e-6)
    modulus = indentation_modulus(C)
    assert modulus == pytest.approx(float(row["indentation modulus M (Barnett-Lothe)"]), rel=1e-6)
    k = hertz_coefficient(0.008, 207e9, 0.3, modulus)
    assert k == pytest.approx(float(row["k"]), rel=1e-6)


def test_the_reports_plate_has_the_coefficient_of_the_reference() -> None:
    (row,) = (row for row in table("laminate_contact.csv") if row["ply"].startswith("report"))
    half = 2 * (0.0, 45.0, 0.0, -45.0, 0.0)
    modulus = indentation_modulus(
        effective_stiffness(REPORT_PLY, half + half[::-1], [1.0] * 20, 0.4)
    )
    assert hertz_coefficient(0.375, 30e6, 0.3, modulus) == pytest.approx(float(row["k"]), rel=1e-6)


def test_k_of_an_isotropic_ply_is_hertzs_without_nu23() -> None:
    e, nu, radius = 70e3, 0.3, 8.0
    shear = e / (2.0 * (1.0 + nu))
    sphere = ("--radius", radius, "--es", 207000, "--nus", 0.3, "--format", "json")
    ply = ",".join(map(str, (2.7e-9, nu, e, e, shear, shear, shear)))
    done = call(
        "indent", "estimate", "--layup", "[0]4", "--ply-thickness", 0.5, "--ply", ply, *sphere
    )
    compliance = (1.0 - nu**2) / e + (1.0 - 0.3**2) / 207e3
    expected = 4.0 / 3.0 * radius**0.5 / compliance
    assert json.loads(done.stdout)["k"] == pytest.approx(expected, rel=1e-5)


def test_an_own_metal_without_g23_is_isotropic() -> None:
    text = '["m"]\ndensity = 2.7e-9\nnu12 = 0.3\nE1 = 70e3\nE2 = 70e3\nG12 = 26923.1\n'
    assert read_plies(text)["m"].ply.g23 == pytest.approx(70e3 / 2.6, rel=1e-6)


@pytest.mark.parametrize(
    ("g23", "expected"),
    [(10.3e9 / 2.8, 0.4), (10.3e9 / 3.0, 0.5), (7.17e9, 0.4), (None, 0.4)],
    ids=["0.4", "0.5", "as G12, which gives a negative ratio", "unknown"],
)
def test_nu23_of_parallel_fibres_follows_from_g23(g23: float | None, expected: float) -> None:
    ratio = poissons_ratio_across(0.28, 181e9, 10.3e9, 7.17e9, g23)
    assert ratio == pytest.approx(expected, rel=1e-12)


def test_a_compliance_that_is_not_positive_definite_names_the_ratio() -> None:
    with pytest.raises(PlyError, match=r"not positive definite.*nu23"):
        ply_stiffness(T300, 1.2)
