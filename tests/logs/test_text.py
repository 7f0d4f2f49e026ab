"""Text logs in every dialect give the same run as the plain one."""

import gzip
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from eaid.logs.options import ReadOptions
from hypothesis import given, settings
from hypothesis import strategies as st

from eaid.errors import DataError
from eaid.logs.read import read_runs
from eaid.logs.run import Run

N = 300
T = np.arange(N) / 100.0
U = np.where(T >= 1.0, 40.0, 0.0)
Y = np.round(np.where(T >= 1.0, 1.5 * -np.expm1(-(T - 1.0) / 0.3), 0.0) + 0.01 * np.sin(50 * T), 6)


def table(
    cell: Callable[[float], str] = repr,
    delimiter: str = ",",
    header: str | None = "time_s,duty_pct,torque_nm",
    end: str = "\n",
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> str:
    lines = [] if header is None else [header.replace(",", delimiter)]
    lines += [
        delimiter.join(cell(float(f"{value * scale:.10g}")) for value, scale in zip(row, factor, strict=True))
        for row in zip(T, U, Y, strict=True)
    ]
    return end.join(lines) + end


def comma(value: float) -> str:
    return repr(value).replace(".", ",")


def mixed(value: float) -> str:
    return f"{value:,.6f}"


DIALECTS: dict[str, tuple[bytes, dict[str, object]]] = {
    "plain": (table().encode(), {}),
    "semicolons and decimal comma": (table(comma, ";").encode(), {}),
    "tabs and decimal comma": (table(comma, "\t").encode(), {}),
    "tabs": (table(delimiter="\t").encode(), {}),
    "bars": (table(delimiter="|").encode(), {}),
    "spaces": (table(delimiter="   ").encode(), {}),
    "carriage returns and line feeds": (table(end="\r\n").encode(), {}),
    "carriage returns": (table(end="\r").encode(), {}),
    "byte-order mark": (table().encode("utf-8-sig"), {}),
    "UTF-16": (table().encode("utf-16"), {}),
    "UTF-16 without a mark": (table().encode("utf-16-le"), {}),
    "UTF-16 decimal comma": (table(comma, ";").encode("utf-16"), {}),
    "thousands": (table(mixed, ";", factor=(1e3, 1.0, 1e3), header="time_ms,duty_pct,torque_mNm").encode(), {}),
    "no header": (table(header=None).encode(), {}),
    "comment lines": (b"# rig 3\n% made by hand\n" + table().encode(), {}),
    "header in a comment": (table(header="# time_s,duty_pct,torque_nm").encode(), {}),
    "comments and blank lines inside": (table().replace("\n1.5,", "\n# pause\n\n1.5,").encode(), {}),
    "metadata lines": (b"Rig;3\nOperator;Jo\n\n" + table(delimiter=";").encode(), {}),
    "units row": (table(header="time,duty,torque\n s , % , N*m ").encode(), {}),
    "units in brackets": (table(header="Time [s],Duty cycle (%),Torque {N·m}").encode(), {}),
    "Latin-1 header": (table(header="Zeit (s),Tastgrad (%),Drehmoment (N·m)").encode("latin-1"), {}),
    "milliseconds": (table(factor=(1e3, 1, 1), header="time_ms,duty_pct,torque_nm").encode(), {}),
    "microseconds": (table(factor=(1e6, 1, 1), header="Time (µs),PWM (%),Torque").encode(), {}),
    "millinewton metres": (table(factor=(1, 1, 1e3), header="t,u,Torque (mNm)").encode(), {}),
    "duty as a fraction": (table(factor=(1, 0.01, 1)).encode(), {"units": {"input": "fraction"}}),
    "time said to be in ms": (table(factor=(1e3, 1, 1), header="t,u,torque").encode(), {"units": {"time": "ms"}}),
    "an empty last column": (table(header="time_s,duty_pct,torque_nm,note").replace("\n", ",\n").replace(
        "note,", "note").encode(), {}),
    "quoted": (table(lambda v: f'"{v!r}"', header='"time_s","duty_pct","torque_nm"').encode(), {}),
    "quoted names with commas": (
        table(header='"Time, s","Duty, %","Torque, Nm"').replace('"Time, s","Duty, %"', '"Time, s","Duty, %"').encode(),
        {},
    ),
    "trailing delimiter": (table().replace("\n", ",\n").encode(), {}),
    "index column": (
        ("idx,time_s,duty_pct,torque_nm\n" + "".join(f"{i},{a!r},{b!r},{c!r}\n" for i, (a, b, c) in
         enumerate(zip(T.tolist(), U.tolist(), Y.tolist(), strict=True)))).encode(), {},
    ),
    "other order, other columns": (
        ("torque_nm,temperature,note,time_s,duty_pct\n" + "".join(f"{c!r},21.5,ok,{a!r},{b!r}\n" for a, b, c in
         zip(T.tolist(), U.tolist(), Y.tolist(), strict=True))).encode(), {},
    ),
    "columns by name": (
        table(header="Zeitpunkt,Volt A,Load Cell").encode(),
        {
            "columns": {"time": "Zeitpunkt", "input": "Volt A", "output": "Load Cell"},
            "units": {"input": "%", "output": "Nm"},
        },
    ),
    "columns by number": (
        table(header=None).encode(), {"columns": {"time": "1", "input": "2", "output": "3"}},
    ),
    "clock stamps": (
        ("stamp,duty_pct,torque_nm\n" + "".join(
            f"23:59:{58 + int(a):02d}.{round(a % 1 * 100):02d},{b!r},{c!r}\n" if a < 2 else
            f"00:00:{int(a) - 2:02d}.{round(a % 1 * 100):02d},{b!r},{c!r}\n"
            for a, b, c in zip(T.tolist(), U.tolist(), Y.tolist(), strict=True))).encode(),
        {"columns": {"time": "stamp"}},
    ),
    "dates": (
        ("timestamp;duty;torque\n" + "".join(
            f"2024-10-29 16:18:{17 + int(a):02d},{round(a % 1 * 100):02d};{comma(b)};{comma(c)}\n"
            for a, b, c in zip(T.tolist(), U.tolist(), Y.tolist(), strict=True))).encode(), {},
    ),
    "rate in a comment": (
        ("# sampling rate: 0.1 kHz\nduty_pct,torque_nm\n" + "".join(f"{b!r},{c!r}\n" for b, c in
         zip(U.tolist(), Y.tolist(), strict=True))).encode(), {},
    ),
    "sample time in a metadata line": (
        ("dt;0.01 s\nduty_pct;torque_nm\n" + "".join(f"{b!r};{c!r}\n" for b, c in
         zip(U.tolist(), Y.tolist(), strict=True))).encode(), {},
    ),
    "rate given": (
        ("duty_pct,torque_nm\n" + "".join(f"{b!r},{c!r}\n" for b, c in
         zip(U.tolist(), Y.tolist(), strict=True))).encode(),
        {"rate_hz": 100.0},
    ),
    "gzip": (gzip.compress(table().encode()), {}),
    "gzip of a dialect": (gzip.compress(table(comma, ";", end="\r\n").encode()), {}),
}  # fmt: skip


def read_one(path: Path, content: bytes, **options: object) -> Run:
    path.write_bytes(content)
    (found,) = read_runs([path], ReadOptions(**options))  # type: ignore[arg-type]
    return found


UNKNOWN = {"no header", "columns by number"}
"""Dialects whose columns say no unit; those of a torque alone are unknown, too."""


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("quick", [True, False], ids=["quick", "cell by cell"])
def test_dialect(name: str, quick: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not quick:
        monkeypatch.setattr("eaid.logs.text.by_arrow", lambda *_: None)
    content, options = DIALECTS[name]
    run = read_one(tmp_path / "log.dat", content, **options)
    np.testing.assert_allclose(run.time_s - run.time_s[0], T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.input, U, rtol=1e-12)
    np.testing.assert_allclose(run.output, Y, rtol=1e-9, atol=1e-15)
    assert run.input_unit == ("" if name in UNKNOWN else "%")
    assert run.output_unit == ("" if name in UNKNOWN | {"microseconds", "time said to be in ms", "dates"} else "N·m")


@pytest.mark.parametrize(
    ("header", "units", "factor", "unit"),
    [
        ("force_g", {}, 9.80665e-3, "N"),
        ("force", {"output": "g"}, 9.80665e-3, "N"),
        ("force (lbf)", {}, 4.4482216152605, "N"),
        ("Torque [ozf·in]", {}, 0.00706155181422604, "N·m"),
        ("Torque (kgf.cm)", {}, 0.0980665, "N·m"),
        ("torque", {"output": "mm/s^2"}, 1.0, "mm/s^2"),
        ("torque", {}, 1.0, ""),
        ("torque.mNm", {}, 1e-3, "N·m"),
        ("TorqueMnm", {}, 1e-3, "N·m"),
        ("torqueNcm", {}, 1e-2, "N·m"),
        ("Load Cell", {}, 1.0, "N"),
        ("Load Cell (g)", {}, 9.80665e-3, "N"),
        ("response (g)", {}, 1.0, "g"),
        ("accel output [g]", {"output": "g"}, 1.0, "g"),
        ("output", {"output": "/1000"}, 1e-3, ""),
        ("Torque [MNm]", {}, 1.0, "MNm"),
    ],
)
def test_output_units(header: str, units: dict[str, str], factor: float, unit: str, tmp_path: Path) -> None:
    run = read_one(tmp_path / "a.csv", table(header=f"time_s,duty_pct,{header}").encode(), units=units)
    np.testing.assert_allclose(run.output, Y * factor, rtol=1e-12)
    assert run.output_unit == unit


def test_numbers_are_correctly_rounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ways give the bits of Python's own float(), for 17 digits and for hard cases."""
    rng = np.random.default_rng(7)
    numbers = [*(rng.normal(size=2000) * 10.0 ** rng.integers(-12, 12, 2000)).tolist(), 5e-324, 1.7976931348623157e308]
    hard = [
        "9007199254740993",
        "0.1e-5",
        "2.2250738585072011e-308",
        "1.00000000000000011102230246251565404236316680908",
    ]
    texts = [repr(x) for x in numbers] + hard
    content = "time_s,torque_nm\n" + "".join(f"{i},{text}\n" for i, text in enumerate(texts))
    for quick in (True, False):
        if not quick:
            monkeypatch.setattr("eaid.logs.text.by_arrow", lambda *_: None)
        run = read_one(tmp_path / "a.csv", content.encode())
        assert run.output.tolist() == [float(text) for text in texts]


@pytest.mark.parametrize("cell", ["1.23", "1.2345", "12.34.567", ".123", "1.234.", "1..234"])
def test_a_mark_that_stands_between_no_thousands(cell: str, tmp_path: Path) -> None:
    """A point that would be lost without a word, were all points between thousands taken away."""
    content = table(lambda v: f"{v:,.3f}".translate(str.maketrans(",.", ".,")), ";", factor=(1e3, 1.0, 1e3))
    row = next(i for i, line in enumerate(content.splitlines(), start=1) if line.startswith("2.000"))
    with pytest.raises(DataError, match=f"row {row}, column time_s, holds {re.escape(repr(cell + ',000'))}"):
        read_one(tmp_path / "a.csv", content.replace("\n2.000,", f"\n{cell},").encode())


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(st.floats(-1e12, 1e12, allow_nan=False), min_size=12, max_size=40),
    delimiter=st.sampled_from([",", ";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
    end=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
)
def test_any_dialect_gives_the_same_numbers(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], delimiter: str, decimal: str, end: str, encoding: str
) -> None:
    if delimiter == decimal:
        return
    lines = [delimiter.join(("time_s", "torque_nm"))]
    lines += [delimiter.join((str(i), repr(v).replace(".", decimal))) for i, v in enumerate(values)]
    path = tmp_path_factory.mktemp("any") / "a.csv"
    path.write_bytes((end.join(lines) + end).encode(encoding))
    (run,) = read_runs([path])
    assert run.output.tolist() == values


def test_repair_drops_and_says_so(tmp_path: Path) -> None:
    lines = table().splitlines()
    lines[100], lines[201] = "0.99,0,", "0.1,40,1.0"
    run = read_one(tmp_path / "a.csv", "\n".join(lines).encode(), repair=True)
    assert len(run.time_s) == N - 2
    assert [(one.code, one.values) for one in run.findings] == [("rows-dropped", {"dropped": 2, "count": 300})]
    assert (np.diff(run.time_s) > 0).all()
    np.testing.assert_array_equal(run.output, np.delete(Y, [99, 200]))


def test_names_tell_level_and_repeat(tmp_path: Path) -> None:
    run = read_one(
        tmp_path / "b_V=-12,5_r3.csv",
        table(header="time_s,junk,torque").encode(),
        name_pattern="_V={level}_r{repeat}.",
        units={"input": "V"},
    )
    assert (run.level, run.repeat, run.input_unit, run.output_unit) == (-12.5, 3, "V", "")
    assert np.isnan(run.input).all()


def test_a_folder_is_read_by_name_and_a_log_counts_once(tmp_path: Path) -> None:
    for name in ("b.csv", "a.csv", ".hidden.csv", "notes.md"):
        (tmp_path / name).write_bytes(f"# {name}\n{table()}".encode())
    assert [run.name for run in read_runs([tmp_path])] == ["a", "b"]
    with pytest.raises(Exception, match="is given twice; a log counts once"):
        read_runs([tmp_path, tmp_path / "a.csv"])


def test_equal_names_are_told_apart(tmp_path: Path) -> None:
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.csv").write_bytes(f"# {folder}\n{table()}".encode())
    assert [run.name for run in read_runs([tmp_path / "x", tmp_path / "y"])] == ["x-a", "y-a"]


def test_the_duty_wins_over_constant_speed_and_force(tmp_path: Path) -> None:
    body = table(header=None).replace("\n", ",10,86\n").encode()
    run = read_one(tmp_path / "a.csv", b"time_s,duty_pct,torque_nm,speed_rpm,force_n\n" + body)
    assert (run.kind, run.input_unit) == ("clutch", "%")


def test_the_column_that_steps_is_the_input(tmp_path: Path) -> None:
    body = table(header=None).replace("\n", ",15\n").encode()
    run = read_one(tmp_path / "a.csv", b"time_s,force_n,torque_nm,speed_rpm\n" + body)
    assert (run.kind, run.input_unit) == ("friction-force", "N")
    run = read_one(tmp_path / "a.csv", b"time_s,speed_rpm,torque_nm,force_n\n" + body)
    assert (run.kind, run.input_unit) == ("friction-speed", "RPM")


def test_a_torque_reference_is_no_output(tmp_path: Path) -> None:
    body = table(header=None).replace("\n", ",2.5\n").encode()
    run = read_one(tmp_path / "a.csv", b"time_s,duty_pct,torque_nm,torque_reference_nm\n" + body)
    np.testing.assert_array_equal(run.output, Y)
    assert run.reference_nm is not None
    assert set(run.reference_nm.tolist()) == {2.5}


@pytest.mark.parametrize(
    "name",
    ["plain", "semicolons and decimal comma", "tabs", "spaces", "thousands", "Latin-1 header", "trailing delimiter"],
)
def test_plain_logs_take_the_quick_way(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        raise AssertionError("read cell by cell")

    monkeypatch.setattr("eaid.logs.text.cell_by_cell", never)
    content, options = DIALECTS[name]
    assert len(read_one(tmp_path / "log.dat", content, **options).time_s) == N
