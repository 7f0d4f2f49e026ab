"""Every bad log in one table: what is wrong with it, and the one sentence it must get (exit code 3 unless said)."""

import gzip
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from eaid.cli.main import run

HEADER = "time_s,duty_pct,torque_nm"
CELL = "; mend the cell, or drop such rows with --repair"


def rows(n: int = 200, idle: int = 50, level: float = 50.0, rate_hz: float = 100.0) -> list[str]:
    """A good log: idle, then a step, with a little deterministic noise."""
    t = np.arange(n) / rate_hz
    u = np.where(np.arange(n) >= idle, level, 0.0)
    rise = 2.0 * -np.expm1(-np.maximum(t - idle / rate_hz, 0.0) / 0.2)
    y = 0.01 + np.where(u > 0, rise, 0.0) + 0.002 * np.sin(1000.0 * t)
    return [f"{a:.3f},{b:g},{c:.5f}" for a, b, c in zip(t, u, y, strict=True)]


def csv(lines: list[str], header: str | None = HEADER) -> bytes:
    return "\n".join(([header] if header else []) + lines + [""]).encode()


def changed(row: int, line: str) -> bytes:
    """The good log with one row (counted as an editor counts lines) replaced."""
    lines = rows()
    lines[row - 2] = line
    return csv(lines)


def column(number: int, edit: Callable[[int, float], object], header: str = HEADER) -> bytes:
    """The good log with one column (from 0) changed in every row."""
    edited = []
    for i, line in enumerate(rows()):
        cells = line.split(",")
        cells[number] = str(edit(i, float(cells[number])))
        edited.append(",".join(cells))
    return csv(edited, header)


@dataclass(frozen=True)
class Bad:
    """One bad log and what is said about it; `{f}` stands for its path."""

    name: str
    content: bytes
    sentence: str
    arguments: tuple[str, ...] = ()
    exit_code: int = 3


