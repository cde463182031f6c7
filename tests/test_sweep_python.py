"""Sweeps as Python code makes them: values, executors, own decks, own quantities, arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fecm
from fecm.sweeps.cases import CasesError
from tests.decks import small


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"vary": {"layup": "[0/90]5s"}}, r"layup is one value; write a list: .*\['\[0/90\]5s'\]"),
        ({"vary": {"velocity": 5.0}}, r"velocity is one value; write a list: .* \[5.0\]"),
        ({"vary": {"velocity": np.array(5.0)}}, "velocity is one value"),
        ({"vary": {"velocity": []}}, "velocity has no values"),
        ({"vary": {"k": [None]}}, "k can't be None"),
        ({"vary": "velocity"}, "write a mapping"),
        ({"cases": {"velocity": 5.0}}, "case 0 is 'velocity', not a mapping"),
        ({"cases": [{"k": 1e6}, 2e6]}, "case 1 is 2000000.0, not a mapping"),
        ({"cases": 5.0}, "write a list of mappings"),
    ],
)
def test_values_that_are_not_in_a_list_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(CasesError, match=message):
        fecm.sweep(small(), **given)
