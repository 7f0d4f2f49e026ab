"""The linear model, Eq. (8), pooled and for each level, with intervals; B = 1/b0, specification 4.3.

Its step response is one exponential with τ = 1/a0 and the gain (b0 u + c0)/a0. Every number here answers linearly to
small changes of the levels' own T_s, τ1, τ2, by the full curvature of the cost: the model need not fit.
"""

from collections.abc import Sequence

import msgspec
import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.estimate import data as metrics
from eaid.estimate.data import Data, missed
from eaid.estimate.forms import Model
from eaid.estimate.points import log_crossed
from eaid.estimate.scatter import Scatter
from eaid.estimate.spread import Influence, LevelScatter, interval_of, log_interval_of
from eaid.findings import Finding, finding
from eaid.levels.from_steps import UNSEEN_PART, Solution, fit_linear, textbook_covariance
from eaid.levels.task import FitTask, fit_with_loss
from eaid.plant import linear
from eaid.plant.forms import RESTING
from eaid.plant.linear import LinearPlant as LinearModel
from eaid.results.models import Bounds, BoundsIntervals, Linear, LinearLevel, LinearLevelIntervals, PooledIntervals
from eaid.steps.levels import wanted_levels


def to_line(form: Model) -> Array:
    """Slope and offset of the gain (b0 u + c0)/a0 by its coefficients, (2, k); with a single level the offset is 0."""
    assert form.Ts is not None
    if form.high == form.low:
        return np.array([[1 / form.low if form.low else 0.0], [0.0]])
    low, high = form.Ts.rows(np.array([form.low, form.high]))
    slope = (high - low) / (form.high - form.low)
    return np.array([slope, low - slope * form.low])


def parameters(form: Model, x: Array) -> LinearModel:
    """a0, b0, c0 of a model's unknowns."""
    a0, (slope, offset) = 1 / float(x[-1]), (to_line(form) @ x[:-1]).tolist()
    return LinearModel(a0, a0 * slope, a0 * offset)


def to_parameters(form: Model, x: Array) -> Array:
    """∂(a0, b0, c0)/∂x, (3, n); a single level has no c0, (2, 2)."""
    tau, L = x[-1], to_line(form)
    turn = np.zeros((3, len(x)))
    turn[0, -1] = -1 / tau**2
    turn[1:, :-1], turn[1:, -1] = L / tau, -(L @ x[:-1]) / tau**2
    return turn if form.high > form.low else turn[:2]


def variances(
    solved: Solution, turn: Array, own: Array, scatter: LevelScatter, white: bool
) -> tuple[list[float], list[float]]:
    """Variances and degrees of freedom of numbers that go with the unknowns of a fit by `turn`, (k, n).

    By how the unknowns answer to the levels' `own` T_s, τ1, τ2, C, (4, L), or those of the textbook.
    """
    steps, x, data, form = solved.steps, solved.x, solved.steps.data, solved.steps.model
    if white:
        covariance, spare = textbook_covariance(data, form, x)
        return np.diag(turn @ covariance @ turn.T).tolist(), [spare] * len(turn)
    along = log_crossed(own, form.theta(x, steps.M), data.points, scatter.expected.shape[1] == 4)
    assert steps.problem.exact is not None
    gain = along @ steps.M.transpose(1, 0, 2) @ scaled_inverse(0.5 * steps.problem.exact(x), UNSEEN_PART)
    variance, degrees = Influence(gain, scatter, np.zeros((0, len(x))), 0.0).of(turn).variance()
    return variance.tolist(), degrees.tolist()


def single_levels(data: Data, solved: Sequence[Solution]) -> tuple[LinearLevel, ...]:
    """a0, gain, b0 and B of each level by itself, c0 = 0, specification 4.3."""
    rows = []
    for one, u, record in zip(solved, data.u.tolist(), data.records, strict=True):
        a0, gain = 1 / float(one.x[-1]), float(one.at.theta[0, 0])
        total = metrics.errors([record.y], one.residuals(one.steps.data))
        b0 = a0 * gain / u if u else 0.0
        B = 1 / b0 if b0 > 0 else None
        rows.append(LinearLevel(u, a0, gain, b0, 0.0, B, one.solver.converged, **total.scores))
    return tuple(rows)


def bounds_of(rows: Sequence[LinearLevel], wanted: Sequence[float] | None) -> Bounds:
    """Least and largest B over the kept levels: those that are wanted, else all whose output does not stay at rest."""
    out = find_levels_at_rest(rows) if wanted is None else []
    chosen = [row for row in rows if row.level not in out and (wanted is None or row.level in wanted)]
    known = [row.B for row in chosen if row.B is not None]
    levels = tuple(row.level for row in chosen)
    return Bounds(levels=levels, B_m=min(known, default=None), B_M=max(known, default=None))


def find_levels_at_rest(rows: Sequence[LinearLevel]) -> list[float]:
    """Levels whose output all but stays at rest, as below a clutch's onset: their B is as large as one likes."""
    top = max((row.gain for row in rows), default=0.0)
    return [row.level for row in rows if abs(row.gain) <= RESTING * top]


