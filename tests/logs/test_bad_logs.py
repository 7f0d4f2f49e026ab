"""Every bad log in one table: what is wrong with it, and the one sentence that `eaid ingest` says."""

import gzip
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

HEADER = "time_s,duty_pct,torque_nm"


def rows(n: int = 200, idle: int = 50, rate_hz: float = 100.0) -> list[str]:
    """A good log: idle, then a step, with a little deterministic noise."""
    t = np.arange(n) / rate_hz
    rise = 2.0 * -np.expm1(-np.maximum(t - idle / rate_hz, 0.0) / 0.2)
    y = 0.01 + rise + 0.002 * np.sin(1000.0 * t)
    return [f"{a:.3f},{50 * (k >= idle)},{b:.5f}" for k, (a, b) in enumerate(zip(t, y, strict=True))]


GOOD = rows()


def csv(lines: list[str], header: str | None = HEADER) -> bytes:
    return "\n".join([*([header] if header else []), *lines, ""]).encode()


def changed(row: int, line: str) -> bytes:
    """The good log with one row (counted as an editor counts lines) replaced."""
    return csv([*GOOD[: row - 2], line, *GOOD[row - 1 :]])


def column(number: int, edit: Callable[[int, float], object], header: str = HEADER) -> bytes:
    """The good log with one column (from 0) changed in every row."""
    edited = []
    for i, line in enumerate(GOOD):
        cells = line.split(",")
        cells[number] = str(edit(i, float(cells[number])))
        edited.append(",".join(cells))
    return csv(edited, header)


def more(of_row: Callable[[int], object], header: str) -> bytes:
    return csv([f"{line},{of_row(i)}" for i, line in enumerate(GOOD)], header)


