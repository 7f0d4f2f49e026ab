"""Which τ2 the runs of a level allow: a confidence set by inverting tests, whatever the shape of the cost.

At a supposed τ2 = x the other two parameters are refitted to the level's mean ȳ, f_x. Along a direction z that T_s and
τ1 cannot follow, a run would move the fit by d_r = z'(y_r − f_x)/z'z. If x is the truth, the runs' mean is zero but for
their scatter: t(x) = d̄/√V(x), V(x) from the runs pooled over the levels, is Student's. Two directions are tried:
∂f_x/∂log τ2 (a score test), and the way from f_x to the level's best curve, which has power where x is far off. The
best curve has been chosen by the same data, so the second test rejects only at 99.9 %.

The set of all x that neither rejects holds the true τ2 in 95 % also where the estimate has run off into another minimum
of the cost, as it often does in records no longer than τ2 (docs/uncertainty.md has the coverage).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import compress
from eaid.models import friction
from eaid.steps.stepset import Level
from eaid.uncertainty.levels import LevelEstimate
from eaid.uncertainty.run_statistics import RunStatistics
from eaid.uncertainty.scatter import Mask, pooled_scatter
from eaid.uncertainty.student_t import t_quantile

SUPPOSED = np.geomspace(0.02, 20.0, 25)
"""τ2 that are tried, in units of the level's record."""
FAR_NOMINAL = 0.999
"""Confidence at which the way to the best curve rejects a τ2."""
STEPS = 12
"""Gauss–Newton steps in which T_s and τ1 settle at a supposed τ2."""


@dataclass(frozen=True, eq=False)
class Tau2Sets:
    """95 % confidence sets of the levels' τ2, and the T_s and τ1 that go with them."""

    tau2_s: Array
    """Least and largest τ2 allowed [s], shape (L, 2); 0 and ∞ where no end is seen."""
    log_theta: Array
    """Least and largest log T_s and log τ1 over the allowed τ2, shape (L, 2, 2)."""


def tau2_sets(levels: Sequence[Level], estimates: Sequence[LevelEstimate], variance: Array, degrees: Array) -> Tau2Sets:
    """The sets of levels whose C was held; `variance` and `degrees` of log τ2, shape (L,), serve single runs."""
    points = [compress([level.time_s] * len(level.runs), list(level.runs)) for level in levels]
    supposed = np.array([one.runs.duration_s for one in estimates])[:, None] * SUPPOSED
    t = np.zeros((2, *supposed.shape))
    theta = np.zeros((*supposed.shape, 2))
    count = np.zeros(supposed.shape)
    for j in reversed(range(len(SUPPOSED))):  # from τ2 without end, where T_s and τ1 are plain
        tests = []
        for i, (one, p) in enumerate(zip(estimates, points, strict=True)):
            start = one.runs.log_theta[:2] if j + 1 == len(SUPPOSED) else theta[i, j + 1]
            theta[i, j], test = _test(one, p.t_s[0], p.y, p.w[0], supposed[i, j], start)
            tests.append(test)
        t[:, :, j], count[:, j] = _statistics(tests, estimates, variance, degrees)
    allowed = (np.abs(t[0]) <= t_quantile(count)) & (np.abs(t[1]) <= t_quantile(count, FAR_NOMINAL))
    ends = [
        _ends(supposed[i], t[0, i], allowed[i], float(np.exp(one.runs.log_theta[2]))) for i, one in enumerate(estimates)
    ]
    low, high = (np.where(allowed[:, :, None], theta, side).T for side in (np.inf, -np.inf))
    return Tau2Sets(np.array(ends), np.stack([low.min(axis=1), high.max(axis=1)], axis=-1).transpose(1, 0, 2))


def _test(
    one: LevelEstimate, time_s: Array, runs: Array, weight: Array, tau2_s: float, start: Array
) -> tuple[Array, RunStatistics]:
    """(log T_s, log τ1) at a held τ2, and along both directions the mean shift d̄ and what the runs scatter about it."""
    root, mean, share = np.sqrt(weight), np.sort(runs, axis=0).mean(axis=0), one.curve.C
    theta = start
    for _ in range(STEPS):
        fastest, slowest = np.log(1e-6 * tau2_s), np.log(tau2_s / 1.2)  # the fast part stays the fast one
        theta = np.array([theta[0], np.clip(theta[1], fastest, slowest)])
        J = _log_slopes(theta, tau2_s, share, time_s)
        left = mean - J[:, 0]
        step = np.linalg.lstsq(J[:, :2] * root[:, None], left * root, rcond=None)[0]
        if np.abs(step).max() < 1e-8:
            break
        theta = theta + np.clip(step, -0.7, 0.7)
    basis = np.linalg.qr(J[:, :2] * root[:, None])[0]
    ways = np.stack([J[:, 2], friction.step_response(one.curve, time_s) - J[:, 0]]) * root
    ways -= (ways @ basis) @ basis.T
    size = np.maximum((ways**2).sum(axis=1), 1e-300)
    along = ways * root / size[:, None]
    white = float(np.mean(one.noise_nm**2)) / size
    influence = (runs - mean) @ along.T
    return theta, RunStatistics(one.level, along @ left, np.eye(2), influence, white, one.runs.duration_s)


def _log_slopes(theta: Array, tau2_s: float, share: float, time_s: Array) -> Array:
    """∂f/∂(log T_s, log τ1, log τ2), shape (n, 3); the first column is f itself."""
    steady, tau1 = np.exp(theta)
    a, b = time_s / tau1, time_s / tau2_s
    fast, slow = share * np.exp(-a), (1 - share) * np.exp(-b)
    return np.asarray(steady * np.stack([1 - fast - slow, -a * fast, -b * slow], axis=1))


def _statistics(
    tests: Sequence[RunStatistics], estimates: Sequence[LevelEstimate], variance: Array, degrees: Array
) -> tuple[Array, Array]:
    """t of both directions, shape (2, L), and their degrees of freedom, shape (L,)."""
    shift = np.array([test.log_theta for test in tests]).T
    if max(test.repeats for test in tests) > 1:
        scatter = pooled_scatter(tests)
        spread = (scatter.pooled + scatter.common).T
        return shift / np.sqrt(spread), np.full(len(tests), scatter.total_degrees)
    # a single run: the memory of its noise is that of its own best curve
    memory = np.array([one.memory for one in estimates])
    within = np.array([test.within for test in tests]).T * memory
    between = np.maximum(variance - np.array([one.runs.within[2] for one in estimates]), 0.0)
    return shift / np.sqrt(within + np.where(np.isfinite(between), between, 0.0)), degrees


def _ends(supposed: Array, t: Array, allowed: Mask, best: float) -> tuple[float, float]:
    """The hull of what is allowed: tried values, those between two of opposite sign, and the estimate's own place."""
    turns = np.not_equal(np.sign(t[1:]), np.sign(t[:-1])) & (allowed[1:] | allowed[:-1])
    place = int(np.searchsorted(supposed, best))
    inside = allowed | np.append(turns, False) | np.append(False, turns)
    inside[max(place - 1, 0) : place + 1] = True
    first, last = np.flatnonzero(inside)[[0, -1]]
    low = 0.0 if first == 0 and allowed[0] else supposed[max(first - 1, 0)]
    return float(low), float("inf" if last == len(t) - 1 else supposed[last + 1])
