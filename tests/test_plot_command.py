"""The command ``fecm plot``: its files, its refusals, and results without sense."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import fecm
from fecm.plot.kinds import PlotError
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, DISC, PLY_PROGRAM, small
from tests.pictures import OF_RUNS

Array = NDArray[Any]

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result file of the small plate under a patch, with ply stresses and exposures."""
    program = PLY_PROGRAM.replace("NEXT", "FAIL          5\nNEXT")
    program = program.replace("LMAS\n", "LMAS\nEIGE          2\n")
    data = "ALLO\n200000,200000,7000,28000,13000\n\n" + DISC + DATA_CARDS
    path = tmp_path_factory.mktemp("made") / "small.h5"
    fecm.run(small(program, data=data), output=path)
    return path


@pytest.fixture
def file(made: Path, tmp_path: Path) -> Path:
    """A copy of that file in a folder of its own."""
    return Path(shutil.copy(made, tmp_path))


def test_the_command_writes_every_kind_and_keeps_what_is_there(file: Path) -> None:
    asked = [part for kind in OF_RUNS for part in ("--kind", kind)]
    done = call("plot", file, *asked, cwd=file.parent)
    expected = [f"small-{k}.{'gif' if k == 'animation' else 'png'}" for k in OF_RUNS]
    assert (done.exit_code, done.stdout.split()) == (0, expected)
    residual, left_out = done.stderr.splitlines()
    assert "in-plane supports act there" in residual  # a coupled laminate with u = v = 0
    assert left_out.endswith("are left out: 1 point of element 4")
    assert sorted(p.name for p in file.parent.iterdir()) == sorted([*expected, "small.h5"])
    (file.parent / "small-loop.png").write_text("precious")
    (file.parent / "small-force.png").unlink()
    refused = call("plot", file, "--kind", "force", "--kind", "loop", cwd=file.parent)
    assert refused.exit_code == 2
    assert "small-loop.png exists already" in refused.stderr
    assert (file.parent / "small-loop.png").read_text() == "precious"
    assert not (file.parent / "small-force.png").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("-o", "picture.jpg"), ".png or .svg or .pdf"),
        (("--kind", "animation", "-o", "plate.png"), ".gif"),
        (("--kind", "force", "--kind", "loop", "-o", "both.png"), "is not a folder"),
        (("--kind", "contour", "--times", "1"), "at time 1"),
        (("--times", "soon"), "T,T"),
        (("--at", "1"), "X,Y"),
        (("small.h5",), "given twice"),
    ],
)
def test_a_call_that_makes_no_picture_is_refused_in_words(
    file: Path, arguments: tuple[str, ...], words: str
) -> None:
    refused = call("plot", "small.h5", *arguments, cwd=file.parent)
    assert refused.exit_code == 2
    assert words in refused.stderr
    assert "Traceback" not in refused.stderr
    assert [p.name for p in file.parent.iterdir()] == ["small.h5"]


# Results without sense ----------------------------------------------------------------------------


def zero(file: h5py.File) -> None:
    file["mesh/coordinates"][...] = 0.0


def infinite(file: h5py.File) -> None:
    file["tape3/w"][...] = np.inf
    file["history/force"][...] = np.inf
    file["energy/plate_kinetic"][...] = np.nan
    file["tape8/kappa_x"][...] = file["plies/sigma_1"][...] = np.inf
    for criterion in file["failure"].values():
        if isinstance(criterion, h5py.Group) and "exposure" in criterion:
            criterion["exposure"][...] = np.nan


def huge(file: h5py.File) -> None:
    file["history/force"][...] = np.linspace(-0.8e308, 0.8e308, 10)
    file["mesh/coordinates"][...] *= 0.5e308
    file["tape3/w"][...] = 1e308


def tiny(file: h5py.File) -> None:
    for path in (
        "history/force",
        "history/time",
        "tape3/w",
        "tape3/time",
        "plies/sigma_1",
        "mesh/coordinates",
        "failure/puck/exposure",
    ):
        file[path][...] *= 1e-310
    for name in ("x", "y", "radius"):
        file["patch"].attrs[name] *= 1e-310