CELL, SORT = (f"; {how}, or drop such rows with --repair" for how in ("mend the cell", "sort the rows"))
PROSE = "holds no rows of numbers; a log is a table with a column of time and one of what was measured"
BEYOND = "; if it is not in %, say its unit with --units input=UNIT, or input=/255 of counts up to 255"
NO_TIME = "; name it with --columns time=NAME, or give --rate-hz HZ where the log has none"
NO_STEP = ": no step; record the idle time before the step too, or give the step instant with --step-at"
NAMELESS = column(1, lambda i, u: u, "time_s,ignored,torque_nm")
BINARY = "a binary file of no format that eaid knows; export it as CSV, MAT or HDF5"
UNREAD = {
    b"PK\x03\x04": "a ZIP archive; unpack it",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook; save its sheet as CSV",
    **{bytes((0x80, n)): "a Python pickle, which can run code; export the log as CSV or HDF5" for n in (2, 3, 4, 5)},
    **dict.fromkeys((b"BZh91AY", b"\xfd7zXZ", b"(\xb5/\xfd", b"7z\xbc\xaf"), "packed, but not with gzip; unpack it"),
    b"%PDF": "a PDF; export the log as CSV",
    **dict.fromkeys((b"\x89PNG\r\n", b"RIFF", b"\xff\xd8\xff", b"SQLite format 3"), BINARY),
}  # fmt: skip
BAD: dict[str, tuple[Any, ...]] = {
    **{f"{mark!r}": (mark + bytes(100), f"is {said}") for mark, said in UNREAD.items()},
    "empty.csv": (b"", "is empty; record the log again"), "blank.csv": (b"\n \n\n", "is empty; record the log again"),
    "header.csv": (csv([]), PROSE),
    "fit.json": (b'{\n "schema": "eaid/fit/2",\n',
                 "is a result of eaid, no log; give the logs that it was made of (eaid.load opens it)"),
    "prose.csv": (b"Dear all,\nthe clutch broke.\nNo data today.\nSorry.\n", PROSE),
    "united.csv": (csv(["{} s,{} %,{} Nm".format(*line.split(",")) for line in GOOD]),
                   "holds units beside its numbers, as '0.000 s'; save the numbers alone, and name their units in the "
                   "header or with --units"),
    "binary.csv": (bytes(range(256)) * 40, f"is {BINARY}"),
    "repeated.csv": (changed(100, GOOD[97]), "time is repeated at row 100 (0.97 s after 0.97 s)" + SORT),
    "falling.csv": (changed(100, "0.5,50,1.9"), "time falls at row 100 (0.5 s after 0.97 s)" + SORT),
    "all-falling.csv": (csv(GOOD[::-1]), "time falls at row 3 (1.98 s after 1.99 s), and 198 more such rows; sort "
                                         "the rows"),
    "cell.csv": (changed(60, "0.58,,0.9"), "row 60, column duty_pct, is empty" + CELL),
    "lone-quote.csv": (changed(2, '0,:,",0'), "row 2, column duty_pct, holds ':', which is no number" + CELL),
    "word.csv": (changed(60, "0.58,50,high"), "row 60, column torque_nm, holds 'high', which is no number" + CELL),
    "nan.csv": (changed(60, "0.58,50,nan"), "row 60, column torque_nm, holds 'nan', which is not finite" + CELL),
    "short-row.csv": (changed(60, "0.58,50"), "row 60 has 2 cells, unlike the others" + CELL),

    "long-word.csv": (changed(60, "0.58,50," + "x" * 50),
                      f"row 60, column torque_nm, holds '{'x' * 40}', which is no number" + CELL),
    "header-again.csv": (changed(60, HEADER), "row 60, column time_s, holds 'time_s', which is no number" + CELL),
    "cut-off.csv": (csv(GOOD)[:-9], "row 201 has 2 cells, unlike the others" + CELL),
    "summary.csv": (csv([*GOOD, "mean,,1.2"]), "row 202, column time_s, holds 'mean', which is no number" + CELL),
    "stamps.csv": (column(0, lambda i, t: "25:61:61.5" if i == 70 else f"16:18:{17 + int(t):02d}.{t % 1 * 100:02.0f}"),
                   "row 72, column time_s, holds '25:61:61.5', which is no number" + CELL),
    "no-stamp.csv": (column(0, lambda i, t: "" if i == 70 else f"16:18:{17 + int(t):02d}.{t % 1 * 100:02.0f}"),
                     "row 72, column time_s, is empty or not a number" + CELL),
    "too-many-bad.csv": (csv([*GOOD[:-3], "1.97,50,x", "1.98,50,x", "1.99,50,x"]), "3 of 200 rows are bad, more than "
                         "--repair drops (1 % of a log); record it again, or cut them out of the file, whose gap is "
                         "told", "--repair"),
    "dead-sensor.csv": (column(2, lambda i, y: 0.25),
                        "the output never changes (0.25 N·m throughout); check the sensor"),
    "no-step.csv": (column(1, lambda i, u: 50), "the input stays at 50 %" + NO_STEP),
    "never-on.csv": (column(1, lambda i, u: 0),
                     "the input stays at 0 %: no step; nothing was switched on; give logs in which the input steps"),
    "above.csv": (column(1, lambda i, u: 2.55 * u), "the input is 127.5 % at 0.5 s, above 100" + BEYOND),
    "counts.csv": (
        column(1, lambda i, u: 40.95 * u),
        "the input is 2047.5 % at 0.5 s, above 100" + BEYOND.replace("255", "4095")),
    "below.csv": (column(1, lambda i, u: -u), "the input is -50 % at 0.5 s, below 0" + BEYOND),
    "short.csv": (csv(rows(59)), "9 samples in its window, at least 10 are needed; record it longer"),
    "nine-rows.csv": (csv(GOOD[45:54]), "holds 9 samples, and a step takes at least 10; record it longer"),
    "on-off.csv": (column(1, lambda i, u: "on" if u else "off"),
                   "column duty_pct holds no number in any row, but words such as 'off'; write what they stand for in "
                   "numbers, or name another column with --columns"),
    "thousands.csv": (
        "\n".join(["time_s;duty_pct;torque_nm", *(f"{i / 100};{i // 99};{40 * i:,.1f}" for i in range(200))]).encode(),
        "column torque_nm holds '1,000.0' and the like in 175 of 200 rows; write them with one decimal mark, and none "
        "for thousands"),
    "no-time.csv": (csv(GOOD, "tick,duty_pct,torque_nm"),
                    "no column is called time (columns: tick, duty_pct, torque_nm)" + NO_TIME),
    "no-torque.csv": (csv(GOOD, "time_s,duty_pct,temperature"), "no column is called torque, force … (columns: time_s, "
                      "duty_pct, temperature); name what was measured with --columns output=NAME"),
    "two-torques.csv": (more(lambda i: 0, f"{HEADER},torque_nm"), "several columns may be the output (torque_nm, "
                        'torque_nm); say which with --columns output="3"'),
    "two-clocks.csv": (csv([f"{10 * i},2024-05-03 09:15:{i / 100:06.3f}{line[line.index(','):]}" for i, line in
                            enumerate(GOOD)], "Test Time [s],DateTime,duty_pct,torque_nm"), "two columns of time "
                       "contradict each other: by Test Time [s] the log takes 1990 s, by DateTime 1.99 s; say --units "
                       "time=ms if the second is right, --units time=s if the first is"),
    "two-units.csv": (csv(GOOD, "Time [s],duty_pct,torque_nm\nms,%,Nm"), "column Time [s] says s in its name and ms "
                      "beside it; say which with --units time=ms or time=s"),
    "names-of-more-columns.csv": (csv(GOOD, "# time,control output,box temp,P,I,D"), "its 3 columns have 6 names, "
                                  "time, control output, box temp, P, I and 1 more, of which none is taken; say by "
                                  "number, from 1 to 3, what they are, as in --columns time=1,input=2,output=3, and "
                                  "--units time=UNIT where it is not in s"),
    "two-duties.csv": (more(lambda i: 50, f"{HEADER},duty (%)"),
                       'several columns may be the input (duty_pct, duty (%)); say which with --columns '
                       'input="duty_pct"'),
    "two-inputs.csv": (more(lambda i: 86 * (i > 99), "time_s,force_n,torque_nm,speed_rpm"), "may be friction-force and "
                       "friction-speed, as it has a column of each; say which with --kind"),
    "wrong-column.csv": (csv(GOOD), "has no column torqe_nm for --columns output=torqe_nm; its columns are time_s, "
                         "duty_pct, torque_nm (a number counts them from 1); did you mean torque_nm?",
                         "--columns", "output=torqe_nm"),
    "name.csv": (NAMELESS, "its name does not match --name-pattern; rename it or mend the pattern",
                 "--name-pattern", "_V={level}_"),
    "no-level.csv": (NAMELESS, "nothing tells its level; give the input column, or --name-pattern with {level}",
                     "--step-at", "0.5"),
    "step-outside.csv": (csv(GOOD), "the step at 7 s lies outside the log (0 to 1.99 s); mend --step-at",
                         "--step-at", "7"),
    "until-before.csv": (csv(GOOD), "the window ends (0.2 s) before it begins (0.5 s); mend --until",
                         "--step-at", "0.5", "--until", "0.2"),
    "noise_V=5_.csv": (csv([f"{i / 100},{np.sin(i * i):.4f}" for i in range(200)], "time_s,torque_nm"),
                       "no step stands out of the output's noise; give its instant with --step-at",
                       "--name-pattern", "_V={level}_"),
    "cut.csv.gz": (gzip.compress(csv(GOOD))[:-20], "is no whole gzip file (Compressed file ended before the "
                                                   "end-of-stream marker was reached); copy it again"),
    "bomb.csv.gz": (gzip.compress(csv(GOOD) + b"\n" * 10_000_000, 9),
                    "unpacks to more than 200 times its size, as no recorded log does; unpack it yourself"),
    "log.mat.gz": (gzip.compress(b"MATLAB 5.0".ljust(124, b"\0") + b"\x00\x01IM" + bytes(range(256)) * 9),
                   "is gzip around a file that is no text; unpack it and give what is inside"),
    "array": (b"\x93NUMPY\x01" + bytes(99), "is a damaged NumPy file ("),
    "damaged.h5": (b"\x89HDF\r\n\x1a\n" + b"\0" * 500, "is a damaged HDF5 file ("),
    "two-tables.csv": (csv(["1,2"] * 3, "a,b") + csv(GOOD), "holds two tables, one from row 2 and another from row 6; "
                                                           "save each in a file of its own"),
    "may-be-either.csv": (csv([f"{1000 + i:,};{60 * (i > 99)};{1000 + i:,}" for i in range(200)],
                              "time_ms;duty_pct;torque_mNm"), "its commas may be decimal marks or stand between "
                          "thousands, as three digits follow every one; save it with decimal points"),
    "few-digits.csv": (column(0, lambda i, t: f"{t:.1f}"), "179 of 200 rows repeat the time of the row before, from "
                       "row 3 on: its stamps have too few digits, or rows were written twice; save each row once, with "
                       "all digits, or give the sample rate with --rate-hz"),
    "set-back-in-ms.csv": (column(0, lambda i, t: 1e3 * (t - 0.5 * (i > 99)), "time_ms,duty_pct,torque_nm"), "time "
                           "falls at row 102 (0.5 s after 0.99 s); split the log where its clock was set back; or "
                           "number its runs in a further column, if the next begins there"),
    "unknown-unit.csv": (csv(GOOD, "time (m),duty_pct,torque_nm"), "column time (m) is in m, which is no unit of time "
                         "that eaid knows; say it with --units time=UNIT (s, ms, us, ns, min, h or d)"),
    "since-1970.csv": (column(0, lambda i, t: f"{1.7e12 + 1e3 * t:.0f}"), "column time_s says its unit, but its first "
                       "stamp, 1.7e+12, counts ms since 1970; say which with --units time=UNIT"),
    "sample-numbers.csv": (column(0, lambda i, t: i, "sample,duty_pct,torque_nm"), "column sample numbers the samples "
                           "and is no time; give their rate with --rate-hz HZ and name no time column, or say --units "
                           "time=/1000 for 1000 samples a second", "--columns", "time=sample"),
    "rate-and-time.csv": (csv(GOOD), "has a time column, time_s, so --rate-hz does nothing; leave it out",
                          "--rate-hz", "100"),
    f"a_{2**63}.csv": (csv(GOOD), f"its repeat, {2**63}, is no count; mend --name-pattern, or rename the log",
                       "--name-pattern", "_{repeat}"),
}  # fmt: skip
"""Name of the log: what is in it, what is said of it, and the options of the call; exit code 3."""
OTHERS = {"header-again.csv": 2, "lone-quote.csv": 1, "summary.csv": 1, "too-many-bad.csv": 3}
"""How many more sentences a log gets."""


