"""replay.h5: `/<controller>/{time_s, reference_nm, torque_nm, duty_pct}` at the control rate, written whole or not
at all.

Beside them, where they differ: `measured_nm` (what the controller read), `applied_pct` (mean duty on the clutch
until the next sample); and what
a scenario adds (`extra`). The options and inputs are root attributes, the metrics of a controller the attribute
`metrics` (JSON) of its group.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.files import hdf5_written_whole
from eaid.logs.digest import check_digest, digest_of
from eaid.logs.hdf import check_safe, open_hdf5
from eaid.logs.walk import walk

SCHEMA = "eaid/replay/1"


@dataclass(frozen=True, eq=False)
class Record:
    """One group of replay.h5: columns of one length by name, and what was measured on them."""

    columns: Mapping[str, Array]
    """`time_s` and others, each of shape (n,)."""
    metrics: Mapping[str, Any] = field(default_factory=dict)
    """JSON-able."""
    tables: Mapping[str, Array] = field(default_factory=dict)
    """Further arrays of any length, as `plants/band_nm`, in inner groups named before the slash."""


def write_replay(path: Path, records: Mapping[str, Record], attributes: Mapping[str, Any], force: bool = False) -> None:
    """Write records under their names; attributes that are no number or text are kept as JSON. The same input gives
    the same bytes."""
    with hdf5_written_whole(path, force) as file:
        file.attrs["schema"] = SCHEMA
        for name, value in attributes.items():
            file.attrs[name] = value if isinstance(value, str | int | float) else _json(value)
        for name, record in records.items():
            group = file.create_group(name)
            for column, values in {**record.columns, **record.tables}.items():
                array = np.asarray(values)
                squeezed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if array.ndim else {}
                group.create_dataset(column, data=array, track_times=False, **squeezed)
            if record.metrics:
                group.attrs["metrics"] = _json(record.metrics)
        file.attrs["digest"] = digest_of(walk(file))


def read_replay(path: Path) -> tuple[dict[str, Record], dict[str, Any]]:
    """Records by name, in the file's order of names, and the root attributes; `DataError` where it is no replay.h5."""
    if not path.is_file():
        raise DataError(f"{path}: no such file; give the replay.h5 that eaid simulate wrote")
    if not h5py.is_hdf5(path):
        raise DataError(f"{path}: is no HDF5 file; give the replay.h5 that eaid simulate wrote")
    with open_hdf5(path, str(path)) as file:
        items = walk(file)
        if items[0].fact("schema") != SCHEMA:
            raise DataError(f"{path}: is no {SCHEMA} file; make it again with eaid simulate")
        check_safe(items, str(path), path.stat().st_size)
        check_digest(items, str(path), "make it again with eaid simulate")
        records = {}
        for name, group in file.items():
            if not isinstance(group, h5py.Group) or "time_s" not in group:
                continue
            n = len(group["time_s"])
            arrays: dict[str, Any] = {}
            group.visititems(lambda key, item, kept=arrays: _keep(key, item, kept))
            columns = {key: read_only(array) for key, array in arrays.items() if array.shape == (n,) and "/" not in key}
            tables = {key: array for key, array in arrays.items() if key not in columns}
            records[name] = Record(columns, json.loads(group.attrs.get("metrics", "{}")), tables)
        return records, {key: _plain(value) for key, value in file.attrs.items() if key != "digest"}


def _keep(name: str, item: Any, kept: dict[str, Any]) -> None:
    """Every array of a group, those of its inner groups too, under its path."""
    if isinstance(item, h5py.Dataset):
        kept[name] = item[...]


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value[:1] in "{[":
        return json.loads(value)
    return value.item() if hasattr(value, "item") else value
