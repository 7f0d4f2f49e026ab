"""Limits of the readers, at the last value of one side and the first of the other."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eaid.logs.options import ReadOptions

from eaid.errors import DataError, UsageError
from eaid.logs import text, to_run
from eaid.logs.columns import Roles, by_place, chosen_table, rises, shown, steps, the_input
from eaid.logs.dialect import has_table
from eaid.logs.foreign.groups import grouped
from eaid.logs.foreign.lvm import read_lvm
from eaid.logs.foreign.ros import MOST_ELEMENTS, layout_of
from eaid.logs.foreign.signals import Signal, tables_of_signals
from eaid.logs.formats import is_hdf5
from eaid.logs.read import joined, read_runs
from eaid.logs.run import Run
from eaid.logs.table import BadCell, Cells, Table
from eaid.logs.to_run import checked, seconds_since_start, time_scale, without_moving_steps
from eaid.logs.units import divisor, likely_time_unit, scale_of

# clocks


@pytest.mark.parametrize("unit", to_run.PER_S)
def test_stamps_since_1970_begin_in_2001_and_end_in_2096(unit: str) -> None:
    per_s = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    beyond = 1 if unit != "ns" else 1024  # the next whole number that a float tells apart
    low, high = 10**9 * per_s, 4 * 10**9 * per_s
    for first, counted in ((low, True), (low - beyond, False), (high, True), (high + beyond, False)):
        raw = np.array([first, first + per_s])
        scale = time_scale("a", None, "time", "")
        found = seconds_since_start("a", "time", raw, scale)
        told = [one.code for one in found[2]] == ["time-since-1970"]
        assert (float(found[0][1]), told) == ((1.0, unit != "s") if counted else (per_s, False))


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_stamps_since_1970_lie_up_to_90_s_apart(unit: str) -> None:
    per_s = {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    for apart_s, code in ((90, "time-since-1970"), (91, "time-too-long")):
        raw = np.array([2 * 10**9 * per_s, (2 * 10**9 + apart_s) * per_s])
        found = seconds_since_start("a", "time", raw, time_scale("a", None, "time", ""))
        assert [one.code for one in found[2]] == [code]


@pytest.mark.parametrize(
    ("first", "counted"),
    [(29_999.0, False), (30_000.0, True), (60_000.0, True), (60_001.0, False),
     (699_999.0, False), (700_000.0, True), (770_000.0, True), (770_001.0, False)],
)  # fmt: skip
def test_stamps_in_days(first: float, counted: bool) -> None:
    raw = first + np.arange(100) / 86400 / 100
    found = seconds_since_start("a", "time", raw, time_scale("a", None, "time", ""))
    assert [one.code for one in found[2]] == (["time-in-days"] if counted else ["time-too-fast"])


def codes(rate_hz: float, column: str = "time", unit: str = "") -> list[str]:
    raw = np.arange(1000) / rate_hz
    found = seconds_since_start("a", column, raw, time_scale("a", None, column, unit))[2]
    return [f"{one.code} {one.values['likely']}" for one in found]


def test_clocks_that_no_bench_has() -> None:
    assert codes(49_999.5) == [] and codes(50_000.5) == ["time-too-fast min"]
    assert codes(4_999_999.5) == ["time-too-fast min"] and codes(5_000_000.5) == ["time-too-fast d"]
    assert codes(4_999_999.5, unit="s") == [] and codes(5_000_000.5, unit="s") == ["time-too-fast d"]


@pytest.mark.parametrize(
    ("span", "step", "code"),
    [(3600.0, 1.0, "time-in-whole-numbers"), (3601.0, 1.0, "time-too-long"), (3600.5, 0.5, "")],
)
def test_whole_numbers_of_a_clock(span: float, step: float, code: str) -> None:
    raw = np.arange(0, span + step / 2, step)
    found = seconds_since_start("a", "t", raw, time_scale("a", None, "t", ""))[2]
    assert [one.code for one in found] == ([code] if code else [])


def test_likely_units_of_a_clock() -> None:
    assert [likely_time_unit(usual) for usual in (500.0, 501.0, 5e5, 5.1e5, 1e9)] == ["ms", "us", "us", "ns", "ns"]


@pytest.mark.parametrize("said", ["/0", "/-1", "/x", "/inf", "/nan", "/"])
def test_a_divisor_is_a_number_above_zero(said: str) -> None:
    with pytest.raises(UsageError):
        divisor("time", said)
    assert divisor("time", "/255") == 255.0
    into = [scale_of("a", role, "/4", "x", "", "", "x") for role in ("input", "output")]
    assert [(one.unit, one.factor) for one in into] == [("%", 25.0), ("", 0.25)]


# rows


def refusals(columns: dict[str, Any], cells: list[tuple[int, str, str]] = [], repair: bool = False) -> list[str]:  # noqa: B006
    try:
        checked("a", {k: np.asarray(v) for k, v in columns.items()}, cells, lambda i: i + 1, "row", repair)
    except DataError as fault:
        return list(fault.sentences)
    return []


def test_columns_of_different_lengths() -> None:
    assert "different lengths (2, 3)" in refusals({"time": [0.0, 1.0], "y": [0.0, 1.0, 2.0]})[0]
    assert "no rows" in refusals({"time": [], "y": []})[0]
    assert refusals({"time": [0.0, 1.0], "y": [0.0, 1.0]}) == []


def test_five_bad_rows_are_named_and_the_rest_counted() -> None:
    for count, named in ((5, 5), (6, 6), (9, 6)):
        y = np.where(np.arange(2000) < count, np.nan, 0.0)
        said = refusals({"time": np.arange(2000.0), "y": y})
        assert len(said) == named
        assert ("and 1 more such rows" in said[-1]) is (count == 6)
    assert (
        "or drop such rows with"
        in refusals({"time": np.arange(100.0), "y": np.where(np.arange(100) == 4, np.nan, 0)})[0]
    )
    assert "or drop" not in refusals({"time": np.arange(99.0), "y": np.where(np.arange(99) == 4, np.nan, 0)})[0]


def test_repeated_stamps_up_to_a_fifth() -> None:
    time = np.arange(100.0)
    time[1:40:2] = time[0:40:2]
    assert "rows repeat the time" not in refusals({"time": time})[0]
    time[41] = time[40]
    assert "21 of 100 rows repeat the time of the row before, from row 2 on" in refusals({"time": time})[0]


def test_a_clock_that_was_set_back_is_no_single_row() -> None:
    for rows, word in ((5, "sort the rows"), (6, "split the log")):
        time = np.concatenate([np.arange(100.0), 100.0 - rows + np.arange(100.0)])
        said = refusals({"time": time})
        assert word in said[0] and len(said) == (5 if rows == 5 else 1)


def test_a_dropped_row_moves_no_step() -> None:
    u = np.array([0.0, 0, 0, 5, 5, 5, 5])
    time = np.array([0.0, 1, 2, 2, 3, 4, 5])
    drop = lambda *rows: np.setdiff1d(np.arange(7), rows)  # noqa: E731
    keep, lost = without_moving_steps(drop(3), time, u)
    assert (keep.tolist(), lost) == ([0, 1, 3, 4, 5, 6], [])
    keep, lost = without_moving_steps(drop(3), np.arange(7.0), u)
    assert (keep.tolist(), lost) == ([0, 1, 2, 4, 5, 6], [3])
    for rows in ((2,), (4,), (0,), (6,)):  # none of them is the row of the step
        assert without_moving_steps(drop(*rows), np.arange(7.0), u)[1] == []
    keep, lost = without_moving_steps(np.array([0, 2]), np.array([0.0, 0, 1]), np.array([0.0, 5, 5]))
    assert (keep.tolist(), lost) == ([0, 2], [1])  # nothing else is recorded before it
    for share, count in ((0.09, 0), (0.12, 1)):
        small = np.array([0.0, 0, 0, share, share, share, 1.0])
        assert len(without_moving_steps(drop(3), np.arange(7.0), small)[1]) == count


def test_a_dropped_row_of_which_nothing_stays_is_no_step() -> None:
    peak = np.array([0.0, 0, 0, 5, 2, 2, 2])
    assert without_moving_steps(np.setdiff1d(np.arange(7), 3), np.arange(7.0), peak)[1] == []


def test_joined_parts_keep_their_times() -> None:
    time = np.array([0.0, 1.0])
    first = Run("a", time, time, time, "%", "N·m", "a", "", start_s=100.0)
    (run,) = joined([replace(first, start_s=102.5), first])
    assert run.time_s.tolist() == [0.0, 1.0, 2.5, 3.5]


# columns


def table(count: int, rows: int = 30) -> Table:
    values = [np.arange(float(rows)), *((-1.0) ** np.arange(rows) * k for k in range(1, count))]
    return Table("", ("",) * count, lambda wanted: Cells(tuple(values[i] for i in wanted)))


@pytest.mark.parametrize(("count", "looked"), [(64, True), (65, False)])
def test_columns_without_names_are_looked_at_up_to_64(count: int, looked: bool) -> None:
    with pytest.raises(DataError) as fault:
        by_place("a", table(count), ReadOptions())
    assert ("only column 1 rises all the way" in str(fault.value)) is looked


def test_a_time_rises_in_99_of_100_rows() -> None:
    values = np.arange(1000.0)
    values[500:509] = values[500]
    assert rises(values)
    values[500:512] = values[500]
    assert not rises(values)
    assert not rises(np.arange(2.0)) and rises(np.arange(3.0))


def test_a_commanded_input_jumps_a_few_times() -> None:
    assert not steps(np.r_[np.zeros(9), np.ones(10)]) and steps(np.r_[np.zeros(10), np.ones(10)])
    for jumps in (10, 11):  # a twentieth of 209 samples is 10
        values = np.repeat(np.arange(jumps + 1) % 2.0, 17)
        values = np.r_[values, np.full(209 - len(values), values[-1])]
        assert steps(values) is (jumps == 10)
    flat = np.r_[np.zeros(100), np.linspace(0, 1, 50), np.ones(100)]
    assert not steps(flat)


def test_the_input_is_looked_for_among_64_other_columns() -> None:
    values = [np.zeros(100)] * 70
    names = tuple(f"c{k}" for k in range(70))
    for at, kind in ((63, "clutch"), (64, None)):
        chosen = [*values]
        chosen[at] = np.repeat([0.0, 5.0], 50)
        roles = Roles(None, (), 69, None, others=tuple(range(69)))
        sheet = Table("", names, lambda _: Cells(()))
        assert the_input("a", sheet, roles, chosen.__getitem__, False)[0] == kind


def test_twelve_columns_are_listed() -> None:
    assert shown(["a"] * 12).count("a") == 12
    assert shown(["a"] * 13).endswith(" and 1 more")
    assert shown(["a", "", "c"]) == "a, column 2, c"  # counted from 1, as «columns» does


# text


@pytest.mark.parametrize(("count", "last"), [(12, "r11"), (13, "r11")])
def test_twelve_tables_are_listed(count: int, last: str) -> None:
    sheets = [replace(table(3), name=f"r{k}", columns=("time", "duty", "torque")) for k in range(count)]
    with pytest.raises(DataError, match=rf"several tables that may be the log \(r0, .*, {last}\)"):
        chosen_table("a", sheets, ReadOptions())
    with pytest.raises(DataError, match=rf"holds no table x for variable=; it holds r0, .*, {last}$"):
        chosen_table("a", sheets, ReadOptions(variable="x"))


@pytest.mark.parametrize(
    ("values", "there"),
    [([np.nan, np.nan, 5.0], True), ([5.0, np.nan, np.nan], True), ([np.nan] * 3, False), ([], False)],
)
def test_an_input_is_there_where_its_first_or_last_sample_is(values: list[float], there: bool) -> None:
    column = np.array(values)
    assert Run("a", column, column, column, "%", "N·m", "a", "").has_input is there


def test_three_rows_make_a_table() -> None:
    assert has_table(["time,y", "0,1", "1,2", "2,3"])
    assert not has_table(["notes of a day", "0,1", "1,2", "and so on", "it went"])


def test_bad_cells_are_listed_up_to_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "MOST_BAD", 5)
    for bad, word in ((5, "more such rows|mend the cell"), (6, "more than 5 of its cells are bad")):
        rows = [f"{k},{'x' if k < bad else k},{k}" for k in range(40)]
        (tmp_path / "a.csv").write_text("\n".join(["time,duty,torque", *rows[::-1]][:1] + rows[20:] + rows[:20]))
        with pytest.raises(DataError, match=word):
            read_runs([tmp_path / "a.csv"])
    assert to_run.SHOWN == 5


def test_the_mark_of_an_hdf5_file_stands_at_its_beginning_or_behind_512_bytes() -> None:
    mark = b"\x89HDF\r\n\x1a\n"
    assert is_hdf5(mark) and is_hdf5(bytes(512) + mark)
    assert not is_hdf5(bytes(511) + mark) and not is_hdf5(bytes(513) + mark)


# binary formats


@pytest.mark.parametrize(("count", "fields"), [(MOST_ELEMENTS, MOST_ELEMENTS), (MOST_ELEMENTS + 1, 0)])
def test_long_arrays_are_no_columns(count: int, fields: int) -> None:
    import struct

    vector = {"p": ([], [("x", (1, ("float32", 0)))]), "m": ([], [("v", (3, ((2, "p"), count)))])}
    raw = struct.pack(f"<{count}f", *range(count))
    layout = layout_of(vector, "m", raw, ros1=True)
    assert len(layout.places) == fields
    plain = {"m": ([], [("v", (3, ((1, ("float32", 0)), count)))])}
    assert len(layout_of(plain, "m", raw, ros1=True).places) == fields


def test_a_row_before_the_first_segment_of_an_lvm(tmp_path: Path) -> None:
    head = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\n"
    body = "Channels\t1\n***End_of_Header***\nX_Value\tA\n0\t1\n1\t2\n"
    (tmp_path / "a").write_text(head + body)
    assert read_lvm(tmp_path / "a", "a")[0].columns == ("time", "A")
    (tmp_path / "a").write_text(head + "5\t6\n" + body)
    with pytest.raises(DataError, match="no line Channels"):
        read_lvm(tmp_path / "a", "a")


def test_a_matrix_is_a_record_from_ten_rows_on() -> None:
    found = {rows: grouped("", {"m": np.zeros((rows, 2))})[0] for rows in (9, 10)}
    assert (found[9], len(found[10])) == ([], 1)


def test_signals_of_other_clocks_are_held() -> None:
    base, slow = np.arange(6.0), np.array([1.5, 3.0])
    signals = [
        Signal("y", "N", "", 0, lambda: (base, 10 * base)),
        Signal("u", "V", "", 1, lambda: (slow, np.array([7.0, 8.0]))),
    ]
    (sheet,) = tables_of_signals("a", signals)
    cells = sheet.load([1, 0, 2])
    assert [one.tolist() for one in cells.values] == [[20.0, 30, 40, 50], [2.0, 3, 4, 5], [7.0, 8, 8, 8]]
    (said,) = cells.findings
    assert (said.code, dict(said.values)) == ("signals-held", {"columns": "u", "left_out": 2})
    twice = np.array([1.5, 1.5, 3.0])  # the later of two values at one time counts
    again = replace(signals[1], load=lambda: (twice, np.array([6.0, 7.0, 8.0])))
    assert tables_of_signals("a", [signals[0], again])[0].load([1, 2]).values[1].tolist() == [7.0, 8, 8, 8]
    falling = replace(again, load=lambda: (twice[::-1], twice))
    with pytest.raises(DataError, match="the times of u fall"):
        tables_of_signals("a", [signals[0], falling])[0].load([1, 2])
    with pytest.raises(DataError, match="not recorded at the same time"):
        tables_of_signals("a", [signals[0], replace(signals[1], load=lambda: (slow + 9, slow))])[0].load([1, 2])


def test_cells_that_an_mdf_marks_as_invalid_are_empty(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    from eaid.logs.foreign.mdf import read_mdf

    t = np.arange(20) / 10
    bits = np.arange(20) == 7
    file = asammdf.MDF(version="4.10")
    file.append(
        [
            asammdf.Signal(t * 2, t, name="torque", unit="Nm", invalidation_bits=bits),
            asammdf.Signal(t * 3, t, name="duty", unit="%"),
        ]
    )
    file.save(str(tmp_path / "a.mf4"), overwrite=True)
    file.close()
    (sheet,) = read_mdf(tmp_path / "a.mf4", "a")
    torque, duty = sheet.load([sheet.columns.index("torque"), sheet.columns.index("duty")]).values
    np.testing.assert_array_equal(np.isnan(torque), bits)
    np.testing.assert_array_equal(duty, t * 3)


def test_bad_cells_of_columns_that_are_not_read_refuse_nothing() -> None:
    assert Cells((), (BadCell(0, 3, "x"),)).row(4) == 5
