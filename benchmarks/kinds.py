"""Intervals of each kind of lag on simulated logs: how often they hold the truth, how often evidence finds the kind.

`python -m benchmarks.kinds 100 [KIND …]`: so many logs a kind, random steps of 60 s at 50 Hz, 5 % of noise, white and
of first order with a memory of 0.2 s in turn. What is done stands in kinds.jsonl, a line a log; what stands there is
not done again. Coverage of nominal 95 % intervals where the right kind was chosen, and of the gain whatever was
chosen; chance alone makes ± 4 % of a hundred.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks.table import asked
from eaid.arrays import Array
from eaid.estimate.recorded_log import RecordedLog
from eaid.options import FitOptions
from eaid.plant.dynamics import Plant
from eaid.plant.respond import respond
from eaid.recorded.fit import fit_recorded
from eaid.results.fit import Fit

RESULTS = Path("kinds.jsonl")
NOISE, IDLE = 0.05, 3.0
Row = dict[str, Any]


def plant(tau1: float, tau2: float = 1.0, **more: Any) -> Plant:
    """A plant of gain 1."""
    return Plant((tau1,), (tau2,), (0.0, 1.0), (0.0, 1.0), floor_s=0.0, **more)


@dataclass(frozen=True)
class Case:
    """One kind, and how its logs are made and fitted."""

    plant: Plant
    levels: tuple[float, ...] = (0.0, 0.3, 0.6, 1.0)
    share: float | Literal["free"] = 0.85
    idle_known: bool = False
    form: str = ""
    """The gain that has to win the trial, where the plant's kind does not say it."""


