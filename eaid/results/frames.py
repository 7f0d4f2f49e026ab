"""Results as pandas: parameters, intervals and level tables of a fit; its curves at any input."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pandas as pd
from scipy.special import stdtrit

from eaid.errors import DataError, UsageError
from eaid.models import linear, nonlinear
from eaid.results.codec import holds_part

if TYPE_CHECKING:
    from eaid.results.fit import Fit

Cell = float | int | str | bool
MODELS = ("nonlinear", "linear", "friction")


def parameters(fit: "Fit") -> pd.Series:
    """All fitted parameters, indexed by (model, parameter)."""
    values = [np.nan if row.value is None else row.value for row in fit.parameters]
    return pd.Series(values, index=_index(fit), name="value", dtype=float)


def intervals(fit: "Fit", alpha: float = 0.05) -> pd.DataFrame:
    """Intervals of the same parameters, columns `low` and `high`; NaN where the data say nothing of use.

    Those of another confidence than 95 % by Student's t: of what is above 0 throughout on its logarithm.
    """
    if not 0 < alpha < 1:
        raise UsageError(f"«alpha» {alpha:g}: must lie between 0 and 1")
    ends = [[np.nan if end is None else end for end in (row.low, row.high)] for row in fit.parameters]
    if alpha != 0.05:
        for row, pair in zip(fit.parameters, ends, strict=True):
            dof = np.inf if row.dof is None else row.dof
            ratio = float(stdtrit(min(dof, 1e12), 1 - alpha / 2) / stdtrit(min(dof, 1e12), 0.975))
            if row.value is not None and row.low is not None and row.high is not None:
                pair[:] = _rescaled(row.value, row.low, row.high, ratio)
    return pd.DataFrame(ends, index=_index(fit), columns=["low", "high"], dtype=float)


def _rescaled(value: float, low: float, high: float, ratio: float) -> tuple[float, float]:
    if low > 0 and value > 0:
        return value * (low / value) ** ratio, value * (high / value) ** ratio
    return value + ratio * (low - value), value + ratio * (high - value)


def _index(fit: "Fit") -> pd.MultiIndex:
    rows = [(one.model, one.name if one.level is None else f"{one.name}({one.level:g})") for one in fit.parameters]
    return pd.MultiIndex.from_tuples(rows, names=["model", "parameter"])


def at(fit: "Fit", level: float) -> pd.DataFrame:
    """T_s, τ1 and τ2 at an input, with the ends of their 95 % intervals."""
    names = ("Ts", "tau1", "tau2")
    rows = {
        one.name: one for one in fit.parameters if one.level is not None and np.isclose(one.level, level, rtol=1e-9)
    }
    if set(names) <= set(rows):
        found = [(rows[name].value, rows[name].low, rows[name].high) for name in names]
        return pd.DataFrame(found, index=list(names), columns=["value", "low", "high"], dtype=float)
    p = fit.nonlinear
    if p is None or not p.u_range[0] <= level <= p.u_range[1]:
        low, high = p.u_range if p is not None else (min(fit.data.levels), max(fit.data.levels))
        inside = "" if p is not None else "the levels "
        raise UsageError(
            f"«level» {level:g}: the fit knows {inside}{low:g} … {high:g} {fit.data.input_unit}".rstrip() + " only"
        )
    values = (nonlinear.steady_torque(p.parameters, level), *nonlinear.time_constants(p.parameters, level))
    V = covariance(fit) if p.covariance is not None else None
    found = []
    for name, value in zip(names, map(float, values), strict=True):
        reach = np.nan
        if V is not None and value > 0:
            own = [f"{name}[{k}]" for k in range(len(getattr(p, name)))]
            g = (level / 100) ** np.arange(len(own)) / value
            dof = p.covariance.degrees_of_freedom.get(name) if p.covariance is not None else None
            reach = float(stdtrit(dof or 1e12, 0.975) * np.sqrt(g @ V.loc[own, own].to_numpy() @ g))
        found.append((value, value * np.exp(-reach), value * np.exp(reach)))
    return pd.DataFrame(found, index=list(names), columns=["value", "low", "high"], dtype=float)


def covariance(fit: "Fit") -> pd.DataFrame:
    """Covariance of the nonlinear model's coefficients of (u/100)^k."""
    held = fit.nonlinear.covariance if fit.nonlinear is not None else None
    if held is None or not held.matrix:
        raise DataError("the fit holds no covariance; fit a nonlinear model with «ci» robust")
    return pd.DataFrame(held.matrix, index=list(held.order), columns=list(held.order), dtype=float)


def residuals(fit: "Fit") -> pd.Series:
    """Recorded less fitted, indexed by (level, time_s)."""
    steps = fit.__dict__.get("steps_fitted")
    if steps is None:
        raise DataError("this fit was read from a file, or is of logs as recorded, and holds no samples; fit again")
    model = _model_of(fit)
    parts: dict[float, pd.Series] = {
        level.level: pd.Series(level.mean - _curve(fit, model, level.level, level.time_s), index=level.time_s)
        for level in steps.levels
    }
    whole: pd.Series = pd.concat(parts, names=["level", "time_s"])
    return whole.rename("residual")


