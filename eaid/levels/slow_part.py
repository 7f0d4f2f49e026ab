"""Which slow time constants the runs leave possible, and what T_s of each level is with them.

A record that is short beside τ2 shows a plateau that may be T_s, or C T_s with a slow part still to come. Of τ2 = g
record lengths, one for all levels, Neyman's score test asks whether the runs reject it: with T_s of the levels and
τ1(u) estimated anew, the slope of the cost by ln τ2, less what T_s and τ1 can follow,

    S = Σ_l mean_r ψ_lr,   Var S = Σ_l Σ_r (ψ_lr − ψ̄_l)²/(R (R − 1)),

lies within t standard deviations of 0, and the squares are fewer than with a τ2 that is rejected. Of single runs Var S
is what their ψ scatter over the levels, or the noise within them where these are few. At a supposed τ2 that test is
right however bent the way from the estimate is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, median
from eaid.estimate.forms import LEAST_TAU_S
from eaid.estimate.points import Normal
from eaid.estimate.scatter import bartlett_variance, run_residuals
from eaid.estimate.solver import SOLVE_SETTLED, Problem, approach
from eaid.estimate.spread import FEW_DEGREES, satterthwaite, t_quantile
from eaid.levels.from_steps import StepProblem
from eaid.steps.stepset import Level

LENGTHS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.5)  # τ2 supposed, in record lengths; the last stands for all beyond
FEWEST_SPARE_SINGLES = 2  # Levels beyond the unknowns from which single runs show what ψ scatters


@dataclass(frozen=True, eq=False)
class SlowPart:
    """What the runs leave open of the slow part."""

    endless: bool  # Whether a τ2 beyond the records is possible
    Ts_low: Array  # Least and largest T_s of the levels with any τ2 that is possible, (L,)
    Ts_high: Array


def slow_part(levels: Sequence[Level], steps: StepProblem, x: Array, tested: bool = True) -> SlowPart:
    """Of an estimate x of the levels' τ1(u) and τ2(u), T_s solved for; not `tested`, every τ2 is possible."""
    record_s, tried = median([level.time_s[-1] for level in levels]), list[tuple[float, Normal, float, bool]]()
    for length in LENGTHS:
        if (supposed := _with_tau2(steps, x, length * record_s)) is not None:
            cost = float(steps.weight @ supposed.cost)
            tried.append((length, supposed, cost, tested and _rejects(levels, steps, supposed)))
    # between two rejected ones, or beyond, the slope may be 0 where the squares are at their most
    most = min((cost for *_, cost, rejected in tried if rejected), default=np.inf)
    possible = [(length, one) for length, one, cost, rejected in tried if not rejected and cost < most]
    found = [steps.at(x).theta[0], *(one.theta[0] for _, one in possible)]
    endless = LENGTHS[-1] in [length for length, _ in possible]
    if endless:
        beyond = _with_tau2(steps, x, 1e3 * record_s)
        found += [] if beyond is None else [beyond.theta[0]]
    return SlowPart(endless, np.min(found, axis=0), np.max(found, axis=0))


def _with_tau2(steps: StepProblem, x: Array, tau2_s: float) -> Normal | None:
    """The levels' curves with one τ2 for all, τ1(u) following; None where τ1 would pass it."""
    assert steps.model.tau2 is not None
    _, one, two = steps.model.slices
    y = x.copy()
    y[two] = np.linalg.lstsq(steps.model.tau2.rows(steps.data.u), np.full(len(steps.data.u), tau2_s), rcond=None)[0]

    def normal(tau1: Array) -> tuple[float, Array, Array]:
        y[one] = tau1
        cost, gradient, curvature = steps.normal(y)
        return cost, gradient[one], curvature[one, one]

    rows = steps.M[1][:, one]
    problem = Problem(normal, rows, np.full(len(rows), LEAST_TAU_S), str, floor=steps.problem.floor)
    y[one] = approach(problem, x[one], near=SOLVE_SETTLED).x
    at = steps.at(y)
    return at if (at.theta[1] <= at.theta[2]).all() else None


def _rejects(levels: Sequence[Level], steps: StepProblem, at: Normal) -> bool:
    """Whether the runs reject a τ2, with T_s and τ1(u) at their best beside it."""
    _, information = steps.reduced(at)
    to_T = at.information[:, 0, 1:3] / np.maximum(at.information[:, 0, :1], 1e-300)
    rows, tau2 = steps.M[1][:, steps.model.slices[1]], at.theta[2]
    own = np.einsum("lp,l,lq->pq", rows, information[:, 0, 0], rows)
    across = np.einsum("lp,l->p", rows, information[:, 0, 1] * tau2)
    follows = rows @ np.linalg.lstsq(own, across, rcond=1e-12)[0]
    psi, parts, degrees = [], [], []
    for i, level in enumerate(levels):
        slopes = steps.data.points.step_slopes(at.theta, i, level.time_s)[:3]
        turn = steps.weight[i] * np.array([follows[i] * to_T[i, 0] - tau2[i] * to_T[i, 1], -follows[i], tau2[i]])
        along = turn @ slopes
        psi.append((level.runs - level.mean) @ along - turn @ at.score[i, :3])  # steps may begin on tails
        if len(level.runs) == 1:
            off = run_residuals(level.runs, at.theta[0, i] * slopes[0], slopes.T)[0]
            parts.append(float(bartlett_variance(level.time_s, (along * off)[:, None]).max()))
            degrees.append(FEW_DEGREES)
        else:
            parts.append(float(psi[i].var(ddof=1)) / len(psi[i]))
            degrees.append(len(psi[i]) - 1.0)
    means = np.array([one.mean() for one in psi])
    if all(len(one) == 1 for one in psi) and len(psi) - steps.M.shape[2] >= FEWEST_SPARE_SINGLES:
        parts, degrees = [len(psi) * float(means.var(ddof=1))], [float(len(psi) - steps.M.shape[2])]
    variance = sum(parts)
    known = float(satterthwaite(parts, degrees)) if variance > 0 else 1.0
    return bool(abs(means.sum()) > t_quantile(known) * np.sqrt(variance))
