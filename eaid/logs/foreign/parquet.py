"""Parquet, and Arrow files (Feather v2): one table of numeric columns; units from the metadata of a column.

Time stamps become seconds since the first.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.foreign.signals import seconds
from eaid.logs.table import BadCell, Cells, Table


def read_parquet(path: Path, source: str) -> list[Table]:
    """The one table of a Parquet file; raises DataError where it holds no columns of numbers."""
    from pyarrow import parquet

    def column(name: str) -> Any:
        with parquet.ParquetFile(str(path), page_checksum_verification=True) as file:
            return file.read(columns=[name], use_threads=False).column(0)

    with parquet.ParquetFile(str(path)) as file:
        return [_table(file.schema_arrow, column, source)]


def read_arrow(path: Path, source: str) -> list[Table]:
    """The one table of an Arrow file; raises DataError as for Parquet."""
    from pyarrow import OSFile, ipc

    def column(name: str) -> Any:
        with OSFile(str(path)) as opened:
            table = ipc.open_file(opened).read_all()
        table.validate(full=True)
        return table.column(name)

    with OSFile(str(path)) as opened:
        return [_table(ipc.open_file(opened).schema, column, source)]


def _table(schema: Any, column: Callable[[str], Any], source: str) -> Table:
    from pyarrow import types

    kinds = (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean, types.is_timestamp,
             types.is_duration)  # fmt: skip
    numeric = [field for field in schema if any(is_it(field.type) for is_it in kinds)]
    names = tuple(field.name for field in numeric)
    if not names:
        raise DataError(f"{source}: holds no columns of numbers; save time and torque as such")
    twice = [name for name in names if schema.names.count(name) > 1]
    if twice:
        raise DataError(f"{source}: several columns are called {twice[0]}; save it with names of their own")
    said = {_text(k).lower(): _text(v)[:500] for k, v in (schema.metadata or {}).items()}

    def load(wanted: Sequence[int]) -> Cells:
        columns, bad = [], list[BadCell]()
        for i in wanted:
            values, empty = _column(column(names[i]))
            bad.extend(BadCell(int(row), i, "") for row in empty)
            columns.append(values)
        return Cells(tuple(columns), tuple(bad))

    units = tuple(_unit(field, types) for field in numeric)
    dropped = tuple(field.name for field in schema if field.name not in names)
    return Table("", names, load, units, synthetic=said.get("synthetic"), dropped=dropped)


def _text(value: bytes) -> str:
    return value.decode("utf-8", errors="replace")


def _unit(field: Any, types: Any) -> str:
    if types.is_timestamp(field.type) or types.is_duration(field.type):
        return "s"
    said = {_text(key).lower(): _text(value) for key, value in (field.metadata or {}).items()}
    return said.get("unit", said.get("units", ""))


def _column(chunked: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Values of a column, and the rows that are empty."""
    empty = np.flatnonzero(np.asarray(chunked.is_null())) if chunked.null_count else np.empty(0, np.intp)
    if str(chunked.type).startswith("decimal"):
        chunked = chunked.cast("float64")
    values = chunked.to_numpy()
    if values.dtype.kind in "mM":
        known = values[~np.isnat(values)]
        values = seconds(values, known[0]) if len(known) else np.full(len(values), np.nan)
    if len(empty):
        values = np.array(values, dtype=np.float64)
        values[empty] = np.nan
    return values, empty
