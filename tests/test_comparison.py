"""A measured force beside that of a result: closed forms, files, refusals."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fecm
from fecm._errors import StudyError
from fecm.plot.pictures import draw
from tests.calls import assert_unusable, call
from tests.decks import DATA_CARDS, small

pytest.importorskip("matplotlib")

UNITS = {"unit_length": "in", "unit_force": "lbf", "unit_time": "s"}


def half_sine(scale: float = 1.0) -> fecm.Result:
    """Force 10 sin(pi t), the transducer half of it, from the first of 1000 steps to time 1."""
    time = np.linspace(0.0, 1.0, 1001)[1:]
    force = scale * 10.0 * np.sin(np.pi * time)
    arrays: dict[str, Any] = {"time": time, "force": force, "transducer": force / 2.0}
    history = {f"history/{name}": values for name, values in arrays.items()}
    return fecm.Result(history, {}, {"": UNITS})


def table(path: Path, head: str, time: Any, force: Any) -> Path:
    """A CSV file of a measurement."""
    rows = (f"{t!r},{f!r}\n" for t, f in zip(time.tolist(), force.tolist(), strict=True))
    path.write_text(head + "".join(rows))
    return path


def test_a_measurement_of_ten_percent_more_has_the_errors_of_closed_form() -> None:
    time = np.linspace(-0.5, 1.5, 4001)
    comparison = half_sine().compare((time, 11.0 * np.sin(np.pi * time)))
    assert (comparison.begin, comparison.end) == pytest.approx((0.0, 1.0), abs=1e-3)
    assert (comparison.peak, comparison.measured_peak) == pytest.approx((10.0, 11.0), rel=1e-5)
    both = (20.0 / math.pi, 22.0 / math.pi)
    assert (comparison.impulse, comparison.measured_impulse) == pytest.approx(both, rel=1e-4)
    assert comparison.rms == pytest.approx(1.0 / math.sqrt(2.0), rel=1e-3)
    assert comparison.correlation == pytest.approx(1.0, abs=1e-6)
    assert "peak 10 against 11 lbf (-9.1%), impulse 6.366 against 7.003 lbf*s (-9.1%)" in str(
        comparison
    )


def test_a_late_measurement_is_correlated_as_the_cosine_of_its_delay() -> None:
    time = np.linspace(0.0, 1.0, 2001)
    whole = fecm.Result(
        {"history/time": time[1:], "history/force": np.sin(2.0 * np.pi * time[1:])}, {}, {}
    )
    actual = whole.compare((time, np.sin(2.0 * np.pi * time - 0.3)))
    assert actual.correlation == pytest.approx(math.cos(0.3), abs=1e-3)


def test_a_delay_and_an_offset_of_the_measurement_are_subtracted() -> None:
    time = np.linspace(0.0, 2.0, 4001)
    force = 3.0 + np.where(time < 0.25, 0.0, 10.0 * np.sin(np.pi * (time - 0.25)))
    comparison = half_sine().compare((time, force), delay=0.25, offset=3.0)
    assert comparison.rms == pytest.approx(0.0, abs=1e-4)
    assert half_sine().compare((time, force)).rms > 3.0
    with pytest.raises(StudyError, match="must be finite"):
        half_sine().compare((time, force), delay=math.nan)


@pytest.mark.parametrize(("delay", "word"), [(0.45, "after"), (0.2, "after"), (-0.1, "")])
def test_a_record_that_begins_at_the_trigger_is_told_its_delay(delay: float, word: str) -> None:
    # Half of the peak of sin(pi t) is passed at 1/6 and 5/6.
    time = np.linspace(0.0, 1.5, 3001)
    force = np.where(
        (time > delay) & (time < 1.0 + delay), 10.0 * np.sin(np.pi * (time - delay)), 0
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        half_sine().compare((time, force))
        half_sine().compare((time, force), delay=delay)
    texts = [str(one.message) for one in caught]
    assert len(texts) == bool(word)
    if word:
        assert f"measured rises {delay} s {word} the result; a delay of {delay}" in texts[0]


@pytest.mark.parametrize(
    ("head", "factor"),
    [("", 1.0), ("time,force\n", 1.0), ("force (lb),Time [s]\n", 1.0), ("time,transducer\n", 0.5)],
)
def test_the_header_says_what_a_file_is_compared_with(
    tmp_path: Path, head: str, factor: float
) -> None:
    time = np.linspace(0.0, 1.0, 101)
    columns = (time, factor * 10.0 * np.sin(np.pi * time))
    file = table(tmp_path / "m.csv", head, *(columns[::-1] if "Time" in head else columns))
    comparison = half_sine().compare(file)
    assert comparison.points == 101
    assert comparison.rms == pytest.approx(0.0, abs=1e-4)
    assert comparison.peak == pytest.approx(factor * 10.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time (parsec),force\n0,1\n1,2\n", "unknown unit of time `parsec`"),
        ("time,force\ns,volts\n0,1\n1,2\n", "unknown unit of force `volts`"),
        ("time,force,force\n0,1,1\n1,2,2\n", "one must be named force"),
        ("time,force\n10,1\n11,2\n", "measured from 10 to 11, computed from 0 to"),
        ("time,force\n0,1\n0,2\n", ":3: time must increase: 0 follows 0"),
        (
            "time,displacement\n0,1\n1,2\n",
            "the columns are time, displacement; one must be named force",
        ),
        ("time,force\n0,nan\n1,2\n", "is 'nan', not a finite number"),
    ],
)
@pytest.mark.few(3)  # of 7, 0.1 s each
def test_files_that_can_not_be_compared_are_refused_in_one_line(
    tmp_path: Path, text: str, words: str
) -> None:
    fecm.run(small(data=DATA_CARDS + "UNIT\nin lbf s\n"), output=tmp_path / "a.h5")
    (tmp_path / "m.csv").write_text(text)
    done = call("plot", "a.h5", "--overlay", "m.csv", cwd=tmp_path)
    assert_unusable(done)
    assert words in done.stderr
    assert not list(tmp_path.glob("*.png"))


RIGS = {
    "milliseconds and kilonewtons": "Time (ms),Load (kN)\n{ms},{kN}\n",
    "tabs and a line of units": "Time\tLoad\tEnergy\nms\tkN\tJ\n{ms}\t{kN}\t0\n",
    "a preamble": "CEAST 9350\nSpecimen : A1\nMass,5.5,kg\nTime,Force\n(s),(N)\n{s},{N}\n",
    "a preamble of pairs": 'Specimen : label,"A1"\n\nTime,Force\n(sec),(N)\n"{s}","{N}"\n',
    "German words and decimal commas": "Zeit (µs);Weg (mm);Kraft (N)\n{us};0,0;{N}\n",
    "a line that names the separator": "sep=;\nTime (s);Force (lbf)\n{s};{lbf}\n",
    "two columns of force": "time (s),force (mV),force (lbf)\n{s},-7,{lbf}\n",
}


@pytest.mark.parametrize("form", RIGS.values(), ids=RIGS)
def test_files_of_test_rigs_are_read_as_they_are(tmp_path: Path, form: str) -> None:
    # The deck is in pounds; a newton is 1/4.4482216152605 of one.
    head, row = form.rstrip("\n").rsplit("\n", 1)
    time = np.linspace(0.0, 1.0, 101)
    force = 10.0 * np.sin(np.pi * time)
    newtons = 4.4482216152605 * force
    columns = {"s": time, "ms": 1e3 * time, "us": 1e6 * time, "lbf": force}
    columns |= {"N": newtons, "kN": 1e-3 * newtons}
    rows = [
        row.format(**{name: f"{values[n]:.9g}" for name, values in columns.items()})
        for n in range(len(time))
    ]
    text = "\n".join([head, *rows])
    (tmp_path / "rig.csv").write_text(text.replace(".", ",") if "Zeit" in head else text)
    comparison = half_sine().compare(tmp_path / "rig.csv")
    assert comparison.points == 101
    assert comparison.measured_peak == pytest.approx(10.0)
    assert comparison.rms == pytest.approx(0.0, abs=1e-4)


def test_columns_and_units_of_a_measurement_are_chosen(tmp_path: Path) -> None:
    time = np.linspace(0.0, 1.0, 101)
    rows = "".join(
        f"{0.0},{4.4482216152605e-3 * f!r},{1e3 * t!r}\n"
        for t, f in zip(time.tolist(), (10.0 * np.sin(np.pi * time)).tolist(), strict=True)
    )
    file = tmp_path / "rig.csv"
    file.write_text("a,channel 2,clock\n" + rows)
    for columns in (("clock", "channel 2"), ("3", "2")):
        comparison = half_sine().compare(file, columns=columns, units=("ms", "kN"))
        assert comparison.rms == pytest.approx(0.0, abs=1e-4)
    pair = (1e3 * time, 4.4482216152605e-3 * 10.0 * np.sin(np.pi * time))
    assert half_sine().compare(pair, units=("ms", "kN")).rms == pytest.approx(0.0, abs=1e-4)
    with pytest.raises(StudyError, match="`columns` of time and force selects others"):
        half_sine().compare(file)
    with pytest.raises(StudyError, match="not two names, of time and force"):
        half_sine().compare(file, units="ms")
    file.write_text("time (s),force\n0,1\n1,2\n")
    with pytest.raises(StudyError, match="time is in s, and `units` says ms"):
        half_sine().compare(file, units=("ms", "lbf"))


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        (([0.0, 1.0], [1.0]), "as many times as forces"),
        (([1.0, 0.0], [1.0, 1.0]), "increasing times"),
        (([0.0, math.nan], [1.0, 1.0]), "finite"),
        (("a", "b"), "a CSV file, or a pair"),
        (([0.0, 1.0], [1.0, 1.0], 3), "a CSV file, or a pair"),
    ],
)
def test_numbers_that_are_no_measurement_are_refused(pair: Any, words: str) -> None:
    with pytest.raises(StudyError, match=words):
        half_sine().compare(pair)


def test_the_command_draws_a_measurement_and_notes_its_difference(tmp_path: Path) -> None:
    result = fecm.run_one(small(), output=tmp_path / "a.h5")
    table(tmp_path / "m.csv", "time,force\n", result.time, 0.5 * result.force)
    done = call("plot", "a.h5", "--overlay", "m.csv", cwd=tmp_path)
    assert (done.exit_code, done.stdout) == (0, "a-force.png\n")
    assert done.stderr.startswith("fecm: note: contact force of a against m.csv: 10 points from")
    assert "(+100.0%), impulse" in done.stderr


def test_the_command_draws_a_measurement_without_its_delay_and_offset(tmp_path: Path) -> None:
    result = fecm.run_one(small(), output=tmp_path / "a.h5")
    late = 5.0 * float(result.time[-1])
    table(tmp_path / "m.csv", "time,force\n", result.time + late, result.force + 7.0)
    options = ("--delay", repr(late), "--offset", 7)
    done = call("plot", "a.h5", "--overlay", "m.csv", *options, cwd=tmp_path)
    assert done.exit_code == 0
    assert "correlation 1.0000" in done.stderr
    assert_unusable(call("plot", "a.h5", "--offset", 7, "-o", "b.png", cwd=tmp_path))


@pytest.mark.parametrize("column", ["force", "transducer"])
def test_a_measurement_lies_on_what_it_is_compared_with(tmp_path: Path, column: str) -> None:
    result = fecm.run_one(small())
    file = table(tmp_path / "m.csv", f"time,{column}\n", result.time, result.force)
    figure: Any = draw("force", {"a": result, "b": result}, overlay=file).figure
    above, below = (axes.get_lines()[-1] for axes in figure.axes)
    own = below if column == "transducer" else above
    assert (own.get_label(), own.get_linestyle()) == ("m.csv", "None")
    np.testing.assert_array_equal(own.get_ydata(), result.force)
    assert figure.legends[0].get_texts()[-1].get_text() == "m.csv"