def without_rows(file: h5py.File) -> None:
    for group in ("history", "energy", "tape3", "tape8", "plies"):
        kept = {"element", "z", "under_load"}
        for name, dataset in [item for item in file[group].items() if item[0] not in kept]:
            del file[group][name]
            file[group][name] = np.zeros((0, *dataset.shape[1:]), dataset.dtype)
    del file["failure/under_load"]


@pytest.mark.parametrize(
    ("edit", "undrawn", "drawn"),
    [
        (zero, "strain line contour surface mesh thickness failure", "force"),
        (infinite, "force loop energy strain line contour surface thickness failure", "mesh"),
        pytest.param(
            huge,
            "force loop strain line contour surface mesh thickness failure",
            "energy",
            marks=pytest.mark.long,
        ),
        (tiny, "contour", "force strain surface failure"),
        (without_rows, "force loop energy strain line contour surface thickness failure", "mesh"),
    ],
)
@pytest.mark.few(1)  # of 4, 0.8 s each
def test_a_result_without_sense_is_drawn_or_is_one_line(
    file: Path, edit: Callable[[h5py.File], None], undrawn: str, drawn: str
) -> None:
    with h5py.File(file, "r+") as stored:
        edit(stored)
    refused = []
    for kind in (*undrawn.split(), *drawn.split()):
        picture = file.with_name(f"{kind}.png")
        done = call("plot", file, "--kind", kind, "-o", picture)
        if done.exit_code:
            refused.append(kind)
            assert_unusable(done)
            assert not picture.exists()
        else:
            assert kind in ("thickness", "failure") or done.stderr == ""
    assert refused == undrawn.split()


def test_what_is_wrong_with_a_result_is_named(file: Path) -> None:
    with h5py.File(file, "r+") as stored:
        zero(stored)
        infinite(stored)
    assert "the mesh of small has no area" in call("plot", file, "--kind", "mesh").stderr
    assert "history/force of small holds numbers beyond" in call("plot", file).stderr


def test_a_kind_whose_data_were_not_stored_leaves_the_others(file: Path) -> None:
    with h5py.File(file, "r+") as stored:
        del stored["plies"]
    kinds = [part for kind in ("force", "thickness", "mesh") for part in ("--kind", kind)]
    done = call("plot", file, *kinds, cwd=file.parent)
    assert (done.exit_code, done.stdout.split()) == (1, ["small-force.png", "small-mesh.png"])
    assert (file.parent / "small-force.png").stat().st_size > 0
    words = "thickness is not drawn: small has no plies/sigma_1; add PLYS to the deck's program"
    assert words in done.stderr
    alone = call("plot", file, "--kind", "thickness", "--kind", "sensitivity", cwd=file.parent)
    assert alone.exit_code == 2
    assert not (file.parent / "small-thickness.png").exists()


def test_a_name_that_is_no_text_is_escaped(file: Path) -> None:
    strange = file.with_name("b\udcff.h5")
    shutil.copy(file, strange)
    done = call("plot", file, strange, "-o", file.with_name("x.png"))
    assert (done.exit_code, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("options", "name"),
    [(["--times", "1e-6"], "times"), (["--at", "1,1"], "at"), (["--along", "y"], "along"),
     (["--level", "3"], "level"), (["--face", "struck"], "face")],
)  # fmt: skip
def test_an_option_of_another_kind_is_refused(file: Path, options: list[str], name: str) -> None:
    done = call("plot", file, "--kind", "force", *options, "-o", file.with_name("x.png"))
    assert_unusable(done)
    assert f"the option {name} is for the kind " in done.stderr


def test_an_option_needs_one_kind_that_shows_it(file: Path) -> None:
    kinds = ["--kind", "force", "--kind", "line"]
    done = call("plot", file, *kinds, "--times", "1e-6", "-o", file.parent)
    assert done.exit_code == 0
    with pytest.raises(PlotError, match="the option times is for"):
        fecm.load(file).plot("force", times=(1e-6,))
