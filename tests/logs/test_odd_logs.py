"""Good text logs in every dialect, and odd ones: what is read of each, to the last digit, and what is told."""

import gzip
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from logs_written import T, U, Y, text

from eaid.logs import text as text_logs

HEADER = "time_s,duty_pct,torque_nm"


def commas(values: Any) -> list[str]:
    return [f"{x:.15g}".replace(".", ",") for x in values]


def grouped(values: Any, digits: int, marks: str = ",.") -> list[str]:
    """Numbers with a mark between thousands, and a decimal mark."""
    return [f"{x:,.{digits}f}".translate(str.maketrans(",.", marks)) for x in values]


def clock(form: str = "{h:02d}:{m:02d}:{s:05.2f}", start: float = 86398.0, mark: str = ".") -> list[str]:
    """Wall-clock stamps from 23:59:58 on; `{d}` counts days from 28."""
    parts = [divmod(round(start + t, 2), 86400) for t in T.tolist()]
    return [
        form.format(d=28 + int(d), h=int(s // 3600), m=int(s // 60 % 60), s=s % 60).replace(".", mark) for d, s in parts
    ]


@dataclass(frozen=True)
class Log:
    """What is written, what is said to it, and what has to come out: time T, input U and output Y unless told."""

    content: str
    said: dict[str, Any] = field(default_factory=dict)
    encoding: str = "utf-8"
    units: str = "% N·m"
    """Of input and output; `?` where none is known."""
    input: Any = None
    output: Any = None
    """None: U and Y."""
    code: str = ""
    """Of a finding that tells what was done."""
    within_s: float = 1e-9


PAIR = "duty_pct,torque_nm"
DATED = clock("2024-02-{d} {h:02d}:{m:02d}:{s:05.2f}")
LOGS = {
    "plain": Log(text(HEADER, T, U, Y)),
    "tabs": Log(text(HEADER, T, U, Y, between="\t")),
    "spaces before every row": Log(text(HEADER, T, U, Y, between="  ").replace("\n", "\n  ").rstrip(" ")),
    "commas and decimal commas in quotes": Log(text(HEADER, *([f'"{x}"' for x in commas(v)] for v in (T, U, Y)))),
    "mixed line ends": Log("".join(
        line + ("\n", "\r\n", "\r")[i % 3] for i, line in enumerate(text(HEADER, T, U, Y).splitlines()))),
    "UTF-16": Log(text(HEADER, T, U, Y), encoding="utf-16"),
    "Windows-1252": Log(text("Zeit (s),Tastgrad (%),Drehmoment (N·m)", T, U, Y), encoding="cp1252"),
    "signed and bare points": Log(text(HEADER, [f"+{t:.2f}".replace("+0", "+") for t in T], [f"{u:g}." for u in U], Y)),
    "no header": Log(text(None, T, U, Y), {"columns": {"time": "1", "input": "2", "output": "3"}}, units="? ?"),
    "brackets of a matrix, names of several words": Log(
        "  Time   Duty (%)   Drive torque (Nm)\n\n[" + text(None, T, U, Y, between="   ", end=";\n  ").rstrip()[:-1]
        + "];\n"),
    "channels by number, and a row of units": Log(
        text("x-axis,1,2\nsecond,Volt,Volt", *([f"{x:+.6e}" for x in v] for v in (T, U, Y))),
        {"columns": {"input": "channel 1", "output": "channel 2"}}, units="V V"),
    "ms under [s], a clock beside it, and the unit said": Log(
        text("Test Time [s],DateTime,duty_pct,torque_nm", 1e3 * T, DATED, U, Y),
        {"units": {"time": "ms"}}),
    "ms under [s] and a clock that is named": Log(
        text("Test Time [s],DateTime,duty_pct,torque_nm", 1e3 * T, DATED, U, Y),
        {"columns": {"time": "DateTime"}}),
    "two clocks that agree, one in whole seconds": Log(
        text("Time [s],Clock,duty_pct,torque_nm", T, [x[:8] for x in clock()], U, Y)),
    "a countdown and a lap time beside the time": Log(
        text("time_s,left [s],lap [ms],duty_pct,torque_nm", T, 9 - T, 1e3 * (T % 0.5), U, Y)),
    "blank lines above the header": Log("\n\n" + text(HEADER, T, U, Y)),
    "a header in a comment": Log("# note: x\n" + text("# " + HEADER, T, U, Y)),
    "comments and blank lines inside": Log(text(HEADER, T, U, Y).replace("\n1.5,", "\n# pause\n\n1.5,")),
    "facts above": Log("Rig;3\nOperator;Jo\n\n" + text(HEADER, T, U, Y, between=";")),
    "two header rows": Log("Bench A,,Bench B,\n" + text("time [s],duty [%],torque [Nm],temp [degC]", T, U, Y, T)),
    "a row of units": Log(text("time,duty,torque\n s , % , N*m ", T, U, Y)),
    "units in brackets": Log(text("time,duty,torque\n[ms],-,(mNm)", 1e3 * T, U, 1e3 * Y)),
    "a row of units, one of them unknown": Log(text("time,temp,duty,torque,deflection\ns,°C,%,Nm,mV/V", T, T + 20, U, Y,
                                                    Y)),
    "a row of units with a gap": Log(text("time_s,duty,torque\n,%,Nm", T, U, Y)),
    "names called like units": Log(text("s,V,Nm", T, U, Y), {"columns": {"output": "3"}}, "utf-8", "V ?",
                                  code="unit-unknown"),
    "names in quotes": Log(text('"time_s","duty_pct","torque_nm"', *([f'"{x:.15g}"' for x in v] for v in (T, U, Y)))),
    "commas in names": Log('"Time, s","Duty, %","Torque, Nm"\n' + text(None, T, U, Y)),
    "a delimiter behind every row": Log(text(HEADER, T, U, Y).replace("\n", ",\n")),
    "a delimiter behind the rows only": Log(HEADER + "\n" + text(None, T, U, Y).replace("\n", ",\n")),
    "an index": Log(text("idx," + HEADER, range(300), T, U, Y)),
    "other order, other columns": Log(text("torque_nm,temperature,note,time_s,duty_pct", Y, 21.5 + 0 * T, ["ok"] * 300,
                                           T, U)),
    "columns by name": Log(text("Zeitpunkt,Volt A,Load Cell", T, U, Y),
                           {"columns": {"time": "Zeitpunkt", "input": "Volt A", "output": "Load Cell"},
                            "units": {"input": "%", "output": "Nm"}}),
    "a clock past midnight": Log(text("stamp,duty,torque", clock(), U, Y), {"columns": {"time": "stamp"}}, units="% ?"),
    "a clock of twelve hours": Log(text("time,duty,torque", [f"{x} PM" if i < 200 else f"{x} AM" for i, x in enumerate(
        clock("{h:02d}:{m:02d}:{s:05.2f}"))], U, Y).replace("23:59", "11:59").replace("\n00:", "\n12:"), units="% ?"),
    "stamps, decimal comma": Log(text("timestamp,duty,torque", clock("2024-02-{d} {h:02d}:{m:02d}:{s:05.2f}", mark=","),
                                      commas(U), commas(Y), between=";"), units="% ?"),

    "the end of summer time": Log(text("time,duty,torque_nm", [
        f"2024-10-27 {x}+02:00" if i < 200 else f"2024-10-27 {x}+01:00" for i, x in enumerate(
            [*clock(start=10798.0)[:200], *clock(start=7198.0)[200:]])], U, Y)),
    "a rate given": Log(text(PAIR, U, Y), {"rate_hz": 100.0}),
    "numbers of samples and a rate": Log(text("sample," + PAIR, range(300), U, Y),
                                         {"columns": {"time": "sample"}, "rate_hz": 100.0}),
    "zeros behind the last row": Log(text(HEADER, T, U, Y) + "\0" * 3000),
    "settings above a shorter table": Log("".join(f"k{k};{k}\n" for k in range(320)) + text(HEADER, T, U, Y)),
    "rows of numbers in comments": Log("# 1,2\n# 3,4\n# 5,6\n# 7,8\n" + text(HEADER, T, U, Y)),
    "words for the valve": Log(text("time_s,valve,torque_nm", T, ["ON" if u else "-" for u in U], Y), input=np.nan * T,
                               units="? N·m"),
    "decimal comma, units row, kV and mN·m": Log(text("Zeit,Spannung,Drehmoment\nms,kV,mN·m", commas(1e3 * T),
                                                      commas(U / 1e3), commas(1e3 * Y), between=";"), units="V N·m"),
    "labels of a serial plotter": Log(
        "logger v1\nready\n" + text(None, [f"t:{t:g}" for t in T], [f"duty:{u:g}" for u in U],
                                     [f"torque:{y:.15g}" for y in Y]), units="% ?"),
    "durations of MATLAB": Log(text("Time,duty_pct,torque_nm", [f"{t:g} sec" for t in T], U, Y)),
    "channels of LabVIEW by number, each with its stamps": Log(
        text("time[0]\tai0[0]\ttime[1]\tai1[1]", DATED, U, DATED, Y, between="\t"),
        {"columns": {"time": "time[0]", "input": "ai0[0]", "output": "ai1[1]"}}, units="? ?"),
    "a torque of counts": Log(text(HEADER, T, U, 16000 * Y), output=16000 * Y, code="torque-too-large"),
    "a temperature called T": Log(text("Time [s],duty_pct,T [degC]", T, U, Y), {"columns": {"output": "T"}},
                                  units="% degC"),
}  # fmt: skip


@pytest.mark.parametrize("careful", [False, True], ids=["quick", "cell by cell"])
@pytest.mark.parametrize("name", LOGS)
def test_a_text_log(name, careful, read, codes):
    """A remark in a piece has it taken apart cell by cell."""
    log = LOGS[name]
    content = log.content.rstrip("\0")
    end = "\r\n" if content.endswith("\r\n") else content[-1]
    content += f"# the end{end}" * careful + "\0" * log.content.count("\0")
    raw = gzip.compress(content.encode()) if log.encoding == "gzip" else content.encode(log.encoding)
    run = read(raw, **log.said)
    np.testing.assert_allclose(run.time_s, T, rtol=0, atol=log.within_s)
    np.testing.assert_allclose(run.input, U if log.input is None else log.input, rtol=1e-12)
    np.testing.assert_allclose(run.output, Y if log.output is None else log.output, rtol=1e-12, atol=1e-13)
    assert f"{run.input_unit} {run.output_unit}".replace("a.u.", "?") == log.units
    told = codes(run)
    assert log.code in told if log.code else not told or set(told) == {"unit-unknown"}


@pytest.mark.parametrize(
    ("log", "times", "values"),
    [
        ("t y\n0 1\n1 2\n2 3", (0, 1), (1, 2)), ("t;y\n0,5;1,5\n1,5;2\n2,5;3", (0.5, 1.5), (1.5, 2)),
        ("t,y\n1.234,5\n2.345,6\n3.4,7", (1.234, 2.345), (5, 6)), ("t\ty|x\n1\t2\n2\t3\n3\t4", (1, 2), (2, 3)),
        ('t,y\n"1,5","2,5"\n"2,5","3,5"\n"3,5","4,5"', (1.5, 2.5), (2.5, 3.5)),
        ("0,1\n1,2\n2,3", (0, 1), (1, 2)), ("a note\nt,y\n0,1\n1,2\n2,3", (0, 1), (1, 2)),
        *((above + "0,1,2\n1,2,3\n2,3,4\n3,4,5\n", (0, 1), (1, 2)) for above in (
            "t,y,z\n# 1,2\n", "9\n", "t,y,z\n1,x,x,x\n", "t,y,z\nx,2\n")),  # 9: how many rows follow
        *((above + "0,1,2\n1,2,3\n2,3,4\n3,4,5\n", row, cells) for above, row, cells in (
            ("t,y,z\n1,2\n", 2, 2), ("t,y,z\n1,2,3,4\n", 2, 4), ("t,y,z\n1,2\n3,4\n", 2, 2), ("1,2\n", 1, 2))),
    ],
)  # fmt: skip
def test_marks_and_rows(log, times, values, read):
    """What stands between cells and in numbers; a broken row right above the first good one is a row."""
    columns = {"columns": {"time": "1", "output": "2"}}
    if isinstance(times, int):
        assert read.refused(log, **columns)[0].startswith(f"row {times} has {values} cells, unlike the others")
    else:
        run = read(log, **columns)
        assert ((run.time_s + run.start_s)[:2].tolist(), run.output[:2].tolist()) == (list(times), list(values))


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_the_last_row_of_a_short_log_is_read(rows, read):
    log = text(HEADER, range(rows), [50 * (k > 0) for k in range(rows)], range(rows))
    assert {tuple(read(one).output.tolist()) for one in (log, log.rstrip())} == {tuple(map(float, range(rows)))}


@pytest.mark.parametrize("digits", [0, 3])
@pytest.mark.parametrize("marks", [",.", "'.", " ,", ".,"])
@pytest.mark.parametrize("between", [";", ","])
def test_marks_between_thousands_are_refused(between, marks, digits, read):
    cells = [grouped(1e3 * T, digits, marks), [f"{u:g}" for u in U], grouped(1e6 * Y, digits, marks)]
    quoted = [[f'"{x}"' for x in column] for column in cells]
    alone = {".,": digits == 0}.get(marks, False)  # 1.234: a decimal point
    for columns in (cells, quoted) if between == ";" else (quoted,):
        log = text("time_ms,duty_pct,torque_mNm", *columns, between=between)
        assert alone or read.refused(log)


def test_numbers_are_correctly_rounded(read):
    """Both ways of reading give the bits of Python's own float(), for 17 digits and for hard cases."""
    rng = np.random.default_rng(7)
    numbers = (rng.normal(size=500) * 10.0 ** rng.integers(-12, 12, 500)).tolist()
    texts = [*map(repr, numbers), "5e-324", "1.7976931348623157e98", "9007199254740993", "0.1e-5",
             "2.2250738585072011e-308", "1.00000000000000011102230246251565404236316680908"]  # fmt: skip
    for more in ("", "# the end\n"):
        run = read(text("time_s,torque_nm", range(len(texts)), texts) + more)
        assert run.output.tolist() == [float(one) for one in texts]


@pytest.mark.parametrize(
    ("stamps", "seconds"),
    [
        (["12:00:00 AM", "12:00:01 AM", "1:00:00 AM"], [0, 1, 3600]),
        (["11:59:59 AM", "12:00:00 PM", "12:00:01 PM", "1:00:00 PM"], [0, 1, 2, 3601]),
        (["23:59:59.5", "23:59:60.5", "00:00:01.25"], [0, 1, 1.75]),
        (["2024-02-28 23:59:59", "2024-02-29 00:00:00", "2024-03-01 00:00:00"], [0, 1, 86401]),
        (["28.02.2024 10:00", "28.02.2024 10:01", "28.02.2024 10:02"], [0, 60, 120]),
        (["2024.02.28 10:00:00,125", "2024.02.28 10:00:00,25", "2024.02.28 10:00:01"], [0, 0.125, 0.875]),
        (["13/02/2024 10:00:00", "14/02/2024 10:00:00", "14/02/2024 10:00:01"], [0, 86400, 86401]),
        (["02/13/2024 10:00:00", "02/14/2024 10:00:00", "02/14/2024 10:00:01"], [0, 86400, 86401]),
        (["1-3-2024 10:00:00", "2-3-2024 10:00:00", "2-3-2024 10:00:01"], [0, 86400, 86401]),
        (["10:00:00+02:00", "08:00:01Z", "08:00:02"], [0, 1, 2]),
        (["10:00:00-0130", "11:30:01Z", "11:30:02Z"], [0, 1, 2]),
        (["10:00:00", "22:00:01", "10:00:00"], [0, 43201, 86400]),
        (["10:00:00", "22:00:00", "10:00:00"], "time falls at row 4"),
        (["13:00:00", "12:00:00", "12:00:01"], "time falls at row 3"),  # an hour back is no midnight
        *((["10:00:00", bad, "10:00:02"], f"row 3, column time, holds '{bad}', which is no number") for bad in
          ("24:00:00", "10:60:00", "10:00:61", "2024-02-30 10:00:00", "10", "x", "10:00 XM", "100:00:00")),
    ],
)  # fmt: skip
def test_stamps(stamps, seconds, read):
    log = text("time,duty,torque", stamps, range(len(stamps)), range(len(stamps)), between=";")
    if isinstance(seconds, str):
        assert read.refused(log)[0].startswith(seconds)
    else:
        np.testing.assert_allclose(read(log).time_s, seconds, atol=1e-9)


@pytest.mark.parametrize(("size", "end"), [(40, "\n"), (41, "\r\n"), (55, "\r\n"), (97, "\r"), (500, "\r\n")])
def test_pieces_of_whole_lines(end, size, read, monkeypatch):
    """However long the blocks are that are read, nothing is lost, and every bad cell is told by its own row."""
    monkeypatch.setattr(text_logs, "PIECE", size)
    log = "# a pause" + end + text(HEADER, T[:60], U[50:110], Y[50:110], end=end)
    for encoding in ("utf-8", "utf-16"):
        run = read(log.encode(encoding))
        assert (run.time_s.tolist(), run.output.tolist()) == (T[:60].tolist(), Y[50:110].tolist())
    bad = log.replace(f"{end}0.3,", f"{end}# one{end}{end}0.3x,").replace(f"{end}0.5,", f"{end}7,7,7,")
    assert [one.split(";")[0] for one in read.refused(bad)] == [
        "row 35, column time_s, holds '0.3x', which is no number", "row 55 has 5 cells, unlike the others",
    ]  # fmt: skip


def test_whole_numbers_of_many_digits_stay_whole(read):
    """A stamp of 1.7e18 ns has more digits than a float."""
    first = 17 * 10**17
    run = read(text("time,duty,torque_nm", [str(first + k) for k in range(1, 40)], U[81:120], Y[81:120]),
               units={"time": "ns"})  # fmt: skip
    np.testing.assert_allclose(run.time_s, 1e-9 * np.arange(39), rtol=1e-12)
