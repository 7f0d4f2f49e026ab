"""The two-stage estimator: fit each level, then put the polynomials through log T_s, log τ1, log τ2 of the levels.

The weights are 1/V of the levels' own parameters, so run-to-run scatter stays where it arose; the joint fit
instead lets a gain that is 3 % high at one level bend τ1 and τ2 at all of them.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array, inverse
from eaid.fitting.problem import Problem
from eaid.fitting.solver import slsqp
from eaid.models.parameters import Nonlinear
from eaid.uncertainty.curve import Curve, covariance_between, powers
from eaid.uncertainty.joint import BLOCKS, Coefficients, coefficients_of, free_inverse, limits_of, with_covariance


def two_stage(
    duty_pct: Array,
    log_values: dict[str, Array],
    variance: dict[str, Array],
    curves: dict[str, Curve],
    correlation: Array,
    share: float,
) -> Coefficients:
    """The coefficients from the three curves; where they break a constraint, the best ones that keep all of them.

    `correlation`, shape (3, 3), is that of the scatter of (τ1, τ2, T_s) within a level. Levels that do not determine a
    parameter have an infinite variance there.
    """
    first, second, third = (len(curves[name].coefficients) for name in BLOCKS)
    counts = (first, second, third)
    u_range = (float(duty_pct.min()), float(duty_pct.max()))
    values = np.concatenate([curves[name].coefficients for name in BLOCKS])
    rows, offset = limits_of(counts, u_range)
    if (rows @ values - offset).min() < -1e-12:
        values = _constrained(duty_pct, log_values, variance, counts, rows, offset)
    parts = np.split(values, np.cumsum(counts)[:2])
    raw = [tuple((part / 100.0 ** np.arange(len(part))).tolist()) for part in parts]
    c = coefficients_of(Nonlinear(raw[0], raw[1], raw[2], u_range, share))
    covariance = covariance_between([curves[name] for name in BLOCKS], correlation)
    if c.constrained:
        covariance = free_inverse(c, inverse(covariance), len(duty_pct))
    return with_covariance(c, covariance)


def _constrained(
    duty_pct: Array,
    log_values: dict[str, Array],
    variance: dict[str, Array],
    counts: Sequence[int],
    rows: Array,
    offset: Array,
) -> Array:
    """Σ (θ̂ − log p)²/V over all three parameters under the constraints, from constant τ1, τ2 and T_s."""
    design = np.zeros((3 * len(duty_pct), sum(counts)))
    for k, count in enumerate(counts):
        start = sum(counts[:k])
        design[k * len(duty_pct) : (k + 1) * len(duty_pct), start : start + count] = powers(duty_pct, count)
    aim = np.concatenate([log_values[name] for name in BLOCKS])
    weight = 1 / np.sqrt(np.concatenate([np.maximum(variance[name], 1e-18) for name in BLOCKS]))

    def normal(c: Array) -> tuple[float, Array, Array]:
        now = np.maximum(design @ c, 1e-9)
        left = weight * (np.log(now) - aim)
        J = design * (weight / now)[:, None]
        return float(left @ left), 2 * J.T @ left, 2 * J.T @ J

    begin = np.zeros(sum(counts))
    for k, name in enumerate(BLOCKS):
        begin[sum(counts[:k])] = np.exp(np.average(log_values[name], weights=1 / np.maximum(variance[name], 1e-18)))
    begin[0] = max(begin[0], 2e-3)
    begin[counts[0]] = max(begin[counts[0]], 1.5 * begin[0])
    return slsqp(Problem(normal, rows, offset, str), begin).x
