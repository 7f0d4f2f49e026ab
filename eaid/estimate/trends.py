"""Trends of T_s, τ1, τ2 and the coefficient of friction over stress or speed, with intervals of their coefficients.

The weights of the exponentials are solved for (variable projection); SLSQP sees their one or two rates alone.
"""

from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.estimate.solver import CONVERGED, ROUNDING, Problem, approach, polish, slsqp
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, Value, finding
from eaid.plant.trends import FORMS, gradient
from eaid.results.common import Interval
from eaid.results.models import Trend

# Rates are looked for up to this many e-folds over the range of x; steeper ones live between two points
STEEPEST = 40.0
# Rates to try on x scaled to 0…1, falling, denser about zero
RATES = np.sinh(np.linspace(np.arcsinh(15.0), -np.arcsinh(STEEPEST), 61))
TrendForm: TypeAlias = Literal["linear", "double-exponential", "merged-exponential"]
RATES_APART = 0.05
CANCEL = 100.0
LEVELS_NEEDED = {"linear": 3, "double-exponential": 5}  # Levels that a form needs: one more than its coefficients
# Which value has which trend in which experiment, Tables I and II
FORMS_OVER: dict[str, dict[str, TrendForm]] = {
    "friction-force": {
        "Ts": "linear",
        "tau1": "double-exponential",
        "tau2": "double-exponential",
        "C_f": "double-exponential",
    },
    "friction-speed": {"Ts": "double-exponential", "tau1": "double-exponential", "tau2": "double-exponential"},
}


def fit_trend(x: Array, y: Array, over: str, form: TrendForm) -> Trend:
    """The least-squares trend; `form` is linear or double-exponential, shapes (n,), n as `LEVELS_NEEDED` says."""
    origin, range_, size = float(x.min()), float(np.ptp(x)), float(np.abs(y).max()) or 1.0
    s, converged = (x - origin) / range_, True
    held: tuple[str, ...] = ()
    if form == "linear":
        c = np.polyfit(x, y, 1)
    else:
        c, converged, held = _fit_one(form, s, y / size, _rate_pairs(s, y / size, 4))
        weights = np.abs(c[[0, 2], None] * np.exp(np.multiply.outer(c[[1, 3]], s)))
        if "rates-meet" in held or weights.sum(axis=0).max() > CANCEL:
            form = "merged-exponential"
            rate = min(RATES, key=lambda rate: _project(np.array([rate]), s, y / size)[0])
            c, converged, held = _fit_one(form, s, y / size, [np.array([rate])])
            rate, slope = c[2] / range_, c[1] / range_
            c = np.append(size * np.exp(-rate * origin) * np.array([c[0] - slope * origin, slope]), rate)
        else:
            c[1::2] /= range_
            c[::2] *= size * np.exp(-c[1::2] * origin)
    left = FORMS[form].curve(c, x) - y
    return Trend(form, tuple(c.tolist()), over, float(np.sqrt(np.mean(left**2))), converged, held)


def _fit_one(form: str, s: Array, y: Array, starts: list[Array]) -> tuple[Array, bool, tuple[str, ...]]:
    """Coefficients on x scaled to 0…1. The weights are solved for; SLSQP sees the one or two rates alone."""
    if form == "double-exponential":
        A, b = np.array([[1.0, -1.0], [-1.0, 0], [0, 1.0]]), np.array([RATES_APART, -STEEPEST, -1.5 * STEEPEST])
        names: tuple[str, ...] = ("rates-meet", "r1-steepest", "r2-steepest")
        order = [0, 2, 1, 3]
    else:
        A, b = np.array([[-1.0], [1.0]]), np.array([-STEEPEST, -1.5 * STEEPEST])
        names = ("r-steepest-rise", "r-steepest-fall")
        order = [0, 1, 2]
    floor = ROUNDING * float(y @ y)
    problem = Problem(lambda rates: _project(rates, s, y)[:3], A, b, names.__getitem__, floor=floor)
    ends = [slsqp(problem, approach(problem, start)) for start in starts]
    best = min(ends, key=lambda end: end.cost)
    end, predicted, active = polish(problem, best)
    c = np.concatenate([_project(end.x, s, y)[3], end.x])[order]
    # Where one exponential is exact, (p + q x) e^(r x) is flat in r: what is predicted is 0/0 then.
    return c, predicted <= CONVERGED or end.cost <= problem.floor, tuple(names[i] for i in active)


