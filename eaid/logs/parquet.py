"""Parquet: one table of numeric columns; units from the metadata of a column; stamps become seconds since the first."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.extras import damage_told, library
from eaid.logs.hdf import MOST_VALUES
from eaid.logs.sheet import BadCell, Cells, Sheet
from eaid.logs.signals import seconds

WHAT = "Parquet"
MOST_RATIO = 200
"""A column that unpacks to more than this many times the size of its file is a bomb (recorded torque: about 4)."""


def read_parquet(path: Path, source: str) -> list[Sheet]:
    """The one sheet of a Parquet file; raises DataError where it holds no columns of numbers."""
    parquet = library("pyarrow.parquet", source, WHAT)
    types = library("pyarrow", source, WHAT).types
    with damage_told(source, WHAT), parquet.ParquetFile(str(path)) as file:
        schema = file.schema_arrow
        _check_size(source, file.metadata, path.stat().st_size)
        numeric = [
            field
            for field in schema
            if types.is_integer(field.type) or types.is_floating(field.type) or types.is_decimal(field.type)
            or types.is_boolean(field.type) or types.is_timestamp(field.type) or types.is_duration(field.type)
        ]  # fmt: skip
        said = {_text(k): _text(v) for k, v in (schema.metadata or {}).items()}
        names = [field.name for field in numeric]
        units = tuple(_unit(field, types) for field in numeric)
    if not names:
        raise DataError(f"{source}: holds no columns of numbers; save time and torque as such")
    twice = [name for name in names if schema.names.count(name) > 1]
    if twice:
        raise DataError(f"{source}: several columns are called {twice[0]}; save it with names of their own")
    facts = {key: value for key, value in said.items() if len(value) < 500 and "ARROW" not in key}
    return [Sheet("", tuple(names), _loader(path, source, names), units, None, 0.0, facts)]


def _check_size(source: str, metadata: Any, size: int) -> None:
    """Refuse a table that claims to be far larger than its file."""
    rows = metadata.num_rows
    packed = sum(metadata.row_group(i).total_byte_size for i in range(metadata.num_row_groups))
    if not 0 <= rows <= MOST_VALUES or max(8 * rows, packed) > max(MOST_RATIO * size, 1 << 24):
        raise DataError(
            f"{source}: claims {rows:.3g} rows, {packed:.3g} bytes, in a file of {size:,} bytes; no log does"
        )


def _text(value: bytes) -> str:
    return value.decode("utf-8", errors="replace")


def _unit(field: Any, types: Any) -> str:
    if types.is_timestamp(field.type) or types.is_duration(field.type):
        return "s"
    said = {_text(key).lower(): _text(value) for key, value in (field.metadata or {}).items()}
    return said.get("unit", said.get("units", ""))


def _loader(path: Path, source: str, names: Sequence[str]) -> Callable[[Sequence[int]], Cells]:
    def load(wanted: Sequence[int]) -> Cells:
        parquet = library("pyarrow.parquet", source, WHAT)
        columns: list[Array] = []
        bad: list[BadCell] = []
        with damage_told(source, WHAT), parquet.ParquetFile(str(path), page_checksum_verification=True) as file:
            for i in wanted:
                chunked = file.read(columns=[names[i]], use_threads=False).column(0)
                nulls = np.flatnonzero(np.asarray(chunked.is_null())) if chunked.null_count else ()
                if str(chunked.type).startswith("decimal"):
                    chunked = chunked.cast("float64")
                values = chunked.to_numpy()
                if values.dtype.kind in "mM":
                    known = values[~np.isnat(values)]
                    values = seconds(values, known[0]) if len(known) else np.full(len(values), np.nan)
                values = np.asarray(values, dtype=np.float64)
                if len(nulls):
                    values = np.array(values)
                    values[nulls] = np.nan
                    bad.extend(BadCell(int(row), i, "") for row in nulls)
                columns.append(read_only(values))
        return Cells(tuple(columns), tuple(bad))

    return load
