"""What a notebook asks a fit for, under the names that statsmodels' users guess; n samples, k free parameters:

    rsquared  1 − SSE/Σ (y − mean y)²        llf  −n/2 (log(2π SSE/n) + 1)
    aic       2 k − 2 llf                    bic  k log n − 2 llf

All are of the first model that was fitted: the plant where it is of another kind than the clutch's, else nonlinear,
linear, friction. Repeats of a level are averaged before a model is fitted, so n counts the samples of the averages;
noise that remembers makes fewer of them independent than there are, so `aic` and `bic` compare models of the same logs
and are no absolute measure.
"""

import contextlib
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.shown import pandas

if TYPE_CHECKING:
    from eaid.results.fit import Fit, Parameter
    from eaid.steps.stepset import StepSet

FIRST_MODELS = ("nonlinear", "linear", "friction")  # Models of steps, the first that was fitted before the others
PLANT = "plant"  # The one plant, where it is of another kind
SAME_MIDDLE = 1e-6  # Part of an interval by which a value lies off its middle and still is the middle


def first_model(fit: "Fit") -> str:
    """The model that a fit stands for: its plant of another kind, or the first model of steps."""
    if fit.another_plant is not None:
        return PLANT
    found = next((name for name in FIRST_MODELS if getattr(fit, name) is not None), None)
    if found is None:
        raise DataError("the fit holds no model of steps")
    return found


def index_of(rows: "tuple[Parameter, ...]") -> "pandas.MultiIndex":
    """(model, parameter) of each row, the level in brackets."""
    names = [(row.model, row.name if row.level is None else f"{row.name}({row.level:g})") for row in rows]
    return pandas.MultiIndex.from_tuples(names, names=["model", "parameter"])


def interval_columns(rows: "tuple[Parameter, ...]") -> Array:
    """Value, low, high and degrees of freedom, shape (4, rows); what is not known is NaN, such freedom infinite."""
    cells = [(row.value, row.low, row.high, row.dof) for row in rows]
    table = np.array(cells, dtype=np.float64).reshape(-1, 4).T  # None becomes NaN
    table[3] = np.minimum(np.where(np.isnan(table[3]), np.inf, table[3]), 1e12)
    return table


def by_ratio(value: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Of which values the interval lies about the logarithm: all that are above 0 and not in the middle."""
    off = np.abs(low + high - 2 * value) > SAME_MIDDLE * (high - low)
    return (low > 0) & (value > 0) & off


def as_numbers(name: str, given: Any, most: int = 1) -> Array:
    """An argument as numbers, spans of time in seconds, of so many dimensions at most; else `UsageError`."""
    with contextlib.suppress(TypeError, ValueError):
        plain = np.asarray(given)
        found = plain / np.timedelta64(1, "s") if plain.dtype.kind == "m" else plain.astype(np.float64)
        if found.ndim <= most:
            return found
    raise UsageError(f"«{name}» {given!r}: give {'numbers' if most else 'a number'}")


def sums(fit: "Fit") -> tuple[float, float, int]:
    """Sums of squares of the residuals and about the mean, and samples; friction curves each about their own mean."""
    model = first_model(fit)
    rows: Sequence[Any] = fit.friction_levels if model == "friction" else ()
    if model in ("nonlinear", "linear"):
        rows = (getattr(fit, model),)
    if model == PLANT and not fit.logs and fit.samples.steps is not None:
        both = residuals(fit)
        left, about = (both["recorded"] - value for value in (both["fitted"], both["recorded"].mean()))
        return float((left**2).sum()), float((about**2).sum()), len(left)
    known = [
        (n * one.rmse**2, n * one.rmse**2 / (1 - one.fit_pct / 100) ** 2, n)
        for one in (fit.logs if model == PLANT else ())
        if (n := one.samples) and one.rmse and one.fit_pct is not None
    ]
    known += [
        (one.sse, one.sse / (1 - one.R2), one.sse / one.rmse**2)
        for one in rows
        if one.sse and one.rmse and one.R2 is not None and one.R2 < 1
    ]
    sse, about_mean, samples = np.array(known or [(math.nan, math.nan, sum(fit.data.samples))]).sum(axis=0).tolist()
    return sse, about_mean, round(samples)


def free_parameters(fit: "Fit") -> int:
    """k: coefficients that are not held at 0 or another value."""
    model = first_model(fit)
    if model == "friction":
        held = fit.friction is not None and fit.friction.C is not None
        return (4 - held) * len(fit.friction_levels)
    if model == "linear":
        return int(np.count_nonzero([getattr(fit.linear, name) for name in ("a0", "b0", "c0")]))
    if model != PLANT:
        part = fit.nonlinear
        assert part is not None
        return int(np.count_nonzero([*part.parameters.steady_numbers, *part.tau1, *part.tau2])) + part.C_free
    plant = fit.plant_
    assert plant is not None  # of another kind: one lag has no τ2 of its own, a ringing one a damping
    numbers = [*plant.plant.steady_numbers, *plant.Ts_below, *plant.tau1]
    numbers += [plant.dead_time_s, plant.zeta or 0.0, plant.zero]
    parallel = plant.kind in ("parallel", "overshoot")
    return int(np.count_nonzero([*numbers, *(plant.tau2 if parallel else ())])) + parallel


def log_likelihood(fit: "Fit") -> float:
    """Of residuals as if they were independent and normal, of the variance that is most likely."""
    sse, _, n = sums(fit)
    return -n / 2 * (math.log(2 * math.pi * sse / n) + 1)


def residuals(fit: "Fit", steps: "StepSet | None" = None) -> "pandas.DataFrame":
    """Recorded and fitted output of the mean of each level's repeats, indexed by (level, time_s), or of logs fitted as
    recorded, by (log, time_s); `steps`: those of a fit that was read from a file."""
    if fit.samples.of_logs is not None:
        return fit.samples.of_logs(fit)
    steps = fit.samples.steps or steps
    if steps is None:
        raise DataError("this fit was read from a file and holds no samples; fit again")
    parts = {}
    for one in steps.levels:
        both = {"recorded": one.mean, "fitted": fit.curve(first_model(fit), one.level, one.time_s)}
        parts[one.level] = pandas.DataFrame(both, index=one.time_s)
    return pandas.concat(parts, names=["level", "time_s"])
