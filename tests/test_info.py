"""`fecm info`, and result files that are damaged or foreign."""

from __future__ import annotations

import json
import math
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fecm
from fecm._errors import ResultFileError
from fecm.results.groups import GROUPS
from fecm.results.hdf5_reader import read
from fecm.results.schema import DATASETS
from tests.calls import assert_unusable, call
from tests.decks import APPENDIX, DATA_CARDS, PROGRAM, small

# The projectile has left the plate at the end.
LONG = small(PROGRAM.replace(" 10\n", "400\n"), data=DATA_CARDS.replace("EXPE", "DELA\n.2,\nEXPE"))
Edit = Callable[[h5py.File], object]


def test_every_group_with_datasets_is_described() -> None:
    groups = {dataset.group.partition("/")[0] for dataset in DATASETS.values()}
    assert groups == {*GROUPS} - {"threshold"}  # it has attributes only
    assert all(info.description for info in GROUPS.values())


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small result."""
    path = tmp_path_factory.mktemp("info") / "small.h5"
    fecm.run(small(), output=path)
    return path


@pytest.fixture
def changed(result: Path, tmp_path: Path) -> Callable[[Edit], Path]:
    """Make a changed copy of the small result."""

    def change(edit: Edit) -> Path:
        path = tmp_path / "changed.h5"
        shutil.copy(result, path)
        with h5py.File(path, "r+") as file:
            edit(file)
        return path

    return change


def words(path: Path) -> str:
    """What ``fecm info`` says, its runs of blanks made one."""
    done = call("info", path)
    assert done.exit_code == 0, done.stderr
    return "\n".join(" ".join(line.split()) for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    "command",
    [
        ("run", "d.inp"),
        ("estimate", "d.inp"),
        ("sweep", "d.inp", "--find", "velocity", "--until", "peak_force=threshold"),
        ("sweep", "d.inp", "--random", "velocity=normal:115,5", "--samples", "16"),
    ],
)
def test_a_computed_number_has_at_most_four_digits_in_print(
    command: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "d.inp").write_text(LONG)
    done = call(*command, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    printed = re.sub(r"\((?:step|velocity) .*?\)|seed \d+", "", done.stdout)
    numbers = re.findall(r"(?<![\w.])\d*\.\d+", printed)
    assert len(numbers) > 2
    assert [n for n in numbers if len(n.replace(".", "").lstrip("0")) > 4] == []


def test_json_has_all_digits_of_a_computed_number(tmp_path: Path) -> None:
    (tmp_path / "d.inp").write_text(LONG)
    about = json.loads(call("run", "d.inp", "--format", "json", cwd=tmp_path).stdout)
    assert about["metrics"]["peak_force"] == fecm.load(tmp_path / "d.h5").force.max()


def test_info_tells_the_run_its_summary_and_every_dataset(tmp_path: Path) -> None:
    path = tmp_path / "appendix.h5"
    fecm.run(APPENDIX, mode="listing", output=path)
    text = words(path)
    for line in (
        "**LOW VELOCITY IMPACT OF LAMINATED PLATE**",
        f"file {path}, {path.stat().st_size} bytes",
        "mode listing",
        "units the deck names none",
        "steps 10, time 2e-07 to 2e-06",
        "peak force at least 6.642 at time 2e-06 (step 10), as the run ends in contact",
        "tape9: contact and the projectile, stored by RODP; 10 rows",
        "location = gauss",
        "elements 140x9 int32 1 to 609",
        "coordinates 609x2 float64 length 0 to 6",
    ):
        assert line in text
    assert "slips check-end, counter, density" in text
    for group in ("mesh", "laminate", "tape3", "tape8", "tape9", "history", "energy"):
        assert f"\n{group}: " in text


def test_units_are_told_where_the_deck_names_them(tmp_path: Path) -> None:
    path = tmp_path / "units.h5"
    fecm.run(small(data=f"UNIT\nin lbf s\n{DATA_CARDS}"), output=path)
    text = words(path)
    assert "units length in, force lbf, time s" in text
    assert "force/length (lbf/in)" in text


def test_a_result_that_lacks_what_a_tape_needs_is_refused(
    changed: Callable[[Edit], Path], tmp_path: Path
) -> None:
    def edit(file: h5py.File) -> None:
        del file["tape8/gamma_yz"]

    done = call("tapes", changed(edit), "-d", tmp_path / "tapes")
    assert done.exit_code == 2
    assert "tape8/gamma_yz" in done.stderr
    assert done.stderr.count("\n") == 1


def test_json_holds_the_files_own_numbers(result: Path) -> None:
    done = call("info", result, "--format", "json")
    said = json.loads(done.stdout)
    assert done.stdout.count("\n") == 1
    assert said["title"] == "small plate"
    assert said["size"] == result.stat().st_size
    assert (said["mode"], said["slips"], said["format_version"]) == ("report", [], 1)
    assert said["time"] == pytest.approx([0.5e-6, 5e-6])
    datasets = {d["name"]: d for group in said["groups"] for d in group["datasets"]}
    with h5py.File(result) as file:
        force = file["history/force"][()]
        names: list[str] = []
        file.visititems(lambda n, i: names.append(n) if hasattr(i, "shape") and i.shape else None)
    assert sorted(datasets) == sorted(name for name in names if "/" in name)
    assert datasets["history/force"]["max"] == force.max()
    assert datasets["history/force"]["dimension"] == "force"
    assert datasets["tape8/kappa_x"]["shape"] == [2, 4, 9]
    rows = {group["name"]: group["rows"] for group in said["groups"]}
    assert (rows["history"], rows["tape3"], rows["mesh"]) == (10, 2, None)


def test_numbers_that_are_none_are_counted_and_left_out_of_the_range(
    changed: Callable[[Edit], Path],
) -> None:
    def edit(file: h5py.File) -> None:
        file["tape3/w"][0, :3] = [math.nan, math.inf, -math.inf]
        file["tape9/velocity"][:] = math.nan
        file.attrs["note"] = math.nan

    path = changed(edit)
    text = words(path)
    assert "velocity 2 float64 length/time no finite number, 2 not finite" in text

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    said = json.loads(call("info", path, "--format", "json").stdout, parse_constant=refuse)
    datasets = {d["name"]: d for group in said["groups"] for d in group["datasets"]}
    assert datasets["tape3/w"]["not_finite"] == 3
    assert math.isfinite(datasets["tape3/w"]["max"])
    assert said["attributes"]["note"] == "NaN"


def test_a_result_of_a_deck_without_impact_steps_is_told(tmp_path: Path) -> None:
    path = tmp_path / "idle.h5"
    fecm.run(small("LMAS\nDT        .5E-6\n"), output=path)
    assert "Nothing was stored" in words(path)


def test_a_title_can_not_command_the_terminal(changed: Callable[[Edit], Path]) -> None:
    def edit(file: h5py.File) -> None:
        file.attrs["title"] = "red \x1b[31m\nline"

    first = call("info", changed(edit)).stdout.splitlines()[0]
    assert first == r"red \x1b[31m\nline"


def foreign_attributes(file: h5py.File) -> None:
    file.attrs["reference"] = file["tape3"].ref
    file.attrs["region"] = file["tape3/w"].regionref[0, :2]
    file.attrs["empty"] = h5py.Empty("f8")
    file.attrs["table"] = np.zeros(2, dtype=[("a", "f8"), ("b", "S3")])
    file.attrs["opaque"] = np.void(b"\x00\x01")
    file.attrs["complex"] = 1 + 2j
    file.attrs["bytes"] = np.bytes_(b"\xff\xfe")
    file["tape3/w"].attrs["description"] = [1.0, 2.0]
    file["tape3"].attrs["references"] = np.array([file.ref], dtype=h5py.ref_dtype)


def without_energy(file: h5py.File) -> None:
    del file["energy"]


def without_attributes(file: h5py.File) -> None:
    for name in list(file["energy"].attrs):
        del file["energy"].attrs[name]


def foreign_items(file: h5py.File) -> None:
    file["tape3/again"] = file["/"]  # a loop of groups
    file["type"] = np.dtype("f8")


@pytest.mark.parametrize(
    "edit",
    [foreign_attributes, without_energy, without_attributes, foreign_items],
)  # fmt: skip
@pytest.mark.few(1)  # of 4, 0.3 s each
def test_a_result_with_foreign_or_missing_parts_is_still_told(
    changed: Callable[[Edit], Path], edit: Edit
) -> None:
    path = changed(edit)
    assert "indentation 10 float64 length" in words(path)
    assert call("info", path, "--format", "json").exit_code == 0
    assert call("diff", path, path, "--only", "history").exit_code == 0


def put(path: str, value: Any) -> Edit:
    """An edit that puts something else in the place of a dataset or group."""

    def edit(file: h5py.File) -> None:
        del file[path]
        file[path] = value

    return edit


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (put("history/force", np.zeros((10, 2))), "history/force has the shape (10, 2)"),
        (put("history/force", np.zeros(9)), "rows is"),
        (put("history/time", 3.0), "history/time has the shape ()"),
        (put("history/force", np.zeros(10, dtype="i8")), "has the wrong type: expected f8"),
        (put("tape3/w", np.zeros((2, 24))), "numnp is"),
        (put("laminate/A", np.zeros((2, 2))), "but 3 is"),
        (put("history", np.zeros(3)), ""),
        (put("tape3/w", np.zeros(2, dtype=[("a", "f8")])), "tape3/w holds neither numbers nor"),
        (put("tape3/w", np.zeros(2, dtype="c16")), "tape3/w holds neither"),
        (put("tape3/w", h5py.Empty("f8")), "tape3/w holds neither"),
        (put("deck", ["two", "texts"]), "deck holds neither"),
    ],
)  # fmt: skip
def test_a_dataset_that_is_none_of_a_results_is_named(
    changed: Callable[[Edit], Path], edit: Edit, reason: str
) -> None:
    done = call("info", changed(edit))
    if reason:
        assert_unusable(done)
        assert reason in done.stderr
    else:
        assert done.exit_code == 0
        assert "steps             10" in done.stdout


def test_a_name_that_is_not_utf_8_is_refused_in_words(changed: Callable[[Edit], Path]) -> None:
    done = call("info", changed(lambda file: h5py.h5g.create(file.id, b"g\xff")))
    assert_unusable(done)
    assert "the name 'g\ufffd' is not UTF-8" in done.stderr


def test_a_shape_beyond_the_files_size_is_refused_before_anything_is_read(
    changed: Callable[[Edit], Path],
) -> None:
    path = changed(
        lambda file: file.create_dataset("extra", (10**6, 10**6), "f8", chunks=(1, 10**6))
    )
    for done in (call("info", path), call("diff", path, path)):
        assert_unusable(done)
        assert "extra has the shape (1000000, 1000000)" in done.stderr


def test_packed_datasets_are_read_like_any_other(
    result: Path, changed: Callable[[Edit], Path]
) -> None:
    def edit(file: h5py.File) -> None:
        values = file["tape3/displacement"][()]
        attributes = dict(file["tape3/displacement"].attrs)
        del file["tape3/displacement"]
        packed = file.create_dataset("tape3/displacement", data=values, compression="gzip")
        packed.attrs.update(attributes)

    assert call("diff", result, changed(edit)).exit_code == 0


def format_of(value: Any) -> Edit:
    """An edit of the attribute that says what the file is."""
    return lambda file: file.attrs.__setitem__("format", value)


@pytest.mark.parametrize(
    "edit",
    [
        format_of("other"), format_of(["fecm"]), format_of(1.0), format_of(h5py.Empty("f8")),
        lambda file: file.attrs.__setitem__("format_version", [1, 2]),
        lambda file: file.attrs.__delitem__("format"),
        lambda file: file.attrs.__delitem__("format_version"),
    ],
)  # fmt: skip
def test_a_foreign_hdf5_file_is_refused(changed: Callable[[Edit], Path], edit: Edit) -> None:
    assert_unusable(call("info", changed(edit)))


@pytest.mark.parametrize("name", ["truncated", "text", "empty", "folder", "missing"])
def test_every_unreadable_file_ends_in_one_line(result: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    contents = {"truncated": result.read_bytes()[:-1], "text": small().encode(), "empty": b""}
    if name == "folder":
        path.mkdir()
    elif name in contents:
        path.write_bytes(contents[name])
    done = call("info", path)
    assert_unusable(done)
    assert str(path) in done.stderr


def test_a_dataset_that_vanishes_while_it_is_read_is_one_error(
    changed: Callable[[Edit], Path],
) -> None:
    path = changed(lambda file: None)
    arrays = read(path)
    path.write_bytes(b"gone")
    with pytest.raises(ResultFileError, match=r"changed\.h5: not a readable HDF5 file"):
        arrays["tape3/w"]


def test_altered_bytes_in_the_name_of_an_attribute_end_in_an_answer_or_one_error(
    result: Path, tmp_path: Path
) -> None:
    # One name only: damage to HDF5's own tables may end the library itself.
    generator = random.Random(0)
    data = result.read_bytes()
    begin = data.index(b"format_version")
    for _ in range(20):
        mutated = bytearray(data)
        for _ in range(generator.randint(1, 4)):
            mutated[begin + generator.randrange(14)] = generator.randrange(256)
        path = tmp_path / "mutated.h5"
        path.write_bytes(mutated)
        assert call("info", path).exit_code in (0, 2)
