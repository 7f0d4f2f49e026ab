"""How often the next session lies in its 95 % interval: `python -m benchmarks.sessions [SETS]`.

Sets of S sessions at five levels: ln T_s goes as ln level and its square, each session has a gain, a tilt and a part of
its own at each level, each level three runs. A further session is drawn alike, and shows nothing of itself, one run at
the level that the rig calls worth most, or two runs at the outermost levels; its T_s at the other levels is held
against `rig.next`. Printed as Markdown: coverage [%] (of the least covered level) and the median factor of the
interval; then the processor's time of a rig of 20 sessions at 10 levels, wanted below 50 ms.
"""

import sys
import time
from typing import Any

import numpy as np
import pandas as pd

import eaid

LEVELS = np.array([100.0, 150.0, 200.0, 250.0, 300.0])
SESSIONS = (3, 4, 6, 10)
GAIN, TILT, LEVEL, RUN, REPEATS = 0.35, 0.46, 0.076, 0.113, 3  # Standard deviations of ln T_s; runs of a level
TRUTH = (-1.26, 2.66, -0.4)  # ln T_s over ln(level/200)
KNOWN = ("nothing", "one step", "two steps")


def session(random: np.random.Generator, levels: Any = LEVELS) -> Any:
    """ln T_s of a session at the levels."""
    x, (gain, tilt) = np.log(levels / 200), random.normal(0, (GAIN, TILT))
    return np.polyval(TRUTH[::-1], x) + gain + tilt * x + LEVEL * random.standard_normal(len(x))


def table(count: int, random: np.random.Generator, levels: Any = LEVELS) -> pd.DataFrame:
    """What is recorded of so many sessions, each level with the standard error of its runs."""
    error = RUN / REPEATS**0.5
    rows = [
        (f"s{k}", u, np.exp(y + error * random.standard_normal()), error)
        for k in range(count)
        for u, y in zip(levels, session(random, levels), strict=True)
    ]
    return pd.DataFrame(rows, columns=["session", "level", "value", "sd_log"])


def covered(count: int, sets: int, terms: int | None = None) -> dict[str, tuple[float, float, float]]:
    """Of each thing known: coverage, that of the least covered level, and the median factor."""
    random = np.random.default_rng(count)
    held: dict[str, list[Any]] = {name: [] for name in KNOWN}
    for _ in range(sets):
        rig, truth = eaid.sessions(table(count, random), terms=terms), session(random)
        best = int(np.argmin(np.abs(LEVELS - rig.main.best_level)))
        for name, at in zip(KNOWN, ([], [best], [0, len(LEVELS) - 1]), strict=True):
            shown = np.exp(truth[at] + RUN * random.standard_normal(len(at)))
            steps = pd.DataFrame({"level": LEVELS[at], "value": shown, "sd_log": RUN}) if at else None
            found = rig.next(LEVELS, steps=steps)
            inside = ((found["low"] <= np.exp(truth)) & (np.exp(truth) <= found["high"])).to_numpy(dtype=float)
            inside[at] = np.nan  # where a step was seen is no prediction
            held[name].append((inside, np.delete((found["high"] / found["value"]).to_numpy(), at)))
    results = {}
    for name, rows in held.items():
        by_level = np.array([inside for inside, _ in rows])
        with np.errstate(all="ignore"):
            each = [
                float(np.mean(one[~np.isnan(one)])) if (~np.isnan(one)).sum() > sets / 2 else 1.0 for one in by_level.T
            ]
        factor = float(np.median(np.concatenate([one for _, one in rows])))
        results[name] = (100 * float(np.nanmean(by_level)), 100 * min(each), factor)
    return results


def taken_s(count: int = 20, levels: int = 10, runs: int = 20) -> float:
    """Processor's time of a rig of so many sessions and levels [s], the least of some runs."""
    frame, least = table(count, np.random.default_rng(0), np.linspace(100.0, 300.0, levels)), np.inf
    for _ in range(runs):
        began = time.process_time()
        eaid.sessions(frame)
        least = min(least, time.process_time() - began)
    return float(least)


def main(sets: int = 500) -> None:
    print("| line | sessions | " + " | ".join(f"{name}: holds (least level); ×/÷" for name in KNOWN) + " |")
    print("|---|---|" + "---|" * len(KNOWN))
    for said, terms in (("a term a level", None), ("quadratic", 3)):
        for count in SESSIONS:
            rows = covered(count, sets, terms)
            cells = [f"{mean:.1f} ({least:.1f}); {factor:.2f}" for mean, least, factor in rows.values()]
            print(f"| {said} | {count} | " + " | ".join(cells) + " |", flush=True)
    print(f"\n20 sessions at 10 levels: {1e3 * taken_s():.0f} ms")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
