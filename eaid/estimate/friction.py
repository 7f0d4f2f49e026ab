"""The friction model: the curve of every level, the coefficient of friction by Eq. (1), and trends, specification 3."""

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.estimate import data as metrics
from eaid.estimate import points as sums
from eaid.estimate.data import Data
from eaid.estimate.huber import minimise
from eaid.estimate.levels import fit_levels
from eaid.estimate.solver import CONVERGED, ROUNDING, Problem, judged, polish, slsqp
from eaid.findings import Finding, finding
from eaid.models import friction as model
from eaid.models.parameters import SHARE, TAU_FLOOR_S
from eaid.models.parameters import Friction as FrictionCurve
from eaid.models.trends import FORMS
from eaid.options import FitOptions
from eaid.results.common import HoldOut, Huber, Solver
from eaid.results.fit import Friction, FrictionLevel, Trend
from eaid.steps.stepset import Level, StepSet

STEEPEST = 40.0
"""Rates are looked for up to this many e-folds over the range of x; steeper ones live between two points."""
Form: TypeAlias = Literal["linear", "double-exponential", "merged-exponential"]
APART = 0.05
CANCEL = 100.0
LEAST = {"linear": 3, "double-exponential": 5}
"""Levels that a form needs: one more than its coefficients."""


def fit_trend(x: Array, y: Array, over: str, form: Form) -> Trend:
    """The least-squares trend; `form` is linear or double-exponential, shapes (n,), n as `LEAST` says."""
    origin, range_ = float(x.min()), float(np.ptp(x))
    s = (x - origin) / range_
    if form == "linear":
        return _trend(form, np.polyfit(x, y, 1), x, y, over, True, ())
    size = float(np.abs(y).max()) or 1.0
    c, converged, held = _fit("double-exponential", s, y / size, _rate_pairs(s, y / size, 4))
    weights = np.abs(c[[0, 2], None] * np.exp(np.multiply.outer(c[[1, 3]], s)))
    if "rates-meet" not in held and weights.sum(axis=0).max() <= CANCEL:
        order = (0, 1, 2, 3) if c[1] >= c[3] else (2, 3, 0, 1)
        c = c[list(order)]
        rates = c[[1, 3]] / range_
        back = size * np.exp(-rates * origin)
        return _trend(form, np.array([c[0] * back[0], rates[0], c[2] * back[1], rates[1]]), x, y, over, converged, held)
    c, converged, held = _fit("merged-exponential", s, y / size, [_merged_rate(s, y / size)])
    rate = c[2] / range_
    back = size * np.exp(-rate * origin)
    slope = c[1] / range_
    merged = np.array([(c[0] - slope * origin) * back, slope * back, rate])
    return _trend("merged-exponential", merged, x, y, over, converged, held)


def _trend(form: Form, c: Array, x: Array, y: Array, over: str, converged: bool, held: tuple[str, ...]) -> Trend:
    residual = FORMS[form].curve(c, x) - y
    rmse = float(np.sqrt(np.mean(residual**2)))
    return Trend(form, tuple(c.tolist()), over, rmse, converged, held)


def _fit(form: str, s: Array, y: Array, starts: list[Array]) -> tuple[Array, bool, tuple[str, ...]]:
    """Coefficients on x scaled to 0…1. The weights are solved for; SLSQP sees the one or two rates alone."""
    if form == "double-exponential":
        A, b = np.array([[1.0, -1.0], [-1.0, 0], [0, 1.0]]), np.array([APART, -STEEPEST, -1.5 * STEEPEST])
        names: tuple[str, ...] = ("rates-meet", "r1-steepest", "r2-steepest")
        order = [0, 2, 1, 3]
    else:
        A, b = np.array([[-1.0], [1.0]]), np.array([-STEEPEST, -1.5 * STEEPEST])
        names = ("r-steepest-rise", "r-steepest-fall")
        order = [0, 1, 2]
    floor = ROUNDING * float(y @ y)
    problem = Problem(lambda rates: _projected(rates, s, y)[:3], A, b, names.__getitem__, floor=floor)
    ends = [slsqp(problem, _apart(start)) for start in starts]
    best = min(ends, key=lambda end: end.cost)
    end, predicted, active = polish(problem, best, problem.value)
    c = np.concatenate([_projected(end.x, s, y)[3], end.x])[order]
    # Where one exponential is exact, (p + q x) e^(r x) is flat in r: what is predicted is 0/0 then.
    return c, predicted <= CONVERGED or end.cost <= problem.floor, tuple(names[i] for i in active)


