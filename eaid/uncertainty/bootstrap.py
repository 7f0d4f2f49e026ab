"""Second opinion: refits to resampled data. Whole runs within a level, or blocks of 2 s where a level has one run.

Resampling R runs with replacement shows (R − 1)/R of their variance; the deviations from the mean are drawn out by
√(R/(R − 1)) to make up for it. Each refit has a seed of its own, so the number of processes changes nothing.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import fit_linear, fit_own_levels
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.fitting.result import Fit
from eaid.models import friction
from eaid.models.parameters import SHARE
from eaid.steps.stepset import Level
from eaid.uncertainty.joint import coefficients_of
from eaid.uncertainty.levels import log_theta

BLOCK_S = 2.0
"""Blocks of a single run [s]: the longest memory that the Bartlett windows allow for."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Spread over the refits."""

    level_variance: Array
    """Variance of log (T_s, τ1, τ2[, logit C]) of the level means, shape (L, k)."""
    joint: Array | None
    """Covariance of the joint coefficients of (u/100)^k."""
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
    share = SHARE if fit.nonlinear is None else fit.nonlinear.parameters.C
    if fit.friction is not None:
        share_of_levels = fit.friction.C
    else:
        share_of_levels = share
    job = _Job(
        tuple(levels),
        share_of_levels,
        None if fit.nonlinear is None else (None if fit.nonlinear.share_free else share),
        fit.nonlinear is not None,
        None if fit.nonlinear is None else fit.nonlinear.weights,
        fit.linear is not None,
        seed,
    )
    found = []
    if workers > 1:
        with ProcessPoolExecutor(workers, initializer=_begin, initargs=(job,)) as pool:
            for one in pool.map(_of_pool, range(draws), chunksize=8):
                found.append(one)
                if advance:
                    advance()
    else:
        for i in range(draws):
            found.append(_refit(job, i))
            if advance:
                advance()
    theta = np.array([one[0] for one in found])
    return Draws(
        level_variance=_robust_variance(theta),
        joint=np.cov(np.array([one[1] for one in found]), rowvar=False) if job.nonlinear else None,
        pooled=np.cov(np.array([one[2] for one in found]), rowvar=False) if job.linear else None,
        own=_robust_variance(np.array([one[3] for one in found])) if job.linear else None,
    )


def _robust_variance(values: Array) -> Array:
    """Variance over draws from the central 95 %: a few refits that run away (τ2) do not decide it; shape (L, k)."""
    low, high = np.quantile(values, [0.025, 0.975], axis=0)
    return np.asarray(((high - low) / (2 * 1.959964)) ** 2)


@dataclass(frozen=True, eq=False)
class _Job:
    levels: tuple[Level, ...]
    share_of_levels: float | None
    share: float | None
    nonlinear: bool
    weights: tuple[float, ...] | None
    linear: bool
    seed: int


_job: list[_Job] = []


def _begin(job: _Job) -> None:
    _job[:] = [job]


def _of_pool(i: int) -> tuple[Array, Array, Array, Array]:
    return _refit(_job[0], i)


def resampled(level: Level, fitted_nm: Array, random: np.random.Generator) -> Level:
    """One level as another day might have recorded it: its mean curve in a single run."""
    runs = len(level.runs_nm)
    mean = level.mean_nm
    if runs > 1:
        taken = random.integers(0, runs, runs)
        drawn = mean + np.sqrt(runs / (runs - 1)) * (level.runs_nm[taken].mean(axis=0) - mean)
    else:
        left = mean - fitted_nm
        n = len(left)
        length = int(np.clip(np.searchsorted(level.time_s - level.time_s[0], BLOCK_S), 1, max(1, n // 2)))
        starts = random.integers(0, n, -(-n // length))
        drawn = fitted_nm + left[((starts[:, None] + np.arange(length)) % n).ravel()[:n]]
    return replace(level, runs_nm=drawn[None], names=level.names[:1])


def _refit(job: _Job, i: int) -> tuple[Array, Array, Array, Array]:
    random = np.random.default_rng([job.seed, i])
    fits = fit_levels(data_of(job.levels), job.share_of_levels) if len(job.levels[0].runs_nm) == 1 else None
    drawn = []
    for k, level in enumerate(job.levels):
        fitted = friction.step_response(fits[k].curve, level.time_s) if fits else level.mean_nm
        drawn.append(resampled(level, fitted, random))
    data = data_of(drawn, None if job.weights is None else np.array(job.weights))
    theta = np.array([log_theta(f.curve, job.share_of_levels is None) for f in fit_levels(data, job.share_of_levels)])
    none = np.zeros(0)
    joint = pooled = own = none
    if job.nonlinear:
        joint = coefficients_of(fit_nonlinear(data, job.share).parameters, job.share is None).values
    if job.linear:
        p = fit_linear(data).parameters
        pooled = np.array([p.a0, p.b0, p.c0])
        rows = fit_own_levels(data)
        a0, gain = np.log([1 / row.tau for row in rows]), np.log(np.maximum([row.gains[0] for row in rows], 1e-300))
        own = np.stack([a0, gain, a0 + gain], axis=1)
    return theta, joint, pooled, own