BAD = [
    Bad("empty.csv", b"", "{f}: is empty; record the log again"),
    Bad("blank.csv", b"\n \n\n", "{f}: is empty; record the log again"),
    Bad("header.csv", csv([]), "{f}: has a header but no rows; record the log again"),
    Bad(
        "prose.csv",
        b"Dear all,\nthe clutch broke.\nNo data today.\nSorry.\n",
        "{f}: holds no rows of numbers; a log is a table with a column of time and one of torque",
    ),
    Bad(
        "binary.csv",
        bytes(range(256)) * 40,
        "{f}: is a binary file of no format that eaid knows; export it as CSV, MAT or HDF5",
    ),
    Bad(
        "repeated.csv",
        changed(100, rows()[97]),
        "{f}: time is repeated at row 100 (0.97 s after 0.97 s); sort the rows, or drop such rows with --repair",
    ),
    Bad(
        "falling.csv",
        changed(100, "0.5,50,1.9"),
        "{f}: time falls at row 100 (0.5 s after 0.97 s); sort the rows, or drop such rows with --repair",
    ),
    Bad(
        "cell.csv",
        changed(60, "0.58,,0.9"),
        "{f}: row 60, column duty_pct, is empty" + CELL,
    ),
    Bad(
        "word.csv",
        changed(60, "0.58,50,high"),
        "{f}: row 60, column torque_nm, holds 'high', which is no number" + CELL,
    ),
    Bad(
        "nan.csv",
        changed(60, "0.58,50,nan"),
        "{f}: row 60, column torque_nm, holds 'nan', which is not finite" + CELL,
    ),
    Bad(
        "inf.csv",
        changed(60, "0.58,50,-inf"),
        "{f}: row 60, column torque_nm, holds '-inf', which is not finite" + CELL,
    ),
    Bad(
        "huge.csv",
        changed(60, "0.58,50,1e400"),
        "{f}: row 60, column torque_nm, holds '1e400', which is not finite" + CELL,
    ),
    Bad(
        "short-row.csv",
        changed(60, "0.58,50"),
        "{f}: row 60 has 2 cells, unlike the others" + CELL,
    ),
    Bad(
        "long-row.csv",
        changed(60, "0,58,50,0.9"),
        "{f}: row 60 has 4 cells, unlike the others" + CELL,
    ),
    Bad(
        "hex.csv",
        changed(60, "0x3A,50,0.9"),
        "{f}: row 60, column time_s, holds '0x3A', which is no number" + CELL,
    ),
    Bad(
        "underscore.csv",
        changed(60, "0.58,50,1_000"),
        "{f}: row 60, column torque_nm, holds '1_000', which is no number" + CELL,
    ),
    Bad(
        "header-again.csv",
        changed(60, HEADER),
        "{f}: row 60, column time_s, holds 'time_s', which is no number" + CELL,
    ),
    Bad(
        "cut-off.csv",
        csv(rows())[:-9],
        "{f}: row 201 has 2 cells, unlike the others" + CELL,
    ),
    Bad(
        "too-many-bad.csv",
        csv([*rows()[:-3], "1.97,50,x", "1.98,50,x", "1.99,50,x"]),
        "{f}: 3 of 200 rows are bad, more than --repair drops (1 % of a log); record it again",
        ("--repair",),
    ),
    Bad(
        "dead-sensor.csv",
        column(2, lambda i, y: 0.25),
        "{f}: the output never changes (0.25 N·m throughout); check the sensor",
    ),
    Bad(
        "no-step.csv",
        column(1, lambda i, u: 50),
        "{f}: the input stays at 50 %: no step; record the idle time before the step too, "
        "or give the step instant with --step-at",
    ),
    Bad(
        "never-on.csv",
        column(1, lambda i, u: 0),
        "{f}: the input stays at 0 %: no step; record the idle time before the step too, "
        "or give the step instant with --step-at",
    ),
    Bad(
        "above.csv",
        column(1, lambda i, u: 2.55 * u),
        "{f}: the input is 127.5 % at 0.5 s, above 100; if it is not in %, say its unit with --units input=UNIT",
    ),
    Bad(
        "below.csv",
        column(1, lambda i, u: -u),
        "{f}: the input is -50 % at 0.5 s, below 0; if it is not in %, say its unit with --units input=UNIT",
    ),
    Bad(
        "short.csv",
        csv(rows(59)),
        "{f}: 9 samples in its window, at least 10 are needed; record it longer",
    ),
    Bad(
        "no-time.csv",
        csv(rows(), "tick,duty_pct,torque_nm"),
        "{f}: no column is called time (columns: tick, duty_pct, torque_nm); name it with --columns time=NAME, "
        "or give --rate-hz HZ where the log has none",
    ),
    Bad(
        "no-torque.csv",
        csv(rows(), "time_s,duty_pct,temperature"),
        "{f}: no column is called torque (columns: time_s, duty_pct, temperature); name what was measured with "
        "--columns output=\"temperature\"",
    ),
    Bad(
        "two-torques.csv",
        csv([f"{line},0" for line in rows()], f"{HEADER},torque_nm"),
        '{f}: several columns may be the output (torque_nm, torque_nm); say which with --columns output="torque_nm"',
    ),
    Bad(
        "two-times.csv",
        csv([f"{i},{line}" for i, line in enumerate(rows())], f"time,{HEADER}"),
        '{f}: several columns may be the time (time, time_s); say which with --columns time="time"',
    ),
    Bad(
        "five-nameless.csv",
        csv([f"{line},1,2" for line in rows()], None),
        "{f}: its 5 columns have no names; only column 1 rises all the way; say by number, from 1 to 5, what they "
        "are: --columns time=1,input=2,output=5",
    ),
    Bad(
        "wrong-column.csv",
        csv(rows()),
        "{f}: has no column Force for --columns output=Force; its columns are time_s, duty_pct, torque_nm "
        "(a number counts them from 1)",
        ("--columns", "output=Force"),
    ),
    Bad(
        "same-column.csv",
        csv(rows()),
        "--columns: input and output are the same column, torque_nm",
        ("--columns", "output=torque_nm,input=3"),
        2,
    ),
    Bad(
        "bad-role.csv",
        csv(rows()),
        "--columns and --units know time, input, output, reference and position, not torque",
        ("--columns", "torque=3"),
        2,
    ),
    Bad(
        "bad-pairs.csv",
        csv(rows()),
        "--columns time: write role=name pairs with commas between them, as time=Time,output=Force",
        ("--columns", "time"),
        2,
    ),
    Bad(
        "bad-time-unit.csv",
        csv(rows()),
        "--units time=N: is no unit of time; use s, ms, us, ns, min, h or d",
        ("--units", "time=N"),
        2,
    ),
    Bad(
        "time-as-output.csv",
        csv(rows()),
        "--units output=ms: is a unit of time, not of the output",
        ("--units", "output=ms"),
        2,
    ),
    Bad(
        "name.csv",
        column(1, lambda i, u: u, "time_s,ignored,torque_nm"),
        "{f}: its name does not match --name-pattern; rename it or mend the pattern",
        ("--name-pattern", "_V={level}_"),
    ),
    Bad(
        "pattern.csv",
        csv(rows()),
        "--name-pattern _V=: holds neither {level} nor {repeat}",
        ("--name-pattern", "_V="),
        2,
    ),
    Bad(
        "no-level.csv",
        column(1, lambda i, u: u, "time_s,ignored,torque_nm"),
        "{f}: nothing tells its level; give the input column, or --name-pattern with {level}",
        ("--step-at", "0.5"),
    ),
    Bad(
        "clutch_0.8kV_rep1.csv",
        column(1, lambda i, u: u, "time_s,ignored,torque_nm"),
        '{f}: nothing tells its level; give the input column, or --name-pattern "_{level}kV", if 0.8 is the level',
        ("--step-at", "0.5"),
    ),
    Bad(
        "step-outside.csv",
        csv(rows()),
        "{f}: the step at 7 s lies outside the log (0 to 1.99 s); mend --step-at",
        ("--step-at", "7"),
    ),
    Bad(
        "until-before.csv",
        csv(rows()),
        "{f}: the window ends (0.2 s) before it begins (0.5 s); mend --until",
        ("--step-at", "0.5", "--until", "0.2"),
    ),
    Bad(
        "noise_V=5_.csv",
        csv([f"{i / 100},{np.sin(i * i):.4f}" for i in range(200)], "time_s,torque_nm"),
        "{f}: no step stands out of the output's noise; give its instant with --step-at",
        ("--name-pattern", "_V={level}_"),
    ),
    Bad(
        "not-there.csv.gz",
        gzip.compress(csv(rows()))[:-20],
        "{f}: is no whole gzip file (Compressed file ended before the end-of-stream marker was reached); copy it again",
    ),
    Bad(
        "bomb.csv.gz",
        gzip.compress(csv(rows()) + b"\n" * 40_000_000, 9),
        "{f}: unpacks to more than 200 times its size, as no recorded log does; unpack it yourself",
    ),
    Bad(
        "damaged.mat",
        b"MATLAB 5.0 MAT-file, Platform: x".ljust(124) + b"\x00\x01IM" + b"\x0e\0\0\0\x40\0\0\0" + b"\xff" * 64,
        "{f}: is a damaged MAT file (",
    ),
    Bad(
        "damaged.h5",
        b"\x89HDF\r\n\x1a\n" + b"\0" * 500,
        "{f}: is a damaged HDF5 file (",
    ),
    Bad(
        "workbook.csv",
        b"PK\x03\x04" + bytes(100),
        "{f}: is a ZIP archive or an Excel workbook; unpack it, or save its sheet as CSV",
    ),
    Bad(
        "pickle.csv",
        b"\x80\x04\x95\x1a\x00\x00\x00cposix\nsystem\nX\x04\x00\x00\x00trueR.",
        "{f}: is a Python pickle, which can run code; export the log as CSV or HDF5",
    ),
    Bad("a", b"\x93NUMPY\x01" + bytes(99), "{f}: is no whole NumPy array of numbers; export the log as CSV or HDF5"),
    Bad("picture.png", b"\x89PNG\r\n" + bytes(100), "{f}: is a picture; export the log as CSV"),
    Bad("log.csv.bz2", b"BZh91AY" + bytes(100), "{f}: is packed with bzip2; unpack it, or pack it with gzip"),
    Bad(
        "log.mat.gz",
        gzip.compress(b"MATLAB 5.0".ljust(124, b"\0") + b"\x00\x01IM" + bytes(range(256)) * 9),
        "{f}: is gzip around a file that is no text; unpack it and give what is inside",
    ),
    Bad(
        "one-column.csv",
        b"torque_nm\n" + b"".join(b"%d.5\n" % i for i in range(99)),
        "{f}: no column is called time (columns: torque_nm); name it with --columns time=NAME, "
        "or give --rate-hz HZ where the log has none",
    ),
    Bad(
        "wave.csv",
        column(1, lambda i, u: 50 + 40 * np.sin(i / 15)),
        "{f}: the input turns 4 times at 1.06 Hz: a periodic excitation holds no steps; eaid fit takes such a "
        "log whole, as it was recorded (--logs-as recorded asks for it); for steps, hold each level",
    ),
    Bad("one-row.csv", csv(rows()[:1]), "{f}: holds 1 samples, and a step takes at least 10; record it longer"),
    Bad("nine-rows.csv", csv(rows()[45:54]), "{f}: holds 9 samples, and a step takes at least 10; record it longer"),
    Bad(
        "all-falling.csv",
        csv(rows()[::-1]),
        "{f}: time falls at row 3 (1.98 s after 1.99 s); sort the rows",
    ),
    Bad(
        "stamps.csv",
        column(0, lambda i, t: "25:61:61.5" if i == 70 else f"16:18:{17 + int(t):02d}.{round(t % 1 * 100):02d}"),
        "{f}: row 72, column time_s, holds '25:61:61.5', which is no number" + CELL,
    ),
    Bad(
        "two-kinds.csv",
        csv([f"{line},50" for line in rows()], "time_s,duty_pct,torque_nm,duty (%)"),
        '{f}: several columns may be the input (duty_pct, duty (%)); say which with --columns input="duty_pct"',
    ),
    Bad("role-twice.csv", csv(rows()), "--columns time=1,time=2: says time twice", ("--columns", "time=1,time=2"), 2),
    Bad(
        "rig.csv",
        csv(rows()),
        "--apparatus surfaces=none: is no number",
        ("--apparatus", "surfaces=none"),
        2,
    ),
    Bad(
        "odd-pattern.csv",
        csv(rows()),
        "--name-pattern {level}{level}: holds a field twice",
        ("--name-pattern", "{level}{level}"),
        2,
    ),
    Bad(
        "same-unit.csv",
        csv(rows()),
        "--columns and --units know time, input, output, reference and position, not speed",
        ("--units", "speed=rpm"),
        2,
    ),
    Bad(
        "kind.csv",
        csv(rows()),
        "--kind brake: must be one of clutch, friction-force, friction-speed",
        ("--kind", "brake"),
        2,
    ),
    Bad("levels.csv", csv(rows()), "--levels 60: no log holds 60; levels found: 50", ("--levels", "60")),
    Bad("levels-text.csv", csv(rows()), "--levels high: write 30:100 or 30,40,90", ("--levels", "high"), 2),
    Bad("rate.csv", csv(rows()), "--rate-hz -5: must be above zero", ("--rate-hz", "-5"), 2),
    Bad(
        "two-inputs.csv",
        csv([f"{line},{86 if i > 99 else 0}" for i, line in enumerate(rows())], "time_s,force_n,torque_nm,speed_rpm"),
        "{f}: may be friction-force and friction-speed, as it has a column of each; say which with --kind",
    ),
]  # fmt: skip