def _rate_grid(s: Array) -> Array:
    """Rates to try, from −40 to 15 e-folds over the range of s, denser about zero, falling, shape (61,)."""
    return np.sinh(np.linspace(np.arcsinh(15.0), -np.arcsinh(STEEPEST), 61)) / float(np.ptp(s))


def _rate_pairs(s: Array, y: Array, most: int) -> list[Array]:
    """The best few pairs of rates on a grid with the weights solved for, neighbours of a better one left out."""
    rates = _rate_grid(s)
    basis = np.exp(np.multiply.outer(rates, s))
    basis /= np.linalg.norm(basis, axis=1)[:, None]
    n = len(rates)
    gram, along = basis @ basis.T, basis @ y
    first, second = np.triu_indices(n, 1)
    g, a, b = gram[first, second], along[first], along[second]
    grid = np.full((n, n), -np.inf)
    grid[first, second] = (a * a + b * b - 2 * g * a * b) / np.maximum(1 - g * g, 1e-12)
    found: list[Array] = []
    for _ in range(most):
        i, j = np.unravel_index(grid.argmax(), grid.shape)
        found.append(rates[[i, j]])
        grid[max(i - 3, 0) : i + 4, max(j - 3, 0) : j + 4] = -np.inf
    return found


def _merged_rate(s: Array, y: Array) -> Array:
    """The best rate of (p + q s) e^(r s) on the grid, p and q solved for, shape (1,)."""
    rates = _rate_grid(s)
    return rates[[int(np.argmin([_projected(rates[[k]], s, y)[0] for k in range(len(rates))]))]]


def _apart(rates: Array) -> Array:
    """Rates in falling order, within the limits and at least `APART` from one another."""
    if len(rates) == 1:
        return np.clip(rates, -1.4 * STEEPEST, 0.99 * STEEPEST)
    high, low = np.clip(rates.max(), -STEEPEST, 0.99 * STEEPEST), np.clip(rates.min(), -1.4 * STEEPEST, 0.9 * STEEPEST)
    return np.array([high, min(low, high - 1.01 * APART)])


def _projected(rates: Array, s: Array, y: Array) -> tuple[float, Array, Array, Array]:
    """Cost with the weights solved for, its gradient and Gauss–Newton curvature by the rates, and the weights."""
    clipped = np.clip(rates, -2 * STEEPEST, 2 * STEEPEST)  # SLSQP may look far outside before it comes back
    e = np.exp(np.multiply.outer(s, clipped))
    basis = e if len(rates) == 2 else np.stack([e[:, 0], s * e[:, 0]], axis=1)
    q, triangle = np.linalg.qr(basis / np.linalg.norm(basis, axis=0))
    weights = np.linalg.lstsq(triangle, q.T @ y, rcond=1e-15)[0] / np.linalg.norm(basis, axis=0)
    r = basis @ weights - y
    slopes = s[:, None] * (basis * weights if len(rates) == 2 else (basis @ weights)[:, None])
    inside = slopes - q @ (q.T @ slopes)
    return float(r @ r), 2 * slopes.T @ r, 2 * inside.T @ inside, weights


