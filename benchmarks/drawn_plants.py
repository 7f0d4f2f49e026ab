"""Do the ranges over drawn plants hold the truth? `python -m benchmarks.drawn_plants [SETS]`.

Each set of benchmarks/coverage.py is fitted (two-stage) and 200 plants are drawn from it. Counted is how often the
middle 95 % of the plants holds the true T_s, τ1 and τ2 at each level, and the errors of the PI (21, 360) on the true
plant that follows the multisine.
"""

import sys

import numpy as np

from benchmarks import coverage
from eaid.control.pi import PIGains
from eaid.fitting.fit import fit
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.replay.controllers import pi_controller
from eaid.replay.references import multisine
from eaid.replay.scenarios import replayed
from eaid.results.fit import FitOptions
from eaid.uncertainty.draw import draw
from eaid.uncertainty.intervals import with_intervals

PLANTS = 200
METRICS = ("mean_abs_error_nm", "max_abs_error_nm", "rms_error_nm")
REFERENCE = multisine(0.002, 10.0)
PI = pi_controller(PIGains(21.0, 360.0))


def curves(p: Nonlinear) -> dict[str, np.ndarray]:
    tau1, tau2 = nonlinear.time_constants(p, coverage.LEVELS)
    return {"Ts": nonlinear.steady_torque(p, coverage.LEVELS), "tau1": tau1, "tau2": tau2}


def metrics(p: Nonlinear) -> dict[str, np.ndarray]:
    found = replayed(p, PI, REFERENCE)
    return {name: np.array([getattr(found, name)]) for name in METRICS}


def held(drawn: list[dict[str, np.ndarray]], true: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Whether the middle 95 % hold the truth, by name."""
    result = {}
    for name, value in true.items():
        low, high = np.quantile([one[name] for one in drawn], [0.025, 0.975], axis=0)
        result[name] = (low <= value) & (value <= high)
    return result


def main(sets: int) -> None:
    rows, rejected = [], []
    for seed in range(sets):
        made = coverage.one_set(seed, coverage.VARIANTS["base"])
        found = with_intervals(made, fit(made), FitOptions(estimator="two-stage"))
        drawn = draw(found, PLANTS, seed)
        rejected.append(drawn.rejected_share)
        row = held([curves(p) for p in drawn.plants], curves(REFERENCE_PLANT))
        rows.append(row | held([metrics(p) for p in drawn.plants], metrics(REFERENCE_PLANT)))
    print(f"{sets} sets, {PLANTS} plants each; {100 * np.mean(rejected):.1f} % of the draws rejected\n")
    print("| | coverage [%], mean | at any one level |\n|---|---|---|")
    for name in rows[0]:
        share = 100 * np.mean([row[name] for row in rows], axis=0)
        print(f"| {name} | {share.mean():.0f} | {share.min():.0f} to {share.max():.0f} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
