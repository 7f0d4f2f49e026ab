"""The time of a log, whatever its clock counts, and the units of its columns, against pint."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from logs_written import frame, text

import eaid

T = np.arange(60.0) / 10
STEP = np.where(np.arange(60) >= 30, 1.0, 0.0)


def at(times: Any, name: str = "time", torque: str = "torque_nm", **more: Any) -> Any:
    """A log with these times, whose input steps."""
    count = len(times)
    return frame(f"{name}|duty|{torque}", np.asarray(times), np.arange(count) > count // 2, np.arange(count), **more)


@pytest.mark.parametrize(
    ("first", "step", "name", "said", "factor", "code"),
    [
        (25, 0.01, "t", None, 1, ""), (-1, 0.01, "time", None, 1, ""),
        (1e7, 0.5, "time", None, 1, ""), (0, 1.5, "time", None, 1, "time-doubtful ms"),
        (0, 60.5, "time", None, 1, "time-doubtful ms"), (0, 100.5, "time", None, 1, "time-unclear ms"),
        (0, 1 / 49_999.5, "time", None, 1, "time-doubtful h"), (0, 1 / 50_000.5, "time", None, 1, "time-unclear h"),
        (0, 1 / 5_100_000, "time_s", None, 1, "time-unclear d"), (0, 1 / 5_100_000, "time", "s", 1, ""),
        (0, 0.1, "time_ns", None, 1e-9, "time-unclear d"),
        (0, 0.01, "Time [us]", None, 1e-6, ""), (0, 1, "time", None, 1, "time-doubtful ms"),
        (0, 1 / 6000, "t", None, 1, "time-unclear h"), (0, 10, "Time [s]", None, 1, ""),
        (0, 11, "Time [s]", None, 1, "whole-seconds"), (0, 11, "Time [s]", "ms", 1e-3, ""),
        (0, 501, "time", None, 1, "time-unclear us"), (0, 61.3, "time", None, 1, "time-unclear ms"),
        (0, 5.1e5, "time", None, 1, "time-unclear ns"), (0.5, 62, "time", None, 1, "time-unclear ms"),
        (1.2e9, 5000, "time", None, 1, "time-unclear us"), (4e9, 74, "time", None, 1, ""),
        (45_000, 1 / 8_640_000, "time", None, 1, "time-unclear d"),
        (45_000, 1 / 49_000, "time", None, 1, "time-doubtful h"),
        (0, 1 / 1999, "time", None, 1, ""),
        (45_000, 1 / 8_640_000, "time_s", None, 1, "time-unclear d"), (0, 10, "time_ms", None, 1e-3, ""),
        (0, 10, "millis", None, 1e-3, ""), (0, 10, "timeMs", None, 1e-3, ""), (0, 1e-3, "Time (h)", None, 3600, ""),
        (0, 1e4, "Zeit in us", None, 1e-6, ""), (0, 1, "time", "/200", 1 / 200, ""),
        (1.7e12, 1, "time_ms", None, 1e-3, ""), (1.7e12, 1, "time", "s", 1, ""),
        (0, 2.5, "sample", None, 1, "time-doubtful ms"),
        (0, 1, "sample", "s", 1, ""),
    ],
)  # fmt: skip
def test_clocks(first, step, name, said, factor, code, read, codes):
    raw = first + step * np.arange(60)
    if code.startswith("time-unclear"):  # asked before anything else is done
        (asked,) = read.refused(at(raw, name), columns={"time": "1"})
        assert f"say «units» time={code.split()[1]}, or time=" in asked
        return
    run = read(at(raw, name), columns={"time": "1"}, units={"time": said} if said else {})
    np.testing.assert_allclose(run.time_s, (raw - raw[0]) * factor, rtol=1e-12)
    assert run.start_s == pytest.approx(first * factor) and run.time_s[0] == 0
    told = [f"{code} {values.get('likely', '')}".strip() for code, values in codes(run).items()]
    assert told == ([code] if code else [])


@pytest.mark.parametrize(
    ("said", "since"), [(8.0, 3.0), (5.0, 0.0), (10.9, 5.9), (4.9, 4.9), (30.0, 25.0), (-1.0, -6.0)]
)
def test_instants_on_the_clock_of_a_log_or_since_its_start(said, since, read):
    """Of a log from 5 s to 10.9 s; outside of it they count since its start, if they lie inside so."""
    run = read(frame("time|duty|torque_nm", T + 5, 60 * STEP, STEP), step_at=said, until=said)
    assert (run.step_s, run.until_s, run.start_s) == (pytest.approx(since), pytest.approx(since), 5.0)
    plain = read(at(T + 5))
    assert (plain.step_s, plain.until_s) == (None, None)


PINT = {
    "second": "s sec secs second seconds sek seg", "millisecond": "ms msec millisecond milliseconds millis",
    "microsecond": "us usec microsecond microseconds micros µs μs", "nanosecond": "ns nsec nanosecond nanoseconds",
    "minute": "min mins minute minutes", "hour": "h hr hrs hour hours", "day": "d day days",
    "newton * meter": "nm newtonmeter newtonmetre newtonmeters newtonmetres N·m N*m Nm",
    "millinewton * meter": "mnm [mN_m]", "newton * centimeter": "ncm N*cm", "newton * millimeter": "nmm",
    "kilonewton * meter": "knm", "micronewton * meter": "unm µN·m", "kilogram_force * meter": "kgfm kgm",
    "kilogram_force * centimeter": "kgfcm kgcm kgf·cm", "gram_force * centimeter": "gfcm gcm gf·cm",
    "pound_force * foot": "lbfft lbft ftlb ftlbf ft-lb", "pound_force * inch": "lbfin lbin inlb inlbf",
    "ounce_force * inch": "ozin ozfin inoz oz_in", "newton": "n newton newtons N", "millinewton": "mn mN",
    "kilonewton": "kn kN", "gram_force": "g gf gram grams", "kilogram_force": "kg kgf", "pound_force": "lbf lb lbs",
    "revolution / minute": "rpm 1/min r/min rev/min u/min min-1 U/min", "revolution / second": "rps rev/s hz",
    "radian / second": "rad/s rads rad/sec", "degree / second": "deg/s °/s dps deg/sec",
    "percent": "% pct percent prozent procent", "dimensionless": "fraction 1 ratio -", "volt": "v volt volts vdc",
    "millivolt": "mv {mV}", "kilovolt": "kv (kV)", "ampere": "a amp amps ampere amperes", "milliampere": "ma",
    "bar": "bar bars", "millibar": "mbar hpa mBar", "pascal": "pa", "kilopascal": "kpa", "megapascal": "mpa MPa",
    "pound_force_per_square_inch": "psi",
}  # fmt: skip
INTO = {"s": "second", "N·m": "newton * meter", "N": "newton", "RPM": "revolution / minute", "%": "percent",
        "V": "volt", "A": "ampere", "bar": "bar"}  # fmt: skip


def test_every_spelling_of_a_unit(read):
    import pint

    units = pint.UnitRegistry()
    for name, spelling in ((name, one) for name, spellings in PINT.items() for one in spellings.split()):
        of_time = name in list(PINT)[:7]
        run = read(at(T, torque="torque"), units={"time" if of_time else "output": spelling})
        values, into = (run.time_s, "s") if of_time else (run.output, run.output_unit)
        factor = units.Quantity(1.0, name).to(INTO[into]).magnitude
        np.testing.assert_allclose(values, factor * (T if of_time else np.arange(60)), rtol=1e-11, err_msg=spelling)


@pytest.mark.parametrize(
    ("column", "unit", "factor"),
    [
        ("torque.mNm", "N·m", 1e-3), ("TorqueMnm", "N·m", 1e-3), ("Torque / Nm", "N·m", 1), ("Force,N", "N", 1),
        ("T1", "", 1), ("Torque (mNm)", "N·m", 1e-3), ("Load Cell (g)", "N", 9.80665e-3), ("levelPct", "%", 1),
        ("a {V}", "V", 1), ("a [what]", "what", 1), ("a_what", "", 1), ("ratio_1", "", 1),
        ("(V)", "", 1), ("temperature_degC", "degC", 1), ("travel_mm", "mm", 1), ("x [bits]", "bits", 1),
        ("omega in rad/s", "RPM", 30 / np.pi), ("speed rad/s", "RPM", 30 / np.pi),
        ("velocity_mm/s", "mm/s", 1), ("speed in m/min", "m/min", 1), ("a_b/c", "", 1), ("Drehzahl, U/min", "RPM", 1),
        ("forceN", "N", 1), ("levelV", "V", 1), ("planA", "", 1), ("ForceMn", "N", 1e-3), ("dutyCycle", "", 1),
        ("u%", "", 1), ("a b_kV", "V", 1e3), (" x [kPa] ", "bar", 1e-2), ("torqueNcm", "N·m", 1e-2),
        ("force_g", "N", 9.80665e-3), ("force (lbf)", "N", 4.4482216152605),
        ("Torque [ozf·in]", "N·m", 0.00706155181422604), ("Torque (kgf.cm)", "N·m", 0.0980665),
        ("Torque [MNm]", "MNm", 1), ("Force [MN]", "MN", 1),
        ("Force [mN]", "N", 1e-3), ("u_ms", "", 1), ("friction", "N", 1), ("load cell", "N", 1), ("output", "", 1),
    ],
)  # fmt: skip
def test_the_unit_in_a_name(column, unit, factor, read, codes):
    run = read(frame(f"time|duty|{column}", T, 60 * STEP, 2 * STEP), columns={"output": "3"})
    assert run.output_unit == (unit or "a.u.") and run.output[-1] == pytest.approx(2 * factor, rel=1e-12)
    assert set(codes(run)) == ({"unit-unknown"} if not unit else {"unit-assumed"} if column in ("friction", "load cell")
                               else set())  # fmt: skip


@pytest.mark.parametrize(
    ("column", "said", "of_file", "unit", "factor", "code"),
    [
        ("torque", None, "", "", 1, "unit-unknown"), ("torque", None, "mNm", "N·m", 1e-3, ""),
        ("torque_ncm", "mN·m", "mNm", "N·m", 1e-3, ""), ("torque_mnm", None, "mNm", "N·m", 1e-3, ""),
        ("torque", "bits", "", "bits", 1, ""),
        ("torque", None, "ms", "", 1, "unit-unknown"),  # no unit of a torque
        ("torque", "/1000", "", "FS", 1e-3, ""),
        ("torque*1e3", "mNm", "Nm", "N·m", 1e-3, ""), ("force", None, "g", "N", 9.80665e-3, ""),
        ("accel", None, "g", "g", 1, "unit-g-unclear"), ("output", None, "g", "g", 1, "unit-g-unclear"),
        ("output", "g", "", "N", 9.80665e-3, ""), ("accel force", "kg", "", "kg", 1, "unit-g-unclear"),
        ("output", None, "gf", "N", 9.80665e-3, ""), ("output [kg]", None, "", "kg", 1, "unit-g-unclear"),
        ("load", None, "[kg]", "N", 9.80665, ""), ("Load-Cell", None, "kg", "N", 9.80665, ""),
        ("shearForce", None, "g", "N", 9.80665e-3, ""), ("acc force", None, "g", "g", 1, "unit-g-unclear"),
    ],
)  # fmt: skip
def test_who_says_the_unit(column, said, of_file, unit, factor, code, read, codes):
    log = frame(f"time|duty|{column}", T, 60 * STEP, 2 - 3 * STEP, units={column: of_file} if of_file else {})
    run = read(log, columns={"output": "3"}, units={"output": said} if said else {})
    assert (run.output_unit, list(codes(run))) == (unit or "a.u.", [code] if code else [])
    np.testing.assert_allclose(run.output, factor * (2 - 3 * STEP), rtol=1e-12)


@pytest.mark.parametrize(
    ("column", "said", "unit", "factor", "code"),
    [
        ("duty", None, "%", 1, ""), ("u", "/200", "%", 0.5, ""), ("u", "fraction", "%", 100, ""),
        ("volts", None, "V", 1, "assumed"), ("strom", None, "", 1, "unknown"), ("pressure", None, "bar", 1, "assumed"),
        ("Kraft", None, "N", 1, "assumed"), ("drehzahl", None, "RPM", 1, "assumed"),
        ("speed_rad/s", None, "RPM", 30 / np.pi, ""), ("voltage_mV", None, "V", 1e-3, ""),
        ("duty", "counts", "counts", 1, ""), ("PWM [V]", None, "V", 1, ""),
    ],
)  # fmt: skip
def test_units_of_inputs(column, said, unit, factor, code, read, codes):
    level = 0.6 if said == "fraction" else 60
    run = read(frame(f"time|{column}|torque_nm", T, level * STEP, STEP), units={"input": said} if said else {})
    assert (run.input_unit, list(codes(run))) == (unit or "a.u.", [f"unit-{code}"] if code else [])
    np.testing.assert_allclose(run.input, factor * level * STEP, rtol=1e-12)


@pytest.mark.parametrize(
    ("y", "name", "said", "told"),
    [(1000.0, "torque_Nm", {}, False), (-1000.5, "torque_Nm", {}, True), (1001.0, "torque_Nm", {"output": "Nm"}, False),
     (1000.5, "force_kN", {}, False)],
)  # fmt: skip
def test_a_torque_beyond_any_clutch(y, name, said, told, read, codes):
    run = read(frame(f"time|duty|{name}", T, 60 * STEP, y * STEP), units=said)
    assert codes(run) == ({"torque-too-large": {"largest": abs(y)}} if told else {})


def test_a_doubt_about_the_unit_leaves_no_run_out():
    """Of two runs one lies just beyond what a clutch has: its column is that of the other."""
    t = np.arange(400) / 50
    rise = np.where(t >= 2, 1 - np.exp(-(t - 2).clip(0) / 0.5), 0.0)
    logs = [pd.DataFrame({"time_s": t, "duty": 60.0 * (t >= 2), "torque_Nm": y * rise}) for y in (990.0, 1010.0)]
    fit = eaid.fit(logs, model=("friction",))
    assert "runs-left-out" not in {one.code for one in fit.findings} and not fit.verdict.usable


@pytest.mark.parametrize(("start", "per_s"), [(0, 10**9), (2**63 - 10**9, 10**9), (10**25, 10**21)])
def test_a_clock_in_a_finer_unit_is_asked_about_without_filling_the_memory(start, per_s, tmp_path, run_eaid):
    long = np.arange(0.0, 60.0, 0.02)
    on, stamps = long > 40, [str(start + round(a * per_s)) for a in long]
    y = np.where(on, 0.5, 1e-3 * np.sin(1e4 * long))
    (tmp_path / "a.csv").write_text(text("time,duty_pct,torque_nm", stamps, 60 * on, y))
    ran = run_eaid("ingest", tmp_path / "a.csv", "-o", tmp_path / "d.h5")
    assert ran.code == 3 and "say --units time=ns, or time=s if it lasts" in ran.err


def test_a_rate_takes_the_place_of_stamps_of_whole_seconds():
    """The advice was to give the rate, and then that the log has a time column."""
    t = np.arange(600) / 50.0
    duty = np.where(t >= 2, 60.0, 0.0)
    torque = np.where(t >= 2, -2.0 * np.expm1(-(t - 2) / 0.3), 0.0) + 1e-3 * np.sin(1e4 * t)
    log = pd.DataFrame({"time_s": np.floor(t), "duty_pct": duty, "torque_nm": torque})
    with pytest.raises(eaid.DataError, match=r"give the sample rate with rate_hz="):
        eaid.read(log)
    (level,) = eaid.read(log, rate_hz=50.0).levels
    assert level.time_s[1] == pytest.approx(0.02)
    with pytest.raises(eaid.DataError, match="does nothing"):
        eaid.read(log.assign(time_s=t), rate_hz=50.0)


@pytest.mark.parametrize(("before", "after"), [("2025-03-30 01:59", 3), ("2025-10-26 02:59", 2)])
def test_a_clock_that_is_set_for_summer_or_winter_goes_on(before, after, tmp_path):
    """35 s of rows 10 ms apart were an hour and 35 s: τ2 of 16 s came out as 7, "usable"."""
    t = np.arange(3500) / 100
    stamps = [f"{before}:{55 + one:06.3f}" if one < 5 else f"{before[:11]}{after:02d}:00:{one - 5:06.3f}" for one in t]
    on = t >= 2
    rows = text("timestamp,duty_pct,torque_nm", stamps, 60 * on, np.where(on, -2 * np.expm1(-(t - 2) / 0.7), 0.0))
    (tmp_path / "a.csv").write_text(rows)
    (level,) = eaid.read(tmp_path / "a.csv").levels
    np.testing.assert_allclose(level.time_s, np.arange(3300) / 100, atol=1e-6)
    head, *lines = rows.splitlines()
    (tmp_path / "a.csv").write_text("\n".join([head, *lines[:500], *lines[700:]]))  # an hour and more is a pause
    if after == 3:
        (level,) = eaid.read(tmp_path / "a.csv").levels
        assert np.diff(level.time_s).max() > 3600


def test_a_reference_is_read_in_its_own_unit_or_that_of_the_output():
    """In mN·m beside a torque that was turned into N·m, the errors of a loop were a thousand times its torque."""
    t = np.arange(500) * 0.01
    u, rise = np.where(t > 1, 50.0, 0.0), np.where(t > 1, 900 * -np.expm1(-(t - 1) / 0.3), 0.0)

    def read(name, **how):
        columns = {"time_s": t, "duty_pct": u, "torque_mNm": rise, name: np.where(t > 1, 1000.0, 0.0)}
        (run,) = eaid.read(pd.DataFrame(columns), **how).steps
        return float(run.reference_nm.max())

    assert [read("reference_mNm"), read("reference"), read("reference_Nm")] == [1.0, 1.0, 1000.0]
    assert read("reference", units={"reference": "kN·m"}) == 1e6
    with pytest.raises(eaid.DataError, match=r"its reference, reference_N, is in N, its output in N·m"):
        read("reference_N")