PRESSURE_KPA: dict[str, float] = {"Pa": 1e-3, "kPa": 1.0, "MPa": 1e3, "bar": 100.0, "mbar": 0.1}
"""Units of an input that is a stress already."""
TORQUE_UNITS = ("N·m", "Nm", "N.m", "N*m")
FORMS_OVER: dict[str, dict[str, Form]] = {
    "friction-force": {
        "Ts": "linear",
        "tau1": "double-exponential",
        "tau2": "double-exponential",
        "C_f": "double-exponential",
    },
    "friction-speed": {"Ts": "double-exponential", "tau1": "double-exponential", "tau2": "double-exponential"},
}
"""Which value has which trend in which experiment, Tables I and II."""


def trend_axis(stepset: StepSet, levels: Array) -> tuple[str, Array]:
    """What the trends run over, and the levels in it: stress [kPa], speed [RPM], or the level's own unit."""
    if stepset.kind == "friction-speed":
        return "speed_rpm", levels
    if stepset.kind == "friction-force" and stepset.input_unit == "N":
        rig: Apparatus = stepset.apparatus
        return "stress_kpa", np.array([rig.stress_kpa(force) for force in levels])
    if stepset.kind == "friction-force" and stepset.input_unit in PRESSURE_KPA:
        return "stress_kpa", levels * PRESSURE_KPA[stepset.input_unit]
    return f"level_{stepset.input_unit or 'number'}".replace("%", "pct"), levels


def friction_fit(
    stepset: StepSet, fits: Sequence[FrictionLevel], share: float | None
) -> tuple[Friction, list[Finding]]:
    """The curves of all levels with the coefficient of friction and trends, and their warnings."""
    over, x = trend_axis(stepset, np.array([fit.level for fit in fits]))
    found = level_findings(stepset, fits)
    coefficient: list[float | None] = [None] * len(fits)
    if stepset.kind == "friction-force":
        if over != "stress_kpa":
            found.append(finding("level-is-no-stress", "friction", unit=stepset.input_unit or "no unit"))
        elif stepset.output_unit not in TORQUE_UNITS:
            found.append(finding("output-is-no-torque", "friction", unit=stepset.output_unit))
        else:
            coefficient = [
                stepset.apparatus.friction_coefficient(fit.Ts, float(at)) if at > 0 else None
                for fit, at in zip(fits, x, strict=True)
            ]
    trends: dict[str, Trend] = {}
    for name, form in FORMS_OVER.get(stepset.kind, {}).items():
        values = coefficient if name == "C_f" else [getattr(fit, name) for fit in fits]
        if any(value is None for value in values):
            continue
        if len(fits) < LEAST[form]:
            found.append(
                finding(
                    "trend-needs-levels",
                    "friction",
                    parameter=name,
                    over=over,
                    form=form,
                    least=LEAST[form],
                    count=len(fits),
                )
            )
            continue
        trends[name] = fit_trend(x, np.array(values, dtype=np.float64), over, form)
        found += _trend_findings(name, trends[name])
    key = {"stress_kpa": "stress_kpa", "speed_rpm": "speed_rpm"}.get(over)
    levels = tuple(
        msgspec.structs.replace(fit, C_f=c, **({key: float(at)} if key else {}))
        for fit, at, c in zip(fits, x, coefficient, strict=True)
    )
    return Friction(share, over, levels, trends, _together(fits)), found


def _trend_findings(name: str, trend: Trend) -> list[Finding]:
    found = []
    if trend.form == "merged-exponential":
        found.append(finding("trend-rates-merge", "friction", parameter=name))
    if steep := [code for code in trend.at_bounds if code != "rates-meet"]:
        found.append(finding("trend-follows-one-point", "friction", parameter=name, rates=tuple(steep)))
    if not trend.converged:
        found.append(finding("trend-not-converged", "friction", parameter=name))
    return found


