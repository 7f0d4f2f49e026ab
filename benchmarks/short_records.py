"""Records shorter than τ2: are quoted intervals right, and alarms true? `python -m benchmarks.short_records [SETS]`.

The sets of benchmarks/coverage.py (τ2 is 4.8 to 16.8 s) with records of 3 to 30 s at 100 Hz. Counted is over all levels
of all sets: how often an interval is quoted and how often it then holds the truth; how often "τ2 is anywhere between"
holds it; and of "τ2 is longer than the record" how often it is said where it is not so, and how often neither it nor an
open τ2 is said where it is so (levels within a tenth of the record are no misses).
"""

import sys
from typing import Any

import numpy as np

from benchmarks import coverage
from eaid.fitting.fit import fit
from eaid.results.fit import Fit, FitOptions
from eaid.uncertainty.intervals import with_intervals

RECORDS_S = (3.0, 5.0, 8.0, 12.0, 20.0, 30.0)
NAMES = ("Ts", "tau1", "tau2")


def one(seed: int, record_s: float) -> Fit:
    made = coverage.one_set(seed, coverage.VARIANTS["base"], samples=round(100 * record_s), record_s=record_s)
    return with_intervals(made, fit(made), FitOptions(estimator="two-stage"))


def counted(found: Fit, true: dict[str, np.ndarray], record_s: float) -> dict[str, list[float]]:
    """1 and 0 for what holds and what does not, NaN where nothing is said."""
    result: dict[str, list[float]] = {}
    assert found.friction is not None and found.nonlinear is not None
    model = found.nonlinear
    for name in NAMES:
        own = [getattr(row.ci95, name) for row in found.friction.levels]
        result[f"level {name}"] = [coverage.inside(ends, v) for ends, v in zip(own, true[name], strict=True)]
        curves = [getattr(row.ci95, name) for row in model.curves] if model.estimator == "two-stage" else [None] * 10
        result[f"curve {name}"] = [coverage.inside(ends, v) for ends, v in zip(curves, true[name], strict=True)]
    ranges: dict[float, Any] = {f.levels[0]: f.values for f in found.findings if f.code == "tau2-open"}
    long = {u for f in found.findings if f.code == "tau2-outlasts-record" for u in f.levels}
    result["range"], result["false alarm"], result["miss"] = [], [], []
    for u, tau2 in zip(coverage.LEVELS.tolist(), true["tau2"], strict=True):
        ends = ranges.get(u)
        bounds = None if ends is None else (ends["low_s"] or 0.0, ends["high_s"] or np.inf)
        result["range"].append(coverage.inside(bounds, tau2))
        result["false alarm"].append(float(u in long) if tau2 <= record_s else np.nan)
        result["miss"].append(float(u not in long and u not in ranges) if tau2 > 1.1 * record_s else np.nan)
    return result


def truth() -> dict[str, np.ndarray]:
    """T_s, τ1, τ2 of the plant at the levels."""
    curves = [coverage.plant(float(u), coverage.VARIANTS["base"]) for u in coverage.LEVELS]
    return {name: np.array([getattr(curve, name) for curve in curves]) for name in NAMES}


def row(record_s: float, sets: int) -> dict[str, str]:
    """Coverage [%] and, in brackets, how often something is quoted [%]."""
    rows = [counted(one(seed, record_s), truth(), record_s) for seed in range(sets)]
    cells = {}
    for key in rows[0]:
        values = np.array([r[key] for r in rows])
        known = np.isfinite(values)
        share = f"{100 * values[known].mean():.0f}" if known.any() else "–"
        cells[key] = share if key in ("false alarm", "miss") else f"{share} ({100 * known.mean():.0f})"
    return cells


def main(sets: int) -> None:
    table = {record_s: row(record_s, sets) for record_s in RECORDS_S}
    keys = list(next(iter(table.values())))
    print(f"{sets} sets a row: coverage [%] (quoted [%])\n")
    print("| record | " + " | ".join(keys) + " |\n" + "|---" * (len(keys) + 1) + "|")
    for record_s, cells in table.items():
        print(f"| {record_s:g} s | " + " | ".join(cells[key] for key in keys) + " |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
