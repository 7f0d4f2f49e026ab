"""The best duty against the same optimiser left alone: SciPy's L-BFGS-B from half duty, with a gradient of its own."""

import math
from typing import Any

import numba
import numpy as np
from scipy.optimize import minimize

from benchmarks.table import Row, paired_medians
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay.best import best
from eaid.replay.plant import plant_parameters
from eaid.replay.references import Reference, multisine, steps

PLANT = plant_parameters(REFERENCE_PLANT)
DT_S = 1e-3
ITERATIONS = 1500
NUMBERS = np.array([*REFERENCE_PLANT.tau1, *REFERENCE_PLANT.tau2, *REFERENCE_PLANT.Ts, *REFERENCE_PLANT.u_range, 0.85])


@numba.njit
def terms(p: Any, u: float) -> Any:
    """τ1, τ2, T_s and their slopes over the duty, written anew from the specification's equations."""
    share, share_slope, v, inside = 1.0, 0.0, u, 1.0
    if u < p[10]:
        share, share_slope, v, inside = u / p[10], 1.0 / p[10], p[10], 0.0
    steady = p[6] + v * (p[7] + v * (p[8] + v * p[9]))
    steady_slope = p[7] + v * (2 * p[8] + 3 * v * p[9])
    return (
        p[0] + v * (p[1] + v * p[2]),
        inside * (p[1] + 2 * v * p[2]),
        p[3] + v * (p[4] + v * p[5]),
        inside * (p[4] + 2 * v * p[5]),
        share * steady,
        share_slope * steady + inside * steady_slope,
    )


@numba.njit
def cost_and_gradient(p: Any, duty: Any, reference: Any, weight: Any, dt: float, gradient: Any) -> float:
    n = len(duty)
    x1, x2 = np.zeros(n), np.zeros(n)
    cost = weight[0] * reference[0] ** 2
    for k in range(n - 1):
        t1, _, t2, _, steady, _ = terms(p, duty[k])
        x1[k + 1] = x1[k] - math.expm1(-dt / t1) * (p[12] * steady - x1[k])
        x2[k + 1] = x2[k] - math.expm1(-dt / t2) * ((1 - p[12]) * steady - x2[k])
        cost += weight[k + 1] * (x1[k + 1] + x2[k + 1] - reference[k + 1]) ** 2
    l1 = l2 = 0.0
    gradient[n - 1] = 0.0
    for k in range(n - 2, -1, -1):
        pull = 2 * weight[k + 1] * (x1[k + 1] + x2[k + 1] - reference[k + 1])
        l1, l2 = l1 + pull, l2 + pull
        t1, t1s, t2, t2s, steady, ss = terms(p, duty[k])
        e1, e2 = math.exp(-dt / t1), math.exp(-dt / t2)
        d1 = (1 - e1) * p[12] * ss - e1 * dt / t1**2 * t1s * (p[12] * steady - x1[k])
        d2 = (1 - e2) * (1 - p[12]) * ss - e2 * dt / t2**2 * t2s * ((1 - p[12]) * steady - x2[k])
        gradient[k] = l1 * d1 + l2 * d2
        l1, l2 = l1 * e1, l2 * e2
    return cost


def general(reference: Reference) -> float:
    """RMS error [N·m] that L-BFGS-B reaches from half duty, all gradients exact."""
    wanted = np.array(reference.torque_nm)
    weight = np.ones(len(wanted))
    weight[: round(reference.counted_from_s / DT_S)] = 0.0
    gradient = np.empty_like(wanted)

    def objective(duty: np.ndarray) -> tuple[float, np.ndarray]:
        return cost_and_gradient(NUMBERS, duty, wanted, weight, DT_S, gradient), gradient.copy()

    found = minimize(
        objective, np.full(len(wanted), 50.0), jac=True, method="L-BFGS-B", bounds=[(0.0, 100.0)] * len(wanted),
        options={"maxiter": ITERATIONS, "maxfun": 2 * ITERATIONS, "ftol": 1e-15, "gtol": 1e-12},
    )  # fmt: skip
    return math.sqrt(found.fun / weight.sum())


def rows() -> list[Row]:
    """One row a reference; the error of both stands in the last column."""
    result = []
    for name, reference in (("multisine, 12 s", multisine(DT_S, 12.0)), ("staircase, 45 s", steps(DT_S))):
        reached: dict[str, float] = {}

        def ours(kept: dict[str, float] = reached, of: Reference = reference) -> None:
            found = best(PLANT, of)
            kept["ours"], kept["bound"] = found.rms_error_nm, found.bound_nm

        def other(kept: dict[str, float] = reached, of: Reference = reference) -> None:
            kept["other"] = general(of)

        ours_s, other_s = paired_medians(ours, other, runs=1)
        result.append(
            Row(
                what=f"best duty for the {name}, 1 kHz",
                ours="convex path, then SciPy L-BFGS-B from a duty that switches about it",
                ours_s=ours_s,
                other=f"SciPy L-BFGS-B from half duty, {ITERATIONS} iterations",
                other_s=other_s,
                bar="no worse an error, in less than ten seconds",
                met=reached["ours"] <= reached["other"] * 1.001 and ours_s < 10,
                accuracy=f"RMS {reached['ours']:.5f} against {reached['other']:.5f} N·m; "
                f"no duty below {reached['bound']:.5f}",
            )
        )
    return result
