"""Odd logs, what is odd times the format it comes in: read right, read with a finding that says what was assumed, or
refused in one sentence; never wrong in silence."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from logs_written import text

import eaid
from eaid import EaidError

T, N = np.arange(300) / 100.0, 300
U = np.where(T >= 1.0, 60.0, 0.0)


@dataclass
class Odd:
    """A log: its names with their units, its columns, what stands above them, how its file is called."""

    names: str = "time_s,duty_pct,torque_nm"
    columns: tuple[Any, ...] = ()
    above: str = ""
    stem: str = "log"


def torque(seed: int) -> Any:
    rise = np.where(T >= 1.0, -1.5 * np.expm1(-(T - 1.0) / 0.3), 0.0)
    return np.round(rise + 0.01 * np.random.default_rng(seed).normal(size=N), 6)


def decimal_comma(log: Odd) -> str:
    cells = ([x if isinstance(x, str) else f"{x:.15g}".replace(".", ",") for x in column] for column in log.columns)
    return log.above + text(log.names, *cells, between=";")


def plain(log: Odd) -> str:
    return log.above + text(log.names, *log.columns)


def named(log: Odd) -> dict[str, Any]:
    return dict(zip(log.names.split(","), log.columns, strict=True))


def hdf5(log: Odd, path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.update(named(log))


TEXT: dict[str, Callable[[Odd, Path], Any]] = {
    "CSV": lambda log, path: path.write_text(plain(log), newline=""),
    "decimal comma": lambda log, path: path.write_text(decimal_comma(log)),
}  # fmt: skip
ARRAYS: dict[str, Callable[[Odd, Path], Any]] = {
    "HDF5": lambda log, path: hdf5(log, path),
    "frame": lambda log, path: pd.DataFrame(named(log)),
}  # fmt: skip
ALL = TEXT | ARRAYS


def clock(day: str, start: float = 86398.5) -> list[str]:
    """Stamps over midnight of 31 January; `day` has {d} and {m}."""
    at = [divmod(round(start + t, 2), 86400) for t in T.tolist()]
    return [day.format(d=1 if over else 31, m=2 if over else 1) + f" {int(s // 3600):02}:{int(s // 60 % 60):02}:"
            f"{s % 60:05.2f}" for over, s in at]  # fmt: skip


def time(name: str, values: Any) -> Callable[[Odd], Odd]:
    return lambda log: replace(log, names=f"{name},duty_pct,torque_nm", columns=(values, *log.columns[1:]))


def output(name: str, factor: float = 1.0) -> Callable[[Odd], Odd]:
    return lambda log: replace(
        log, names=f"time_s,duty_pct,{name}", columns=(*log.columns[:2], factor * log.columns[2])
    )


def input_(name: str, values: Any = U) -> Callable[[Odd], Odd]:
    return lambda log: replace(log, names=f"time_s,{name},torque_nm", columns=(T, values, log.columns[2]))


def called(stem: str, pattern: str) -> tuple[Callable[[Odd], Odd], dict[str, Any]]:
    still = replace(Odd(), names="time_s,torque_nm", stem=stem)
    return lambda log: replace(still, columns=log.columns[::2]), {"name_pattern": pattern}


NO_TIME, FACTOR, SAYS = "no column is called time", "which may multiply or divide", "something else"
DIFFERS = "they count in different units"  # from the other logs of the call
PART = "may not be the whole level"
ODD: dict[str, tuple[Any, ...]] = {
    # what is odd: how it is made, the formats, what comes of it: right, a code, or words of the refusal; and options
    "plain": (lambda log: log, ALL, "right"),
    "time in minutes": (time("time", T / 60), ALL, "say «units» time=min"),
    "time in hours": (time("time", T / 3600), ALL, "say «units» time=h"),
    "time in us with fractions": (time("time", 1e6 * T + 0.25 * np.sin(T)), ALL, "say «units» time=us"),
    "time in ms with fractions": (time("time", 1e3 * T + 0.25 * np.sin(T)), ALL, DIFFERS),
    "time in whole ms": (time("time", (1e3 * T).round().astype(int)), ALL, DIFFERS),
    "FILETIME": (time("time", 133_500_000_000_000_000 + (1e7 * T).round().astype(int)), ALL, "time-since-a-day"),
    "FILETIME called ns": (time("time_ns", 133_500_000_000_000_000 + (1e7 * T).round().astype(int)), ALL, "since 1601"),
    "ns since 1970": (time("time", 1_700_000_000_000_000_000 + (1e9 * T).round().astype(int)), ALL, "time-since-a-day"),
    "ms since 1970 called s": (time("time_s", 1_700_000_000_000 + 1e3 * T), ALL, "counts ms since 1970"),
    "days": (time("time", 45_000 + T / 86400), ALL, "say «units» time=d"),
    "times of day as numbers": (time("time", 161858.5 + T + 40 * (T >= 1.5)), ALL, "save it as 16:18:59"),
    "ticks": (time("tick", 84_000 * np.arange(N)), ALL, NO_TIME),
    "d/m over midnight": (time("time", clock("{d:02}/{m:02}/2024")), TEXT, "right"),
    "m/d over midnight": (time("time", clock("{m:02}/{d:02}/2024")), TEXT, "right"),
    "d.m over midnight": (time("time", clock("{d}.{m}.2024")), TEXT, "right"),
    "minutes and seconds": (
        time("time", [f"{t // 60:02.0f}:{t % 60:05.2f}" for t in T]), TEXT, "holds no number in any row"
    ),
    **{name: (output(name), ALL, FACTOR) for name in (
        "Torque*1000 [Nm]", "Torque x100 [Nm]", "torque (Nm x 0.01)", "torque (N.m*1e-2)", "torque [10^-3 Nm]",
        "Torque(x10) Nm", "torque % of 5 Nm")},
    "a divided torque": (output("Torque/1000 [Nm]"), TEXT, FACTOR),
    "a number beside the time's unit": (time("time [10 ms]", 100 * T), ALL, FACTOR),
    "torque in mNm": (output("torque (mNm)", 1e3), ALL, "right"),
    "torque without a unit": (output("torque", 7.0), ALL, "unit-unknown"),
    "units against the header": (output("torque_mnm", 1e3), ALL, SAYS, {"units": {"output": "Nm"}}),
    "units against the input": (input_("voltage_kV", U / 1e3), ALL, SAYS, {"units": {"input": "%"}}),
    "units of the time against it": (time("time_s", T), ALL, "says its unit", {"units": {"time": "ms"}}),
    "an input called u": (input_("u", U / 5), ALL, "unit-unknown"),
    "a command in V": (input_("command", U / 5), ALL, "unit-unknown"),
    "a duty without a unit": (input_("duty"), ALL, "unit-assumed"),
    "a share": (input_("duty", U / 100), ALL, "unit-assumed"),
    "counts of 255": (input_("pwm", 2.55 * U), ALL, "beyond 100 by more than noise; if it is not in %"),
    "a limit beside what has its unit": (lambda log: replace(
        log, names="time_s,duty_pct,torque_limit,T_clutch (Nm)", columns=(T, U, 5 + 0 * T, log.columns[2])),
        ALL, "right"),
    "a limit and no torque": (output("torque_limit"), ALL, "no column is called torque, force …"),
    "every tenth row": (lambda log: replace(log, columns=(
        T, U, [x if k % 10 == 0 else "" for k, x in enumerate(log.columns[2])])), ("CSV",),
        "holds a number in 30 of 300 rows only"),
    "every tenth sample": (lambda log: replace(
        log, columns=(T, U, np.where(np.arange(N) % 10, np.nan, log.columns[2]))), ARRAYS,
        "holds a number in 30 of 300 rows only"),
    "beyond any sensor": (output("torque_nm", 1e300), ALL, "as no sensor does"),
    "below any sensor": (output("torque_nm", 1e-300), ALL, "as no sensor does"),
    "an active-low duty": (input_("duty_pct", 60 - U), ALL, "input-may-be-active-low"),
    "unseen characters in a name": (input_("duty\u202e_\x1b[31m", U), ("CSV", "frame"), "unit-assumed"),
    "a line break in a unit": (output("torque (N\nm)"), ("frame", "HDF5"), "right"),
    "UTF-32": (lambda log: log, {"UTF-32": lambda log, path: path.write_bytes(plain(log).encode("utf-32"))},
               "holds no rows of numbers"),
    "objects": (lambda log: log, {"NumPy objects": lambda log, path: np.lib.format.write_array(
        path.open("wb"), np.array(log.columns, dtype=object))}, "holds Python objects"),
    "a duty of another length": (lambda log: replace(log, columns=(T, U[::4], log.columns[2])), ("HDF5",),
                                 "is of another length"),
    **{f"{kind} in cells": (lambda log, of=of: replace(log, columns=(T, U, [of(x) for x in log.columns[2].tolist()])),
                            ("frame",), "right") for kind, of in (("texts", repr), ("decimals", Decimal))},
    **{stem: (*(lambda made: (made[0], ("CSV", "frame", "HDF5"), PART, made[1]))(called(stem, pattern)),)
       for stem, pattern in (("x_2-5V", "{level}V"), ("x_2p5V", "{level}V"), ("x_1e2V", "{level}V"),
                             ("x_2_5V", "_{level}V"), ("x_1,000V", "{level}V"), ("x_2.5.1", "x_{level}"),
                             ("x_24V_60V", "{level}V"))},
}  # fmt: skip
ROWS = [(name, form) for name, row in ODD.items() for form in row[1]]


COPIES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "later": lambda log: log.assign(time_s=log.time_s + 17.3), "every second": lambda log: log[::2],
    "every seventh": lambda log: log[3::7], "cropped": lambda log: log[50:250], "rounded": lambda log: log.round(3),
    "significant digits": lambda log: log.assign(torque_nm=[float(f"{x:.4g}") for x in log.torque_nm]),
    "in mN·m": lambda log: log.assign(torque_nm=1e3 * log.torque_nm).rename(columns={"torque_nm": "torque_mnm"}),
    "at half the rate": lambda log: log.assign(time_s=2 * log.time_s), "single precision": lambda log: log.astype("f4"),
    "inside a longer log": lambda log: pd.concat([log, log.assign(time_s=T + 3, torque_nm=torque(98))]),
    "fewer and rounded": lambda log: log[2::5].round(2),
    "tared": lambda log: log.assign(torque_nm=log.torque_nm + 0.01),
    "with noise": lambda log: log.assign(torque_nm=log.torque_nm + 2e-3 * np.sin(1e5 * T)),
    "another": lambda log: log.assign(torque_nm=torque(99)),
}  # fmt: skip


@pytest.mark.parametrize("kind", COPIES)
def test_a_copy_is_no_repeat(kind):
    log = pd.DataFrame({"time_s": T, "duty_pct": U, "torque_nm": torque(97)})
    steps = eaid.read({"a": log, "b": COPIES[kind](log)})
    told = {one.code for run in steps.runs for one in run.findings}
    assert told == (set() if kind == "another" else {"run-given-twice"})
    assert len(steps.levels[0].names) == 2 - (kind not in ("another", "inside a longer log"))


def test_repeats_with_the_same_ripple_are_no_copies():
    """A ripple that the drive makes counted as their noise, within which two recordings are one."""
    ripple = 0.15 * np.sin(2 * np.pi * 0.37 * np.arange(len(T)))
    logs = [pd.DataFrame({"time_s": T, "duty_pct": U, "torque_nm": torque(k) + ripple}) for k in range(2)]
    assert len(eaid.read(logs).levels[0].names) == 2


LOG = pd.DataFrame({"time_s": T, "duty_pct": U, "torque_nm": torque(0)})


@pytest.mark.parametrize(
    ("given", "said", "sentence"),
    [({1: LOG, "1": LOG}, {}, "1: is the name of two runs"), ({"a": None}, {}, "a: is no DataFrame"),
     ([LOG, None], {}, "give files or folders of logs"), (LOG, {"baseline": "1e300"}, "baseline= 1e300: write"),
     (LOG, {"units": {"input": "/1e308"}}, "from 1e-12 to 1e12"),
     (LOG, {"input": "duty_pct", "columns": {"output": "torque_nm"}}, "say all columns in one place")],
)  # fmt: skip
def test_what_is_no_table_and_options_that_mean_nothing(given, said, sentence):
    with pytest.raises(EaidError, match=sentence) as caught:
        eaid.read(given, **said)
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def answers(tmp_path_factory) -> dict[tuple[str, str], Any]:
    """Of every row its run, or the sentences of its refusal; the logs of one set of options are read in one call."""
    calls: dict[str, tuple[dict[str, Any], dict[str, tuple[str, str]], dict[str, Any]]] = {}
    folder = tmp_path_factory.mktemp("odd")
    for k, (name, form) in enumerate(ROWS):
        row = ODD[name]
        make, _, _, *options = row
        log = make(Odd(columns=(T, U, torque(k))))
        said = options[0] if options else {}
        _, rows, frames = calls.setdefault(repr((said, form == "frame")), (said, {}, {}))
        path = folder / str(k) / log.stem
        path.parent.mkdir()
        table = (row[1][form] if isinstance(row[1], dict) else ALL[form])(log, path)
        if form == "frame":
            frames[f"{k}_{log.stem}"] = table
        rows[f"{k}_{log.stem}" if form == "frame" else str(path)] = (name, form)
    found: dict[tuple[str, str], Any] = defaultdict(list)
    for said, rows, frames in calls.values():
        while logs := [source for source in rows if rows[source] not in found]:
            given = {source: frames[source] for source in logs} if frames else [*map(Path, logs)]
            try:
                found |= {rows[run.source]: run for run in eaid.read(given, logs_as="recorded", **said).recorded}
            except EaidError as refusal:
                for sentence in (one for one in refusal.sentences if not one.startswith("try: ")):
                    (where,) = [source for source in rows if sentence.startswith(f"{source}: ")]
                    found[rows[where]].append(sentence)
    return found


@pytest.mark.parametrize(("name", "form"), ROWS)
def test_no_odd_log_is_wrong_in_silence(name, form, answers):
    answer, wanted = answers[name, form], ODD[name][2]
    if isinstance(answer, list):
        assert wanted in answer[0], answer
        return
    codes = {one.code for one in answer.findings}
    assert wanted in codes or (wanted == "right" and not codes), codes
    if wanted == "right" or wanted == "time-since-a-day":
        k = ROWS.index((name, form))
        np.testing.assert_allclose(answer.time_s, T, atol=2e-5)
        np.testing.assert_allclose(answer.output, torque(k), atol=1e-9)
        np.testing.assert_allclose(answer.input, U)
        assert (answer.input_unit, answer.output_unit) == ("%", "N·m")
