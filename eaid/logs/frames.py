"""DataFrames → runs, by the same column finding and checks as logs."""

import hashlib
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.read import together
from eaid.logs.run import Run
from eaid.logs.table import Cells, Table, seconds
from eaid.logs.to_run import run_of
from eaid.options import ReadOptions

if TYPE_CHECKING:
    import pandas as pd

RUN = "run"  # Column of a DataFrame with several runs that tells them apart


def runs_from_frames(frames: "pd.DataFrame | Mapping[str, pd.DataFrame]", options: ReadOptions) -> list[Run]:
    """Runs of a DataFrame with a column `run` (without one: a single run), or of {name: DataFrame}.

    Columns go by name, as in logs; stamps count as times; `frame.attrs["units"]`, a mapping of column to unit, says
    units that the names do not. Raises DataError with a sentence for every fault of every run.
    """
    runs: list[Run] = []
    faults: list[str] = []
    for name, frame in _parted(frames).items():
        try:
            if frame.empty:
                raise DataError(f"{name}: the DataFrame is empty; give rows with columns of time, input and output")
            table = _table(name, frame)
            digest = hashlib.sha256(repr((table.columns, table.units)).encode())
            for values in table.load(range(len(table.columns))).values:
                digest.update(np.ascontiguousarray(values).data)
            runs.append(run_of(name, name, digest.hexdigest(), [table], options))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    return together(runs, options)


def _parted(frames: "pd.DataFrame | Mapping[str, pd.DataFrame]") -> "dict[str, pd.DataFrame]":
    if not isinstance(frames, Mapping):
        frame = _with_index(frames)
        if RUN not in frame.columns:
            return {RUN: frame}
        if unnamed := int(frame[RUN].isna().sum()):
            raise DataError(
                f"{unnamed} of {len(frame)} rows have no name in the column {RUN}; say of each row which run it is of"
            )
        frames = dict(iter(frame.drop(columns=RUN).groupby(frame[RUN], sort=False)))
    counts = Counter(str(name) for name in frames)
    if (twice := counts.most_common(1)) and twice[0][1] > 1:
        raise DataError(f"{twice[0][0]}: is the name of two runs, a number and a text; give each a name of its own")
    other = next((name for name, frame in frames.items() if not hasattr(frame, "columns")), None)
    if other is not None:
        raise DataError(f"{other}: is no DataFrame; give pandas.DataFrame(…), or DataFrames by the names of their runs")
    return {str(name): _with_index(frame) for name, frame in frames.items()}


def _with_index(frame: "pd.DataFrame") -> "pd.DataFrame":
    """A frame whose index, where it has a name or holds times, is a column."""
    if frame.index.nlevels == 1 and frame.index.dtype.kind in "mM" and frame.index.name is None:
        frame = frame.rename_axis("time")
    return frame.reset_index() if any(name is not None for name in frame.index.names) else frame


def _table(name: str, frame: "pd.DataFrame") -> Table:
    columns = {str(label): _array(frame[label]) for label in frame.columns if frame[label].ndim == 1}
    if len(columns) < len(frame.columns):
        raise DataError(f"{name}: several columns have one name; give each a name of its own")
    numbers = {label: values for label, values in columns.items() if values.dtype.kind in "fiub"}
    units = {str(label): "s" for label in frame.columns if frame[label].dtype.kind in "mM"}
    declared = tuple(str({**frame.attrs.get("units", {}), **units}.get(label, "")) for label in numbers)
    dropped = tuple(label for label in columns if label not in numbers)
    values = tuple(numbers.values())
    stamped = tuple(i for i, label in enumerate(numbers) if label in units)
    return Table(
        "", tuple(numbers), lambda wanted: Cells(tuple(values[i] for i in wanted)), declared, stamped=stamped,
        dropped=dropped,
    )  # fmt: skip


def _array(column: "pd.Series[Any]") -> np.ndarray[Any, Any]:
    """A column as NumPy has it; stamps as seconds since the first; decimals and texts as numbers, if most of it is."""
    zoned = getattr(column.dtype, "tz", None) is not None
    values = column.to_numpy(dtype="datetime64[ns]") if zoned else np.asarray(column)
    if values.dtype.kind in "mM":
        return seconds(values)
    if values.dtype.kind not in "OSU":
        return values
    import pandas as pd

    numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(dtype=np.float64)
    return numbers if len(numbers) and np.isfinite(numbers).mean() > 0.5 else values
