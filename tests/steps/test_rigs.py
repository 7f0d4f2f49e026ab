"""Every command of docs/how-to/rigs.md on the recordings that it names, beside fits of this file's own.

The recordings are not in the repository: without them these tests are skipped.
"""

import json
import re
import shlex
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import curve_fit

from eaid.cli import main

PAGE = Path(__file__).parents[2] / "docs/how-to/rigs.md"
REALDATA = Path(__file__).parents[2] / "../shared/realdata"
pytestmark = pytest.mark.skipif(not REALDATA.is_dir(), reason="the recorded logs are not beside the project")
COMMANDS = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("eaid ")]


def command_for(name: str) -> str:
    (found,) = (line for line in COMMANDS if name in line)
    return found


@cache
def recorded(name: str) -> Path:
    return next(path for path in REALDATA.rglob("*") if path.name == name)


def run(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any], str]:
    """Exit code, fit.json and messages of the command that names a recording."""
    words = shlex.split(command_for(name))[1:]
    words[1] = str(recorded(words[1]))
    out = folder / "fit.json"
    words = [str(out) if word == "fit.json" else word for word in words]
    code = main.run(words)
    told = capsys.readouterr()
    return code, json.loads(out.read_text()) if out.exists() else {}, told.out + told.err


def one(t: np.ndarray, start: float, change: float, tau: float, dead: float) -> np.ndarray:
    return start - change * np.expm1(-np.maximum(t - dead, 0.0) / tau)


def two(t: np.ndarray, change: float, tau1: float, tau2: float) -> np.ndarray:
    return change * (1 - 0.85 * np.exp(-t / tau1) - 0.15 * np.exp(-t / tau2))


