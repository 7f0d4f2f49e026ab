"""Second opinion: refits to resampled data. Whole runs within a level, or blocks of 2 s where a level has one run.

Resampling R runs with replacement shows (R − 1)/R of their variance; the deviations from the mean are drawn out by
√(R/(R − 1)) to make up for it. A refit starts at the fit itself and finds the same minimum, moved. Each has a seed of
its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.basis import Basis
from eaid.estimate.certainty import Estimate
from eaid.estimate.data import Data, data_of
from eaid.estimate.joint import nonlinear_problem
from eaid.estimate.level_statistics import ENOUGH, log_theta, refit
from eaid.estimate.linear import Sums, refit_linear
from eaid.estimate.points import Points, compress
from eaid.estimate.solver import descend, slsqp
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.options import FitOptions
from eaid.results.fit import Fit, Nonlinear
from eaid.steps.stepset import Level

BLOCK_S = 2.0
"""Blocks of a single run [s]: the longest memory that the Bartlett windows allow for."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Spread over the refits."""

    level_variance: Array
    """Variance of log (T_s, τ1, τ2[, logit C]) of the level means, shape (L, k)."""
    unknowns: Array | None
    """Unknowns of the nonlinear estimate that stands of each refit, (draws, n): their spread is far from normal."""
    pooled: Array | None
    """Covariance of the pooled a0, b0, c0, shape (3, 3)."""
    own: Array | None
    """Variance of log a0, log gain, log(a0 gain) of the levels, shape (L, 3)."""


def bootstrap(
    levels: Sequence[Level],
    fit: Fit,
    first: Estimate | None,
    options: FitOptions,
    advance: Callable[[], None] | None = None,
) -> Draws:
    """Refit resampled sets, from the estimate that stands; `advance` is called after each."""
    assert fit.friction is not None
    model, linear, curves = fit.nonlinear, fit.linear, [row.curve for row in fit.friction.levels]
    data = data_of(levels)
    runs = [_compressed(level, len(data.points.y[0])) for level in levels]
    start, free = (
        np.array([log_theta(curve, True) for curve in curves]),
        np.array([True, True, True, fit.friction.C is None]),
    )
    theta: list[Array] = []
    unknowns: list[Array] = []
    pooled: list[Array] = []
    own: list[Array] = []
    for i in range(options.draws):
        again = replace(data)
        # the means as they were fitted keep their times; only their compressed values change
        again.__dict__["points"] = _resampled(
            data.points, levels, curves, runs, np.random.default_rng([options.seed, i])
        )
        theta.append(refit(again.points, start, free).x[:, : int(free.sum())])
        if first is not None and options.estimator == "joint":
            unknowns.append(_joint(first.basis, model, again))
        elif first is not None:
            unknowns.append(first.refit(again))
        if linear is not None:
            p = refit_linear(again, linear.parameters)
            pooled.append(np.array([p.a0, p.b0, p.c0]))
            curve = _first_order(again.points, np.log([[row.a0, row.gain] for row in linear.per_level]))
            own.append(np.column_stack([curve, curve.sum(axis=1)]))
        if advance:
            advance()
    return Draws(
        level_variance=_tame_variance(np.array(theta)),
        unknowns=np.array(unknowns) if unknowns else None,
        pooled=np.cov(np.array(pooled), rowvar=False) if pooled else None,
        own=_tame_variance(np.array(own)) if own else None,
    )


def _tame_variance(values: Array) -> Array:
    """Variance over draws, those that run away (a τ2 that the draw lost) held at five of the others' half-widths."""
    low, middle, high = np.quantile(values, [0.025, 0.5, 0.975], axis=0)
    reach = 2.5 * (high - low)
    return np.asarray(np.clip(values, middle - reach, middle + reach).var(axis=0))


def _compressed(level: Level, length: int) -> Array:
    """Every run of a level on the points of its mean, shape (R, length): compression is linear in the data."""
    rows = compress([level.time_s] * len(level.runs), list(level.runs)).y
    return np.pad(rows, ((0, 0), (0, length - rows.shape[1])))


def resampled_mean(runs: Array, random: "np.random.Generator") -> Array:
    """Mean of R runs drawn with replacement from R, its distance to the mean drawn out by √(R/(R − 1)); shape (n,)."""
    count = len(runs)
    mean = runs.mean(axis=0)
    taken = random.integers(0, count, count)
    return np.asarray(mean + np.sqrt(count / (count - 1)) * (runs[taken].mean(axis=0) - mean))


def resampled_blocks(level: Level, fitted_nm: Array, random: "np.random.Generator") -> Array:
    """A single run made anew from blocks of its own residuals, shape (n,)."""
    left = level.mean - fitted_nm
    n = len(left)
    length = int(np.clip(np.searchsorted(level.time_s - level.time_s[0], BLOCK_S), 1, max(1, n // 2)))
    starts = random.integers(0, n, -(-n // length))
    return np.asarray(fitted_nm + left[((starts[:, None] + np.arange(length)) % n).ravel()[:n]])


def _resampled(
    base: Points,
    levels: Sequence[Level],
    curves: Sequence[Friction],
    runs: Sequence[Array],
    random: "np.random.Generator",
) -> Points:
    """The levels' means, resampled; `runs` are their compressed runs."""
    y = np.zeros_like(base.y)
    for k, (level, curve, rows) in enumerate(zip(levels, curves, runs, strict=True)):
        if len(rows) > 1:
            y[k] = resampled_mean(rows, random)
        else:
            blocks = resampled_blocks(level, friction.step_response(curve, level.time_s), random)
            y[k] = _compressed(replace(level, runs=blocks[None]), len(y[k]))[0]
    return Points(base.t_s, y, base.w)


def _joint(basis: Basis, model: Nonlinear | None, data: Data) -> Array:
    """The unknowns of the joint fit, from its minimum before."""
    assert model is not None
    problem = nonlinear_problem(data, basis)
    start = basis.unknowns(model.parameters)
    slack = problem.A @ start - problem.b
    if slack.min() < 0:  # the rounding of a fit that a constraint holds
        problem = replace(problem, b=problem.b + np.minimum(slack, 0.0))
    return slsqp(problem, start).x


def _first_order(points: Points, start: Array) -> Array:
    """(log a0, log gain) of the levels' first-order curves, from `start`, shape (L, 2)."""
    x = np.stack([np.exp(start[:, 1]), -start[:, 0]], axis=1)
    gain, log_tau = descend(Sums(points).normal, x, 30, ENOUGH).x.T
    return np.stack([-log_tau, np.log(np.maximum(gain, 1e-300))], axis=1)
