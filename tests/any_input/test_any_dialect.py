"""Whatever a CSV file is written with, the numbers that are read are those that were written, or it is refused."""

import tempfile
import warnings
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pandas import DataFrame, Timestamp, to_timedelta
from reading_whatever import many

from armid.errors import ArmidError
from armid.record import RecordWarning
from armid.record.table import read_table, table_of, time_column

NAMES = ("time_s", "angular_velocity_rad_s", "drive_V")
# What spreadsheets, loggers and languages print.
FORMATS = ("{!r}", "{:.3f}", "{:.1f}", "{:g}", "{:.6e}", "{:.0f}")
FINITE = st.floats(-1e9, 1e9, allow_subnormal=False)
SMALL = st.integers(-9999, 9999).map(lambda i: i / 1000)


def read(content):
    """Return the columns of these bytes with what was assumed, or the sentence with which they are refused."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        path = Path(folder) / "a.csv"
        path.write_bytes(content)
        try:
            table = read_table(path, "a.csv")
        except ArmidError as error:
            return None, str(error)
    assert all(w.category is RecordWarning for w in caught)
    assert len(caught) <= 1
    return table, " ".join(str(w.message) for w in caught)


def written(rows, form, separator, point, quotes=False, trailing="", comments=0, units=False, end="\n", names=NAMES):
    def cell(value):
        text = form.format(value).replace(".", point)
        return f'"{text}"' if quotes else text

    lines = [f"# {i}" for i in range(comments)] + [separator.join(names) + trailing]
    lines += [separator.join(("s", "rad/s", "V")) + trailing] if units else []
    lines += [separator.join(map(cell, row)) + trailing for row in rows]
    return end.join(lines) + end


DIALECT = {
    "form": st.sampled_from(FORMATS), "separator": st.sampled_from([",", ";", "\t"]), "point": st.sampled_from(".,"),
    "quotes": st.booleans(), "comments": st.integers(0, 2), "units": st.booleans(),
    "end": st.sampled_from(["\n", "\r\n", "\r"]), "tail": st.booleans(),
    "encoding": st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
}  # fmt: skip


@many(500)
@given(st.lists(st.tuples(*[st.one_of(FINITE, SMALL)] * 3), min_size=1, max_size=8), st.fixed_dictionaries(DIALECT))
@example([(0.0, 1.234, 5.678), (1.0, 2.345, 6.789)], {
    "form": "{:.3f}", "separator": ";", "point": ",", "quotes": False, "comments": 0, "units": False, "end": "\n",
    "tail": False, "encoding": "utf-8"})  # fmt: skip
@example([(1.234, 1.234, 1.234)], {
    "form": "{:.3f}", "separator": ";", "point": ",", "quotes": True, "comments": 1, "units": True, "end": "\n",
    "tail": True, "encoding": "utf-16"})  # fmt: skip
def test_what_is_read_is_what_was_written(rows, dialect):
    style = dict(dialect)
    encoding, tail = style.pop("encoding"), style.pop("tail")
    style["trailing"] = style["separator"] if tail else ""
    text = written(rows, **style)
    table, said = read(text.encode(encoding))
    if style["separator"] == "," == style["point"] and not style["quotes"] and "," in text.split(style["end"])[-2]:
        # no reader can tell: a file of whole numbers is plain, all others have to be refused
        printed = [style["form"].format(v) for row in rows for v in row]
        if any("." in p for p in printed):
            assert table is None, said
            return
    if table is None:
        assert "expected" in said
        return
    printed = np.array([[float(style["form"].format(v)) for v in row] for row in rows])
    found = np.column_stack([table.columns[name] for name in NAMES])
    np.testing.assert_array_equal(found, printed)
    unusual = style["separator"] != "," or style["comments"] or tail or style["units"] or encoding == "utf-16"
    assert bool(said) >= bool(unusual)


ROWS = [(0.0, 0.5, 12.25), (0.01, 0.75, -3.5)]


@pytest.mark.parametrize(("content", "words"), [
    (written(ROWS, "{!r}", ";", ","), ["';' between columns", "',' for the decimal point"]),
    (written(ROWS, "{!r}", ",", ",", quotes=True), ["',' for the decimal point"]),
    (written(ROWS, "{!r}", "\t", "."), ["a tab between columns"]),
    (written(ROWS, "{!r}", ",", ".", comments=2), ["2 comment lines left out"]),
    (written(ROWS, "{!r}", ",", ".", units=True), ["units on line 2"]),
    (written(ROWS, "{!r}", ",", ".", trailing=","), ["a separator at the end of each line"]),
    ("# " + written(ROWS, "{!r}", ",", "."), ["names in the comment"]),
    (written(ROWS, "{!r}", ",", ".").encode("utf-16"), ["UTF-16"]),
    (written(ROWS, "{!r}", ";", ".", units=True, names=("time", "angular_velocity", "drive")), ["units on line 2"]),
])  # fmt: skip
def test_other_ways_to_write_a_file_are_read_with_one_sentence(content, words):
    table, said = read(content if isinstance(content, bytes) else content.encode())
    assert table is not None, said
    assert said.startswith("a.csv: read with ")
    for word in words:
        assert word in said
    assert list(table.columns) == list(NAMES)
    np.testing.assert_array_equal(np.column_stack([*table.columns.values()]), ROWS)
    assert table.lines[1] > table.lines[0] > 1


@pytest.mark.parametrize(("text", "words"), [
    ("time_s;a\n1,234;5,678\n", ["line 2", "'1,234' may be 1234 or 1.234", 'sep=";", decimal=","']),
    ("time_s;a\n1.234;5.678\n", ["line 2", "'1.234' may be 1234 or 1.234"]),
    ("time_s;a\n1.234,5;1\n0;1,5\n", None),
    ("time_s,a\n0,001,1,5\n", ["line 2", "4 values", "semicolon between columns"]),
    ('time_s,a\n"1,234","5,678"\n', ["line 2", "'1,234' may be"]),
    ("time,s;a\n0,1;2\n0,2;3\n", ["line 1", "',' and ';'", "one separator"]),
    ('time_s,a\n0,"1\n', ["line 2", "quotation mark"]),
    ("time_s,a_rad\nms,deg\n0,1\n", ["line 2", "unit of 'time_s' is 'ms'"]),
])  # fmt: skip
def test_what_may_be_read_in_two_ways_is_refused(text, words):
    table, said = read(text.encode())
    if words is None:
        # two marks in one number: a text, which nobody may use
        with pytest.raises(ArmidError, match="a finite number is expected"):
            table.numbers("time_s")
        return
    assert table is None
    for word in words:
        assert word in said


CLOCKS = {"{:%H:%M:%S.%f}", "{:%Y-%m-%d %H:%M:%S.%f}", "{:%Y-%m-%dT%H:%M:%S.%fZ}", "{:%Y-%m-%d %H:%M:%S.%f+02:00}"}


@many(50)
@given(st.datetimes(datetime(1999, 1, 1), datetime(2040, 1, 1)), st.sampled_from(sorted(CLOCKS)), st.booleans(),
       st.lists(st.integers(1, 40_000_000_000), min_size=1, max_size=8))  # fmt: skip
@example(datetime(2024, 2, 28, 23, 59, 59, 999_999), "{:%H:%M:%S.%f}", True, [1, 1])
def test_times_of_day_are_seconds_after_the_first_row(begin, form, comma, steps):
    """Steps of up to eleven hours in microseconds, so that midnight passes within a day's half."""
    after = np.append(0, np.cumsum(steps))
    cells = [form.format(begin + timedelta(microseconds=int(n))) for n in after]
    cells = [cell.replace(".", ",") if comma else cell for cell in cells]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_text("time_s;w\n" + "".join(f"{cell};1\n" for cell in cells))
        with pytest.warns(RecordWarning):
            table = read_table(path, "a.csv")
    with pytest.warns(RecordWarning, match="times of day, which are read as seconds after the first row"):
        np.testing.assert_allclose(time_column(table), 1e-6 * after, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("cells", "line"), [
    (["12:00:01", "12:00:62 s"], 3), (["12:00", "12:01"], 2), (["2024-13-01 10:00:00"] * 2, 2),
    (["2024-05-01 10:00:00Z", "2024-05-01 10:00:01+02:00"], 2),
])  # fmt: skip
def test_other_times_are_refused(tmp_path, cells, line):
    path = tmp_path / "a.csv"
    path.write_text("time_s,w\n" + "".join(f"{cell},1\n" for cell in cells))
    with pytest.raises(ArmidError, match=rf"line {line}: time_s is '.*', a finite number is expected"):
        time_column(read_table(path, "a.csv"))


def test_times_of_pandas_are_read_and_a_table_without_rows_is_refused():
    after = np.array([0.0, 0.25, 1.0])
    frame = DataFrame({"time_s": Timestamp("2024-02-28 23:59:59.5") + to_timedelta(after, unit="s")})
    with pytest.warns(RecordWarning, match="times of day"):
        np.testing.assert_allclose(time_column(table_of(frame, "a.csv")), after, rtol=0, atol=1e-9)
    with pytest.raises(ArmidError, match="holds no samples"):
        table_of(DataFrame(columns=["time_s", "w"]), "a.csv")