@pytest.mark.parametrize("name", BAD)
def test_a_bad_log(name, tmp_path, run_eaid):
    content, sentence, *options = BAD[name]
    path, output = tmp_path / name.replace("/", ""), tmp_path / "data.h5"
    path.write_bytes(content)
    ran = run_eaid("ingest", path, "-o", output, *options)
    first, *others = [
        line for line in ran.err.splitlines() if not line.startswith(("columns of ", "try: ", "reading logs: "))
    ]
    wanted = f"error: {path}: {sentence}"
    assert first == wanted or (first.startswith(wanted) and wanted.endswith("("))
    assert ran.code == 3 and len(others) == OTHERS.get(name, 0)
    assert list(tmp_path.iterdir()) == [path]


def test_the_good_log_is_good_but_for_a_level_that_it_does_not_hold(tmp_path, run_eaid):
    (tmp_path / "a.csv").write_bytes(csv(GOOD))
    assert run_eaid("ingest", tmp_path / "a.csv", "-q", "-o", tmp_path / "d.h5").code == 0
    ran = run_eaid("ingest", tmp_path / "a.csv", "-q", "-o", tmp_path / "e.h5", "--levels", "60")
    assert (ran.code, ran.err) == (3, "error: --levels 60: no log holds 60; levels found: 50\n")


