"""Good logs written oddly, in one table: each comes out right, with a stop-finding, or is refused by its cause."""

import gzip
import os
import re
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from eaid.logs.options import ReadOptions
from scipy.io import savemat

from eaid.cli.inputs import runs_from
from eaid.cli.main import run as main
from eaid.errors import DataError, UsageError
from eaid.logs.read import differing_number, read_runs
from eaid.reading import InputOptions
from eaid.steps.build import build_stepset

RATE = 200
T = np.arange(800) / RATE
U = np.where(T >= 1, 60.0, 0.0)
Y = np.round(np.where(T >= 1, -2.0 * np.expm1(-(T - 1) / 0.3), 0.0) + 2e-3 * np.sin(1e4 * T), 6)


def csv(
    time: Any = T, duty: Any = U, torque: Any = Y, header: str = "time,duty_pct,torque_nm", form: str = "{}"
) -> str:
    rows = zip(time, duty, torque, strict=True)
    return "\n".join([header, *(f"{form.format(a)},{b:g},{c:.6f}" for a, b, c in rows)]) + "\n"


def text(content: str) -> Callable[[Path], None]:
    return lambda path: path.write_text(content)  # type: ignore[return-value]


def comma(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


def table(*head: str, rows: list[str]) -> str:
    return "\n".join([*head, *rows]) + "\n"


def three(form: str, time: Any = T, duty: Any = U, torque: Any = Y) -> list[str]:
    return [form.format(t, u, y) for t, u, y in zip(time, duty, torque, strict=True)]


HEAD, ROWS = "time_s,duty_pct,torque_nm", three("{:.3f},{:g},{:.6f}")


def slow_channel() -> str:
    """The torque comes with nine of ten rows."""
    return table(HEAD, rows=[f"{row[: row.rindex(',')]}," if i % 10 == 0 else row
                                                    for i, row in enumerate(ROWS)])  # fmt: skip


def hdf5(path: Path) -> None:
    """CF attributes: counts of 0.5 mN·m from −1 N·m on, one of them never written."""
    with h5py.File(path, "w") as file:
        file["time"], file["duty"] = T * 1e3, U
        file["time"].attrs["units"], file["duty"].attrs["units"] = "ms", "%"
        file["torque"] = np.round((Y * 1e3 + 1000) / 0.5).astype("i4")
        file["torque"].attrs.update(units="mN.m", scale_factor=0.5, add_offset=-1000.0, _FillValue=np.int32(-9999))


def posixtime(path: Path) -> None:
    savemat(path, {"time": 1.7e9 + T, "duty": U, "torque_nm": Y}, appendmat=False)


def matrices(path: Path) -> None:
    savemat(path, {"t": T, "u": np.stack([0 * T, U], 1), "y": np.stack([0 * T, Y, 0 * T])}, appendmat=False)


def stamps_ns(path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    at = np.datetime64("2023-11-14T22:13:20", "ns") + np.round(T * 1e9).astype("timedelta64[ns]")
    pq.write_table(pa.table({"time": at, "duty_pct": U, "torque_nm": Y, "note": ["x"] * len(T)}), path)


def whole_ns(path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    at = 1_700_000_000_000_000_000 + np.round(T * 1e9).astype("i8")
    pq.write_table(pa.table({"time": at, "duty_pct": U, "torque_nm": Y}), path)


def unsigned(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = 1_700_000_000_000_000_000 + np.round(T * 1e9).astype("u8")
        file["duty"], file["torque_nm"] = U.astype("u1"), Y


def offsets(path: Path) -> None:
    """Summer time ends in the middle of the log: the clock falls by an hour, the time does not."""
    stamps = [
        f"2024-10-27 02:59:{58 + int(a):02d}.{round(a % 1 * 1000):03d}+02:00" if a < 2 else
        f"2024-10-27 02:00:{int(a) - 2:02d}.{round(a % 1 * 1000):03d}+01:00" for a in T.tolist()
    ]  # fmt: skip
    path.write_text(csv(stamps))


@dataclass(frozen=True)
class Odd:
    """One oddity: how it is written, what is said to it, and what has to come out."""

    name: str
    write: Callable[[Path], Any]
    options: dict[str, Any] = field(default_factory=dict)
    code: str = ""
    """Code of a finding; its severity tells whether the numbers are right."""
    refused: str = ""
    """What the refusal says; empty: it is read."""
    factor: float = 1.0
    """Of the output."""
    input: Any = None
    """What the input has to be; None: 60 % from 1 s on."""
    atol_s: float = 1e-9


ODD = [
    Odd("seconds since 1970", text(csv(1.7e9 + T, form="{:.4f}")), atol_s=1e-6),
    Odd("seconds since 1970, ten digits", text(csv(1.7e9 + T, form="{:.0f}")),
        refused="795 of 800 rows repeat the time of the row before, from row 3 on: its stamps have too few digits"),
    Odd("every row twice", text(csv(np.repeat(T, 2), np.repeat(U, 2), np.repeat(Y, 2))),
        refused="800 of 1600 rows repeat the time of the row before, from row 3 on"),
    Odd("a clock that was set back", text(csv(np.where(T > 2, T - 1, T))),
        refused="time falls at row 403 (1.005 s after 2 s); split the log where its clock was set back"),
    Odd("two torques", text(csv(header="time,torque1 (Nm),torque2 (Nm)")),
        refused='several columns may be the output (torque1 (Nm), torque2 (Nm)); say which with columns= '
                'output="torque1 (Nm)"'),
    Odd("one numbered torque", text(csv(header="time,duty_pct,torque1 (Nm)"))),
    Odd("a last line that was cut", text(csv()[:-9]), refused="row 801, column torque_nm, is empty; mend the cell"),
    Odd("zeros behind the last line", lambda path: path.write_bytes(csv().encode() + bytes(3000))),
    Odd("hex counts", text(csv().replace(",60,", ",0x3c,")), refused="column duty_pct, holds '0x3c', which"),
    Odd("per cent signs", text(csv().replace(",60,", ",60%,")), refused="column duty_pct, holds '60%', which"),
    Odd("words for the duty", text(csv().replace(",60,", ",on,")), refused="column duty_pct, holds 'on', which"),
    Odd("times before the trigger", text(csv(T - 1))),
    Odd("decimal comma and points between thousands", text("time_ms;duty_pct;torque_mNm\n" + "".join(
        f"{1e3 * a:,.1f};{b:g};{1e3 * c:,.3f}\n".replace(",", "'").replace(".", ",").replace("'", ".")
        for a, b, c in zip(T, U, Y, strict=True)))),
    Odd("seconds since 1e7", text(csv(1e7 + T, form="{:.4f}")), atol_s=1e-8),
    Odd("ms since 1970", text(csv(1.7e12 + 1e3 * T, form="{:.0f}")), code="time-since-1970"),
    Odd("µs since 1970", text(csv(1.7e15 + 1e6 * T, form="{:.0f}")), code="time-since-1970"),
    Odd("ns since 1970", text(csv([1_700_000_000_000_000_000 + round(1e9 * a) for a in T])), code="time-since-1970"),
    Odd("ms since 1970 said to be s", text(csv(1.7e12 + 1e3 * T, header="time_s,duty_pct,torque_nm", form="{:.0f}")),
        refused="counts ms since 1970; say which with units= time="),
    Odd("MAT posixtime", posixtime, atol_s=1e-6),
    Odd("Parquet stamps in ns", stamps_ns, code="columns-without-numbers"),
    Odd("Parquet whole ns", whole_ns, code="time-since-1970"),
    Odd("Excel days", text(csv(45_000 + T / 86400, form="{:.12f}")), code="time-in-days", atol_s=1e-6),
    Odd("datenum days", text(csv(738_000 + T / 86400, form="{:.12f}")), code="time-in-days", atol_s=2e-5),
    Odd("days named", text(csv(T / 86400, header="time [days],duty_pct,torque_nm", form="{:.15f}"))),
    Odd("days named s", text(csv(45_000 + T / 86400, header="time_s,duty_pct,torque_nm", form="{:.12f}")),
        code="time-too-fast"),
    Odd("minutes named", text(csv(T / 60, header="minutes,duty_pct,torque_nm", form="{:.15f}"))),
    Odd("minutes unnamed", text(csv(T / 60 / 10, form="{:.15f}")), code="time-too-fast"),
    Odd("hours named", text(csv(T / 3600, header="Time (h),duty_pct,torque_nm", form="{:.15f}"))),
    Odd("ms by name alone", text(csv(1e3 * T, header="ms,duty_pct,torque_nm", form="{:.0f}"))),
    Odd("camel case", text(csv(1e3 * T, header="timeMs,dutyPct,TorqueNm", form="{:.0f}"))),
    Odd("µs unnamed", text(csv(1e6 * T, form="{:.0f}")), code="time-too-long"),
    Odd("ns unnamed", text(csv([round(1e9 * a) for a in T])), code="time-too-long"),
    Odd("µs unnamed, 20 minutes after power-up", text(csv(1.2e9 + 1e6 * T, form="{:.0f}")), code="time-too-long"),
    Odd("ns unnamed, 20 minutes after power-up", text(csv([1_200_000_000_000 + round(1e9 * a) for a in T])),
        code="time-too-long"),
    Odd("µs named, 20 minutes after power-up",
        text(csv(1.2e9 + 1e6 * T, header="time_us,duty_pct,torque_nm", form="{:.0f}")),
        refused="counts s since 1970; say which with units= time="),
    Odd("ns since 1970, unsigned", unsigned, code="time-since-1970"),
    Odd("ms unnamed", text(csv(1e3 * T, form="{:.0f}")), code="time-too-long"),
    Odd("sample counts", text(csv(range(800), header="sample,duty_pct,torque_nm")),
        {"columns": {"time": "sample"}}, refused="numbers the samples and is no time; give their rate with rate_hz="),
    Odd("sample counts as time", text(csv(range(800))), code="time-in-whole-numbers"),
    Odd("sample counts and their rate", text(csv(range(800), header="sample,duty_pct,torque_nm")),
        {"columns": {"time": "sample"}, "rate_hz": 200.0}),
    Odd("samples a second", text(csv(range(800))), {"units": {"time": "/200"}}),
    Odd("unknown unit of time", text(csv(header="time (m),duty_pct,torque_nm")),
        refused="is in m, which is no unit of time that eaid knows"),
    Odd("rate beside a time", text(csv()), {"rate_hz": 200.0}, refused="so rate_hz= does nothing; leave it out"),
    Odd("UTC offsets", offsets, atol_s=1e-9),
    Odd("mixed line ends", lambda path: path.write_bytes(
        b"".join(line.encode() + (b"\n", b"\r\n", b"\r")[i % 3] for i, line in enumerate(csv().splitlines())))),
    Odd("CF attributes of HDF5", hdf5, atol_s=1e-9),
    Odd("thousands comma in quotes", text(csv([f'"{1e3 * a:,.0f}"' for a in T], header="time_ms,duty_pct,torque_nm"))),
    Odd("thousands comma from a later row on", text(
        csv([f"{1e3 * a:,.1f}" for a in T], header="time_ms,duty_pct,torque_nm").replace(",", ";").replace(
            ";0;", "|0|").replace(";60;", "|60|").replace("time_ms;duty_pct;torque_nm", "time_ms|duty_pct|torque_nm")
        .replace(";", ","))),
    Odd("commas that may be either", text("time_ms;duty_pct;torque_nm\n" + "".join(
        f"{1000 + 5 * i:,};{0 if i < 200 else 60};{1000 + 5 * i:,}\n" for i in range(800))),
        refused="its commas may be decimal marks or stand between thousands"),
    Odd("two tables", text("a,b\n" + "".join(f"{i},{i * i}\n" for i in range(30)) + "\n" + csv()),
        refused="holds two tables, one from row 2 and another from row 34"),
    Odd("two tables of one width", text(csv(T[:30], U[:30], Y[:30]) + csv()),
        refused="row 32, column time, holds 'time', which is no number"),
    Odd("torque of counts", text(csv(torque=16000 * Y)), code="torque-too-large", factor=16000.0),
    Odd("torque.mNm", text(csv(torque=1e3 * Y, header="time,duty_pct,torque.mNm"))),
    Odd("TorqueMnm", text(csv(torque=1e3 * Y, header="time,duty_pct,TorqueMnm"))),
    Odd("no unit of torque", text(csv(header="time,duty_pct,torque")), code="unit-unknown"),
    Odd("an acceleration in g", text(csv(header="time,duty_pct,response acc (g)")), code="unit-g-unclear"),
    Odd("PWM counts", text(csv(duty=255 * U / 100)), {"units": {"input": "/255"}}),
    Odd("matrices of MAT by column", matrices, {"columns": {"time": "t", "input": "u[2]", "output": "y[2]"}}),
    Odd("a constant speed beside a current", text(
        "time,speed_rpm,I_set,torque_nm\n"
        + "".join(f"{a},15,{b:g},{c:.6f}\n" for a, b, c in zip(T, U, Y, strict=True))),
        code="input-by-its-steps"),
    Odd("a temperature called T", text(csv(header="Time [s],duty_pct,T [degC]")), {"columns": {"output": "T"}}),
    Odd("a speed that follows the throttle", text(
        "time,speed_rpm,servo,thrust_N\n" + "".join(
            f"{a},{900 * c:.3f},{b:g},{c:.6f}\n" for a, b, c in zip(T, U * np.where(T < 3, 1, 0.5), Y, strict=True))),
        {"columns": {"output": "thrust_N"}}, code="input-by-its-steps", input=U * np.where(T < 3, 1, 0.5)),
    Odd("one column left for the output", text(csv(header="time,fan [%],T [degC]")),
        refused='name what was measured with columns= output="T [degC]"'),
    Odd("an input of no known name", text(csv(header="time,Q1,torque_nm")), code="input-unnamed"),
    Odd("a trigger and the level in the name", text(csv(duty=U / 60, header="time,trigger,torque_nm")),
        {"name_pattern": "_u{level}_"}, code="level-times-trigger"),
    Odd("a name that contradicts", text(csv(duty=U / 2)), {"name_pattern": "_u{level}_"}, code="level-contradicted"),
    Odd("a rate in a comment", text("# sampled at 0.2 kHz by the DAQ\nduty_pct,torque_nm\n" + "".join(
        f"{b:g},{c:.6f}\n" for b, c in zip(U, Y, strict=True)))),
    Odd("no header, times in the second column", text("".join(
        f"{c:.6f},{1e6 * a:.0f},{b:g}\n" for a, b, c in zip(T, U, Y, strict=True))),
        refused=r"only column 2 rises all the way; say by number, from 1 to 3, what they are: "
                r"columns= time=2,input=3,output=1; and the unit of time if it is not s, perhaps units= time=us"),
    # as the owner of a new rig names and shapes them
    Odd("decimal comma, units row, kV and mN·m", text(table(
        "Zeit;Spannung;Drehmoment", "ms;kV;mN·m",
        rows=[f"{comma(1e3 * t, 1)};{comma(u / 1e3, 3)};{comma(1e3 * y, 3)}"
              for t, u, y in zip(T, U, Y, strict=True)]))),
    Odd("two header rows", text(table("Bench A,,Bench B,", "time [s],duty [%],torque [Nm],temp [degC]",
                                      rows=three("{:.3f},{:g},{:.6f},23.1")))),
    Odd("a clock in ms", text(table("t,u,torque", rows=three("{:.0f},{:g},{:.6f}", 1e3 * T))),
        code="time-too-long"),
    Odd("set and measured values", text(table(
        "idx,timestamp_ms,V_set (V),V_meas (V),T_ref (Nm),T_meas (Nm),Temp1 (C)",
        rows=[f"{i},{1e3 * t:.1f},{u:g},{u + np.sin(i):.3f},{u / 30:.3f},{y:.6f},25.1"
              for i, (t, u, y) in enumerate(zip(T, U, Y, strict=True))])), code="input-unnamed"),
    Odd("a scope's export",
        text(table("Source,CH1,CH2", "Second,Volt,Volt", rows=three("{:+.6e},{:+.4e},{:+.6e}", T - 2))),
        options={"columns": {"output": "CH2"}}, code="input-unnamed"),
    Odd("a summary behind the rows", text(table(HEAD, rows=[*ROWS, "mean,,1.2"])),
        refused="column time_s, holds 'mean', which is no number; mend the cell, or drop such rows with repair="),
    Odd("a logger started anew", text(table(HEAD, rows=[*ROWS[:400], HEAD, *ROWS[400:]])),
        refused="row 402, column time_s, holds 'time_s', which is no number"),
    Odd("one torque in ten is missing", text(slow_channel()),
        refused="row 2, column torque_nm, is empty; mend the cell"),
    Odd("words for the valve", text(table("time_s,valve,torque_nm", rows=[
        f"{t:.3f},{'ON' if u else 'OFF'},{y:.6f}" for t, u, y in zip(T, U, Y, strict=True)])), input=np.nan * T),
    Odd("a duty of 10 bits",
        text(table("ms,pwm_counts,torque_nm", rows=three("{:.0f},{:.0f},{:.6f}", 1e3 * T, 10.23 * U))),
        options={"units": {"input": "/1023"}}, input=np.where(T >= 1, 614 / 10.23, 0.0)),
    Odd("a step of two rows at one time", text(table(HEAD, rows=[*ROWS[:200], "1.000,0,0", *ROWS[200:]])),
        options={"repair": True}, code="rows-dropped"),
]  # fmt: skip
NUMBERS_DIFFER = {
    "a clock in ms",
    "sample counts as time",
    "µs unnamed",
    "ns unnamed",
    "µs unnamed, 20 minutes after power-up",
    "ns unnamed, 20 minutes after power-up",
    "ms unnamed",
    "days named s",
    "minutes unnamed",
}
"""The clock is not what it was: their findings say so."""


@pytest.mark.parametrize("odd", ODD, ids=[odd.name for odd in ODD])
def test_odd_log(odd: Odd, tmp_path: Path) -> None:
    path = tmp_path / "log_u60_.dat"
    odd.write(path)
    options = ReadOptions(**odd.options)
    if odd.refused:
        with pytest.raises(DataError, match=re.escape(odd.refused).replace("\\ ", " ")):
            read_runs([path], options)
        return
    (run,) = read_runs([path], options)
    if odd.code:
        assert odd.code in {one.code for one in run.findings}
    assert all(one.subject == run.name for one in run.findings)
    if odd.name in NUMBERS_DIFFER:
        said = next(one for one in run.findings if one.code == odd.code)
        assert said.severity == ("caution" if odd.code == "time-in-whole-numbers" else "stop")
        return
    assert run.time_s[0] == 0.0
    np.testing.assert_allclose(run.time_s, T, rtol=0, atol=odd.atol_s)
    np.testing.assert_allclose(
        run.output, odd.factor * Y, rtol=0, atol=(3e-4 if odd.write is hdf5 else 1e-9) * odd.factor
    )
    if odd.code not in ("level-contradicted",):
        np.testing.assert_allclose(run.input, U if odd.input is None else odd.input, atol=1e-9)


def test_logs_that_say_only_on_or_off_are_no_repeats_where_their_names_differ(tmp_path: Path) -> None:
    for level in (100, 200):
        for repeat in (1, 2):
            torque = Y * level / 100 + 1e-3 * repeat
            (tmp_path / f"t_{level}V_{repeat}.csv").write_text(
                csv(duty=U / 60, torque=torque, header="time,enable,torque_nm")
            )
    with pytest.raises(DataError, match='say that it is the level with name_pattern= "t_{level}V_"'):
        read_runs([tmp_path], ReadOptions())
    assert [one.level for one in fitted_levels(tmp_path, name_pattern="t_{level}V_")] == [100.0, 200.0]
    assert [one.level for one in fitted_levels(tmp_path, columns={"input": "enable"})] == [1.0]


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["a_100V_1", "a_100V_2", "a_150V_1"], "a_{level}V_"),
        (["run1", "run2"], "run{level}"),
        (["run1", "step2"], None),
        (["run1", "run1b"], None),
        (["s-2.5bar", "s-5bar"], "s-{level}bar"),
    ],
)
def test_the_number_in_which_names_differ(names: list[str], pattern: str | None) -> None:
    assert differing_number(names) == pattern


def fitted_levels(path: Path, **options: Any) -> Any:
    return build_stepset(read_runs([path], ReadOptions(**options))).levels


def test_stamps_since_1970_give_the_steps_of_a_clock_that_starts_at_0(tmp_path: Path) -> None:
    """A tolerance of 1e-9 of the stamp is 1.7 s there: τ1 came out ten times too long, and nothing was said."""
    (tmp_path / "a.csv").write_text(csv())
    (tmp_path / "b.csv").write_text(csv(1_700_000_000 + T, form="{:.4f}"))
    (zero,), (epoch,) = fitted_levels(tmp_path / "a.csv"), fitted_levels(tmp_path / "b.csv")
    np.testing.assert_allclose(epoch.time_s, zero.time_s, atol=1e-6)
    np.testing.assert_array_equal(epoch.runs, zero.runs)


def test_an_instant_is_given_on_the_clock_of_the_log_or_since_its_start(tmp_path: Path) -> None:
    (tmp_path / "a_u60_.csv").write_text(csv(25 + T, header="time_s,x,torque_nm", form="{:.4f}").replace(",60,", ",0,"))
    for said in (26.0, 1.0):
        (run,) = read_runs([tmp_path / "a_u60_.csv"], ReadOptions(step_at_s=said, name_pattern="_u{level}_"))
        assert run.step_s == pytest.approx(1.0)
    steps, stepset = runs_from([tmp_path / "a_u60_.csv"], InputOptions(step_at=26.0, name_pattern="_u{level}_"))
    assert stepset.runs[0].step_s == pytest.approx(26.0)  # told as the log tells it
    assert steps[0].time_s[0] == 0.0


def test_a_log_and_its_copy_count_once(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(csv())
    (tmp_path / "b.csv").write_text(csv())
    (run,) = read_runs([tmp_path / "a.csv", tmp_path / "b.csv"])
    (said,) = run.findings[-1:]
    assert (said.code, said.severity) == ("log-given-twice", "caution")
    assert said.values == {"path": str(tmp_path / "b.csv"), "first": str(tmp_path / "a.csv")}


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of one log, `a.csv` beside it."""
    (tmp_path / "a.csv").write_text(csv())
    assert main(["ingest", str(tmp_path / "a.csv"), "-q", "-o", str(tmp_path / "d.h5")]) == 0
    return tmp_path / "d.h5"


def test_a_dataset_and_the_logs_it_was_made_of_count_once(dataset: Path) -> None:
    (run,) = read_runs([dataset, dataset.with_name("a.csv")])
    assert run.dataset
    assert "log-given-twice" in {one.code for one in run.findings}


def test_one_log_in_fractions_among_percent(tmp_path: Path) -> None:
    for name, scale in (("a", 1.0), ("b", 0.5), ("c", 0.01)):
        (tmp_path / f"{name}.csv").write_text(csv(duty=scale * U))
    found = {run.name: [(one.code, one.severity) for one in run.findings] for run in read_runs([tmp_path])}
    assert found == {"a": [], "b": [], "c": [("input-in-fractions", "stop")]}
    assert not any(run.findings for run in read_runs([tmp_path], ReadOptions(units={"input": "%"})))


def test_a_stored_level_that_its_own_input_contradicts(dataset: Path) -> None:
    with h5py.File(dataset, "a") as file:
        file["runs/a"].attrs["level"] = 40.0
        del file.attrs["digest"]
    with pytest.raises(DataError, match="run a: its level is 40, its input goes to 60 %; ingest the logs again"):
        read_runs([dataset])


def test_options_of_columns_on_a_dataset_are_refused(dataset: Path) -> None:
    for options in ({"units": {"output": "mNm"}}, {"rate_hz": 100.0}, {"step_at_s": 1.0}, {"columns": {"time": "1"}}):
        with pytest.raises(UsageError, match="does nothing on .*d.h5, a dataset"):
            read_runs([dataset], ReadOptions(**options))


def test_columns_taken_and_left_are_known(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(csv(header="time (ms),Load,Torque mNm").replace(",60,", ",60,").encode()))
    (run,) = read_runs([path], ReadOptions(columns={"input": "Load"}, units={"input": "N"}))
    assert run.taken == (("time", "time (ms)"), ("input", "Load"), ("output", "Torque mNm"))
    assert run.left == ()


def test_three_thousand_nested_groups_take_no_time(tmp_path: Path) -> None:
    path = tmp_path / "deep.h5"
    with h5py.File(path, "w") as file:
        file["time"], file["duty"], file["torque"] = T, U, Y
        group = file
        for _ in range(3000):
            group = group.create_group("g")
    import time

    began = time.process_time()
    (run,) = read_runs([path])
    assert len(run.time_s) == len(T)
    assert time.process_time() - began < 2.0


@pytest.mark.parametrize("dtype", ["u8", "i8", "f8"])
def test_counts_beyond_the_largest_whole_number_keep_their_sign(dtype: str, tmp_path: Path) -> None:
    counts = np.where(T >= 1, 0.0, 2.0**62) + (2.0**63 if dtype != "i8" else 0.0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_s"], file["duty_pct"], file["torque"] = T, U, counts.astype(dtype)
    (run,) = read_runs([tmp_path / "a.h5"])
    np.testing.assert_array_equal(run.output, counts)


@pytest.mark.parametrize(
    ("start", "per_s"), [(0, 10**6), (0, 10**9), (2**63 - 10**9, 10**9), (10**25, 10**21)]
)  # fmt: skip
def test_a_clock_in_a_finer_unit_is_stopped_without_filling_the_memory(
    start: int, per_s: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = np.arange(0.0, 60.0, 0.02)
    stamps = [start + round(a * per_s) for a in long]
    path = tmp_path / "a.csv"
    path.write_text(csv(stamps, np.where(long > 40, 60.0, 0.0), np.where(long > 40, 0.5, 1e-3 * np.sin(1e4 * long))))
    tracemalloc.start()
    assert main(["ingest", str(path), "-o", str(tmp_path / "d.h5")]) == 0
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 100e6
    stops = [line for line in capsys.readouterr().out.splitlines() if line.startswith("stop")]
    assert "no unit is given for time, whole numbers" in stops[0]


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are UTF-8 there")
def test_names_that_are_not_utf8(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, odd = tmp_path / "logs", os.fsdecode(b"caf\xe9")
    folder.mkdir()
    for name in ("a.csv", f"{odd}.csv"):
        (folder / name).write_text(csv())
    for given in (folder, folder / f"{odd}.csv"):
        assert main(["ingest", str(given), "-q", "-o", str(tmp_path / "d.h5")]) == 3
        said = f"error: {folder}/caf\\udce9.csv: its name, or that of its folder, is not UTF-8; rename it\n"
        assert capsys.readouterr().err == said
    for _ in range(2):
        assert main(["ingest", str(folder / "a.csv"), "-q", "--force", "-o", str(tmp_path / f"{odd}.h5")]) == 0
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == [f"{odd}.h5"]


def test_a_repeat_beyond_the_largest_whole_number(tmp_path: Path) -> None:
    (tmp_path / f"a_{2**63}.csv").write_text(csv())
    with pytest.raises(DataError, match="its repeat, 9223372036854775808, is no count"):
        read_runs([tmp_path / f"a_{2**63}.csv"], ReadOptions(name_pattern="_{repeat}"))
    (tmp_path / f"b_{2**63 - 1}.csv").write_text(csv())
    assert read_runs([tmp_path / f"b_{2**63 - 1}.csv"], ReadOptions(name_pattern="_{repeat}"))[0].repeat == 2**63 - 1


def test_a_manifest_with_a_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(csv())
    (tmp_path / "dataset.toml").write_bytes(
        b'\xef\xbb\xbfschema = "eaid/manifest/1"\n[options]\n[[log]]\nfile = "a.csv"\n'
    )
    steps, _ = runs_from([tmp_path])
    assert [step.name for step in steps] == ["a"]


def test_ingest_tells_the_columns_before_anything_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k in (1, 2):
        header = f"time (ms),duty_pct,Torque_mNm,T{k}"
        (tmp_path / f"a{k}.csv").write_text(
            csv(1e3 * T, header=header, form="{:.0f}").replace("\n", ",21\n").replace(f"T{k},21", f"T{k}")
        )
    assert main(["ingest", str(tmp_path), "-o", str(tmp_path / "d.h5")]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "to do" not in line]
    assert said[0] == (
        "columns of 1 log: time = time (ms) [s], input = duty_pct [%], output = Torque_mNm [N·m]; left: T1"
    )
    assert said[1].endswith("left: T2")


def test_a_line_break_in_columns_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text(csv())
    arguments = ["ingest", str(tmp_path / "a.csv"), "-o", str(tmp_path / "d.h5"), "--columns", "time=1\n,output=3"]
    assert main(arguments) == 2
    assert "holds a line break; write all pairs on one line" in capsys.readouterr().err


def test_reading_options_are_kept_for_doing_it_again(tmp_path: Path) -> None:
    (tmp_path / "log_u60_.csv").write_text(csv(1e3 * T, header="Zeit,x,Moment", form="{:.0f}"))
    options = {"columns": "time=Zeit,output=Moment", "units": "time=ms,output=Nm,input=%", "name_pattern": "_u{level}_",
               "step_at": 1.0}  # fmt: skip
    _, stepset = runs_from([tmp_path / "log_u60_.csv"], InputOptions(**options))
    assert stepset.reading == options


def test_a_clock_in_another_unit_makes_no_grid_larger_than_the_data() -> None:
    """Bins of 0.01 s over stamps in µs taken for seconds: 134 GiB for a log of 200 kB."""
    from eaid.uncertainty.runs import bartlett_variance

    variances = bartlett_variance(5e6 * np.arange(4000.0), np.ones((4000, 6)))
    assert variances.shape == (4, 6) and np.isfinite(variances).all()


def test_repair_is_not_advised_to_who_gave_it(tmp_path: Path) -> None:
    rows = csv().splitlines()
    rows[100:110] = ["0.1,0,x"] * 10
    (tmp_path / "a.csv").write_text("\n".join(rows))
    with pytest.raises(DataError) as caught:
        read_runs([tmp_path / "a.csv"], ReadOptions(repair=True))
    assert not any("drop such rows" in said for said in caught.value.sentences)


def test_what_was_asked_for_in_the_output_s_unit_is_no_input(tmp_path: Path) -> None:
    path = tmp_path / "loop.csv"
    path.write_text(csv(duty=2.0 * (U > 0), header="time_s,setpoint_nm,torque_nm"))
    (run,) = read_runs([path], ReadOptions())
    assert dict(run.taken)["reference"] == "setpoint_nm" and np.isnan(run.input).all()
    (run,) = read_runs([path], ReadOptions(columns={"input": "setpoint_nm"}))
    assert run.input.max() == 2.0


@pytest.mark.parametrize("fault", ["{:.3f},{:g},", "{:.3f},{:g},bad"])
def test_a_dropped_row_at_the_step_is_told(fault: str, tmp_path: Path) -> None:
    """The row of the step itself is bad: the step counts from the next, 5 ms later, and its instant is named."""
    rows = ROWS.copy()
    rows[200] = fault.format(T[200], U[200])
    path = tmp_path / "a.csv"
    path.write_text(table(HEAD, rows=rows))
    (run,) = read_runs([path], ReadOptions(repair=True))
    assert {one.code: dict(one.values) for one in run.findings}["step-row-dropped"] == {"row": 202, "at_s": 1.0}
    assert build_stepset([run]).runs[0].step_s == pytest.approx(1.005)
    (run,) = read_runs([path], ReadOptions(repair=True, step_at_s=1.0))
    assert "step-row-dropped" not in [one.code for one in run.findings]
    rows[200], rows[300] = ROWS[200], fault.format(T[300], U[300])
    path.write_text(table(HEAD, rows=rows))
    assert [one.code for one in read_runs([path], ReadOptions(repair=True))[0].findings] == ["rows-dropped"]
