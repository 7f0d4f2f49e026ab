"""Intervals of the curves T_s(u), τ1(u), τ2(u) of a recorded fit, in logarithms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.recorded.bias import CurveBias
from eaid.recorded.intervals import Spread
from eaid.recorded.log import RecordedLog
from eaid.recorded.profile import FARTHEST, score_test
from eaid.recorded.solve import Solved
from eaid.results.recorded import Asked

LIMITS_PCT = {"Ts": 10.0, "tau1": 30.0, "tau2": 50.0}
"""Half-widths beyond which an input was never asked about."""
PARABOLA = 0.05
"""Half-width in the logarithm up to which a parabola is a picture of the cost."""


def held(solved: Solved) -> set[str]:
    """Which of T_s, τ1, τ2 an active constraint holds at some input."""
    basis = solved.setup.model.basis
    assert basis is not None
    count = len(basis.duties)
    return {("tau1", "tau2", "Ts", "tau2")[i // count] for i in solved.active.tolist() if i < 4 * count}


@dataclass(frozen=True, eq=False)
class CurveSpread:
    """T_s, τ1, τ2 at some inputs with their 95 % intervals; shapes (3, L)."""

    duty: Array
    values: Array
    low: Array
    high: Array
    half_width: Array
    """Relative half-widths, e^h − 1; infinite where nothing is known."""


def curves(solved: Solved, uncertainty: Spread, duty: Array) -> CurveSpread:
    """Intervals of log T_s, log τ1, log τ2 at some inputs within the range."""
    slopes = solved.setup.model.slopes(duty, solved.setup.size)
    values = slopes @ solved.x
    constrained = held(solved)  # what a constraint holds is not estimated
    test = score_test(solved, uncertainty) if solved.instruments is None else None
    off = np.full((2, *values.shape), np.inf)  # both ends in log, downwards and upwards
    names = tuple(LIMITS_PCT)
    for k, i in np.argwhere(values > 0).tolist():
        half = uncertainty.of(slopes[k, i])
        if names[k] in constrained:
            continue
        off[:, k, i] = half / values[k, i]
        if test is not None and PARABOLA < half / values[k, i] < FARTHEST:
            off[:, k, i] = test.ends(slopes[k, i], half)
    values = np.where(slopes.any(axis=2), values, np.nan)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        minima = np.stack([values, *(slopes @ x for x in uncertainty.rivals)])
        low, high = (minima * np.exp(-off[0])).min(axis=0), (minima * np.exp(off[1])).max(axis=0)
        wide = np.where(low > 0, np.sqrt(high / low) - 1, np.inf)
    return CurveSpread(duty, values, low, high, wide)


def widened(known: CurveSpread, bias: CurveBias) -> CurveSpread:
    """Intervals that hold the bias of a direct fit to a closed loop: wider by it, to both sides."""
    off = np.array([np.interp(known.duty, bias.duty, row) for row in bias.off])
    with np.errstate(over="ignore", invalid="ignore"):
        wide = (1 + known.half_width) * np.exp(off) - 1
    return replace(known, low=known.low * np.exp(-off), high=known.high * np.exp(off), half_width=wide)


def asked(known: CurveSpread, logs: Sequence[RecordedLog]) -> tuple[Asked, ...]:
    """How well each input is known, and the time spent near it."""
    edges = 0.5 * (known.duty[1:] + known.duty[:-1])
    time_s = np.zeros(len(known.duty))
    for log in logs:
        acting = log.input > 0
        np.add.at(time_s, np.searchsorted(edges, log.input[acting]), log.dt_s[acting])
    widths = [[100 * h if h < 10 else None for h in row] for row in known.half_width.tolist()]
    return tuple(map(Asked, known.duty.tolist(), *widths, time_s.tolist()))


def never_asked(known: CurveSpread) -> list[Finding]:
    """Inputs at which a curve is all but unknown."""
    found = []
    for (name, limit), half_width in zip(LIMITS_PCT.items(), known.half_width, strict=True):
        wide = known.duty[~(100 * half_width <= limit)]
        if len(wide):
            found.append(finding("never-asked", "nonlinear", wide, parameter=name, limit_pct=limit))
    return found