@pytest.mark.parametrize("bad", BAD, ids=[bad.name for bad in BAD])
def test_sentence(bad: Bad, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / bad.name
    path.write_bytes(bad.content)
    output = tmp_path / "data.h5"
    code = run(["ingest", str(path), "-o", str(output), *bad.arguments])
    said = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("columns of ")]
    wanted = "error: " + bad.sentence.replace("{f}", str(path))
    if wanted.endswith("("):
        assert said[0].startswith(wanted)
    else:
        assert said[0] == wanted
    assert code == bad.exit_code
    assert not output.exists()
    assert [item.name for item in tmp_path.iterdir()] == [bad.name]


def test_names_are_unique() -> None:
    assert len({bad.name for bad in BAD}) == len(BAD)


def test_the_good_log_is_good(tmp_path: Path) -> None:
    path = tmp_path / "good.csv"
    path.write_bytes(csv(rows()))
    assert run(["ingest", str(path), "-q", "-o", str(tmp_path / "d.h5")]) == 0


def test_all_faults_of_all_logs_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_bytes(changed(60, "0.58,,0.9"))
    (tmp_path / "b.csv").write_bytes(column(2, lambda i, y: 0.25))
    lines = rows()
    lines[28], lines[97], lines[150] = "0.28,0,x", "0.5,50,1.9", "1.50,50"
    (tmp_path / "c.csv").write_bytes(csv(lines))
    (tmp_path / "good.csv").write_bytes(csv(rows()))
    assert run(["ingest", str(tmp_path), "-o", str(tmp_path / "d.h5")]) == 3
    said = [line.split(str(tmp_path) + "/")[1] for line in capsys.readouterr().err.splitlines() if "error" in line]
    assert [line.split(";")[0] for line in said] == [
        "a.csv: row 60, column duty_pct, is empty",
        "c.csv: row 30, column torque_nm, holds 'x', which is no number",
        "c.csv: row 152 has 2 cells, unlike the others",
        "c.csv: time falls at row 99 (0.5 s after 0.96 s)",
        "b.csv: the output never changes (0.25 N·m throughout)",
    ]


