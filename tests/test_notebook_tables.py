"""What notebooks show of materials, statistics, prices and parameters."""

from __future__ import annotations

import inspect
import pickle

import fecm
from fecm._text import significant
from tests.decks import small


def test_a_notebook_shows_materials_and_statistics_as_tables() -> None:
    plies = fecm.materials()
    assert "<td style='text-align:left'>171420</td>" in plies._repr_html_()
    swept = fecm.sweep(small(), random="k=normal:1.9e6,1e4", samples=16)
    assert swept.random is not None
    mean = significant(float(swept.random.statistics["impulse"].mean))
    assert "impulse" in swept.random.statistics._repr_html_()
    assert mean in swept.random.statistics._repr_html_()
    assert pickle.loads(pickle.dumps(plies)) == plies


def test_a_price_shows_its_text() -> None:
    price = fecm.Run(small()).price
    assert repr(price) == f"<fecm price: {price}>"
    assert str(price).startswith(f"{price.steps} steps, ")


def test_parameters_of_a_sweep_say_their_python_form_first_and_their_default() -> None:
    text = inspect.getdoc(fecm.sweep) or ""
    for name, form in (
        ("vary", "Mapping of names to values"),
        ("random", "Mapping of names to laws"),
        ("exceed", "Mapping of quantities to values"),
        ("until", "A peak force"),
    ):
        head, first = text.split(f"\n{name} : ")[1].split("\n")[:2]
        assert head.endswith(", optional")
        assert first.strip().startswith(form)
    assert "seed : int, default 0" in text