LAG, CLUTCH, ZERO = plant(0.8, C=1.0), plant(0.3, 2.0, C=0.85), plant(0.3, 2.0, C=0.6)
SIGNED, MANY = (-1.0, -0.5, 0.0, 0.5, 1.0), (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
WITHOUT = {
    "lag": Case(LAG),
    "lag, idle known": Case(LAG, idle_known=True),
    "lag, never at rest": Case(LAG, (0.3, 0.5, 0.7, 1.0)),
    "lag, signed odd": Case(replace(LAG, Ts_below=(0.0, -1.0)), SIGNED),
    "lag, a gain each side": Case(replace(LAG, Ts_below=(0.0, -0.7)), SIGNED, form="sides"),
    "series": Case(plant(0.6, zeta=1.4)),
    "ringing": Case(plant(0.3, zeta=0.2)),
    "ringing, signed": Case(plant(0.3, zeta=0.2, Ts_below=(0.0, -1.0)), SIGNED),
    "overshoot": Case(plant(0.4, 2.0, C=1.6)),
    "parallel, C 0.6": Case(ZERO, form="one"),
    "clutch": Case(CLUTCH, MANY),
    "clutch, C free": Case(ZERO, MANY, "free"),
    "clutch, falls": Case(replace(CLUTCH, falls=(0.5, 0.5), excess=0.05), MANY),
}
KINDS = {name + late: replace(case, plant=replace(case.plant, dead_time_s=0.253 if late else 0.0))
         for name, case in WITHOUT.items() for late in ("", " + dead time")}  # fmt: skip


def log_of(case: Case, seed: int) -> RecordedLog:
    """One log; it begins with a second at its first level."""
    random, t = np.random.default_rng(seed), np.arange(3000) * 0.02
    u = np.full(t.size, 0.0 if 0.0 in case.levels else case.levels[0])
    at = 50
    while at < t.size:
        held = int(np.exp(random.uniform(np.log(25), np.log(250))))
        u[at : at + held] = random.choice(case.levels)
        at += held
    noise: Array = random.normal(size=t.size)
    if seed % 2:
        keep = np.exp(-0.02 / 0.2)
        for k in range(1, t.size):
            noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    start = case.plant.C * float(case.plant.steady(u[0])), (1 - case.plant.C) * float(case.plant.steady(u[0]))
    y = IDLE + respond(case.plant, t, u, t, start) + NOISE * noise
    return RecordedLog("log", t, u, y, baseline=IDLE if case.idle_known else None)


def quoted(case: Case, fit: Fit) -> Iterator[tuple[str, float, Any]]:
    """Name, truth and interval of every number of a fit."""
    p, told = case.plant, fit.plant_
    assert told is not None
    tau1, tau2 = (float(one) for one in p.time_constants(1.0))
    true = {"gain": 1.0, "gain_below": -p.Ts_below[1] if p.Ts_below else 1.0, "tau1": tau1, "tau2": tau2, "C": p.C}
    true |= {"omega": 1 / p.tau1[0], "zeta": p.zeta or 0.0, "dead_time_s": p.dead_time_s}
    for name, value in true.items():
        if (ends := getattr(told.ci95, name, None)) is not None:
            yield name, value, ends
    if told.ci95 is None or told.ci95.gain is not None or fit.nonlinear is None:
        return
    for row in fit.nonlinear.curves:  # the clutch's form has its numbers level by level
        for name, key, value in (("gain", "Ts", row.level), ("tau1", "tau1", tau1), ("tau2", "tau2", tau2)):
            if (ends := getattr(row.ci95, key)) is not None:
                yield name, value, ends
    if fit.nonlinear.ci95 is not None and fit.nonlinear.ci95.C is not None:
        yield "C", p.C, fit.nonlinear.ci95.C
    of_falls = {"fall_tau1": p.falls[0], "fall_tau2": p.falls[1], "hysteresis_pct": 100 * p.excess}
    for row in fit.recorded.falls if fit.recorded is not None else ():
        if row.fitted and row.ci95 is not None and row.name in of_falls:
            yield row.name, of_falls[row.name], row.ci95


def tried(name: str, seed: int) -> Row:
    """One log fitted: what was chosen, and whether each interval holds its truth."""
    case, row = KINDS[name], {"kind": name, "seed": seed, "chosen": "refused", "held": []}
    try:
        fit = fit_recorded([log_of(case, seed)], FitOptions(model=("nonlinear",), share=case.share))
    except Exception as refusal:  # a refusal, or a fault: both are no fit
        return row | {"why": f"{type(refusal).__name__}: {refusal}"}
    told = fit.plant_
    assert told is not None
    gain = told.tried[0].gain if told.tried else "curve"
    late = " + dead time" if told.dead_time_s else ""
    right = told.kind == case.plant.kind and bool(told.dead_time_s) == bool(case.plant.dead_time_s)
    right = right and (gain == case.form or not case.form)
    p = told.plant  # what falls have of their own is part of the kind
    right = right and (p.falls != (1.0, 1.0), p.excess != 0) == (case.plant.falls != (1.0, 1.0), case.plant.excess != 0)
    held = [(key, bool(ends[0] <= value <= ends[1]), ends) for key, value, ends in quoted(case, fit)]
    return row | {"chosen": f"{told.kind}, {gain}{late}", "right": right, "held": held}


def table(rows: list[Row]) -> Iterator[str]:
    """The rows as Markdown: coverage by number, and over all of them."""
    yield "| kind | logs | right kind | gain | time constants | dead time | others | gain, whatever was chosen |"
    yield "|---|---|---|---|---|---|---|---|"
    groups = {"gain": "gain", "gain_below": "gain", "tau1": "tau", "tau2": "tau", "omega": "tau"}
    for name in KINDS:
        mine = [row for row in rows if row["kind"] == name]
        held: dict[str, list[bool]] = defaultdict(list)
        for row in mine:
            for key, inside, _ in row["held"]:
                if row.get("right"):
                    held[groups.get(key, key)].append(inside)
                held["all"] += [inside] if key == "gain" else []
        if not mine:
            continue
        others = [f"{key} {percent(held[key])}" for key in held if key not in ("gain", "tau", "dead_time_s", "all")]
        right = percent([bool(row.get("right")) for row in mine])
        cells = [percent(held[key]) for key in ("gain", "tau", "dead_time_s")]
        cells[2] = cells[2] if "dead" in name else ""
        yield f"| {name} | {len(mine)} | {right} | {' | '.join(cells)} | {', '.join(others)} | {percent(held['all'])} |"


def percent(held: list[bool]) -> str:
    """A share, in percent."""
    return f"{100 * np.mean(held):.0f}" if held else "–"


def main(words: list[str]) -> None:
    """Do what is not done, then print the table."""
    count, names = asked(words, 100, list(KINDS))
    rows = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []
    done = {(row["kind"], row["seed"]) for row in rows}
    with RESULTS.open("a") as file:
        for name, seed in ((name, seed) for name in names for seed in range(count)):
            if (name, seed) not in done:
                rows.append(tried(name, seed))
                print(json.dumps(rows[-1]), file=file, flush=True)
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main(sys.argv[1:])
