"""How far equal weights, sd weights and the two-stage estimate are off: `python -m benchmarks.weightings [SETS]`.

The sets are those of `benchmarks.coverage` (gain scatter 3 %, τ1 scatter 5 %), for several numbers of runs a level, and
one with white noise alone. Printed is the rms error of log T_s, log τ1, log τ2 over all levels and sets.
"""

import sys
from dataclasses import replace

import numpy as np

from benchmarks.coverage import VARIANTS, Variant, one_set, plant
from eaid.arrays import Array
from eaid.fitting.fit import fit
from eaid.models import friction
from eaid.models.nonlinear import at_duty
from eaid.models.parameters import Nonlinear
from eaid.results.fit import FitOptions
from eaid.steps.stepset import StepSet
from eaid.uncertainty.level_statistics import statistics_at_share
from eaid.uncertainty.nonlinear_intervals import estimates

SAMPLES = 500
WHITE_NM = 0.02


def white(seed: int) -> StepSet:
    """Three runs a level that differ by white noise alone."""
    base = one_set(seed, VARIANTS["base"], samples=SAMPLES)
    random = np.random.default_rng(seed)
    levels = []
    for level in base.levels:
        true = friction.step_response(plant(level.level, VARIANTS["base"]), level.time_s)
        levels.append(replace(level, runs=true + WHITE_NM * random.standard_normal((3, len(true)))))
    return replace(base, levels=tuple(levels))


def missed(found: Nonlinear, stepset: StepSet) -> Array:
    """log of the fitted over the true T_s, τ1, τ2 at each level, shape (L, 3)."""
    rows = []
    for level in stepset.levels:
        ours, true = at_duty(found, level.level), plant(level.level, VARIANTS["base"])
        rows.append([max(ours.Ts, 1e-9) / true.Ts, ours.tau1 / true.tau1, ours.tau2 / true.tau2])
    return np.asarray(np.log(np.array(rows)))


def errors(stepset: StepSet) -> dict[str, Array]:
    """The misses of the three estimates, (L, 3) each."""
    part = fit(stepset, FitOptions(models=("nonlinear",))).nonlinear
    assert part is not None and part.other_weights is not None
    two = estimates(part, statistics_at_share(stepset.levels, 0.85)).two_stage
    plants = {
        "equal": part.parameters,
        "sd": part.other_weights.parameters,
        **({"two-stage": two.plant()} if two else {}),
    }
    return {name: missed(found, stepset) for name, found in plants.items()}


def main() -> None:
    """Print one line a row and estimate."""
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 25
    for runs in (2, 3, 8, 0):
        found: dict[str, list[Array]] = {}
        for seed in range(sets):
            variant = Variant("", runs=runs)
            made = one_set(seed, variant, samples=SAMPLES) if runs else white(seed)
            for name, miss in errors(made).items():
                found.setdefault(name, []).append(miss)
        for name, all_of in found.items():
            rms = np.sqrt(np.mean(np.square(all_of), axis=(0, 1)))
            row = f"{runs} runs" if runs else "3 runs, white noise alone"
            print(f"{row:26} {name:10} T_s {rms[0]:.3f}  τ1 {rms[1]:.3f}  τ2 {rms[2]:.3f}", flush=True)


if __name__ == "__main__":
    main()
