"""Whether sessions keep what a plan promises: `python -m benchmarks.plans [FITS] [--check]`.

Fits of `benchmarks.coverage`'s base sets, each planned for; the session is then recorded on the true plant, disturbed
as those sets are, and fitted. Half-width of the interval at the worst level over the promised one: its median and
spread (of the logarithm), and how many sessions keep it, where four of five are promised. With --check plans are
simulated, too, and what these recordings keep stands below.
"""

import sys
from dataclasses import replace

import numpy as np

import eaid
from benchmarks.coverage import VARIANTS, one_set, stepset
from eaid.planning.kinds import PARAMETERS
from eaid.results.fit import Fit
from eaid.results.plan import Plan

RATE_HZ = 100


def widths(fit: Fit) -> list[float]:
    """Half-width of T_s, τ1, τ2 at the worst level [%]."""
    ends = [[getattr(row.ci95, name) if row.ci95 else None for row in fit.level_values] for name in PARAMETERS]
    return [max(100 * ((e[1] / e[0]) ** 0.5 - 1) if e else np.inf for e in of) for of in ends]


def session(plan: Plan, seed: int) -> Fit:
    """A session recorded as planned, on the true plant."""
    variant, levels = replace(VARIANTS["base"], runs=plan.repeats), []
    for i, (level, hold_s) in enumerate(zip(plan.levels, plan.hold_s, strict=True)):
        made = one_set(1_000_000 + 100 * seed + i, variant, round(RATE_HZ * hold_s), np.array([level]), hold_s)
        levels.append(made.levels[0])
    return eaid.fit(stepset(tuple(levels)), model=("nonlinear",))


def main(fits: int, check: bool, first: int = 0) -> None:
    ratios: dict[str, list[list[float]]] = {"promised": [], "simulated": []}
    for seed in range(first, first + fits):
        plan = eaid.plan(eaid.fit(one_set(seed, VARIANTS["base"])), seed=seed, check=check)
        found = widths(session(plan, seed))
        for name, promise in (("promised", plan.half_width_pct), ("simulated", plan.measured_half_width_pct)):
            if promise:
                ratios[name].append([w / (promise[key] or np.inf) for w, key in zip(found, PARAMETERS, strict=True)])
    for name, rows in ratios.items():
        for key, of in zip(PARAMETERS, np.transpose(rows) if rows else (), strict=False):
            kept = 100 * np.mean(of <= 1)
            print(f"{name:9s} {key:5s} median {np.median(of):.2f}  spread {np.std(np.log(of)):.2f}  kept {kept:.0f} %")


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--check"]
    main(int(words[0]) if words else 40, "--check" in sys.argv, int(words[1]) if words[1:] else 0)