def test_all_faults_of_all_logs_at_once(tmp_path, run_eaid):
    (tmp_path / "a.csv").write_bytes(changed(60, "0.58,,0.9"))
    (tmp_path / "b.csv").write_bytes(column(2, lambda i, y: 0.25))
    lines = rows()
    lines[28], lines[97], lines[150] = "0.28,0,x", "0.5,50,1.9", "1.50,50"
    (tmp_path / "c.csv").write_bytes(csv(lines))
    (tmp_path / "good.csv").write_bytes(csv(GOOD))
    ran = run_eaid("ingest", tmp_path, "-o", tmp_path / "d.h5")
    said = [line.split(f"{tmp_path}/")[1].split(";")[0] for line in ran.err.splitlines() if "error" in line]
    assert said == [
        "a.csv: row 60, column duty_pct, is empty",
        "c.csv: row 30, column torque_nm, holds 'x', which is no number",
        "c.csv: row 152 has 2 cells, unlike the others",
        "c.csv: time falls at row 99 (0.5 s after 0.96 s)",
        "b.csv: the output never changes (0.25 N·m throughout)",
    ]


LONG = rows(1000, 500)


def bad_rows(*at: int, cells: str = "{},0,") -> dict[int, str]:
    return {k: cells.format(k / 100) for k in at}


