"""Every command of docs/how-to/rigs.md on the recordings that it names, beside fits of this file's own."""

import json
import re
import shlex
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import curve_fit

PAGE = (Path(__file__).parents[2] / "docs/how-to/rigs.md").read_text(encoding="utf-8")
COMMANDS = [line for line in PAGE.splitlines() if line.startswith("eaid ")]
Command = Callable[..., tuple[Any, dict[str, Any], Path]]


@pytest.fixture
def command(realdata: Path, tmp_path: Path, run_eaid: Callable[..., Any]) -> Command:
    """The page's command for a recording, and more words: what it gave back, fit.json, and the recording."""

    def run(name: str, *more: str) -> tuple[Any, dict[str, Any], Path]:
        (line,) = (line for line in COMMANDS if name in line)
        words = shlex.split(line)[1:]
        path = next(path for path in realdata.rglob("*") if path.name == words[1])
        out = tmp_path / words[-1]
        ran = run_eaid(words[0], path, *more, *words[2:-1], out)
        return ran, json.loads(out.read_text()) if out.suffix == ".json" and out.exists() else {}, path

    return run


def one(t: Any, start: float, change: float, tau: float, dead: float) -> Any:
    return start - change * np.expm1(-np.maximum(t - dead, 0.0) / tau)


def two(t: Any, change: float, tau1: float, tau2: float) -> Any:
    return change * (1 - 0.85 * np.exp(-t / tau1) - 0.15 * np.exp(-t / tau2))


@pytest.mark.parametrize("name", ["heater_dead_time.csv", "heater_on_from_first_row.csv"])
def test_heaters(name: str, command: Command) -> None:
    ran, fit, path = command(name)
    heads = path.read_text().splitlines()[0].split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)[:, [heads.index(c) for c in ("Time", "T1", "Q1")]]
    table = table[np.r_[np.diff(table[:, 0]) > 0, True]]  # the step instant is written twice, off and on
    first = int(np.argmax(table[:, 2] > 0))
    held = first + int(np.argmin(np.r_[table[first:, 2] > 0, False]))
    time, heat = table[:held, 0], table[:held, 1]
    start = float(heat[: max(first, 1)].mean())
    since, limits = time[first:] - time[first], ([0, 10, 0], [100, 1000, 60])
    best, _ = curve_fit(lambda t, *p: one(t, start, *p), since, heat[first:], (30.0, 150.0, 10.0), bounds=limits)
    (step,) = fit["steps"]
    assert (ran.code, step["shape"], step["start"]) == (0, "one", pytest.approx(start, abs=0.01))
    assert [step["change"], step["tau1"]] == pytest.approx(best[:2].tolist(), rel=0.01)
    assert step["dead_time_s"] == pytest.approx(best[2], rel=0.03)
    for key in ("change", "tau1"):
        low, high = step["ci95"][key]
        assert low < step[key] < high < 1.5 * low


def test_a_lamp_on_a_staircase(command: Command) -> None:
    ran, fit, path = command("light_staircase.csv")
    volts, time, pwm = np.genfromtxt(path, delimiter=",", comments="/").T
    at = np.flatnonzero(np.diff(pwm)) + 1
    assert ran.code == 0 and len(fit["steps"]) == len(at) == 5
    rows = sorted(fit["steps"], key=lambda step: (step["edge"] == "down", step["level"]))
    for k, (row, begin, end) in enumerate(zip(rows, at, [*at[1:], len(time)], strict=True)):
        before = float(volts[([0, *at][k] + begin) // 2 : begin].mean()) / 1e3
        t, y = (time[begin:end] - time[begin]) / 1e6, volts[begin:end] / 1e3 - before
        best, _ = curve_fit(two, t, y, (float(y[-50:].mean()), 0.02, 0.1), bounds=([-4, 1e-3, 1e-2], [4, 0.1, 2]))
        assert row["change"] == pytest.approx(best[0], rel=0.01)
        assert row["gain"] == pytest.approx(best[0] / (np.diff(pwm)[begin - 1] / 2.55), rel=0.01)
        if row["shape"] == "two":
            assert (row["tau1"], row["tau2"]) == pytest.approx(sorted(best[1:]), rel=0.05)
    assert [row["gain"] for row in rows[:4]] == pytest.approx([0.0941, 0.0334, 0.0188, 0.0125], rel=0.01)


@pytest.mark.parametrize("name", ["seal_raw_1bar.csv.gz", "seal_raw_3bar.csv.gz", "tsv_no_header_ms__oring_1bar.csv"])
def test_seals_to_and_fro(name: str, command: Command) -> None:
    """The force before and behind each turn, from the position alone."""
    ran, fit, path = command(name)
    assert ran.code == 0, ran.err
    table = np.loadtxt(path)
    time, position, force = table[:, 0] / 1e3, table[:, 4], table[:, 6]
    middle = (position.max() + position.min()) / 2
    away = np.flatnonzero(np.abs(position - middle) > 5)
    sides = away[np.flatnonzero(np.diff(np.sign(position[away] - middle)))]
    turns = [a + int(np.argmax(np.abs(position[a:b] - middle))) for a, b in pairwise(sides)]
    rows = {round(row["step_s"], 1): row for row in fit["data"]["sources"]}
    for turn in turns:
        row = rows[min(rows, key=lambda at: abs(at - time[turn]))]
        assert row["step_s"] == pytest.approx(time[turn], abs=0.06)
        assert row["baseline_nm"] == pytest.approx(force[turn], abs=2.5)
    strokes = [(force[a], force[a:b]) for a, b in pairwise(turns)]
    swing = np.median([abs(float(np.median(stroke[-150:-60])) - at_turn) for at_turn, stroke in strokes])
    assert np.average([row["Ts"] for row in fit["friction"]["levels"]]) == pytest.approx(swing, rel=0.15)


def test_closed_loops(command: Command) -> None:
    ran, _, _ = command("light_closed_loop.csv ")
    assert ran.code == 3 and "the output has 3 edges, the first at 0.4" in ran.err


def test_seals_one_step_a_file(command: Command) -> None:
    ran, fit, folder = command("friction-steps")
    assert ran.code == 0
    for row in fit["friction"]["levels"]:
        curves = []
        for path in sorted(folder.glob(f"*_p{row['level']:g}bar_*.csv")):
            time, bar, force = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
            first = int(np.argmax(bar > 0))
            start = next(one["baseline_nm"] for one in fit["data"]["sources"] if path.name in one["path"])
            curves.append(np.interp(np.arange(265) / 100, time[first:] - time[first], force[first:] - start))
        t, mean = np.arange(265) / 100, np.mean(curves, axis=0)
        best, _ = curve_fit(two, t, mean, (15.0, 0.1, 1.0), maxfev=10_000)
        assert np.abs(two(t, row["Ts"], row["tau1"], row["tau2"]) - two(t, *best)).max() < 0.025 * row["Ts"]


def test_every_recording_stands_on_the_page(realdata: Path) -> None:
    files = [path.name for folder in ("rigs", "formats") for path in (realdata / folder).iterdir()]
    assert not [name for name in (*files, "ea-clutch", "friction-steps") if name not in PAGE]
    assert not re.findall(r"^eaid (?!fit|ingest|report)", PAGE, re.MULTILINE)
