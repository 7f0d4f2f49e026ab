"""Second opinion: refits to resampled data. Whole runs within a level, or blocks of 2 s where a level has one run.

Resampling R runs with replacement shows (R − 1)/R of their variance; the deviations from the mean are drawn out by
√(R/(R − 1)) to make up for it. A refit starts at the fit itself and finds the same minimum, moved. Each has a seed of
its own, so the number of processes changes nothing.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from eaid.arrays import Array
from eaid.fitting.basis import basis_of
from eaid.fitting.compress import Points, compress
from eaid.fitting.data import Data, data_of
from eaid.fitting.descent import descend
from eaid.fitting.first_order import Sums
from eaid.fitting.linear import refit_linear
from eaid.fitting.nonlinear import nonlinear_problem
from eaid.fitting.solver import slsqp
from eaid.models import friction
from eaid.models.parameters import Friction, Linear, Nonlinear
from eaid.results.fit import Fit
from eaid.steps.stepset import Level
from eaid.uncertainty.joint import coefficients_of
from eaid.uncertainty.levels import log_theta
from eaid.uncertainty.refit import ENOUGH, free_parameters, refit
from eaid.uncertainty.weightings import weights_array

BLOCK_S = 2.0
"""Blocks of a single run [s]: the longest memory that the Bartlett windows allow for."""

_Refit: TypeAlias = tuple[Array, Array, Array, Array]
"""log θ of the levels (L, k), the joint coefficients, (a0, b0, c0), and (log a0, log gain, log a0 gain) (L, 3)."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Spread over the refits."""

    level_variance: Array
    """Variance of log (T_s, τ1, τ2[, logit C]) of the level means, shape (L, k)."""
    joint: Array | None
    """The joint coefficients of (u/100)^k of each refit, shape (draws, P): their spread is far from normal."""
    pooled: Array | None
    """Covariance of the pooled a0, b0, c0, shape (3, 3)."""
    own: Array | None
    """Variance of log a0, log gain, log(a0 gain) of the levels, shape (L, 3)."""


def bootstrap(
    levels: Sequence[Level],
    fit: Fit,
    seed: int,
    draws: int,
    workers: int = 1,
    advance: Callable[[], None] | None = None,
) -> Draws:
    """Refit `draws` resampled sets; the same seed gives the same result for any number of workers."""
    assert fit.friction is not None
    free = fit.friction.C is None
    weights = None if fit.nonlinear is None else weights_array(fit.nonlinear)
    data = data_of(levels, weights)
    job = _Job(
        tuple(levels),
        data,
        tuple(_compressed(level, len(data.points.y[0])) for level in levels),
        tuple(one.curve for one in fit.friction.levels),
        np.array([log_theta(one.curve, True) for one in fit.friction.levels]),
        free,
        None if fit.nonlinear is None else fit.nonlinear.parameters,
        fit.nonlinear is not None and fit.nonlinear.C_free,
        None if fit.linear is None else np.log([[row.a0, row.gain] for row in fit.linear.per_level]),
        None if fit.linear is None else fit.linear.parameters,
        seed,
    )
    found = []
    with ExitStack() as stack:
        refits: Iterable[_Refit] = (_refit(job, i) for i in range(draws))
        if workers > 1:
            from concurrent.futures import ProcessPoolExecutor

            pool = stack.enter_context(ProcessPoolExecutor(workers, initializer=_begin, initargs=(job,)))
            refits = pool.map(_of_pool, range(draws), chunksize=8)
        for one in refits:
            found.append(one)
            if advance:
                advance()
    theta = np.array([one[0] for one in found])
    return Draws(
        level_variance=_tame_variance(theta),
        joint=np.array([one[1] for one in found]) if job.model is not None else None,
        pooled=np.cov(np.array([one[2] for one in found]), rowvar=False) if job.own is not None else None,
        own=_tame_variance(np.array([one[3] for one in found])) if job.own is not None else None,
    )


def _tame_variance(values: Array) -> Array:
    """Variance over draws, those that run away (a τ2 that the draw lost) held at five of the others' half-widths."""
    low, middle, high = np.quantile(values, [0.025, 0.5, 0.975], axis=0)
    reach = 2.5 * (high - low)
    return np.asarray(np.clip(values, middle - reach, middle + reach).var(axis=0))


@dataclass(frozen=True, eq=False)
class _Job:
    """What every refit starts from: the fit itself."""

    levels: tuple[Level, ...]
    data: Data
    """The means as they were fitted; a refit replaces its compressed curves."""
    runs: tuple[Array, ...]
    """Compressed runs of each level, shape (R, P)."""
    curves: tuple[Friction, ...]
    theta: Array
    """Their (log T_s, log τ1, log τ2, logit C), shape (L, 4)."""
    levels_share_free: bool
    model: Nonlinear | None
    share_free: bool
    own: Array | None
    pooled: Linear | None
    seed: int


_job: list[_Job] = []


def _begin(job: _Job) -> None:
    from eaid.processes import end_with_parent

    end_with_parent()
    _job[:] = [job]


def _of_pool(i: int) -> _Refit:
    return _refit(_job[0], i)


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


def _refit(job: _Job, i: int) -> _Refit:
    random = np.random.default_rng([job.seed, i])
    base = job.data.points
    y = np.zeros_like(base.y)
    for k, (level, runs) in enumerate(zip(job.levels, job.runs, strict=True)):
        if len(runs) > 1:
            y[k] = resampled_mean(runs, random)
            continue
        fitted = friction.step_response(job.curves[k], level.time_s)
        drawn = replace(level, runs=resampled_blocks(level, fitted, random)[None])
        y[k] = _compressed(drawn, len(y[k]))[0]
    data = replace(job.data)
    data.__dict__["points"] = Points(base.t_s, y, base.w)
    theta = refit(data.points, job.theta, free_parameters(job.levels_share_free)).x
    joint = pooled = own = np.zeros(0)
    if job.model is not None:
        joint = _joint(job, data)
    if job.own is not None and job.pooled is not None:
        own = _first_order(data.points, job.own)
        own = np.column_stack([own, own.sum(axis=1)])
        again = refit_linear(data, job.pooled)
        pooled = np.array([again.a0, again.b0, again.c0])
    return theta[:, : 4 if job.levels_share_free else 3], joint, pooled, own


def _joint(job: _Job, data: Data) -> Array:
    """The joint coefficients of (u/100)^k, from the fit's own: the same minimum, moved."""
    assert job.model is not None
    basis = basis_of(data.u, None if job.share_free else job.model.C)
    problem = nonlinear_problem(data, basis)
    start = basis.unknowns(job.model)
    slack = problem.A @ start - problem.b
    if slack.min() < 0:  # the rounding of a fit that a constraint holds
        problem = replace(problem, b=problem.b + np.minimum(slack, 0.0))
    return coefficients_of(basis.parameters(slsqp(problem, start).x), job.share_free).values


def _first_order(points: Points, start: Array) -> Array:
    """(log a0, log gain) of the levels' first-order curves, from `start`, shape (L, 2)."""
    x = np.stack([np.exp(start[:, 1]), -start[:, 0]], axis=1)
    gain, log_tau = descend(Sums(points).normal, x, 30, ENOUGH).x.T
    return np.stack([-log_tau, np.log(np.maximum(gain, 1e-300))], axis=1)
