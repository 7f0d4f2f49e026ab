"""Intervals of the friction model: T_s, τ1, τ2 of each level, the coefficient of friction, and the trends."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array, inverse
from eaid.findings import Finding, finding
from eaid.models.trends import FORMS
from eaid.results.common import Interval
from eaid.results.friction import Friction, FrictionLevel, LevelIntervals, Trend
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import NAMES, UNDETERMINED, log_jacobian
from eaid.uncertainty.run_statistics import textbook
from eaid.uncertainty.student_t import t_quantile


@dataclass(frozen=True, eq=False)
class Parameter:
    """One parameter of one level: its interval, or why there is none."""

    name: str
    value: float
    interval: tuple[float, float] | None
    """95 % interval; None where it is constrained or open."""
    log_sd: float
    """Standard deviation of its logarithm (of its logit, for C)."""
    open: bool = False
    """Whether the data do not determine it."""


def level_rows(stats: LevelStatistics, white: bool = False) -> list[list[Parameter]]:
    """The parameters of every level with their intervals; the textbook's where `white`."""
    return [_white_parameters(stats, i) if white else level_parameters(stats, i) for i in range(len(stats.levels))]


def level_parameters(stats: LevelStatistics, i: int) -> list[Parameter]:
    """Intervals exp(θ̂ ± t √V) of one level.

    Where the record leaves τ2 open, those of T_s and τ1 reach over all that go with a τ2 that the runs allow.
    """
    one, result = stats.estimates[i], []
    for k, theta in enumerate(one.runs.log_theta.tolist()):
        name, t = NAMES[k], t_quantile(float(stats.degrees[i, k]))
        sd = float(np.sqrt(max(stats.variance[i, k], 0.0)))
        low, high = theta - t * sd, theta + t * sd
        if k < 2 and stats.open_tau2[i] and np.isfinite(stats.tau2_sets.log_theta[i, k]).all():
            ends = stats.tau2_sets.log_theta[i, k]
            low, high = min(theta, float(ends[0])) - t * sd, max(theta, float(ends[1])) + t * sd
        constrained = name in one.constrained
        undetermined = (k == 2 and not stats.determined[i, 2]) or (
            name != "C" and high - low > 2 * np.log(UNDETERMINED)
        )
        value, first, last = (_natural(name, x) for x in (theta, low, high))
        interval = None if constrained or undetermined else (first, last)
        result.append(Parameter(name, value, interval, sd, open=undetermined and not constrained))
    return result


def _natural(name: str, x: float) -> float:
    with np.errstate(over="ignore"):
        return float(1 / (1 + np.exp(-np.clip(x, -700, 700)))) if name == "C" else float(np.exp(x))


def _white_parameters(stats: LevelStatistics, i: int) -> list[Parameter]:
    """The textbook's intervals θ̂ ± t s of one level, with the variance s² A⁻¹ of the logarithms."""
    one, level = stats.estimates[i], stats.levels[i]
    jacobian = log_jacobian(one.curve, level.time_s, one.share_free)
    information, noise, spare = textbook([jacobian], [level.mean - jacobian[:, 0]], jacobian.shape[1])
    variance = np.diag(inverse(information)) * noise
    rows = []
    for p, v in zip(level_parameters(stats, i), variance.tolist(), strict=True):
        reach = t_quantile(spare) * np.sqrt(v) * (p.value * (1 - p.value) if p.name == "C" else p.value)
        interval = None if p.name in one.constrained else (float(p.value - reach), float(p.value + reach))
        rows.append(Parameter(p.name, p.value, interval, float(np.sqrt(v)), p.open))
    return rows


def level_ci95(part: Friction, rows: Sequence[Sequence[Parameter]]) -> tuple[FrictionLevel, ...]:
    """The levels with the 95 % intervals of their parameters."""
    result = []
    for own, level in zip(rows, part.levels, strict=True):
        ci95 = LevelIntervals(**{p.name: p.interval for p in own})
        if level.C_f is not None and ci95.Ts is not None:
            low, high = (level.C_f * end / level.Ts for end in ci95.Ts)
            ci95 = msgspec.structs.replace(ci95, C_f=(low, high))
        result.append(msgspec.structs.replace(level, ci95=ci95))
    return tuple(result)


def trend_ci95(
    part: Friction, rows: Sequence[Sequence[Parameter]], repeats: bool, degrees: float
) -> tuple[dict[str, Trend], list[Finding]]:
    """The trends with 95 % intervals of their coefficients, and a finding where they have none.

    The coefficients answer to the levels as δc = (G'G)⁻¹ G' δy. The levels' own intervals say how δy scatters; where
    the trend misses the levels by more than that, or each level has one run, the residuals about the trend do.
    """
    result: dict[str, Trend] = {}
    found: list[Finding] = []
    x = np.array(part.x)
    for name, trend in part.trends.items():
        values = np.array([np.nan if one.C_f is None else one.C_f for one in part.levels]) if name == "C_f" else None
        k = {"Ts": 0, "C_f": 0, "tau1": 1, "tau2": 2}[name]
        y = values if values is not None else np.exp([_log(own[k]) for own in rows])
        sd = y * np.array([own[k].log_sd for own in rows])
        ci95, code = _coefficients(trend, x, y, sd if repeats else None, degrees)
        result[name] = msgspec.structs.replace(trend, ci95=ci95)
        if code:
            found.append(finding(code, "friction", parameter=name))
    return result, found


def _log(p: Parameter) -> float:
    return float(np.log(max(p.value, 1e-300)))


def _coefficients(
    trend: Trend, x: Array, y: Array, sd: Array | None, degrees: float
) -> tuple[tuple[Interval, ...] | None, str | None]:
    """Intervals of one trend's coefficients, and the code of what is to be doubted of them."""
    if trend.at_bounds:
        return None, "trend-not-estimable"
    there = np.isfinite(y)
    x, y = x[there], y[there]
    c = np.array(trend.coefficients)
    G = FORMS[trend.form].gradient(c, x).T
    spare = len(y) - len(c)
    if spare < 1:
        return None, "trend-uses-all-levels"
    scale = 1 / np.maximum(np.sqrt((G**2).sum(axis=0)), 1e-300)
    values = np.linalg.svd(G * scale, compute_uv=False)
    if values[-1] < 1e-7 * values[0]:
        return None, "trend-coefficients-alike"
    solve = scale[:, None] * np.linalg.pinv(G * scale)
    left = y - FORMS[trend.form].curve(c, x)
    about = float(left @ left) / spare
    if sd is None:
        variance, own_degrees = np.full(len(y), about), float(spare)
    else:
        variance, own_degrees = sd[there] ** 2, degrees
        expected = float(variance.sum()) * spare / len(y)
        if about * spare > 2 * expected:  # the trend misses the levels by more than they scatter
            share = variance / expected * spare if expected > 0 else np.ones(len(y))
            variance, own_degrees = share * about, float(spare)
    reach = t_quantile(own_degrees) * np.sqrt((solve**2) @ variance)
    vague = (reach > np.abs(c)).any() and trend.form != "linear"
    ends = tuple((float(a - r), float(a + r)) for a, r in zip(c, reach, strict=True))
    return ends, "trend-coefficients-vague" if vague else None
