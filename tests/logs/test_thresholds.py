"""Where a rule begins to hold, on both sides of the place: stamps, clocks, joins, shares, comments."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eaid.errors import DataError
from eaid.logs.columns import rises, steps
from eaid.logs.dialect import Marks, encoding_of, facts_of, number, rate_said, sniff
from eaid.logs.formats import format_of
from eaid.logs.read import differing_number, joined, read_runs, scales_compared
from eaid.logs.run import Run
from eaid.logs.text import seconds_of
from eaid.logs.to_run import TimeScale, checked, seconds_since_start
from eaid.logs.units import likely_time_unit
from eaid.reading import is_recorded


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["12:00:00 AM", "12:00:01 AM", "1:00:00 AM"], [0, 1, 3600]),
        (["11:59:59 AM", "12:00:00 PM", "12:00:01 PM", "1:00:00 PM"], [0, 1, 2, 3601]),
        (["11:59:59 PM", "12:00:00 AM"], [0, 1]),
        (["23:59:59.5", "00:00:00.25"], [0, 0.75]),
        (["13:00:00", "12:00:00"], [0, -3600]),  # an hour back is no midnight
        (["2024-02-28 23:59:59", "2024-02-29 00:00:00", "2024-03-01 00:00:00"], [0, 1, 86401]),
        (["28.02.2024 10:00", "28.02.2024 10:01"], [0, 60]),
        (["2024/02/28T10:00:00,125", "2024/02/28T10:00:00,25"], [0, 0.125]),
        (["13/02/2024 10:00:00", "14/02/2024 10:00:00"], [0, 86400]),
        (["02/13/2024 10:00:00", "02/14/2024 10:00:00"], [0, 86400]),
        (["10:00:00+02:00", "08:00:01Z", "08:00:02"], [0, 1, 2]),
        (["10:00:00-0130", "11:30:01Z"], [0, 1]),
    ],
)
def test_stamps(stamps: list[str], seconds: list[float]) -> None:
    found, wrong = seconds_of(stamps)
    assert wrong == [] and 0 <= found[0] < 1  # since the whole second of the first
    np.testing.assert_allclose(found - found[0], seconds, atol=1e-9)


@pytest.mark.parametrize("stamp", ["24:00:00", "10:60:00", "10:00:61", "2024-02-30 10:00:00", "10", "x", "10:00 XM"])
def test_no_stamps(stamp: str) -> None:
    found, wrong = seconds_of(["10:00:00", stamp, "10:00:02"])
    assert wrong == [1] and np.isnan(found[1]) and found[2] == 2.0


def test_the_last_instants_of_a_clock_are_stamps() -> None:
    assert seconds_of(["23:59:00", "23:59:60"])[0].tolist() == [0, 60]


UNSAID = TimeScale(1.0, False)


def codes(first: float, step: float, scale: TimeScale = UNSAID, column: str = "time", count: int = 50) -> list[str]:
    """What is doubted in a clock; at the end the factor that is found."""
    raw = first + step * np.arange(count)
    time, start, found = seconds_since_start("log", column, raw, scale)
    assert time[0] == 0.0
    factor = time[-1] / (raw[-1] - raw[0])
    assert start == pytest.approx(first * factor)
    return [*(one.code for one in found), f"{factor:.9g}"]


@pytest.mark.parametrize(
    ("first", "step", "found"),
    [
        (0, 0.01, ["1"]),
        (0, 1 / 49_000, ["1"]),
        (0, 1 / 51_000, ["time-too-fast", "1"]),
        (0, 1, ["time-in-whole-numbers", "1"]),
        (0, 73, ["time-in-whole-numbers", "1"]),
        (0, 74, ["time-too-long", "1"]),
        (0, 1.5, ["1"]),
        (1.0e9, 1, ["1"]),
        (0.99e9, 74, ["time-too-long", "1"]),
        (4.0e9, 74, ["1"]),
        (1.0e12, 1, ["time-since-1970", "0.001"]),
        (4.0e12, 1, ["time-since-1970", "0.001"]),
        (1.7e15, 1000, ["time-since-1970", "1e-06"]),
        (45_000, 1 / 8_640_000, ["time-in-days", "86400"]),
        (30_000, 1 / 8_640_000, ["time-in-days", "86400"]),
        (60_001, 1 / 8_640_000, ["time-too-fast", "1"]),
        (738_000, 1 / 864_000, ["time-in-days", "86400"]),
        (771_000, 1 / 864_000, ["time-too-fast", "1"]),
    ],
)
def test_clocks_whose_unit_nobody_gave(first: float, step: float, found: list[str]) -> None:
    told = codes(first, step)
    assert told[:-1] == found[:-1]
    assert float(told[-1]) == pytest.approx(float(found[-1]), rel=1e-6)


def test_clocks_whose_unit_is_named() -> None:
    assert codes(0, 1, TimeScale(1e-3, True)) == ["0.001"]
    assert codes(0, 1 / 4.9e6, TimeScale(1.0, True)) == ["1"]
    assert codes(0, 1 / 5.1e6, TimeScale(1.0, True)) == ["time-too-fast", "1"]
    assert codes(0, 1 / 5.1e6, TimeScale(1.0, True, by_user=True)) == ["1"]
    assert codes(1.7e12, 1, TimeScale(1e-3, True)) == ["0.001"]
    with pytest.raises(DataError, match="counts ms since 1970"):
        codes(1.7e12, 1, TimeScale(1.0, True))
    assert codes(1.7e12, 1, TimeScale(1.0, True, by_user=True)) == ["1"]
    with pytest.raises(DataError, match="numbers the samples"):
        codes(0, 1, column="sample no")
    assert codes(0, 2.5, column="sample no") == ["1"]


@pytest.mark.parametrize(
    ("usual", "unit"), [(1, "ms"), (500, "ms"), (501, "us"), (5e5, "us"), (5.1e5, "ns"), (1e12, "ns")]
)
def test_likely_units_of_time(usual: float, unit: str) -> None:
    assert likely_time_unit(usual) == unit


@pytest.mark.parametrize(
    ("said", "rate_hz"),
    [
        ({"sampling rate": "1 kHz"}, 1000.0), ({"sample frequency [hz]": "250"}, 250.0), ({"fs": "2.5 MHz"}, 2.5e6),
        ({"dt": "0.01 s"}, 100.0), ({"delta_x": "2 ms"}, 500.0), ({"sample interval (us)": "100"}, 1e4),
        ({"dt": "0.004"}, 250.0), ({"": "sampled at 500 Hz by hand"}, 500.0), ({"": "DAQ 2 kS/s"}, 2000.0),
        ({"": "the fan ran at 500 Hz"}, None), ({"rate": "-5 Hz"}, None), ({"operator": "5 Hz"}, None), ({}, None),
        ({"abtastrate": "200"}, 200.0), ({"scan period": "0.5 min"}, 1 / 30),
    ],
)  # fmt: skip
def test_rates_in_comments(said: dict[str, str], rate_hz: float | None) -> None:
    assert rate_said(said) == (None if rate_hz is None else pytest.approx(rate_hz))


def test_facts_above_a_table() -> None:
    lines = ["# Rig: 3", "fs = 100 Hz", "Operator;Jo", "% made by hand", "% on Monday", "nothing"]
    assert facts_of(lines, ";") == {"rig": "3", "fs": "100 Hz", "operator": "Jo", "": "made by hand on Monday"}


@pytest.mark.parametrize(
    ("cell", "decimal", "thousands", "value"),
    [
        ("1,234.5", ".", ",", 1234.5), ("1234,567", ".", ",", None), ("0,123", ".", ",", None),
        ("-1,234,567", ".", ",", -1234567.0), ("1.234,5", ",", ".", 1234.5), ("1.5", ",", "", None),
        ("1'000", ".", "'", 1000.0), (' "2.5" ', ".", "", 2.5), ("1e3", ".", "", 1000.0), ("1D-2", ".", "", 0.01),
        (".5", ".", "", 0.5), ("5.", ".", "", 5.0), ("+5", ".", "", 5.0), ("", ".", "", None), ("1_0", ".", "", None),
        ("0x10", ".", "", None), ("5 V", ".", "", None),
    ],
)  # fmt: skip
def test_numbers(cell: str, decimal: str, thousands: str, value: float | None) -> None:
    assert number(cell, decimal, thousands) == value


def test_words_for_no_number() -> None:
    for word in ("nan", "NA", "n/a", "null", "None", "-"):
        assert np.isnan(number(word, ".", "") or 0.0)
    assert number("-inf", ".", "") in (float("inf"), float("-inf"))


T = np.arange(1000) / 100.0


def run(name: str = "a", start_s: float = 0.0, **more: object) -> Run:
    return replace(
        Run(name, T, np.where(T >= 2, 50.0, 0.0), T, "%", "N·m", f"{name}.csv", name), start_s=start_s, **more
    )


def test_logs_that_meet_in_one_instant_are_not_joined() -> None:
    end = float(T[-1])
    (whole,) = joined([run("b", start_s=end + 0.01), run("log_part01")])
    assert whole.name == "log"
    np.testing.assert_allclose(np.diff(whole.time_s), 0.01, atol=1e-12)
    assert len(whole.output) == 2 * len(T)
    assert [one.code for one in whole.findings] == ["logs-joined"]
    for start in (end, end - 1.0, 0.0):  # the same instant twice, an overlap, a clock that begins anew
        with pytest.raises(DataError, match="must follow each other in time"):
            joined([run(), run("b", start_s=start)])
    with pytest.raises(DataError, match="its output unit is not that of"):
        joined([run(), run("b", start_s=end + 1, output_unit="N")])
    apart = joined([run(level=10.0), run("b", start_s=end + 1, level=20.0)])
    assert [one.name for one in apart] == ["a", "b"]


@pytest.mark.parametrize(
    ("bad", "kept"), [(0, None), (1, 999), (10, 990), (11, 0)], ids=["none", "one", "1 %", "more than 1 %"]
)
def test_repair_drops_up_to_a_hundredth(bad: int, kept: int | None) -> None:
    output = np.array(T)
    output[100 : 100 + bad] = np.nan
    columns = {"time": T, "torque": output}
    if kept == 0:
        with pytest.raises(DataError, match="11 of 1000 rows are bad, more than repair= drops"):
            checked("log", columns, (), lambda i: i + 1, "row", True)
        return
    found = checked("log", columns, (), lambda i: i + 1, "row", True)
    assert (None if found is None else len(found)) == kept


def test_a_fall_of_the_time_costs_the_rows_below_the_highest() -> None:
    time = np.array(T)
    time[500] = time[502]  # the two rows after it are not above it
    found = checked("log", {"time": time}, (), lambda i: i + 1, "row", True)
    assert found is not None
    assert set(range(len(T))) - set(found.tolist()) == {501, 502}


def test_a_fifth_of_repeated_stamps_is_a_clock_with_too_few_digits() -> None:
    few, many = np.repeat(T, 2)[:1000], np.array(T)
    many[np.arange(1, 400, 2)] = many[np.arange(0, 400, 2)]  # 200 of 1000: a fifth, and no more
    with pytest.raises(DataError, match="500 of 1000 rows repeat"):
        checked("log", {"time": few}, (), lambda i: i + 1, "row", False)
    with pytest.raises(DataError, match="time is repeated at row 2"):
        checked("log", {"time": many}, (), lambda i: i + 1, "row", False)


def test_a_commanded_input_stands_still_but_for_jumps() -> None:
    assert steps(np.where(T >= 2, 50.0, 0.0))
    assert steps(np.where(np.arange(20) >= 10, 1.0, 0.0))
    assert not steps(np.where(np.arange(19) >= 10, 1.0, 0.0))  # too few samples
    assert not steps(T)
    assert not steps(np.zeros(1000))
    assert not steps(np.sin(T))
    assert not steps(np.clip(T - 2, 0, 0.05))  # a ramp of several samples
    assert rises(T)
    almost = np.array(T)
    almost[::200] = 0.0
    assert rises(almost)
    almost[::50] = 0.0
    assert not rises(almost)


def test_one_log_up_to_1_among_logs_up_to_100() -> None:
    def told(*tops: float) -> list[int]:
        runs = [run(f"r{k}", input=np.where(T >= 2, top, 0.0)) for k, top in enumerate(tops)]
        return [k for k, one in enumerate(scales_compared(runs)) if one.findings]

    assert told(0.5, 50.0) == [0]
    assert told(1.0, 100.0) == [0]
    assert told(1.0, 50.0) == []  # 1 % may be meant
    assert told(1.2, 50.0) == []
    assert told(0.5, 0.9) == []
    assert told(0.5, 1.5) == []


def test_the_number_in_which_names_differ() -> None:
    assert differing_number(["test_5V_r1", "test_10V_r1"]) == "test_{level}V_r"
    assert differing_number(["a1", "a1"]) is None
    assert differing_number(["a1", "b2"]) is None


@pytest.mark.parametrize(
    ("levels", "recorded"),
    [
        ([0, 50, 0], False), ([0, 20, 40, 0], True), ([0, 50, 49.5, 0], False), ([0, 50, 47, 0], True),
        ([50, 50, 50], False), ([0, 0, 0], False),
        ([0, 50] * 4 + [0], False),  # four holds
    ],
)  # fmt: skip
def test_what_is_fitted_as_it_was_recorded(levels: list[float], recorded: bool) -> None:
    values = np.repeat(np.array(levels, dtype=float), 100)
    made = replace(run(), time_s=np.arange(len(values)) / 100.0, input=values, output=values)
    assert is_recorded(made) is recorded
    assert not is_recorded(replace(made, level=50.0))


def test_short_rests_between_many_falls_are_a_recording() -> None:
    def values(hold: int, rest: int, falls: int) -> Run:
        one = np.concatenate([np.zeros(rest), np.full(hold, 50.0)])
        u = np.concatenate([np.tile(one, falls), np.zeros(rest)])
        return replace(run(), time_s=np.arange(len(u)) / 100.0, input=u, output=u)

    assert is_recorded(values(100, 20, 5))
    assert not is_recorded(values(100, 20, 4))
    assert not is_recorded(values(100, 100, 5))
    assert not is_recorded(values(4, 2, 5))


def test_encodings() -> None:
    assert encoding_of("µ".encode()) == "utf-8"
    assert encoding_of("µ,µ,µ".encode("cp1252")) == "cp1252"
    assert encoding_of("abc".encode("utf-16-be") * 9) == "utf-16-be"
    assert encoding_of(b"abcdefgh\0\xff\xfe\x01") == ""
    assert encoding_of(b"abc\xc2") == "utf-8"  # cut inside a letter


def test_marks_and_header_of_a_text() -> None:
    rows = "".join(f"{i},5;{i},25\n" for i in range(20))
    found = sniff("log", f"# fs: 5 Hz\nzeit;moment\ns;Nm\n{rows}".encode(), True)
    assert found.marks == Marks(";", ",", "")
    assert (found.columns, found.units, found.first_line) == (("zeit", "moment"), ("s", "Nm"), 4)
    assert found.said == {"fs": "5 Hz"}
    assert not found.ragged
    assert sniff("log", rows.replace("\n", ";\n").encode(), True).ragged
    assert Marks(",", ".", "").cells('1,"2,3",4') == ["1", "2,3", "4"]
    assert Marks(",", ".", "").cells("1,2,", 3) == ["1", "2", ""]
    assert Marks(",", ".", "").cells("1,2,", 2) == ["1", "2"]


@pytest.mark.parametrize(
    ("head", "name"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(9), "HDF5"), (bytes(512) + b"\x89HDF\r\n\x1a\n", "HDF5"),
        (bytes(124) + b"\x00\x01IM", "MAT"), ((0).to_bytes(4, "little") + (9).to_bytes(4, "little") * 2 + bytes(4)
         + (2).to_bytes(4, "little") + b"a\0" + bytes(80), "MAT"),
        (b"PK\x03\x04", "not read"), (b"\x80\x04", "not read"), (b"\x80\x06", "text"), (b"time,torque\n", "text"),
        (b"PAR1", "Parquet"), (b"LabVIEW Measurement", "LVM"), (b"TDSm", "TDMS"),
    ],
)  # fmt: skip
def test_formats(head: bytes, name: str) -> None:
    assert format_of(head).name == name


def test_a_short_row_beside_a_long_one_is_told(tmp_path: Path) -> None:
    """Together they hold as many cells as they should."""
    rows = [f"{a},{0 if a < 2 else 50},{a},7" for a in T]
    rows[300], rows[301] = "3.0,50,3.0", "3.01,50,3.01,7,7"
    (tmp_path / "a.csv").write_text("time_s,duty_pct,torque_nm,spare\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError) as caught:
        read_runs([tmp_path / "a.csv"])
    assert [said.split(": ")[1].split(";")[0] for said in caught.value.sentences] == [
        "row 302 has 3 cells, unlike the others", "row 303 has 5 cells, unlike the others",
    ]  # fmt: skip


@pytest.mark.parametrize(("torque", "said"), [(1000.0, False), (1000.5, True)])
def test_a_torque_that_no_clutch_has_is_told(tmp_path: Path, torque: float, said: bool) -> None:
    rows = "".join(f"{k / 100},{50 * (k > 100)},{torque * (k > 100)}\n" for k in range(300))
    (tmp_path / "a.csv").write_text("time_s,duty_pct,torque_nm\n" + rows)
    (run,) = read_runs([tmp_path / "a.csv"])
    assert ("torque-too-large" in [one.code for one in run.findings]) is said
