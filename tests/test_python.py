"""The library as Python code sees it: names, types, warnings, progress."""

from __future__ import annotations

import ast
import inspect
import io
import logging
import os
import pickle
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import fecm
from fecm import ContactPoint
from fecm.deck.reader import HDF5
from tests.calls import call
from tests.decks import APPENDIX, DATA_CARDS, DISC, LONG, PLY_PROGRAM, PROGRAM, ROOT, small
from tests.printed import text_of

# The small plate with ply stresses and exposures.
STRENGTHS = "ALLO\n   200000.   200000.     7000.    28000.    13000.\n\n"
DECK = small(
    PLY_PROGRAM.replace("PLYS", "FAIL          1\nPLYS"), data=DISC + STRENGTHS + DATA_CARDS
)


def test_a_small_deck_is_read_without_room_for_the_largest_one() -> None:
    class Recorded(io.BytesIO):
        sizes: ClassVar[list[int]] = []

        def read(self, size: int | None = -1, /) -> bytes:
            self.sizes.append(-1 if size is None else size)
            return super().read(size)

    assert fecm.read_deck(Recorded(small().encode())) == fecm.read_deck(small())
    assert 0 < min(Recorded.sizes) <= max(Recorded.sizes) <= 1_000_000


def test_the_namespace_lists_the_public_names_and_nothing_else() -> None:
    assert dir(fecm) == sorted(fecm.__all__)
    for name in fecm.__all__:
        assert getattr(fecm, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        fecm.runn  # type: ignore[attr-defined]  # noqa: B018


def test_each_public_name_is_what_a_type_checker_takes_it_for() -> None:
    stub = Path(fecm.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    named: dict[str, object] = {}
    for line in ast.parse(stub).body:
        if not isinstance(line, ast.ImportFrom):
            continue
        module = import_module(str(line.module))
        named |= {alias.asname or alias.name: getattr(module, alias.name) for alias in line.names}
    assert len(named) > 20
    for name, value in named.items():
        assert getattr(fecm, name) is value


def test_the_page_of_the_api_has_every_public_name() -> None:
    page = text_of("api*.md")
    listed = re.findall(r"^\.\. auto\w+:: fecm\.(\w+)$", page, re.MULTILINE)
    assert sorted(listed) == sorted(set(fecm.__all__) - {"__version__"})


# Codes of numpydoc: sections and their order, documented parameters that exist, descriptions.
DOCSTRINGS = {
    "GL03", "GL05", "GL06", "GL07", "GL08", "GL09", "GL10", "SS01", "SS02", "SS03", "SS04",
    "PR02", "PR03", "PR04", "PR06", "PR07", "PR08", "PR09", "RT03", "RT04", "RT05",
}  # fmt: skip


def test_the_docstrings_of_public_functions_and_methods_are_numpys() -> None:
    validate = pytest.importorskip("numpydoc.validate").validate
    public = [getattr(fecm, name) for name in fecm.__all__]
    values = [member for member in public if inspect.isfunction(member)]
    for kind in filter(inspect.isclass, public):
        values += [
            f
            for name, f in vars(kind).items()
            if inspect.isfunction(f) and not name.startswith("_")
        ]
    wrong = {
        f.__qualname__: error
        for f in values
        for error in validate(f"{f.__module__}.{f.__qualname__}")["errors"]
        if error[0] in DOCSTRINGS
    }
    assert wrong == {}
    assert len(values) > 20


def test_importing_fecm_imports_neither_numpy_nor_scipy() -> None:
    code = "import sys, fecm; print({'numpy', 'scipy', 'h5py'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_help_and_version_import_neither_numpy_nor_a_command() -> None:
    code = """
import contextlib, sys
from fecm.cli import main
for option in ("--help", "--version"):
    with contextlib.suppress(SystemExit):
        main([option])
names = ("numpy", "h5py", "fecm.simulation", "fecm.deck", "fecm.cli.run")
print([name for name in names if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


# Modules that a command does not use on a small deck: their import takes a part of its time.
ELSEWHERE = "scipy fecm.sweeps fecm.objects tomllib multiprocessing concurrent.futures decimal html"
NOT_IN_A_RUN = (
    "numpy.ma fecm.results.hdf5_reader fecm.results.export fecm.results.plies "
    "fecm.mechanics.stretching"
)
# By the module that loads most of what the commands below it share.
UNUSED = {
    "fecm.results.result": {
        "info small.h5": f"{ELSEWHERE} matplotlib fecm.plot numpy.ma fecm.mechanics.kernels",
        "tapes small.h5": f"{ELSEWHERE} matplotlib numpy.ma fecm.mechanics.kernels",
        "diff small.h5 small.h5": "scipy matplotlib numpy.ma fecm.sweeps fecm.mechanics.kernels",
        "export small.h5 --to csv": (
            f"{ELSEWHERE} matplotlib numpy.ma pandas fecm.mechanics.kernels"
        ),
        "plot small.h5": (
            "scipy fecm.sweeps fecm.objects fecm.mechanics.kernels matplotlib.pyplot"
        ),
        "--help": "scipy matplotlib pandas vtk",
    },
    "fecm.simulation.run": {
        "run small.inp -o run.h5": f"{ELSEWHERE} {NOT_IN_A_RUN} matplotlib fecm.plot hashlib "
        "zipfile json",
        "check small.inp": f"{ELSEWHERE} matplotlib fecm.plot numpy.ma hashlib zipfile json h5py",
        "estimate small.inp": "scipy.integrate scipy.optimize",
    },
}
LOADED = """
import importlib, os, sys
import numpy
numpys = set(sys.modules)  # of which NumPy 1 has more than NumPy 2
from fecm.cli import main
for shared, commands in %r.items():
    importlib.import_module(shared)  # once, not in every child
    for arguments, names in commands.items():
        if not (child := os.fork()):
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            try:
                main(arguments.split())
            except SystemExit as end:
                assert not end.code, arguments
            loaded = [name for name in names.split() if name in sys.modules.keys() - numpys]
            print(arguments, "imports", *loaded, file=sys.stderr, flush=True)
            os._exit(len(loaded))
        assert not os.waitpid(child, 0)[1]
"""


@pytest.mark.posix
@pytest.mark.long
def test_no_command_imports_what_it_does_not_use(runs: Path, tmp_path: Path) -> None:
    (tmp_path / "small.inp").write_text(small())
    shutil.copy(runs / "small.h5", tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", LOADED % UNUSED],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr


def test_each_warning_of_a_deck_is_a_warning_in_python_at_the_users_line() -> None:
    with pytest.warns(fecm.FecmWarning) as caught:
        result = fecm.run_one(APPENDIX)
    assert [finding.code for finding in result.findings] == ["N414", "W415"]
    texts = [str(warning.message) for warning in caught]
    assert len(texts) == 2
    assert "warning[W415]" in texts[0]
    assert texts[1:] == list(result.notes)
    assert {warning.filename for warning in caught} == {__file__}


TWICE = """
import sys
import fecm
fecm.run_one(sys.argv[1])
fecm.run_one(sys.argv[1])
"""


@pytest.mark.parametrize(("options", "times"), [([], 1), (["-W", "always"], 2)])
@pytest.mark.few(1)  # of 2, 0.5 s each
def test_a_finding_is_a_warning_once_in_a_process_unless_the_user_filters_otherwise(
    options: list[str], times: int, tmp_path: Path
) -> None:
    (tmp_path / "small.inp").write_text(small())
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    done = subprocess.run(
        [sys.executable, *options, "-c", TWICE, "small.inp"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
        env=environment | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.stderr.count("warning[W415]") == times
    assert done.stderr.count("the run ends in contact") == 2  # a doubt of each result


def test_what_a_result_or_a_sweep_lacks_is_named_with_what_there_is(runs: Path) -> None:
    result = fecm.load(runs / "small.h5")
    sweep = fecm.sweep(small(), {"velocity": [50.0]})
    for source, asked, words in (
        (result, "history", "history is a group, not a dataset; .*history/force"),
        (result, "history/forse", "no history/forse .*did you mean history/force"),
        (result, "plies/sigma_1", "no plies/sigma_1 .*add PLYS"),
        (sweep, "peak_forse", "no peak_forse in this sweep; did you mean peak_force"),
    ):
        with pytest.raises(KeyError, match=words):
            source[asked]


def test_doubts_about_a_run_are_warnings_and_stay_with_the_result(tmp_path: Path) -> None:
    path = tmp_path / "small.h5"
    with pytest.warns(fecm.FecmWarning, match="the run ends in contact"):
        result = fecm.run_one(small(), output=path)
    assert any(note.startswith("the run ends in contact") for note in result.notes)
    assert fecm.load(path).notes == fecm.run_one(small()).notes == result.notes
    assert "note              the run ends in contact" in call("info", str(path)).stdout


def test_a_saved_result_is_the_file_that_the_run_would_have_written(tmp_path: Path) -> None:
    written, saved = tmp_path / "written.h5", tmp_path / "saved.h5"
    fecm.run_one(small(), output=written)
    result = fecm.run_one(small())
    result.save(saved)
    again = fecm.load(saved)
    assert again.attributes == fecm.load(written).attributes
    assert again.deck == result.deck
    assert list(again) == list(fecm.load(written))
    assert call("diff", str(written), str(saved)).exit_code == 0
    with pytest.raises(OSError, match="exists already"):
        result.save(saved)


def test_the_deck_of_a_result_is_one_that_can_be_changed_and_run(tmp_path: Path) -> None:
    deck = fecm.read_one(small())
    result = fecm.run_one(deck, output=tmp_path / "r.h5")
    speeds = {"velocity": [60.0, 115.0]}
    swept = fecm.sweep(deck, speeds, history=True, output=tmp_path / "s.h5")
    assert swept.force is not None
    loaded: list[fecm.Result | fecm.SweepResult] = [
        fecm.load(tmp_path / "r.h5"),
        fecm.load_sweep(str(tmp_path / "s.h5")),
    ]
    for one in (result, swept, *loaded):
        assert one.deck == deck
        slower = fecm.run_one(one.deck.with_(velocity=60.0)).force
        np.testing.assert_allclose(slower, swept.force[0], rtol=1e-9)


def test_a_deck_of_a_listing_result_is_read_as_the_original_program_reads_it(runs: Path) -> None:
    result = fecm.load(runs / "listing.h5")
    assert fecm.run_one(result.deck, mode="listing").force.tolist() == result.force.tolist()


def test_a_result_without_a_readable_deck_says_so(runs: Path) -> None:
    result = fecm.load(runs / "small.h5")
    for text in ("", "nonsense\n"):
        other = fecm.Result({path: result[path] for path in result}, {"deck": text}, {})
        assert other.deck_text == text
        with pytest.raises(fecm.FecmError, match="no deck that can be read"):
            _ = other.deck


def test_results_groups_and_sweeps_are_read_by_name_as_mappings_are(runs: Path) -> None:
    swept = fecm.sweep(with_units(small()), {"velocity": [50.0, 60.0]}, history=True)
    result = fecm.run_one(with_units(DECK))
    loaded = fecm.load(runs / "small.h5")
    sources: list[Any] = [result, loaded, swept, result.history, result.failure, result.plies]
    for one in sources:
        names = list(one)
        assert one.keys() == names
        assert len(names) == len(set(names)) > 2
        assert "forse" not in one
        whole = dict(one)
        for name in names:
            assert name in one
            np.testing.assert_array_equal(whole[name], one[name])
        for asked in (one.__getitem__, one.unit):
            with pytest.raises(KeyError, match="forse"):
                asked("forse")
    assert list(swept) == list(swept.to_dataframe())
    assert len(swept) == 2
    assert np.shares_memory(result["force"], result["history/force"])
    assert np.shares_memory(result.history["force"], result.force)
    exposure = result.failure.puck["exposure"]
    assert np.shares_memory(exposure, result["failure/puck/exposure"])
    assert "w" in result.tape3
    assert "w" not in result


def test_results_groups_and_sweeps_survive_pickle(runs: Path) -> None:
    result = fecm.run_one(small())
    swept = fecm.sweep(small(), {"velocity": [50.0, 60.0]})
    whole: list[Any] = [result, result.tape3, result.laminate, fecm.load(runs / "small.h5"), swept]
    for one in whole:
        again = pickle.loads(pickle.dumps(one))
        assert type(again) is type(one)
        assert list(again) == list(one)
        for name in one:
            np.testing.assert_array_equal(again[name], one[name])


def test_arrays_of_results_can_not_be_changed_by_accident(runs: Path, tmp_path: Path) -> None:
    swept = fecm.sweep(
        small(), random={"velocity": "uniform:50,60"}, samples=16, exceed={"peak_force": 1.0}
    )
    assert swept.random is not None
    for result in (fecm.run_one(small()), fecm.load(runs / "small.h5")):
        before = result.force.copy()
        for array in (result.force, result["force"], result.history.force, result.tape3.w):
            with pytest.raises(ValueError, match="read-only"):
                array *= 4.448
        result.save(tmp_path / "again.h5", overwrite=True)
        np.testing.assert_array_equal(fecm.load(tmp_path / "again.h5").force, before)
    for array in (
        swept["velocity"],
        swept["peak_force"],
        swept.dt,
        swept.random.exceedance.probability,
        swept.random.statistics["peak_force"].quantiles,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    mine = swept["peak_force"].copy()
    mine *= 4.448  # a copy is the user's


def test_units_are_asked_for_by_the_names_of_datasets_and_columns() -> None:
    deck = fecm.read_one(with_units(DECK))
    result = fecm.run_one(deck)
    swept = fecm.sweep(deck, {"velocity": [50.0, 60.0]}, history=True)
    assert result.units == result.tape3.units == swept.units
    assert swept.units == {"length": "in", "force": "lbf", "time": "s"}
    for name, unit in (("force", "lbf"), ("velocity", "in/s"), ("peak_force", "lbf")):
        assert result.unit(name) == swept.unit(name) == unit
    assert swept.unit("dt") == result.unit("time") == result.tape3.unit("time") == "s"
    assert swept.unit("status") == result.unit("step") == ""
    assert result.unit("tape8/kappa_x") == result.tape8.unit("kappa_x") == "1/in"
    assert result.unit("plies/sigma_1") == result.plies.unit("sigma_1") == "lbf/in^2"
    assert result.unit("failure/puck/time") == result.failure.puck.unit("time") == "s"
    for one in (result, swept):
        with pytest.raises(KeyError, match="no length in this"):
            one.unit("length")
    assert fecm.run_one(small()).unit("force") == ""


def test_a_saved_sweep_is_the_file_that_the_sweep_would_have_written(tmp_path: Path) -> None:
    written, saved = tmp_path / "written.h5", tmp_path / "saved.h5"
    swept = fecm.sweep(small(), {"velocity": [50.0, 60.0]}, history=True, output=written)
    swept.save(saved)
    assert saved.read_bytes() == written.read_bytes()
    with pytest.raises(FileExistsError, match="exists already; overwrite=True replaces it"):
        fecm.load_sweep(saved).save(saved)


@pytest.mark.long
def test_python_replaces_a_file_only_with_overwrite(tmp_path: Path) -> None:
    deck = tmp_path / "small.inp"
    deck.write_text(small())
    program = PROGRAM.replace("LOOP         10", "LOOP        400")
    result, swept = fecm.run_one(deck), fecm.sweep(small(program), {"velocity": [50.0, 60.0]})
    writers: list[Callable[..., object]] = [
        partial(fecm.run, deck, output=tmp_path / "run.h5"),
        partial(fecm.run_one, deck, output=tmp_path / "one.h5"),
        partial(fecm.sweep, deck, {"velocity": [50.0]}, output=tmp_path / "sweep.h5"),
        partial(result.save, tmp_path / "saved.h5"),
        partial(result.plot, "force", tmp_path / "force.svg"),
        partial(swept.plot, path=tmp_path / "map.svg"),
    ]
    for write in writers:
        before = set(tmp_path.iterdir())
        write()
        (path,) = set(tmp_path.iterdir()) - before
        path.write_text("mine")
        with pytest.raises(FileExistsError, match="exists already; overwrite=True replaces it"):
            write()
        assert path.read_text() == "mine"
        write(overwrite=True)
        assert path.stat().st_size > 1000


def test_an_existing_output_is_refused_before_anything_is_run(tmp_path: Path) -> None:
    (tmp_path / "out-2.h5").write_text("mine")
    ran: list[int] = []
    with pytest.raises(FileExistsError, match=r"out-2\.h5 exists already"):
        fecm.run(
            small(stop=False) + small(),
            output=tmp_path / "out.h5",
            progress=lambda step, steps: ran.append(step),
        )
    assert not ran
    assert [path.name for path in tmp_path.iterdir()] == ["out-2.h5"]


def test_a_result_never_replaces_the_deck_it_is_made_of(tmp_path: Path) -> None:
    deck = tmp_path / "small.inp"
    deck.write_text(small())
    with pytest.raises(fecm.FecmError, match="is an input"):
        fecm.run(deck, output=deck, overwrite=True)
    with pytest.raises(fecm.FecmError, match="is an input"):
        fecm.sweep(deck, {"velocity": [50.0]}, output=deck, overwrite=True)
    assert deck.read_text() == small()


def with_units(text: str) -> str:
    """A deck in inches, pounds and seconds."""
    return text.replace("END\nMACR", "UNIT\nin lbf s\nEND\nMACR")


def test_a_tree_of_arrays_has_named_dimensions_and_places_of_the_nodes() -> None:
    pytest.importorskip("xarray")
    result = fecm.run_one(with_units(small()))
    tree = result.to_xarray()
    assert tree["tape3"].displacement.dims == ("time", "node", "unknown")
    assert tree.to_dataset().unknown.values.tolist() == ["u", "v", "w", "theta_x", "theta_y"]
    np.testing.assert_array_equal(tree["tape3"].y, result.mesh.coordinates[:, 1])
    np.testing.assert_array_equal(tree["history"].force.sel(time=result.time), result.force)
    assert tree["history"].force.attrs["units"] == "lbf"


def test_pint_converts_a_stored_history_to_newtons(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("pint_xarray")
    pytest.importorskip("h5netcdf")
    result = fecm.run_one(with_units(small()), output=tmp_path / "small.h5")
    with xarray.open_dataset(tmp_path / "small.h5", group="history", engine="h5netcdf") as opened:
        force = opened.force.pint.quantify().pint.to("newton").pint.magnitude
    np.testing.assert_allclose(force, 4.4482216152605 * result.force, rtol=1e-12)


def test_a_grid_of_pyvista_has_the_nodes_and_their_displacements() -> None:
    pytest.importorskip("pyvista")
    result = fecm.run_one(small())
    grid = result.to_pyvista(float(result.tape3.time[0]))
    np.testing.assert_array_equal(grid.points[:, :2], result.mesh.coordinates)
    np.testing.assert_array_equal(grid.point_data["w"], result.tape3.w[0])
    assert (grid.n_cells, set(grid.celltypes)) == (4, {28})
    with pytest.raises(KeyError, match="no displacements at time 1"):
        result.to_pyvista(1.0)


def test_an_open_file_is_read_as_the_file_of_its_name(tmp_path: Path) -> None:
    text, path = small(), tmp_path / "small.inp"
    path.write_text(text)
    deck = fecm.read_one(path)
    with path.open() as as_text, path.open("rb") as as_bytes:
        for stream in (io.StringIO(text), io.BytesIO(text.encode()), as_text, as_bytes):
            assert fecm.read_one(stream) == deck
    assert fecm.read_deck(io.StringIO(text)) == deck
    assert fecm.check(io.StringIO(text)).source == "<text>"
    with path.open() as as_text:
        assert fecm.check(as_text).source == str(path)
    with path.open() as as_text, pytest.raises(fecm.FecmError, match="is an input"):
        fecm.run_one(as_text, output=path, overwrite=True)
    assert path.read_text() == text


def test_a_result_is_read_from_bytes_and_from_a_file_that_is_closed_then(tmp_path: Path) -> None:
    path = tmp_path / "small.h5"
    result = fecm.run_one(small(), output=path)
    with path.open("rb") as opened:
        loaded = fecm.load(opened)
    np.testing.assert_array_equal(loaded.force, result.force)
    loaded = fecm.load(io.BytesIO(path.read_bytes()))
    assert fecm.diff(loaded, path).same
    swept = fecm.sweep(small(), {"velocity": [50.0, 60.0]}, output=tmp_path / "swept.h5")
    with (tmp_path / "swept.h5").open("rb") as opened:
        again = fecm.load_sweep(opened)
    np.testing.assert_array_equal(again["peak_force"], swept["peak_force"])


def test_data_frames_have_the_units_of_their_columns() -> None:
    pytest.importorskip("pandas")
    deck = fecm.read_one(with_units(small()))
    history = fecm.run_one(deck).to_dataframe().attrs["units"]
    assert (history["time"], history["force"], history["velocity"]) == ("s", "lbf", "in/s")
    assert "step" not in history
    swept = fecm.sweep(deck, {"velocity": [50.0]}).to_dataframe().attrs["units"]
    assert (swept["velocity"], swept["peak_force"], swept["impulse"]) == ("in/s", "lbf", "lbf*s")
    assert "validity" not in swept
    assert fecm.run_one(small()).to_dataframe().attrs["units"] == {}


@pytest.mark.parametrize(
    ("read", "given", "message"),
    [
        (fecm.read_one, 3, "a deck is a path, a text, an open file or a Deck, not 3"),
        (fecm.run, None, "a deck is a path, a text, an open file or a Deck, not None"),
        (fecm.load, 3, "a result file is a path or an open file, not 3"),
        (fecm.load, io.BytesIO(), "<file> has no bytes to read"),
        (fecm.load, io.StringIO("x"), '<file> is open as text; open it again with the mode "rb"'),
        (fecm.load, io.BytesIO(small().encode()), "<file> is a deck, not a result"),
        (fecm.load, io.BytesIO(b"0" * 100), "<file>: not a readable HDF5 file"),
        (fecm.read_one, io.BytesIO(HDF5), "<text> is an HDF5 file, not a deck"),
    ],
)
def test_what_is_neither_a_path_nor_a_readable_file_is_refused_in_a_sentence(
    read: Any, given: Any, message: str
) -> None:
    with pytest.raises(fecm.FecmError, match=message):
        read(given)


def test_progress_counts_the_steps_up_to_the_last() -> None:
    seen: list[tuple[int, int]] = []
    result = fecm.run_one(small(), progress=lambda step, steps: seen.append((step, steps)))
    steps = len(result.force)
    assert {total for _, total in seen} == {steps}
    assert seen == sorted(seen)
    assert seen[-1] == (steps, steps)


def test_a_run_logs_its_title_and_number_of_steps(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "fecm"):
        result = fecm.run_one(small())
    assert caplog.messages[0] == f"small plate: {len(result.force)} steps"


def test_one_problem_is_refused_where_a_deck_has_two() -> None:
    two = small().removesuffix("STOP\n") + small()
    assert isinstance(fecm.run(two), list)
    for function in (fecm.run_one, fecm.read_one):
        with pytest.raises(ValueError, match="the deck has 2 problems, not one"):
            function(two)


class Bilinear:
    """A law without memory: stiff up to 5e-4, then ten times softer."""

    def start(self) -> None:
        """No memory."""

    def trial(self, memory: None, last: ContactPoint, indentation: float) -> tuple[float, None]:
        """Force at an indentation."""
        a = max(indentation, 0.0)
        return min(1e5 * a, 45.0 + 1e4 * a), None

    def accept(self, memory: None, last: ContactPoint, indentation: float) -> None:
        """No memory."""

    def permanent(self, memory: None, last: ContactPoint) -> float:
        """The law is elastic."""
        return 0.0


def test_a_run_follows_a_users_law_and_stores_its_name() -> None:
    result = fecm.run_one(LONG, law=Bilinear())
    a = np.maximum(result.indentation, 0.0)
    np.testing.assert_allclose(result.force, np.minimum(1e5 * a, 45.0 + 1e4 * a), atol=2e-3)
    assert result.force.max() > 50.0
    assert result.attributes["law"] == "Bilinear"
    energy = result.energy
    assert np.abs(energy.balance_error).max() < 1e-5 * energy.projectile_kinetic[0]
    assert "law" not in fecm.run_one(small()).attributes


def test_a_group_shows_its_datasets_and_their_shapes(tmp_path: Path) -> None:
    result = fecm.run_one(small(), output=tmp_path / "small.h5")
    assert repr(result.laminate) == "<laminate: A (3, 3), B (3, 3), D (3, 3), shear (2, 2)>"
    np.testing.assert_array_equal(result.laminate.A, result["laminate/A"])
    assert {"A", "B", "D", "shear"} <= set(dir(result.laminate))
