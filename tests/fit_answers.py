"""Made sets of steps, and what the fits and their intervals answer to them, kept in two files beside their tests.

A number that moves, a finding that comes or goes, shows here whatever it was that a change was meant to do. After a
change that is meant: `python tests/fit_answers.py` writes both files anew; the commit says why.
"""

import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.fitting.between import between_rows, single_steps
from eaid.fitting.fit import fit
from eaid.models import friction
from eaid.models.nonlinear import at_duty
from eaid.models.parameters import REFERENCE_PLANT, Friction
from eaid.results.codec import to_plain
from eaid.options import FitOptions
from eaid.steps.stepset import Level, LevelStep, StepSet
from eaid.uncertainty.workflow import fit_steps

HERE = Path(__file__).parent
FITTING, UNCERTAINTY = HERE / "fitting" / "answers.json", HERE / "uncertainty" / "answers.json"
LEFT_OUT = {
    *("data", "options", "seed", "text", "severity", "message", "means", "parametrisation", "order", "method"),
    *("predicted_decrease", "evaluations"),
}
"""Keys whose values are no answer, or rounding."""
OF_THE_FIT = {"rmse", "sse", "fit_pct", "R2", "abs_error", "samples", "solver", "starts", "robust", "C"}
"""Keys that intervals do not change."""
USUAL = FitOptions()


def clock(until_s: float = 20.0, count: int = 400) -> Array:
    """Even instants from 0 [s]."""
    return np.arange(count) * (until_s / count)


def made(
    curves: Sequence[tuple[float, Friction]],
    time_s: Array | None = None,
    repeats: int = 3,
    noise: float = 0.01,
    scatter: float = 0.03,
    seed: int = 0,
    kind: str = "clutch",
    unit: str = "%",
    shared: float = 0.0,
) -> StepSet:
    """Steps from rest with white noise, a gain of its own for each run, and one for each sweep."""
    random, levels = np.random.default_rng(seed), []
    time_s = clock() if time_s is None else time_s
    sweeps = 1 + shared * random.standard_normal(repeats)
    for u, curve in curves:
        gains = sweeps * (1 + scatter * random.standard_normal(repeats))
        size = noise * max(abs(curve.Ts), 0.1) ** 0.5
        runs = gains[:, None] * friction.step_response(curve, time_s)
        runs = runs + size * random.standard_normal((repeats, len(time_s)))
        levels.append(Level(u, time_s, runs, tuple(f"{u:g}-{k}" for k in range(repeats))))
    rig = Apparatus(surfaces=2 if kind == "clutch" else 1)
    return StepSet(kind, unit, "N·m", rig, tuple(levels))


def plant(levels: Iterable[float] = (20.0, 40.0, 60.0, 80.0, 100.0)) -> list[tuple[float, Friction]]:
    """Curves of the reference plant."""
    return [(u, at_duty(REFERENCE_PLANT, u)) for u in levels]


def spiked() -> StepSet:
    """Three stretches of spikes, of one run, of two, and of all."""
    whole = made(plant(), seed=2)
    for level, runs, part in ((1, [0], slice(50, 60)), (2, [0, 2], slice(200, 230)), (3, [0, 1, 2], slice(300, 305))):
        whole.levels[level].runs[runs, part] += 2.0
    return whole


def with_releases() -> StepSet:
    """Falls with constants of their own, one fast level, one that leaves something behind."""
    whole, random, falls = made(plant(), seed=4), np.random.default_rng(4), []
    time_s = clock(10.0, 300)
    for level, tau1, tau2, rest in ((20.0, 0.3, 4.0, 0.0), (60.0, 0.2, 6.0, 0.5), (100.0, 0.25, 5.0, 0.0)):
        size = at_duty(REFERENCE_PLANT, level).Ts
        y = rest + size * (0.8 * np.exp(-time_s / tau1) + 0.2 * np.exp(-time_s / tau2))
        y = y + 0.01 * random.standard_normal((2, len(time_s)))
        falls.append(Level(level, time_s, y, (f"{level:g}-0", f"{level:g}-1")))
    return replace(whole, releases=tuple(falls))


