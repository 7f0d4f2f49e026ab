"""Which polynomial follows T_s, τ1, τ2 over the duty: one to four powers, by χ², AICc and levels left out.

χ² is Σ res²/V over the levels, V the levels' own scatter, to be compared with L − p;
AICc = χ² + 2p + 2p(p + 1)/(L − p − 1).
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.results.uncertainty import OrderScore
from eaid.uncertainty.curve import Curve, curve_with_repeats
from eaid.uncertainty.level_statistics import TERMS, LevelStatistics
from eaid.uncertainty.levels import CURVES

ORDERS = (1, 2, 3, 4)
BETTER = 4.0
"""Difference of AICc from which another order is asked for."""


def orders_of(base: LevelStatistics) -> tuple[OrderScore, ...]:
    """Every order that the levels can be held against, for each parameter."""
    rows = []
    for k, name in enumerate(CURVES):
        row = base.determined[:, k]
        duty, theta, variance = base.duty_pct[row], base.log_theta[row, k], base.expected[row, k]
        for order in ORDERS:
            p = order + 1
            if len(duty) < p + 1:
                continue
            curve = curve_with_repeats(duty, theta, variance, base.total_degrees, p)
            chi = float(curve.misfit) * (len(duty) - p)
            spare = max(len(duty) - p - 1, 1)
            errors = left_out(curve, duty, theta)
            inner = errors[1:-1] if len(errors) > 4 else errors  # the ends would be extrapolation
            error = 100 * float(np.sqrt(np.mean(inner**2)))
            rows.append(OrderScore(name, order, chi, chi + 2 * p + 2 * p * (p + 1) / spare, error))
    return tuple(rows)


def left_out(curve: Curve, duty_pct: Array, log_values: Array) -> Array:
    """log p(u) − θ̂ at each level if it were left out, residual/(1 − h) with h its own say in the curve, shape (L,)."""
    own = np.einsum("ij,ji->i", curve.slopes(duty_pct), curve.gains)
    return np.asarray((np.log(curve.at(duty_pct)) - log_values) / np.maximum(1 - own, 1e-9))


def leave_one_level_out(base: LevelStatistics) -> float | None:
    """RMS torque error of inner levels that the curves of all others predict [output unit]."""
    inner = slice(1, -1)
    values = []
    for k, name in enumerate(CURVES):
        row = base.determined[:, k]
        count = int(row.sum())
        if count < 3:
            return None
        duty, theta = base.duty_pct[row], base.log_theta[row, k]
        curve = curve_with_repeats(duty, theta, base.expected[row, k], 10.0, min(TERMS[name], count - 1))
        said = np.log(np.maximum(curve.at(base.duty_pct), 1e-6))
        said[row] = theta + left_out(curve, duty, theta)
        values.append(np.exp(np.clip(said, np.log(1e-6), 50.0)))
    total, samples = 0.0, 0
    shares = [one.curve.C for one in base.estimates]
    for level, Ts, tau1, tau2, C in list(zip(base.levels, *values, shares, strict=True))[inner]:
        left = level.mean - friction.step_response(Friction(float(Ts), float(tau1), float(tau2), C), level.time_s)
        total += float(left @ left)
        samples += len(left)
    return float(np.sqrt(total / samples))


def raised_orders(orders: Sequence[OrderScore]) -> dict[str, int]:
    """Parameters whose levels ask for a higher order than the paper's, and which."""
    found = {}
    for name, paper in (("Ts", 3), ("tau1", 2), ("tau2", 2)):
        own = [order for order in orders if order.parameter == name]
        there = next((order for order in own if order.order == paper), None)
        if there is None:
            continue
        better = min(own, key=lambda order: order.aicc or 0.0)
        if better.order > paper and (better.aicc or 0.0) < (there.aicc or 0.0) - BETTER:
            found[name] = better.order
    return found