def scores(fit: "Fit") -> tuple[float, float, float]:
    """RMSE, R² and AIC of the first model that was fitted; coefficients that the levels do not allow are 0."""
    model = _model_of(fit)
    part = getattr(fit, model)
    if model == "friction":
        rows = [row for row in part.levels if row.sse and row.rmse and row.R2 is not None]
        if not rows:
            return np.nan, np.nan, np.nan
        sse, free = sum(row.sse for row in rows), (3 + (part.C is None)) * len(rows)
        rmse = float(np.sqrt(sse / sum(row.sse / row.rmse**2 for row in rows)))
        R2 = 1 - sse / sum(row.sse / (1 - row.R2) for row in rows)
    else:
        rmse, R2, sse = part.rmse, part.R2, part.sse
        values = (part.a0, part.b0, part.c0) if model == "linear" else (*part.Ts, *part.tau1, *part.tau2)
        free = int(np.count_nonzero(values)) + (model == "nonlinear" and part.C_free)
    if not (sse and rmse):
        return rmse, R2, np.nan
    count = sse / rmse**2
    return rmse, R2, count * np.log(sse / count) + 2 * (free + 1)


def _model_of(fit: "Fit") -> str:
    found = next((name for name in MODELS if getattr(fit, name) is not None), None)
    if found is None:
        raise DataError("the fit holds no model of steps")
    return found


def cells_of(item: msgspec.Struct) -> dict[str, Cell]:
    """The fields of a result that are no parts of their own, by their keys; of intervals `ci95` both ends."""
    cells: dict[str, Cell] = {}
    for name, key in zip(item.__struct_fields__, item.__struct_encode_fields__, strict=True):
        value = getattr(item, name)
        if holds_part(type(item), name):
            ends = value.__struct_fields__ if name == "ci95" and value is not None else ()
            for one in (each for each in ends if each != "dof"):
                low, high = getattr(value, one) or (np.nan, np.nan)
                cells |= {f"{one}_low": low, f"{one}_high": high}
        elif value is None or isinstance(value, Cell):
            cells[key] = np.nan if value is None else value
    return cells


def frame_of(items: Iterable[msgspec.Struct]) -> pd.DataFrame:
    """One row a result, one column a field."""
    return pd.DataFrame([cells_of(item) for item in items])


def levels(fit: "Fit") -> pd.DataFrame:
    """One row a level, or a step between two: its own curve with intervals, and each model's error."""
    rows: dict[tuple[float, float], dict[str, Cell]] = {}
    for one in fit.friction_levels:
        row = cells_of(one)
        rows[one.from_, one.level] = {key: row[key] for key in row if key != "level"}
    for name in ("nonlinear", "linear"):
        part = getattr(fit, name)
        for error in part.per_level if part is not None else ():
            cells = {f"{name}_rmse": error.rmse, f"{name}_fit_pct": error.fit_pct}
            if name == "linear":
                cells |= {"a0": error.a0, "gain": error.gain, "B": error.B}
            level_row = rows.setdefault((0.0, error.level), {})
            level_row |= {key: np.nan if value is None else value for key, value in cells.items()}
    return pd.DataFrame(list(rows.values()), index=pd.Index([level for _, level in rows], name="level", dtype=float))


def predict(fit: "Fit", duty: float | Sequence[float], t: Sequence[float], model: str | None = None) -> pd.DataFrame:
    """The output after a step from rest to each input.

    Parameters
    ----------
    duty : float or sequence of floats
        Inputs, in the input's unit.
    t : sequence of floats, shape (n,)
        Times since the step [s]; before it the output is at rest.
    model : {"nonlinear", "linear", "friction"}, optional
        By default the nonlinear model, else the first that was fitted. The friction model knows its own levels only.

    Returns
    -------
    DataFrame, shape (n, inputs)
        The output in its own unit, time as the index, inputs as columns.

    Raises
    ------
    UsageError
        An input outside the fitted range, of which the data say nothing.
    """
    chosen = model or _model_of(fit)
    if chosen not in MODELS:
        raise UsageError(f"«model» {chosen}: must be one of {', '.join(MODELS)}")
    part = getattr(fit, chosen)
    if part is None:
        raise DataError(f"the fit holds no {chosen} model; fit one, or choose another «model»")
    time = np.asarray(t, dtype=np.float64)
    inputs = [float(u) for u in np.atleast_1d(np.asarray(duty, dtype=np.float64))]
    known = fit.data.levels if fit.recorded is None else fit.recorded.u_range
    low, high = min(known, default=-np.inf), max(known, default=np.inf)
    for u in inputs:
        if not low <= u <= high:
            raise UsageError(f"«duty» {u:g}: the fit knows {low:g} … {high:g} {fit.data.input_unit}".rstrip() + " only")
    columns = [_curve(fit, chosen, u, np.maximum(time, 0.0)) for u in inputs]
    return pd.DataFrame(
        np.column_stack(columns),
        index=pd.Index(time, name="time_s"),
        columns=pd.Index(inputs, name=f"{chosen} [{fit.data.input_unit}]"),
    )


def _curve(fit: "Fit", model: str, duty: float, time_s: np.ndarray) -> np.ndarray:
    if model == "nonlinear" and fit.nonlinear is not None:
        return nonlinear.step_response(fit.nonlinear.parameters, time_s, duty)
    if model == "linear" and fit.linear is not None:
        return linear.step_response(fit.linear.parameters, time_s, duty)
    for row in fit.friction_levels:
        if np.isclose(row.level, duty) and row.from_ == 0:
            return row.predict(time_s)
    known = ", ".join(f"{row.level:g}" for row in fit.friction_levels)
    raise UsageError(f"«duty» {duty:g}: the friction model knows the levels {known} only")