def bounds_findings(rows: Sequence[LinearLevel], bounds: Bounds) -> list[Finding]:
    """Levels that tell the bounds of B nothing, and those that give them no end."""
    levels = {
        "level-without-b": [row.level for row in rows if row.B is None and row.level in bounds.levels],
        "level-at-rest": [u for u in find_levels_at_rest(rows) if u not in bounds.levels],
    }
    return [finding(code, "linear", at) for code, at in levels.items() if at]


def level_intervals(row: LinearLevel, solved: Solution, i: int, scatter: Scatter, white: bool) -> LinearLevelIntervals:
    """95 % intervals of a0, gain and B of level i."""
    own, values, (gain, tau) = scatter.of_levels.alone(i), (row.a0, row.gain, row.B), solved.x
    # their logarithms by these; B = u/(a0 gain)
    turn = np.array([[0.0, -1 / tau], [1 / gain, 0.0], [-1 / gain, 1 / tau]]) if gain else np.full((3, 2), np.nan)
    variance, degrees = variances(solved, turn, scatter.theta[:, i : i + 1], own, white)
    if not white:
        dof = dict(zip(("a0", "gain", "B"), degrees, strict=True))
        return LinearLevelIntervals(*map(log_interval_of, values, variance, degrees), dof=dof)
    rows = zip(values, variance, degrees, strict=True)
    return LinearLevelIntervals(*(None if v is None else interval_of(v, v * v * one, spare) for v, one, spare in rows))


def linear_part(task: FitTask, scatter: Scatter) -> tuple[Linear, list[Finding]]:
    """The linear model, pooled and per level, with the bounds of B, intervals, and warnings."""
    data, options = task.data, task.options
    solved, huber = fit_with_loss(task, "linear", lambda d, _: fit_linear(d))
    form, x = solved.steps.model, solved.x
    p, left = parameters(form, x), solved.residuals(data)
    each = [fit_linear(data.only([i])) for i in range(len(data.u))]
    total = metrics.errors([record.y for record in data.records], left)
    one = Linear(p.a0, p.b0, p.c0, solver=solved.solver, **total.scores)
    rows = single_levels(data, each)
    wanted = options.bounds_levels
    levels = None if wanted is None else wanted_levels(wanted, [row.level for row in rows], "bounds_levels")
    bounds = bounds_of(rows, levels)
    white = options.ci == "white"
    variance, degrees = variances(solved, to_parameters(form, x), scatter.theta, scatter.of_levels, white)
    ends = map(interval_of, (p.a0, p.b0, p.c0), variance, degrees)  # one level leaves c0 to b0
    pooled = PooledIntervals(*ends, dof=dict(zip(("a0", "b0", "c0"), degrees, strict=False)))
    findings = [*linear_findings(data, one, rows, bounds, pooled), *huber]
    findings += missed("linear", data, left, one)
    if options.ci != "none":
        rows = tuple(
            msgspec.structs.replace(row, ci95=level_intervals(row, one_level, i, scatter, white))
            for i, (row, one_level) in enumerate(zip(rows, each, strict=True))
        )
        kept, of_bounds = [row.ci95 and row.ci95.B for row in rows if row.level in bounds.levels], BoundsIntervals()
        if kept and all(kept):  # of the least and the largest B; none where some B is unbounded
            low, high = np.array(kept, dtype=np.float64).T
            of_bounds = BoundsIntervals((float(low.min()), float(high.min())), (float(low.max()), float(high.max())))
        bounds = msgspec.structs.replace(bounds, ci95=of_bounds)
        one = msgspec.structs.replace(one, ci95=pooled)
    beyond = metrics.hold_out(
        task.held_out, lambda level: linear.linear_response(p, level.time_s, level.level), total.scores["rmse"]
    )
    part = msgspec.structs.replace(one, per_level=rows, bounds=bounds, hold_out=beyond)
    return part, findings


def linear_findings(
    data: Data, fit: Linear, rows: Sequence[LinearLevel], bounds: Bounds, ci95: PooledIntervals
) -> list[Finding]:
    """Warnings about the linear model and the bounds of B."""
    findings, solver, several = [], fit.solver, len(rows) > 1
    if solver is not None and not solver.converged:
        findings.append(finding("fit-not-converged", "linear", predicted_decrease=solver.predicted_decrease))
    if solver is not None and solver.at_bounds:
        findings.append(finding("constraint-holds", "linear", constraint=solver.at_bounds[0]))
    levels = {
        "linear-output-negative": [u for u in data.u.tolist() if fit.b0 * u + fit.c0 < 0],
        "linear-level-beyond-record": [
            row.level for row, r in zip(rows, data.records, strict=True) if row.a0 * r.t_s[-1] < 1
        ],
    }
    findings += bounds_findings(rows, bounds)
    findings += [finding(code, "linear", at) for code, at in levels.items() if at]
    if not several:
        findings.append(finding("one-level-linear", "linear", [rows[0].level]))
    for name in ("a0", "b0") if several else ("a0",):
        ends = getattr(ci95, name)
        if ends is not None and ends[0] <= 0:
            findings.append(finding("linear-may-be-zero", "linear", parameter=name, low=ends[0], high=ends[1]))
    return findings
