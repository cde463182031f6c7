"""Title of a new deck: plate, layup, ply and energy."""

from __future__ import annotations

from fecm.authoring.energy import said_energy
from fecm.authoring.laminate import Laminate, Plies
from fecm.authoring.plate import Plate
from fecm.deck import model

LONGEST_LAYUP = 60  # characters; a longer one is replaced by the number of plies


def default_title(plate: Plate, laminate: Laminate, deck: model.Deck, plies: Plies) -> str:
    """Title such as ``D7136 [45/0/-45/90]3s IM7/8552, 10 J``."""
    names = dict.fromkeys(named.name for _, named in plies.named)
    words = (_plate(plate), _layup(laminate), " + ".join(names))
    return f"{' '.join(filter(None, words))}, {said_energy(deck, plies)}"


def _plate(plate: Plate) -> str:
    if plate.fixture is not None:
        return plate.fixture.name
    if plate.size is None:
        return "plate"
    x, y = plate.size
    return f"plate {x:g}x{y:g}"


def _layup(laminate: Laminate) -> str:
    """The layup as the literature writes it, ``[45/0/-45/90]3s``."""
    plies = [f"{ply.angle:g}{ply.name if len(ply.name) == 1 else ''}" for ply in laminate.plies]
    count, symmetric = len(plies), ""
    if count % 2 == 0 and plies == plies[::-1]:
        count, symmetric = count // 2, "s"
    unit = next(n for n in range(1, count + 1) if plies[:count] == plies[:n] * (count // n))
    repeated = f"{count // unit}" if count > unit else ""
    layup = f"[{'/'.join(plies[:unit])}]{repeated}{symmetric}"
    return layup if len(layup) <= LONGEST_LAYUP else f"{len(plies)} plies"
