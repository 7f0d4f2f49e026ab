"""Results as pandas: parameters, intervals and level tables of a fit; its curves at any input."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pandas as pd

from eaid.errors import DataError, UsageError
from eaid.models import linear, nonlinear
from eaid.results.codec import holds_part
from eaid.results.common import Interval, ci95_of

if TYPE_CHECKING:
    from eaid.results.fit import Fit

Cell = float | int | str | bool
Row = tuple[str, str, float, Interval]
MODELS = ("nonlinear", "linear", "friction")


def parameters(fit: "Fit") -> pd.Series:
    """All fitted parameters, indexed by (model, parameter)."""
    rows = list(_rows(fit))
    return pd.Series([value for *_, value, _ in rows], index=_index(rows), name="value", dtype=float)


def intervals(fit: "Fit") -> pd.DataFrame:
    """95 % intervals of the same parameters, columns `low` and `high`; NaN where the data say nothing of use."""
    rows = list(_rows(fit))
    ends = [(np.nan, np.nan) if interval is None else interval for *_, interval in rows]
    return pd.DataFrame(ends, index=_index(rows), columns=["low", "high"], dtype=float)


def _index(rows: Sequence[Row]) -> pd.MultiIndex:
    return pd.MultiIndex.from_tuples([row[:2] for row in rows], names=["model", "parameter"])


def _rows(fit: "Fit") -> Iterator[Row]:
    if (p := fit.nonlinear) is not None:
        for name in ("tau1", "tau2", "Ts"):
            values = getattr(p, name)
            found = getattr(p.ci95, name) if p.ci95 is not None else ()
            for i, value in enumerate(values):
                yield "nonlinear", f"{name}[{i}]", value, found[i] if i < len(found) else None
        yield "nonlinear", "C", p.C, ci95_of(p, "C")
    if (q := fit.linear) is not None:
        for name in ("a0", "b0", "c0"):
            yield "linear", name, getattr(q, name), ci95_of(q, name)
    if fit.friction is not None:
        for row in fit.friction.levels:
            for name in ("Ts", "tau1", "tau2"):
                yield "friction", f"{name}({row.level:g})", getattr(row, name), ci95_of(row, name)
    if fit.release is not None:
        yield "release", "tau1", fit.release.tau1, None
        yield "release", "tau2", fit.release.tau2, None


def cells_of(item: msgspec.Struct) -> dict[str, Cell]:
    """The fields of a result that are no parts of their own, by their keys; of intervals `ci95` both ends."""
    cells: dict[str, Cell] = {}
    for name, key in zip(item.__struct_fields__, item.__struct_encode_fields__, strict=True):
        value = getattr(item, name)
        if holds_part(type(item), name):
            for one in value.__struct_fields__ if name == "ci95" and value is not None else ():
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
    chosen = model or next((name for name in MODELS if getattr(fit, name) is not None), None)
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