def staircase() -> StepSet:
    """Single steps of every shape, up and down, with and without a dead time, one of them nothing but noise."""
    random, time_s, steps = np.random.default_rng(5), clock(8.0, 300), []
    shapes: dict[str, Callable[[Array], Array]] = {
        "one": lambda t: 1 - np.exp(-t / 0.5),
        "two": lambda t: 1 - 0.85 * np.exp(-t / 0.3) - 0.15 * np.exp(-t / 4.0),
        "free": lambda t: 1 - 0.4 * np.exp(-t / 0.2) - 0.6 * np.exp(-t / 3.0),
        "over": lambda t: 1 - 1.4 * np.exp(-t / 0.4) + 0.4 * np.exp(-t / 2.0),
        "late": lambda t: 1 - np.exp(-np.maximum(t - 0.4, 0.0) / 0.5),
        "wave": lambda t: 0.5 * np.sin(t),
        "none": lambda t: 0.0 * t,
    }
    for k, (name, shape) in enumerate(shapes.items()):
        low, high = ((0.0, 40.0), (50.0, 0.0), (30.0, 60.0), (80.0, 50.0))[k % 4]
        y = 1.5 + 0.1 * (high - low) * shape(time_s) + 0.02 * random.standard_normal(len(time_s))
        edge = "up" if high > low else "down"
        steps.append(LevelStep(name, edge, low, high, 1.5, time_s, y, np.full(len(time_s), high), 2.0, 0.01))
    return StepSet("clutch", "%", "N·m", Apparatus(), (), level_steps=tuple(steps))


def ragged() -> StepSet:
    """Levels of different lengths and clocks, one of them uneven, single runs and repeats."""
    parts = [
        made(plant([30.0]), clock(12.0, 300), repeats=1, seed=6),
        made(plant([60.0]), np.sort(np.random.default_rng(6).uniform(0, 20, 500)), repeats=2, seed=7),
        made(plant([90.0]), clock(30.0, 3000), repeats=3, seed=8),
        made(plant([100.0]), clock(20.0, 400), repeats=2, seed=9),
    ]
    return replace(parts[0], levels=tuple(part.levels[0] for part in parts))


def over(kind: str) -> StepSet:
    """Levels of stress or speed with trends of two exponentials, or of one."""
    x = np.linspace(5.0, 60.0, 8) if kind == "friction-force" else np.linspace(1.0, 15.0, 8)
    s = x / x.max()
    rows = zip(x, 0.1 + 0.2 * s, 0.2 + 0.4 * np.exp(-4 * s), 3 + 4 * np.exp(-5 * s) - np.exp(-0.5 * s), strict=True)
    curves = [(float(u), Friction(float(a), float(b), float(c))) for u, a, b, c in rows]
    return made(curves, repeats=2, noise=0.003, scatter=0.01, kind=kind, unit="N" if kind[9] == "f" else "RPM")


def odd() -> StepSet:
    """What a fit can hardly be made of: noise alone, a rise too fast, one exponential, a fall, a drift without end."""
    time_s, random = clock(), np.random.default_rng(10)
    shapes = (
        0.0 * time_s,
        1 - np.exp(-time_s / 3e-4),
        1 - np.exp(-time_s / 2.0),
        -1 + np.exp(-time_s / 2.0),
        0.6 * (1 - np.exp(-time_s / 0.3)) + 0.05 * time_s,
    )
    rows = [
        Level(20.0 * (k + 1), time_s, shape + 0.01 * random.standard_normal((2, len(time_s))), ("a", "b"))
        for k, shape in enumerate(shapes)
    ]
    return StepSet("clutch", "%", "N·m", Apparatus(), tuple(rows))


FITS: dict[str, tuple[Callable[[], StepSet], FitOptions]] = {
    "plant": (lambda: made(plant()), USUAL),
    "levels held out": (
        lambda: made(plant(range(10, 101, 10)), seed=1),
        FitOptions(hold_out=(50.0, 100.0), bounds_levels=(30.0, 60.0, 90.0)),
    ),
    "spikes": (spiked, FitOptions(loss="huber")),
    "free C": (lambda: made(plant(), seed=3), FitOptions(share="free")),
    "another C": (lambda: made(plant(), seed=3), FitOptions(share=0.7)),
    "one level": (lambda: made(plant([50.0])), USUAL),
    "two levels": (lambda: made(plant([30.0, 70.0])), USUAL),
    "short": (lambda: made(plant(), clock(4.0, 300)), USUAL),
    "long": (lambda: made(plant(), clock(20.0, 6000), repeats=1, noise=0.05), USUAL),
    "scattered": (lambda: made(plant(), noise=0.3, scatter=0.3, seed=11), USUAL),
    "releases": (with_releases, USUAL),
    "ragged": (ragged, USUAL),
    "force": (lambda: over("friction-force"), FitOptions(hold_out=(60.0,))),
    "speed": (lambda: over("friction-speed"), FitOptions(loss="huber")),
    "few forces": (lambda: made(plant([20.0, 50.0, 80.0]), kind="friction-force", unit="V"), USUAL),
    "odd": (odd, FitOptions(model=("friction", "linear"))),
    "odd, C free": (odd, FitOptions(share="free", model=("friction",))),
    "staircase": (staircase, USUAL),
}
"""Name → the set and the choices of its fit."""