def _rate_pairs(s: Array, y: Array, most: int) -> list[Array]:
    """The best few pairs of rates on a grid with the weights solved for, neighbours of a better one left out."""
    basis = np.exp(np.multiply.outer(RATES, s))
    basis /= np.linalg.norm(basis, axis=1)[:, None]
    n = len(RATES)
    gram, along = basis @ basis.T, basis @ y
    first, second = np.triu_indices(n, 1)
    g, a, b = gram[first, second], along[first], along[second]
    grid = np.full((n, n), -np.inf)
    grid[first, second] = (a * a + b * b - 2 * g * a * b) / np.maximum(1 - g * g, 1e-12)
    pairs: list[Array] = []
    for _ in range(most):
        i, j = np.unravel_index(grid.argmax(), grid.shape)
        pairs.append(RATES[[i, j]])
        grid[max(i - 3, 0) : i + 4, max(j - 3, 0) : j + 4] = -np.inf
    return pairs


def _project(rates: Array, s: Array, y: Array) -> tuple[float, Array, Array, Array]:
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


def fit_trends(
    kind: str, over: str, x: Array, of: Mapping[str, Sequence[float | None]], seen: tuple[Array | None, float] | None
) -> tuple[dict[str, Trend], list[Finding]]:
    """The trends of a kind of experiment over x, (L,), with 95 % intervals of their coefficients if it is `seen` how
    the levels scatter: relative deviations of T_s, τ1, τ2, (3, L), and their degrees of freedom.

    The coefficients answer to the levels as δc = (G'G)⁻¹ G' δy. Where the trend misses the levels by more than they
    scatter, or each level has one run (no deviations), the residuals about the trend say how δy scatters.
    """
    trends: dict[str, Trend] = {}
    findings: list[Finding] = []
    for name, form in FORMS_OVER.get(kind, {}).items():
        if any(value is None for value in of[name]):
            continue
        if len(x) < LEVELS_NEEDED[form]:
            facts: dict[str, Value] = {"over": over, "form": form, "least": LEVELS_NEEDED[form], "count": len(x)}
            findings.append(finding("trend-needs-levels", "friction", (), parameter=name, **facts))
            continue
        y = np.array(of[name], dtype=np.float64)
        trend = fit_trend(x, y, over, form)
        if steep := [code for code in trend.at_bounds if code != "rates-meet"]:
            findings.append(finding("trend-follows-one-point", "friction", parameter=name, rates=tuple(steep)))
        if not trend.converged:
            findings.append(finding("trend-not-converged", "friction", parameter=name))
        if seen is not None:
            relative, degrees = seen
            sd = None if relative is None else y * relative[{"tau1": 1, "tau2": 2}.get(name, 0)]
            ci95, vague = _coefficients(trend, x, y, sd, degrees)
            trend = msgspec.structs.replace(trend, ci95=ci95)
            findings += [finding("trend-not-estimable", "friction", parameter=name)] if vague else []
        trends[name] = trend
    return trends, findings


def _coefficients(
    trend: Trend, x: Array, y: Array, sd: Array | None, degrees: float
) -> tuple[tuple[Interval, ...] | None, bool]:
    """Intervals of one trend's coefficients, and whether the levels tell some of them hardly."""
    if trend.at_bounds:
        return None, True
    c = np.array(trend.coefficients)
    G, spare = gradient(trend.form, c, x).T, len(y) - len(c)
    scale = 1 / np.maximum(np.sqrt((G**2).sum(axis=0)), 1e-300)
    values = np.linalg.svd(G * scale, compute_uv=False)
    if values[-1] < 1e-7 * values[0]:
        return None, True
    solve = scale[:, None] * np.linalg.pinv(G * scale)
    left = y - FORMS[trend.form].curve(c, x)
    about = float(left @ left) / spare
    if sd is None:
        variance, own_degrees = np.full(len(y), about), float(spare)
    else:
        variance, own_degrees = sd**2, degrees
        expected = float(variance.sum()) * spare / len(y)
        if about * spare > 2 * expected:  # the trend misses the levels by more than they scatter
            share = variance / expected * spare if expected > 0 else np.ones(len(y))
            variance, own_degrees = share * about, float(spare)
    reach = t_quantile(own_degrees) * np.sqrt((solve**2) @ variance)
    vague = bool((reach > np.abs(c)).any()) and trend.form != "linear"
    ends = tuple((float(a - r), float(a + r)) for a, r in zip(c, reach, strict=True))
    return ends, vague
