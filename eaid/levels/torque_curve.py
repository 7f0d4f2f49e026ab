"""T_s(u) through T_s of the levels: a curve that is nowhere below 0, by least squares of the relative error."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.estimate.forms import Model
from eaid.estimate.scatter import USUAL, paule_mandel
from eaid.estimate.solver import Problem, newton_step
from eaid.estimate.spread import free_inverse

# Probability with which levels that lie on the curve are no further from it than this quantile of F
BEYOND_CHANCE = 0.999


@dataclass(frozen=True, eq=False)
class TorqueCurve:
    """T_s(u) through T_s of the levels."""

    coefficients: Array
    gains: Array  # How the coefficients answer to T_s of the levels, (p, L)
    variance: Array  # Of the levels' T_s, (L,)
    misfit: float | None  # χ² of the levels about the curve over its degrees of freedom; None where there are none
    # Factor by which variances are larger where the levels are further from the curve than chance lets them be
    widened: float
    active: tuple[int, ...]  # Rows of the constraints that hold it, among those of T_s ≥ 0


def torque_curve(
    model: Model, u: Array, Ts: Array, relative: Array | None, noise: Array, degrees: float
) -> TorqueCurve:
    """T_s(u) ≥ 0 through the levels' T_s by least squares, with the variance `relative` T_s(u)² + `noise`, (L,) each.

    `relative` is known by so many degrees of freedom; None: it is found from the levels' distance to the curve. Where
    that is more than chance lets it be, it counts in place of the variance.
    """
    assert model.Ts is not None
    first, D, duties = model.Ts.size, model.Ts.rows(u), model.Ts.rows(model.limited)
    spare, largest = len(Ts) - first, float(Ts.max())
    if largest <= 0:
        nothing = np.zeros((first, len(Ts)))
        return TorqueCurve(nothing[:, 0], nothing, np.zeros(len(Ts)), None, 1.0, tuple(range(len(duties))))

    inner = np.linalg.solve(model.Ts.rows(model.Ts.inputs), np.full(first, largest))  # a constant, which is feasible

    def through(variance: Array) -> tuple[Array, tuple[int, ...], float]:
        weighed = D / variance[:, None]
        problem = Problem(lambda x: (0.0, x, x), duties, np.zeros(len(duties)), str)
        step = newton_step(problem, inner, 2 * weighed.T @ (D @ inner - Ts), 2 * weighed.T @ D)
        left = Ts - D @ (inner + step.d)
        return inner + step.d, step.active, float((left**2 / variance).sum())

    def variance_of(at: Array, scatter: Array | float) -> Array:
        return np.maximum(scatter * at**2 + noise, (1e-9 * largest) ** 2)

    at, scatter, shrunk = np.maximum(Ts, 1e-3 * largest), USUAL**2 if relative is None else relative, 1.0
    for _ in range(4):
        c, active, chi_square = through(variance_of(at, scatter))
        at = np.maximum(D @ c, 1e-3 * largest)
        if relative is None and spare > 0:
            total = partial(lambda at, a: through(variance_of(at, a))[2], at)
            scatter, shrunk = paule_mandel(total, float(spare), USUAL**2)
    variance = variance_of(at, scatter) * np.sqrt(shrunk)
    misfit = chi_square / spare if spare > 0 else None
    gains = free_inverse((D / variance[:, None]).T @ D, duties[list(active)]) @ (D / variance[:, None]).T
    widened = 1.0
    if relative is not None and misfit is not None and misfit > fdtri(spare, max(degrees / 2, 1.0), BEYOND_CHANCE):
        widened = misfit
    return TorqueCurve(c, gains, variance * widened, misfit, widened, active)
