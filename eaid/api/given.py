"""What callers hand over: paths, tables or arrays, options, results or their files."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy

from eaid.errors import DataError, UsageError
from eaid.options import FitOptions
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.shown import pandas
from eaid.steps.stepset import StepSet

T = TypeVar("T")
AnyResult = Fit | Gains | Replay | StepSet | Coupling
File = str | os.PathLike[str]
Paths = File | Iterable[File]
GivenTables: TypeAlias = "pandas.DataFrame | Sequence[pandas.DataFrame] | Mapping[str, Any]"
OneColumn = str | int | None


def tables_in(source: Any) -> "pandas.DataFrame | Mapping[str, pandas.DataFrame] | None":
    """DataFrames in memory as `runs_from_frames` takes them; None: paths."""
    if hasattr(source, "columns"):
        return source  # type: ignore[no-any-return]
    if isinstance(source, Mapping):
        for name, one in source.items():
            if one is None or isinstance(one, str):
                raise DataError(f"{name}: is no DataFrame and no array")
        if any(hasattr(one, "columns") or isinstance(one, Mapping) for one in source.values()):
            return {name: one if hasattr(one, "columns") else table_of_arrays(one) for name, one in source.items()}
        return table_of_arrays(source)
    if isinstance(source, list | tuple) and source and all(hasattr(one, "columns") for one in source):
        return {f"run {k}": one for k, one in enumerate(source, 1)}
    return None


def table_of_arrays(columns: Any) -> "pandas.DataFrame":
    """Arrays by the names of their columns as one table; DataError where they are none, or of several lengths."""
    try:
        return pandas.DataFrame({name: numpy.ravel(one) for name, one in columns.items()})
    except (AttributeError, ValueError):
        found = (f"{name} of {numpy.size(one)}" for name, one in columns.items()) if hasattr(columns, "items") else ()
        said = ", ".join(found) or f"a {type(columns).__name__}"
        raise DataError(f"arrays by column: {said}; give as many values of time, input and output") from None


def given_data(data: Any, arrays: Sequence[Any], options: FitOptions | None) -> tuple[Any, FitOptions | None]:
    """What `fit` was given by place: data and options, or time, input and output."""
    if arrays and isinstance(arrays[-1], FitOptions):
        *arrays, options = arrays
    if not arrays:
        return data, options
    if len(arrays) != 2 or any(isinstance(one, str) for one in (data, *arrays)):
        raise UsageError("fit takes logs, or time, input and output as arrays; give FitOptions, or keywords")
    return dict(zip(("time_s", "input", "output"), (data, *arrays), strict=True)), options


def paths_in(source: Any) -> list[Path]:
    """One path or several as a list."""
    try:
        each = [source] if isinstance(source, str | os.PathLike) else list(source)
        if any(isinstance(one, str) and one == "" for one in each):
            raise UsageError("an empty path: give a file or a folder")
        return [Path(one) for one in each]
    except TypeError:
        shown = repr(source) if isinstance(source, int | float | None) else f"a {type(source).__name__}"
        raise UsageError(f"{shown}: give files or folders of logs, a DataFrame, or DataFrames by name") from None


def logs_in(source: Any) -> "list[Path] | pandas.DataFrame | Mapping[str, pandas.DataFrame]":
    """What a caller gave of logs: tables, or the paths of files."""
    tables = tables_in(source)
    return paths_in(source) if tables is None else tables


def as_result(value: Any) -> Any:
    """A result, or what its file holds."""
    from eaid.report.results import read_result

    return read_result(Path(value))[0] if isinstance(value, str | os.PathLike) else value


def result_of(name: str, value: Any, kind: type[T]) -> T:
    """A result of a kind, or what its file holds."""
    found = as_result(value)
    if not isinstance(found, kind):
        said = f"{value} holds {type(found).__name__}" if found is not value else f"is a {type(value).__name__}"
        made = {"Gains": "eaid.tune_rc", "Rig": "eaid.sessions"}.get(kind.__name__, "eaid.fit")
        raise UsageError(f"{name}: {said}; give what {made} returns, or its file")
    return found
