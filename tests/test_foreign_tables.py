"""Tables of other programs: the same numbers in every form, or one line that says why not."""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path

import numpy as np
import pytest

import fecm
from fecm import FecmWarning
from fecm._errors import StudyError
from fecm._measured_tables import read_table
from fecm.authoring.case import CasesError
from fecm.location.table import strain_table
from fecm.results.comparison import measurement_of
from fecm.studies.indentation_test.turns import read_test
from fecm.studies.rod_test.filters import recorded
from fecm.studies.rod_test.pulse_test import pulse_of
from fecm.sweeps.case_tables import read_cases
from tests.calls import assert_unusable, call
from tests.decks import ROOT

DECK = {"length": "mm", "force": "N", "time": "s"}
TIME = np.linspace(0.0, 1e-3, 41)
FORCE = 1500.0 * np.sin(np.pi * TIME / 1e-3) + 0.25

HEADS = {  # names of the columns, the line of units, and sizes of the units in s and N
    "names": (("time", "force"), None, (1.0, 1.0)),
    "units": (("Time (ms)", "Load [kN]"), None, (1e-3, 1e3)),
    "remarks": (("time (s)", "force (filtered) (N)"), None, (1.0, 1.0)),
    "a line of units": (("Zeit", "Kraft"), ("(µs)", "(N)"), (1e-6, 1.0)),
    "plain units": (("Time", "Force (filtered)"), ("ms", "kN"), (1e-3, 1e3)),
    "none": (None, None, (1.0, 1.0)),
}
PREAMBLES = {
    "no preamble": (),
    "text": ("Rig 7", "Operator: A. Müller"),
    "pairs": ("Specimen{s}A1", "Drop height{s}0{d}5{s}m", "", "Rate{s}1000000"),
    "comments": ("# written by rig 7; 5 channels, 2 used",),
}


def document(
    separator: str,
    mark: str,
    head: str,
    preamble: str,
    *,
    trailing: bool = False,
    sep: bool = False,
) -> str:
    """The record as a program writes it."""
    names, units, sizes = HEADS[head]
    rows = [
        [f"{value / size:.9e}".replace(".", mark) for value, size in zip(row, sizes, strict=True)]
        for row in zip(TIME.tolist(), FORCE.tolist(), strict=True)
    ]
    lines = [separator.join(row) for row in (names, units, *rows) if row is not None]
    above = [line.format(s=separator, d=mark) for line in PREAMBLES[preamble]]
    text = "\n".join([*above, *(line + separator * trailing for line in lines)]) + "\n"
    return f"sep={separator}\n{text}" if sep else text


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("preamble", PREAMBLES)
@pytest.mark.parametrize(
    "separator", [",", ";", "\t", " "], ids=["comma", "semicolon", "tab", "blank"]
)
@pytest.mark.few(12)  # of 96, 0.05 s each
def test_a_record_is_the_same_in_every_form(
    tmp_path: Path, separator: str, preamble: str, head: str
) -> None:
    path = tmp_path / "record.csv"
    marks = ".," if separator != "," else "."
    ends = zip(("utf-8", "utf-8-sig", "utf-16", "cp1252"), ("\n", "\r\n", "\r", "\n"), strict=True)
    for (mark, trailing, sep), (encoding, end) in itertools.product(
        itertools.product(marks, (False, True), (False, True)), ends
    ):
        text = document(separator, mark, head, preamble, trailing=trailing, sep=sep)
        path.write_bytes(text.replace("\n", end).encode(encoding))
        # Without names, what is above the numbers may look like names.
        if head == "none" and preamble in ("pairs", "text"):
            with pytest.raises(StudyError, match=r"^[^\n]*; `columns` of time and force selects"):
                measurement_of(path, DECK)
            continue
        read = measurement_of(path, DECK)
        np.testing.assert_allclose(read.time, TIME, rtol=1e-8)
        np.testing.assert_allclose(read.force, FORCE, rtol=1e-8)


@pytest.mark.filterwarnings("ignore::fecm.FecmWarning")
@pytest.mark.parametrize("head", HEADS)
def test_a_comma_that_separates_and_marks_decimals_is_refused(tmp_path: Path, head: str) -> None:
    path = tmp_path / "record.csv"
    path.write_text(document(",", ",", head, "no preamble"), encoding="utf-8")
    words = "time must increase" if head == "none" else "separate the columns by semicolons or tabs"
    with pytest.raises(StudyError, match=rf"^[^\n]*{words}[^\n]*$"):
        measurement_of(path, DECK)