@pytest.mark.parametrize(
    ("changes", "told", "dropped"),
    [
        (bad_rows(100), ["row 102, column torque_nm, is empty"], [100]),
        (bad_rows(*range(100, 110)), ["row 102, column torque_nm, is empty, and 9 more such rows"], range(100, 110)),
        (bad_rows(*range(100, 111)), ["row 102, column torque_nm, is empty, and 10 more such rows"], None),
        (bad_rows(*range(100, 105), cells="{},x,0"), [f"row {k}, column duty_pct, holds 'x', which is no number"
                                                      for k in range(102, 107)], range(100, 105)),
        ({98: "0.98,0", 99: "0.99,0,3,7"},  # together they hold as many cells as they should
         ["row 100 has 2 cells, unlike the others", "row 101 has 4 cells, unlike the others"], [98, 99]),
        # the two rows behind it are not above it
        ({500: "5.02,50,1"}, ["time falls at row 503 (5.01 s after 5.02 s)",
                              "time is repeated at row 504 (5.02 s after 5.02 s)"], [501, 502]),
        ({300: "3,0,x", 700: "3,50,1"}, ["row 302, column torque_nm, holds 'x', which is no number",
                                         "time falls at row 702 (3 s after 6.99 s)"], [300, 700]),
    ],
)  # fmt: skip
def test_bad_rows_are_told_one_by_one_and_dropped_where_that_is_wanted(changes, told, dropped, read, codes):
    """Five of a kind are named, of more the first; up to one in a hundred is dropped."""
    content = csv([changes.get(k, line) for k, line in enumerate(LONG)])
    said = read.refused(content)
    assert [one.split(";")[0] for one in said] == told
    assert all(one.endswith(", or drop such rows with «repair»") is (dropped is not None) for one in said)
    if dropped is None:
        first, *others = read.refused(content, repair=True)
        assert first.startswith("11 of 1000 rows are bad, more than «repair» drops (1 % of a log); record it again, or")
        assert others == said  # it is not advised again
    else:
        run = read(content, repair=True)
        kept = [changes.get(k, line) for k, line in enumerate(LONG) if k not in dropped]
        assert run.time_s.tolist() == [float(line.split(",")[0]) for line in kept]
        assert len(run.input) == len(run.output) == len(kept)
        assert codes(run)["rows-dropped"] == {"dropped": len(dropped), "count": 1000}


def test_bad_rows_of_other_columns_refuse_nothing(read):
    run = read(more(lambda i: "" if i == 50 else i, HEADER + ",spare"))
    assert len(run.time_s) == 200 and run.left == ("spare",) and run.findings == ()
