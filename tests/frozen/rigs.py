"""Logs as other rigs record them, made here: a clutch that overshoots, a heater, a lamp on a staircase, seals."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd


def step(t: Any, *parts: tuple[float, float], dead: float = 0.0) -> Any:
    """Sum of a (1 − exp(−t/τ)) over parts (a, τ), behind a dead time."""
    return sum(-a * np.expm1(-np.maximum(t - dead, 0.0) / tau) for a, tau in parts)


def noise(random: np.random.Generator, n: int, sd: float, keep: float = 0.9) -> Any:
    """Noise of first order."""
    white = sd * np.sqrt(1 - keep**2) * random.normal(size=n)
    for k in range(1, n):
        white[k] += keep * white[k - 1]
    return white


def clutch(folder: Path, random: np.random.Generator) -> None:
    """Five voltages, two runs each, levels off by a twentieth; from 200 V up the force overshoots; release at 5 s."""
    folder.mkdir()
    t = np.arange(3500) / 500
    for volts in (100, 150, 200, 250, 300):
        level = random.normal(1.0, 0.05)
        for run in (1, 2):
            held = 3e-5 * volts**2 * level * random.normal(1.0, 0.02)
            decay = -0.4 * held * (volts >= 200)
            force = step(t - 2, (0.85 * held - decay, 0.05), (0.15 * held + decay, 1.5)) * (t >= 2)
            force *= np.where(t >= 5, np.exp(-np.maximum(t - 5, 0) / 0.1), 1.0)
            table = {
                "Time": np.round(t * 1e6),
                "Load Cell": force + noise(random, t.size, 0.01),
                "Moving": 1 * (t >= 2),
            }
            if (volts, run) == (150, 1):
                table["Time"][1000:1003] = table["Time"][1000]
            pd.DataFrame(table).to_csv(folder / f"rig_V={volts}_run{run}.csv", index=False, float_format="%.6g")


def heater(folder: Path, random: np.random.Generator) -> None:
    """50 % from the first row on; after one row of rest, still for 15 s, the instant of the step written twice."""
    t = np.arange(0, 700.0, 1.0)
    warm = 20.6 + step(t, (28.0, 170.0), (3.0, 20.0), dead=14.0)
    table = {"Time": t, "T1": np.round(warm + noise(random, t.size, 0.15, 0.6), 2), "Q1": 50.0 + 0 * t}
    pd.DataFrame(table).to_csv(folder / "heater_on.csv", index=False)
    warm = 21.2 + step(t, (35.4, 150.0), dead=15.0) + noise(random, t.size, 0.15, 0.6)
    twice = pd.DataFrame({"Time": t, "T1": np.round(warm, 2), "Q1": 50.0 + 0 * t})
    first = twice.iloc[:1].assign(Q1=0.0)
    pd.concat([first, twice]).to_csv(folder / "heater_dead.csv", index=False)


def lamp(folder: Path, random: np.random.Generator) -> None:
    """PWM up in four stairs and off; mV, µs, PWM without a header; a gain that falls."""
    t = np.arange(6000) / 1000
    pwm = np.select([t < 0.5, t < 1.5, t < 2.5, t < 3.5, t < 4.5], [0, 50, 100, 150, 200], 0)
    volts, before = np.zeros(t.size), 0.0
    for at, level in ((0.5, 1.84), (1.5, 2.5), (2.5, 2.87), (3.5, 3.11), (4.5, 0.0)):
        held = t >= at
        volts += held * step(t - at, (0.85 * (level - before), 0.0185), (0.15 * (level - before), 0.2))
        before = level
    table = np.column_stack([1000 * volts + noise(random, t.size, 3.0, 0.5), t * 1e6, pwm])
    np.savetxt(folder / "lamp.csv", table, fmt=["%.1f", "%.0f", "%d"], delimiter=",")


def seals(folder: Path, random: np.random.Generator) -> None:
    """One step a file, four pressures and three repeats, C = 0.6; and eight strokes to and fro in one log."""
    (folder / "seals").mkdir()
    for bar in (1, 2, 3, 5):
        for run in (1, 2, 3):
            t = np.cumsum(random.uniform(0.008, 0.012, 330))
            force = (12 + 2.5 * bar) * random.normal(1, 0.03)
            y = step(t - 0.5, (0.6 * force, 0.05), (0.4 * force, 0.4)) * (t >= 0.5) + noise(random, t.size, 0.1)
            table = pd.DataFrame({"time_s": t, "pressure_bar": np.where(t >= 0.5, bar, 0.0), "force_n": y})
            table.to_csv(folder / "seals" / f"run{run}_p{bar}bar.csv", index=False, float_format="%.6g")
    t = np.arange(0, 24, 0.01)
    position = 40 * np.abs((t / 3 + 0.5) % 2 - 1)
    turn = np.floor(t / 3 + 0.5)
    since = t - np.maximum(3 * (turn - 0.5), 0)
    force = (-1) ** turn * (16 * (1 - 2 * np.exp(-since / 0.12)) + 2 * (1 - np.exp(-since / 0.8)))
    rows = np.column_stack([t * 1e3, position, 1.0 + 0 * t, force + noise(random, t.size, 0.2, 0.5)])
    np.savetxt(folder / "to_and_fro.tsv", rows, fmt="%.5g", delimiter="\t")


def write(folder: Path) -> Path:
    """All of them, the same at every call."""
    clutch(folder / "clutch", np.random.default_rng(1))
    for k, make in enumerate((heater, lamp, seals)):
        make(folder, np.random.default_rng(2 + k))
    return folder