@pytest.mark.parametrize("name", ["heater_dead_time.csv", "heater_on_from_first_row.csv"])
def test_heaters(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heads = recorded(name).read_text().splitlines()[0].split(",")
    table = np.genfromtxt(recorded(name), delimiter=",", skip_header=1)[
        :, [heads.index(c) for c in ("Time", "T1", "Q1")]
    ]
    table = table[np.r_[np.diff(table[:, 0]) > 0, True]]  # the step instant is written twice, off and on
    first = int(np.argmax(table[:, 2] > 0))
    held = first + int(np.argmin(np.r_[table[first:, 2] > 0, False]))
    time, heat = table[:held, 0], table[:held, 1]
    start = float(heat[: max(first, 1)].mean())
    since, limits = time[first:] - time[first], ([0, 10, 0], [100, 1000, 60])
    best, _ = curve_fit(lambda t, *p: one(t, start, *p), since, heat[first:], (30.0, 150.0, 10.0), bounds=limits)
    code, fit, _ = run(name, tmp_path, capsys)
    (step,) = fit["steps"]
    assert code == 0
    assert (step["shape"], step["start"]) == ("one", pytest.approx(start, abs=0.01))
    assert [step["change"], step["tau1"]] == pytest.approx(best[:2].tolist(), rel=0.01)
    assert step["dead_time_s"] == pytest.approx(best[2], rel=0.03)
    for key in ("change", "tau1"):
        low, high = step["ci95"][key]
        assert low < step[key] < high < 1.5 * low


def test_a_lamp_on_a_staircase(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    volts, time, pwm = np.genfromtxt(recorded("light_staircase.csv"), delimiter=",", comments="/").T
    at = np.flatnonzero(np.diff(pwm)) + 1
    code, fit, _ = run("light_staircase.csv", tmp_path, capsys)
    assert code == 0 and len(fit["steps"]) == len(at) == 5
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
def test_seals_to_and_fro(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The force before and behind each turn, from the position alone."""
    table = np.loadtxt(recorded(name))
    time, position, force = table[:, 0] / 1e3, table[:, 4], table[:, 6]
    middle = (position.max() + position.min()) / 2
    away = np.flatnonzero(np.abs(position - middle) > 5)
    sides = away[np.flatnonzero(np.diff(np.sign(position[away] - middle)))]
    turns = [a + int(np.argmax(np.abs(position[a:b] - middle))) for a, b in pairwise(sides)]
    code, fit, told = run(name, tmp_path, capsys)
    assert code == 0, told
    rows = {round(row["step_s"], 1): row for row in fit["data"]["sources"]}
    for turn in turns:
        row = rows[min(rows, key=lambda at: abs(at - time[turn]))]
        assert row["step_s"] == pytest.approx(time[turn], abs=0.06)
        assert row["baseline_nm"] == pytest.approx(force[turn], abs=2.5)
    strokes = [(force[a], force[a:b]) for a, b in pairwise(turns)]
    swing = np.median([abs(float(np.median(stroke[-150:-60])) - at_turn) for at_turn, stroke in strokes])
    means = np.average([row["Ts"] for row in fit["friction"]["levels"]])
    assert means == pytest.approx(swing, rel=0.15)


def test_closed_loops(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = {}
    for name in ("light_closed_loop.csv", "light_closed_loop_antiwindup.csv"):
        words = shlex.split(command_for(f"{name} "))[1:]
        assert main.run(["ingest", str(recorded(name)), *words[2:-1], str(tmp_path / words[-1]), "--json"]) == 0
        found[name] = json.loads(capsys.readouterr().out)["logs"][0]["edges"]
    down, up, last = found["light_closed_loop.csv"]
    time, lux = np.loadtxt(recorded("light_closed_loop.csv"), delimiter=",", unpack=True)
    low, high = float(np.median(lux[(time > 0.8) & (time < 1.3)])), float(np.median(lux[time < 0.3]))
    part = (time > 1.35) & (time < 2.0)
    share = (lux[part] - low) / (high - low)
    rise = time[part][np.argmax(share > 0.9)] - time[part][np.argmax(share > 0.1)]
    assert (up["before"], up["after"]) == (pytest.approx(low, abs=0.5), pytest.approx(high, abs=0.5))
    assert up["rise_s"] == pytest.approx(rise, abs=0.02)
    assert [down["at_s"], up["at_s"], last["at_s"]] == pytest.approx([0.41, 1.42, 2.91], abs=0.02)
    (swing,) = found["light_closed_loop_antiwindup.csv"]
    time, lux = np.loadtxt(recorded("light_closed_loop_antiwindup.csv"), delimiter=",", unpack=True)
    before, after = float(np.median(lux[(time > 1.0) & (time < 1.35)])), float(np.median(lux[time > 2.5]))
    beyond = 100 * (after - float(lux.min())) / (before - after)
    assert swing["overshoot_pct"] == pytest.approx(beyond, abs=3)
    assert (swing["before"], swing["after"]) == (pytest.approx(before, abs=1), pytest.approx(after, abs=1))


def test_seals_one_step_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, fit, _ = run("friction-steps", tmp_path, capsys)
    assert code == 0
    for row in fit["friction"]["levels"]:
        curves = []
        for path in sorted((REALDATA / "friction-steps").glob(f"*_p{row['level']:g}bar_*.csv")):
            time, bar, force = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
            first = int(np.argmax(bar > 0))
            since = time[first:] - time[first]
            start = next(one["baseline_nm"] for one in fit["data"]["sources"] if path.name in one["path"])
            curves.append(np.interp(np.arange(265) / 100, since, force[first:] - start))
        t, mean = np.arange(265) / 100, np.mean(curves, axis=0)
        best, _ = curve_fit(two, t, mean, (15.0, 0.1, 1.0), maxfev=10_000)
        ours = two(t, row["Ts"], row["tau1"], row["tau2"])
        assert np.abs(ours - two(t, *best)).max() < 0.025 * row["Ts"]


def test_a_clutch_of_another_lab(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, fit, told = run("ea-clutch", tmp_path, capsys)
    assert code == 0, told
    rows = {row["level"]: row for row in fit["friction"]["levels"]}
    assert sorted(rows) == [100 + 25 * k for k in range(9)]
    for level in (250.0, 300.0):
        outputs = []
        for path in sorted((REALDATA / "ea-clutch").glob(f"*_V={level:g}_*")):
            table = np.genfromtxt(path, delimiter=",", names=True, usecols=("Time", "Load_Cell"))
            time, force = table["Time"] / 1e6, table["Load_Cell"]
            # some logs end in a sample or two of the time before
            force = force[np.isfinite(time)] - force[(time > 0.0) & (time < 2.0)].mean()
            outputs.append(np.interp(np.arange(0, 2.99, 0.002), time - 2.0, force))
        t = np.arange(0, 2.99, 0.002)
        mean = np.mean(outputs, axis=0)
        best, _ = curve_fit(lambda x, c, a, s: two(x, c, a, a * np.exp(abs(s))), t, mean, (0.3, 0.1, 1))
        ours = two(t, rows[level]["Ts"], rows[level]["tau1"], rows[level]["tau2"])
        theirs = two(t, best[0], best[1], best[1] * np.exp(abs(best[2])))
        assert np.abs(ours - theirs).max() < 0.05 * rows[level]["Ts"]


def test_a_position_loop_that_no_exponential_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, fit, _ = run("quarc_matrix", tmp_path, capsys)
    assert code == 0
    up, down = fit["steps"]
    assert (up["gain"], down["gain"]) == pytest.approx((1.09, 1.10), abs=0.03)
    assert [one["code"] for one in up["findings"]] == ["shape-misses"]
    assert up["findings"][0]["values"]["share_pct"] == pytest.approx(26, abs=3)


REFUSED = {
    "simulink_dataset": "holds MATLAB objects",
    "simulink_structure": "no column is called torque",
    "csv_semicolon": "nothing tells its level",
    "lvm_decimal": "nothing tells its level",
    "lvm_x_column": "9 samples",
    "tdms_daqmx": "nothing tells its level",
}


@pytest.mark.parametrize("name", REFUSED)
def test_logs_that_are_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, fit, told = run(name, tmp_path, capsys)
    assert (code, fit) == (3, {})
    assert REFUSED[name] in told


def test_every_recording_stands_on_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    files = [path.name for folder in ("rigs", "formats") for path in (REALDATA / folder).iterdir()]
    assert not [name for name in (*files, "ea-clutch", "friction-steps") if name not in page]
    assert not re.findall(r"^eaid (?!fit|ingest|report)", page, re.MULTILINE)