def test_every_reader_takes_the_same_forms(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    depth = np.linspace(0.0, 0.4, 41)
    rows = list(zip(depth.tolist(), FORCE.tolist(), TIME.tolist(), strict=True))

    def write(head: str, form: str) -> Path:
        lines = [form.format(d, f, t).replace(".", ",") for d, f, t in rows]
        path.write_bytes("\r\n".join(["sep=;", head, *lines]).encode("utf-16"))
        return path

    read = read_test(
        write("Weg;depth (µm);Kraft;Load (kN);\r\n;;;;", "x;{0:e};;{1:e};"), (), ("mm", "N")
    )
    np.testing.assert_allclose(read.indentation, 1e-3 * depth, rtol=1e-6)
    np.testing.assert_allclose(read.force, 1e3 * FORCE, rtol=1e-6)
    pulse = pulse_of(str(write("Load (kN);Note;Time (ms)", "{1:e};ä;{2:e}")), DECK)
    np.testing.assert_allclose(pulse.force(TIME * 1e-3), 1e3 * FORCE, rtol=1e-5)
    series = recorded(write("Zeit (ms);Note;Kraft (kN)", "{2:e};ä;{1:e}"), "kraft")
    np.testing.assert_allclose(series.values, FORCE, rtol=1e-6)
    assert series.units == {"time": "ms"}
    strains = strain_table(
        write("Time (ms);Temp (°C);gage 2 (µm/m);gage 1 (%)", "{2:e};-;{0:e};{0:e}"), DECK, [1, 2]
    )
    assert strains.gages.tolist() == [2, 1]
    np.testing.assert_allclose(strains.time, 1e-3 * TIME, rtol=1e-6)
    np.testing.assert_allclose(strains.strains, [1e-6 * depth, 1e-2 * depth], rtol=1e-6)
    path.write_bytes("sep=;\nvelocity (m/s);layup;\n1,5;[22,5/-22,5]2s;\n".encode("utf-16"))
    assert read_cases(path, "mm-N-s") == [{"velocity": 1500.0, "layup": "[22.5/-22.5]2s"}]


def test_columns_without_names_are_taken_in_order_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("0,1,\n1,2,\n2,3,\n", encoding="utf-8")
    with pytest.warns(
        FecmWarning, match="no names of columns: column 1 as time, column 2 as force"
    ):
        read = measurement_of(path, DECK)
    assert read.force.tolist() == [1.0, 2.0, 3.0]
    path.write_text("s,w\n0,1\n1,2\n", encoding="utf-8")
    for reader in (lambda: measurement_of(path, DECK), lambda: pulse_of(str(path))):
        with pytest.raises(StudyError, match="the columns are s, w; one must be named time"):
            reader()


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("time,force,force", "one must be named force"),
        ("time,force (N),force (N)", "one must be named force"),
        ("time,force (N),force (kN)", ""),
        ("time,force (lbf),force (kN)", ""),
        ("time,force (filtered),force (raw)", "one must be named force"),
        ("time,force,velocity (furlong)", ""),
        ("time,force (furlong),velocity", "unknown unit of force `furlong`"),
    ],
)
def test_a_repeated_name_needs_units_and_unused_columns_are_not_judged(
    tmp_path: Path, head: str, words: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{head}\n0,1,x\n1,2,\n".replace("x", "5").replace("2,\n", "2,5\n"))
    if words:
        with pytest.raises(StudyError, match=words):
            measurement_of(path, DECK)
    else:
        size = 4.4482216152605 if "lbf" in head else 1.0
        assert measurement_of(path, DECK).force == pytest.approx([size, 2.0 * size])


def test_of_two_columns_of_one_name_the_text_in_brackets_selects(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,force (filtered),force (raw)\n0,1,3\n1,2,4\n")
    for column, force in (("force (filtered)", [1.0, 2.0]), ("force (raw)", [3.0, 4.0])):
        assert measurement_of(path, DECK, ("time", column)).force.tolist() == force
    read = measurement_of(path, DECK, ("time", "-force (raw)"))
    assert read.force.tolist() == [-3.0, -4.0]


def test_a_minus_before_a_column_changes_its_sign(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,force\n0,-1\n1,-2\n")
    for column in ("-force", "-2"):
        assert measurement_of(path, DECK, ("time", column)).force.tolist() == [1.0, 2.0]


def test_units_without_those_of_the_model_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time (ms),force\n0,1\n1,2\n")
    with pytest.raises(StudyError, match="time is in ms, and the units of the model are not known"):
        measurement_of(path, {})


def test_a_pulse_is_converted_to_the_units_of_its_rod(tmp_path: Path) -> None:
    deck = fecm.examples.path("impact-patch.inp").read_text()
    (tmp_path / "d.inp").write_text(deck)
    peaks = []
    for head, size in (("time (s),force (N)", 4.4482216152605), ("time (s),force (lbf)", 1.0)):
        rows = [(0.0, 0.0), (20e-6, 1000.0), (40e-6, 0.0)]
        lines = [f"{t!r},{f * size!r}" for t, f in rows]
        (tmp_path / "p.csv").write_text("\n".join([head, *lines]))
        done = call("rod", "d.inp", "--pulse", "p.csv", "-o", "-", cwd=tmp_path)
        peaks.append(max(float(line.split(",")[1]) for line in done.stdout.splitlines()[1:]))
    assert peaks == pytest.approx([1000.0, 1000.0], rel=1e-9)


def test_a_test_with_negative_forces_is_refused_until_its_sign_is_changed(tmp_path: Path) -> None:
    a = np.concatenate([np.linspace(0.0, 1.0, 25), np.linspace(0.96, 0.2, 20)])
    f = np.where(
        np.arange(45) < 25, 1000.0 * a**1.5, 1000.0 * np.clip((a - 0.2) / 0.8, 0, 1) ** 2.5
    )
    noise = 0.01 * (-1.0) ** np.arange(45)
    path = tmp_path / "a.csv"
    rows = [f"{x!r},{y!r}" for x, y in zip(a.tolist(), (noise - f).tolist(), strict=True)]
    path.write_text("\n".join(["indentation (mm),force (N)", *rows]))
    done = call("indent", "fit", path)
    assert_unusable(done)
    assert "--columns changes the sign" in done.stderr
    done = call("indent", "fit", path, "--columns", "indentation,-force")
    assert done.exit_code == 0
    assert float(done.stdout.split(" k ")[1].split()[0]) == pytest.approx(1000.0, rel=1e-3)


def test_a_calibration_converts_the_transducer_to_the_unit_of_the_accelerometer(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.csv"

    def slope(head: str, *options: str) -> tuple[float, str]:
        path.write_text(f"{head}\n0,0,0\n1,2,4.1\n2,4,7.9\n3,1,2\n")
        done = call("rod", "calibrate", path, "--mass", 1, "--c-a", 1, *options)
        assert done.exit_code == 0, done.stderr
        return float(done.stdout.split("slope V_F/V_a")[1].split()[0]), done.stderr

    plain, text = slope("time,V_F,V_a")
    assert text == ""
    assert slope("time,V_F (mV),V_a (mV)")[0] == plain
    assert slope("time,V_F (mV),V_a (V)")[0] == pytest.approx(1e-3 * plain, rel=1e-5)
    turned, text = slope("time,V_F,V_a", "--columns", "time,V_F,-V_a")
    assert turned == -plain
    assert "--columns time,V_F,-V_a" in text
    path.write_text("time,V_F (mV),V_a\n0,0,0\n1,2,4.1\n2,4,7.9\n3,1,2\n")
    done = call("rod", "calibrate", path, "--mass", 1, "--c-a", 1)
    assert_unusable(done)
    assert "name both units" in done.stderr


@pytest.mark.parametrize(
    "path", sorted((ROOT / "fecm/examples").glob("*.csv")), ids=lambda p: p.stem
)
def test_the_tables_of_the_package_have_the_fields_that_a_plain_split_gives(path: Path) -> None:
    lines = [n for n in path.read_text("utf-8").splitlines() if n and not n.startswith("#")]
    table = read_table(path)
    assert [table.head[1], *(row for _, row in table.rows)] == [
        [field.strip() for field in line.split(",")] for line in lines
    ]


def test_a_pulse_in_milliseconds_without_a_unit_is_doubted(tmp_path: Path) -> None:
    deck, path = fecm.examples.path("impact-patch.inp"), tmp_path / "p.csv"
    rows = [(0.0, 0.0), (20e-6, 1000.0), (40e-6, 0.0)]
    for head, scale in (("time", 1e3), ("time (ms)", 1e3), ("time", 1.0)):
        path.write_text("\n".join([f"{head},force", *(f"{t * scale!r},{f!r}" for t, f in rows)]))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            fecm.pulse_test(deck, path, duration=1e-4)
        doubted = any("as in `time (ms)`" in str(one.message) for one in caught)
        assert doubted == (head == "time" and scale == 1e3)


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("time (us)\tforce (N)\n0\t950\n1\t1,060\n2\t999\n", "'1,060' beside whole numbers"),
        ("time (us);force (N)\n0;950\n1;1.060\n2;999\n", "'1.060' beside whole numbers"),
        ("time (ms);force (N)\n0,1;950,5\n0,2;1.060,5\n", "'1.060,5', not a finite number"),
        ("time (ms);force (N)\n0.1;950.5\n0.2;1'060.5\n", '"1\'060.5", not a finite number'),
        ('time (ms),force (N)\n0.1,950.5\n0.2,"1,060.5"\n', "'1,060.5', not a finite number"),
    ],
)
def test_separators_of_thousands_are_no_decimal_marks(
    tmp_path: Path, text: str, written: str
) -> None:
    file = tmp_path / "force.csv"
    file.write_text(text)
    with pytest.raises(StudyError, match=f":3: force is {written}; write numbers without sep"):
        measurement_of(file, DECK)


def test_three_decimals_are_decimals_where_smaller_numbers_have_them_too(tmp_path: Path) -> None:
    file = tmp_path / "force.csv"
    file.write_text("time (s);force (N)\n0;0,950\n1;1,060\n2;999\n")
    assert measurement_of(file, DECK).force.tolist() == [0.95, 1.06, 999.0]


def test_thousands_in_a_table_of_cases_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "cases.txt"
    file.write_text("velocity\tk\n900\t2e4\n1,100\t2e4\n")
    with pytest.raises(CasesError, match=":3: velocity is '1,100' beside whole numbers"):
        read_cases(file)


def newtons(row: str, count: int = 5) -> str:
    """Rows of times from -0.2 ms at 0.1 ms, and of 10, 20, 30 ... N."""
    return "".join(row.format(t=1e-4 * (n - 2), n=n, f=10.0 * (n + 1)) for n in range(count))


TEKTRONIX = (
    "Record Length,2.5e+03,,-0.0002,10.0,\nSample Interval,1e-04,,-0.0001,20.0,\n"
    "Source,CH1,,0.0,30.0,\nVertical Units,V,,0.0001,40.0,\n,,,0.0002,50.0,\n,,,0.0003,60.0,\n"
)
SCOPES = {  # name: text, columns, factor of the time
    "Tektronix TDS": (TEKTRONIX, ("4", "5"), 1.0),
    "Tektronix MDO": (
        "Model,MDO3024\n\nHorizontal Units,S\nRecord Length,5\n,,\nLabel,,\nTIME,CH1\n"
        + newtons("{t:e},{f}\n"),
        ("TIME", "CH1"),
        1.0,
    ),
    "LeCroy": (
        "LECROYWR62Xi,20123,Waveform\nSegments,1,SegmentSize,5\nSegment,TrigTime,TimeSince\n"
        "#1,27-Jan-2015 13:05:10,0\nTime,Ampl\n" + newtons("{t:e},{f}\n"),
        ("Time", "Ampl"),
        1.0,
    ),
    "Keysight": ("x-axis,1\nsecond,N\n" + newtons("{t:E},{f:E}\n"), ("x-axis", "1"), 1.0),
    "Rigol": ("Time(s),CH1\n" + newtons("{t:e},{f:e},\n").replace(",\n", "\n"), ("1", "2"), 1.0),
    "LabVIEW": (
        "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\nTime\t13:05:10,123\n"
        "***End_of_Header***\t\n\t\nChannels\t1\nX_Dimension\tTime\nX0\t0,0\nDelta_X\t0,0001\n"
        "***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
        + newtons("{t:f}\t{f:f}\n").replace(".", ","),
        (),
        1.0,
    ),
    "PicoScope": (
        "Time,Channel A\n(ms),(N)\n\n" + newtons("{t:f},{f}\n"),
        ("Time", "Channel A"),
        1e-3,
    ),
}


@pytest.mark.parametrize(("text", "columns", "size"), SCOPES.values(), ids=SCOPES)
def test_records_of_oscilloscopes_keep_every_sample(
    tmp_path: Path, text: str, columns: tuple[str, ...], size: float
) -> None:
    file = tmp_path / "scope.csv"
    file.write_text(text)
    actual = measurement_of(file, DECK, columns)
    samples = np.arange(len(actual.time))
    assert len(samples) >= 5
    np.testing.assert_allclose(actual.time, size * 1e-4 * (samples - 2), atol=1e-15)
    np.testing.assert_allclose(actual.force, 10.0 * (samples + 1))


@pytest.mark.parametrize(
    ("text", "columns", "words"),
    [
        (TEKTRONIX, (), "one must be named time"),
        ("X,CH1,Start,Increment\nSequence,Volt,-3e-6,5e-9\n0,1,,\n1,2,,\n", (), "are X, CH1, "),
        ("X,CH1,Start,Increment\nSequence,Volt,-3e-6,5e-9\n0,1,,\n1,2,,\n", ("1", "2"),
         ":2: time is 'Sequence', not a finite number"),
        ("x-axis,1,2\nsecond,Volt,Volt\n0,1,2\n1,2,3\n", ("x-axis", "1"),
         "unknown unit of force `Volt`"),
        ("x-axis,1,2\nsecond,Volt,Volt\n0,1,2\n1,2,3\n", ("1", "2"),
         "1 and 2 are names of columns, and numbers of others"),
        ("X_Value\tForce\tLoad cell\n\t1.0\t2.0\n\t2.0\t2.0\n", (), "time is empty"),
    ],
)  # fmt: skip
def test_records_without_a_time_or_in_volts_are_refused(
    tmp_path: Path, text: str, columns: tuple[str, ...], words: str
) -> None:
    file = tmp_path / "scope.csv"
    file.write_text(text)
    with pytest.raises(StudyError, match=rf"^[^\n]*{words}[^\n]*$"):
        measurement_of(file, DECK, columns)


def test_a_first_row_with_a_remark_is_filtered_too(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("0,1,trigger\n1,2\n2,3\n")
    assert recorded(file).values.tolist() == [1.0, 2.0, 3.0]


def test_columns_that_are_named_by_numbers_keep_their_names(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("note,7,8\na,0,5\nb,1,6\n,2,7\n,3,8\n")
    with pytest.warns(FecmWarning, match=":1: 7, 8 are taken as names, not as a row"):
        assert measurement_of(file, DECK, ("2", "3")).force.tolist() == [5.0, 6.0, 7.0, 8.0]


def test_a_comma_that_may_separate_thousands_is_noted_once_nothing_tells(tmp_path: Path) -> None:
    file = tmp_path / "force.csv"
    file.write_text("time (us)\tforce (N)\n0\t1,060\n1\t1,250\n2\t1,125\n")
    with pytest.warns(FecmWarning, match=":2: force, '1,060', is taken as 1.060; if its comma"):
        actual = measurement_of(file, DECK)
    assert actual.force.tolist() == [1.06, 1.25, 1.125]
    file.write_text("time (us)\tforce (N)\n0,5\t1,060\n1,5\t1,250\n2,5\t1,125\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert measurement_of(file, DECK).force.tolist() == [1.06, 1.25, 1.125]


@pytest.mark.parametrize(
    ("head", "size"),
    [
        ("Kraft/kN", 1e3),
        ("Kraft / kN", 1e3),
        ("Kraft kN", 1e3),
        ("Kraft_kN", 1e3),
        ("Kraft in kN", 1e3),
        ("Kraft in [kN]", 1e3),
        ("Kraft: kN", 1e3),
        ("Kraft-kN", 1e3),
        ("Kraft (kN", 1e3),
        ("Kraft/kN (gefiltert)", 1e3),
        ("Force (filtered) kN", 1e3),
        ("FORCE_KN", 1e3),
        ("F/N", 1.0),
        ("F_N", 1.0),
        ("Load/lbf", 4.4482216152605),
        ("Load Newtons", 1.0),
        ("Last in Kilonewton", 1e3),
        ("force", 1.0),
    ],
)
def test_a_unit_is_read_in_every_notation_with_and_without_columns(
    tmp_path: Path, head: str, size: float
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"Zeit/ms;note;{head}\n0;1;1\n1;1;2\n2;1;4\n", encoding="utf-8")
    for columns in ((), ("1", "3"), ("Zeit/ms", head)):
        read = measurement_of(path, DECK, columns)
        assert read.force == pytest.approx([size, 2.0 * size, 4.0 * size])
        assert read.time == pytest.approx([0.0, 1e-3, 2e-3])


@pytest.mark.parametrize(
    ("head", "unread"),
    [("Load/Deflection", ""), ("force_max", ""), ("force_1", ""), ("m/s", ""), ("N/mm", ""),
     ("force raw", ""), ("Kraft/tonf", "tonf"), ("force_in", "in"), ("Kraft in t", "t"),
     ("force_min", "min")],
)  # fmt: skip
def test_what_is_no_known_unit_stays_in_the_name_and_is_told_if_it_looks_like_one(
    tmp_path: Path, head: str, unread: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"time (s),{head}\n0,1\n1,2\n2,4\n", encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if unread == "t":
            with pytest.raises(StudyError, match="unknown unit of force `t`"):
                measurement_of(path, DECK, ("1", "2"))
            return
        assert measurement_of(path, DECK, ("1", "2")).force.tolist() == [1.0, 2.0, 4.0]
    texts = [str(warning.message) for warning in caught]
    assert [f"`{unread}` in `{head}` is not read as one" in text for text in texts] == (
        [True] if unread else []
    )


def test_a_unit_behind_a_slash_is_converted_to_the_units_of_an_indentation_fit(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{n};{0.01 * n};{2.0 * (0.01 * n) ** 1.5}\n" for n in range(40))
    path.write_text(f"Zeit/s;Weg/mm;Kraft/kN\n{rows}", encoding="utf-8")
    for options in ((), ("--columns", "2,3"), ("--columns", "2,3", "--unit", "mm,N")):
        done = call("indent", "fit", path, *options)
        assert float(done.stdout.split(" k ")[1].split()[0]) == pytest.approx(2000.0, rel=1e-4)


def test_a_table_of_cases_takes_units_in_every_notation(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    for head in ("energy/J", "energy J", "energy_J", "energy in J", "energy [J]"):
        path.write_text(f"{head},velocity_m/s\n1,2\n")
        assert read_cases(path, "mm-N-s") == [{"energy": 1000.0, "velocity": 2000.0}]


def test_a_list_of_columns_is_cut_between_names(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    names = [f"channel number {n}" for n in range(12)]
    path.write_text("\n".join([",".join(names), *[",".join("1" * 12)] * 3]))
    with pytest.raises(StudyError, match=r"channel number 3, \.\.\.; one must be named time"):
        measurement_of(path, DECK)


def test_a_clock_of_too_few_digits_is_told_with_its_mean_step(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{3.3e-7 * n:.6f},{n}\n" for n in range(30))
    path.write_text(f"time (s),force (N)\n{rows}")
    with pytest.raises(
        StudyError, match=r":3: time .* of 29 steps are 0: .* too few digits .*is 3\.4"
    ):
        measurement_of(path, DECK)


@pytest.mark.filterwarnings("always::fecm.FecmWarning")
def test_a_rise_time_has_a_unit_and_one_below_the_step_is_doubted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{0.2 * n:.1f},{float(n > 5)}\n" for n in range(30))
    path.write_text(f"Time/us,Incident_strain\n{rows}")

    def filtered(text: str) -> tuple[str, str]:
        done = call("rod", "filter", path, "--filter", text, "-o", "-")
        assert done.exit_code == 0
        return done.stdout, done.stderr

    assert filtered("first-order:2")[0] == filtered("first-order:2us")[0]
    assert filtered("first-order:2us") == filtered("first-order:0.002ms")
    message = "the rise time 2e-06 us of the filter is below the time step 0.2 us"
    assert message in filtered("first-order:2e-6")[1]
    assert message not in filtered("first-order:2us")[1]
    path.write_text(f"Time,Incident_strain\n{rows}")
    done = call("rod", "filter", path, "--filter", "first-order:2us", "-o", "-")
    assert_unusable(done)
    assert "the times have no unit" in done.stderr