def test_many_bad_rows_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(column(2, lambda i, y: "x" if i % 10 == 0 else y))
    assert run(["ingest", str(path), "-o", str(tmp_path / "d.h5")]) == 3
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 6
    assert said[-1].endswith("and 15 more such rows; mend the cell")  # more than --repair would drop


def test_large_logs_get_the_same_sentences(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The quick parser and the careful one see the same faults, in the same rows."""
    for row, line, said in (
        (30_001, "29.999,50,high", "row 30001, column torque_nm, holds 'high', which is no number"),
        (30_001, "29.999,,1.9", "row 30001, column duty_pct, is empty"),
        (30_001, "29.999,50", "row 30001 has 2 cells, unlike the others"),
        (30_001, "29.999,50,1,9", "row 30001 has 4 cells, unlike the others"),
        (30_001, "29.999,50,NaN", "row 30001, column torque_nm, holds 'NaN', which is not finite"),
        (30_001, "29.998,50,1.9", "time is repeated at row 30001 (29.998 s after 29.998 s)"),
    ):
        lines = rows(40_000, 5000, rate_hz=1000.0)
        lines[row - 2] = line
        path = tmp_path / "long.csv"
        path.write_bytes(csv(lines))
        assert run(["ingest", str(path), "-o", str(tmp_path / "d.h5")]) == 3
        assert capsys.readouterr().err.splitlines()[0].split("long.csv: ")[1].split(";")[0] == said