def _together(fits: Sequence[FrictionLevel]) -> Solver:
    """One verdict for all levels: the worst of theirs."""
    solvers = [fit.solver for fit in fits if fit.solver is not None]
    failed = [f"{fit.level:g}" for fit in fits if fit.solver is not None and not fit.solver.converged]
    fewest = min(len(one.starts) for one in solvers)
    costs = np.sum([one.costs[:fewest] for one in solvers], axis=0)
    worst = max(one.predicted_decrease or 0.0 for one in solvers)
    held = [code for one in solvers for code in one.at_bounds]
    solver = judged(worst, sum(one.evaluations for one in solvers), costs, held)
    said = f"not converged at level {', '.join(failed)}" if failed else "converged at every level"
    return msgspec.structs.replace(solver, converged=not failed, message=said)


def level_findings(stepset: StepSet, fits: Sequence[FrictionLevel]) -> list[Finding]:
    """What the levels' own curves cannot tell."""

    def where(holds: Callable[[FrictionLevel], bool]) -> list[float]:
        return [fit.level for fit in fits if holds(fit)]

    def at_bound(code: str) -> list[float]:
        return where(lambda fit: fit.solver is not None and code in fit.solver.at_bounds)

    rows = {
        "level-not-converged": where(lambda fit: fit.solver is not None and not fit.solver.converged),
        "fast-rise-not-resolved": at_bound("tau1-floor"),
        "output-does-not-rise": at_bound("Ts-zero"),
    }
    return [finding(code, "friction", levels, unit=stepset.input_unit) for code, levels in rows.items() if levels]


def fit_curves(data: Data, options: FitOptions) -> tuple[list[FrictionLevel], Huber | None]:
    """The friction curve of each level, under the loss that was asked for; errors are of the data themselves."""
    fits, huber = minimise(
        data,
        options.loss,
        lambda d: fit_levels(d, options.held_share),
        lambda d, _: fit_levels(d, options.held_share),
        curve_residuals,
    )
    rows = []
    for one, record, r in zip(fits, data.records, curve_residuals(fits, data), strict=True):
        sse = float(r @ r)
        fit_pct, R2 = metrics.quality(sse, [record.y])
        rmse = float(np.sqrt(sse / len(r)))
        rows.append(msgspec.structs.replace(one, sse=sse, rmse=rmse, fit_pct=fit_pct, R2=R2))
    return rows, huber


def curve_residuals(fits: Sequence[FrictionLevel], on: Data) -> list[Array]:
    """f − y of each level's own curve at every sample."""
    return sums.residuals(np.array([[f.Ts, f.tau1, f.tau2, f.C] for f in fits]).T, on.records)


def missed_levels(fits: Sequence[FrictionLevel], data: Data) -> list[float]:
    """Levels whose own curve explains little of their output."""
    pairs = zip(fits, data.records, curve_residuals(fits, data), strict=True)
    return [one.level for one, record, r in pairs if metrics.explains_little([record.y], [r])]


def friction_hold_out(part: Friction, stepset: StepSet, held_out: Sequence[Level]) -> HoldOut | None:
    """Held-out levels against the curve whose T_s, τ1, τ2 the trends give; None where a trend is missing."""
    if not all(name in part.trends for name in ("Ts", "tau1", "tau2")):
        return None

    def predicted(level: Level) -> Array:
        x = trend_axis(stepset, np.array([level.level]))[1]
        trends = (part.trends[name] for name in ("Ts", "tau1", "tau2"))
        Ts, tau1, tau2 = (float(trend.predict(x)[0]) for trend in trends)
        share = SHARE if part.C is None else part.C
        curve = FrictionCurve(Ts, max(tau1, TAU_FLOOR_S), max(tau2, TAU_FLOOR_S), share)
        return model.step_response(curve, level.time_s)

    sums, sse = sum(f.samples or 0 for f in part.levels), sum(f.sse or 0.0 for f in part.levels)
    return metrics.hold_out(held_out, predicted, float(np.sqrt(sse / sums)))