INTERVALS: dict[str, tuple[Callable[[], StepSet], FitOptions]] = {
    "plant": (lambda: made(plant()), USUAL),
    "many levels": (lambda: made(plant(range(25, 101, 15)), clock(30.0, 300), seed=1), USUAL),
    "joint": (
        lambda: made(plant(range(25, 101, 15)), clock(30.0, 300), scatter=0.1, seed=1),
        FitOptions(estimator="joint"),
    ),
    "two-stage": (
        lambda: made(plant(), repeats=4, scatter=0.06, seed=12),
        FitOptions(hold_out=(60.0,)),
    ),
    "sweeps": (lambda: made(plant(), clock(30.0, 300), scatter=0.003, shared=0.05, seed=13), USUAL),
    "single runs": (lambda: made(plant(range(20, 101, 10)), clock(30.0, 300), repeats=1), USUAL),
    "few single runs": (lambda: made(plant(), repeats=1, seed=14), USUAL),
    "short": (lambda: made(plant(), clock(4.0, 300)), USUAL),
    "C of its own": (lambda: made([(u, replace(c, C=0.92)) for u, c in plant()[1:]], scatter=0.01), USUAL),
    "free C": (lambda: made(plant(), clock(40.0, 400), seed=3), FitOptions(share="free")),
    "bootstrap": (lambda: made(plant()[::2]), FitOptions(ci="bootstrap", draws=8, seed=5)),
    "bootstrap of single runs, C free": (
        lambda: made(plant([20.0, 60.0, 100.0]), repeats=1),
        FitOptions(ci="bootstrap", draws=6, share="free"),
    ),
    "white": (lambda: made(plant()[::2]), FitOptions(ci="white")),
    "none": (lambda: made(plant()[::2]), FitOptions(ci="none")),
    "one level": (lambda: made(plant([50.0])), USUAL),
    "ragged": (ragged, USUAL),
    "force": (lambda: over("friction-force"), USUAL),
    "speed": (lambda: over("friction-speed"), USUAL),
    "odd": (odd, FitOptions(model=("friction", "linear"))),
    "releases": (with_releases, FitOptions(model=("linear",))),
    "staircase": (staircase, USUAL),
    "staircase, white": (staircase, FitOptions(ci="white", shape="two", dead_time_s=0.1)),
}


def rounded(value: Any, without: set[str]) -> Any:
    """A plain result without some keys, numbers to five digits; of a covariance its diagonal, of starts the best."""
    if isinstance(value, dict):
        if "matrix" in value:
            value = {**value, "matrix": [row[k] for k, row in enumerate(value["matrix"])]}
        if isinstance(value.get("starts"), list | tuple):
            value = {**value, "starts": [len(value["starts"]), min(one["cost"] for one in value["starts"])]}
        return {k: rounded(one, without) for k, one in value.items() if k not in without and one not in (None, [], {})}
    if isinstance(value, list | tuple):
        return [rounded(one, without) for one in value]
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else None
    return value


def of_fitting(name: str) -> Any:
    """What the fit of one set answers, before intervals, and that of its single steps."""
    make, options = FITS[name]
    steps = make()
    shapes = single_steps(steps, options)
    found = {"shapes": to_plain(shapes), "between": to_plain(between_rows(shapes))}
    return rounded({**(to_plain(fit(steps, options)) if steps.levels else {}), **found}, LEFT_OUT)


def of_intervals(name: str) -> Any:
    """What the whole fit of one set answers, less what the fit itself had."""
    steps, options = INTERVALS[name]
    return rounded(to_plain(fit_steps(steps(), options)), LEFT_OUT | OF_THE_FIT)


def differences(now: Any, kept: Any, where: str = "") -> list[str]:
    """Where two answers part, by key; numbers by more than one in five thousand."""
    if isinstance(now, dict) and isinstance(kept, dict):
        pairs = [(f"{where}/{key}", now.get(key), kept.get(key)) for key in sorted(now.keys() | kept.keys())]
        return [said for inside, *pair in pairs for said in differences(*pair, inside)]
    if isinstance(now, list) and isinstance(kept, list) and len(now) == len(kept):
        rows = enumerate(zip(now, kept, strict=True))
        return [said for i, pair in rows for said in differences(*pair, f"{where}[{i}]")]
    if isinstance(now, float | int) and isinstance(kept, float | int):
        alike = abs(now - kept) <= 2e-4 * max(abs(now), abs(kept)) + 1e-7
    else:
        alike = now == kept
    return [] if alike else [f"{where}: {now} for {kept}"]


def main() -> None:
    """Write both files anew."""
    for file, names, answer in ((FITTING, FITS, of_fitting), (UNCERTAINTY, INTERVALS, of_intervals)):
        rows = []
        for name in names:
            parts = [
                f"  {json.dumps(key)}: {json.dumps(part, ensure_ascii=False, separators=(',', ':'))}"
                for key, part in answer(name).items()
            ]
            rows.append(f"{json.dumps(name)}: {{\n" + ",\n".join(parts) + "\n}")
        file.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
