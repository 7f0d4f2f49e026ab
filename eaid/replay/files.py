"""replay.h5: `/<controller>/{time_s, reference_nm, torque_nm, duty_pct}` at the control rate, written whole or not
at all.

Beside them, where they differ: `measured_nm` (what the controller read), `applied_pct` (mean duty on the clutch
until the next sample); and what
a scenario adds (`extra`). The options and inputs are root attributes, the metrics of a controller the attribute
`metrics` (JSON) of its group.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.files import hdf5_written_whole
from eaid.logs.digest import check_digest, digest_of
from eaid.logs.walk import walk
from eaid.schema import METRICS, REPLAY
from eaid.shapes import Misshapen, Part, shaped

SCHEMA = "eaid/replay/1"
LARGEST = 1e30
"""Size from which no value of a column is believed: figures are drawn in single precision."""


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


def read_replay(path: Path, tell: Callable[[str], None] = lambda _: None) -> tuple[dict[str, Record], dict[str, Any]]:
    """Records by name, in the file's order of names, and the root attributes; `DataError` where it is no replay.h5.

    What they hold has the shapes of eaid/schema.py; `tell` gets a sentence about each part that is left out.
    """
    from eaid.logs.hdf import open_hdf5  # with them come the readers of logs, which writing does not need

    if not path.is_file():
        raise DataError(f"{path}: no such file; give the replay.h5 that eaid simulate wrote")
    if not h5py.is_hdf5(path):
        raise DataError(f"{path}: is no HDF5 file; give the replay.h5 that eaid simulate wrote")
    with open_hdf5(path, str(path)) as file:
        items = walk(file, str(path))
        if items[0].fact("schema") != SCHEMA:
            raise DataError(f"{path}: is no {SCHEMA} file; make it again with eaid simulate")
        check_digest(items, str(path), "make it again with eaid simulate")
        held = {key: _plain(value, path, key) for key, value in file.attrs.items() if key != "digest"}
        options = _checked(held, REPLAY, path, "", tell)
        records = {}
        for name, group in file.items():
            if not isinstance(group, h5py.Group) or "time_s" not in group:
                continue
            arrays: dict[str, Any] = {}
            group.visititems(lambda key, item, kept=arrays: _keep(key, item, kept))
            columns = _columns(arrays, f"{path}: {name}")
            tables = {key: array for key, array in arrays.items() if key not in columns}
            told = _plain(group.attrs.get("metrics", "{}"), path, "metrics")
            records[name] = Record(columns, _checked(told, METRICS, path, f"{name}.metrics", tell), tables)
        return records, options


def _columns(arrays: Mapping[str, Any], where: str) -> dict[str, Array]:
    """The arrays that are as long as the time, as numbers; raises DataError where they are none."""
    time = arrays["time_s"] if "time_s" in arrays else np.empty(0)
    if time.ndim != 1 or len(time) < 2:
        raise DataError(f"{where}: its time_s is no column of two samples or more; make it again with eaid simulate")
    columns = {}
    for key, array in arrays.items():
        if array.shape != time.shape or "/" in key:
            continue
        if array.dtype.kind not in "fiub" or not (np.abs(array.astype(np.float64)) < LARGEST).all():
            raise DataError(f"{where}: its {key} holds what is no number; make it again with eaid simulate")
        columns[key] = read_only(array)
    return columns


def _checked(value: Any, shape: Part, path: Path, name: str, tell: Callable[[str], None]) -> dict[str, Any]:
    left_out: list[str] = []
    try:
        found: dict[str, Any] = shaped(value, shape, name, left_out) or {}
    except Misshapen as fault:
        raise DataError(f"{path}: {fault}; make it again with eaid simulate") from None
    for sentence in left_out:
        tell(f"{path}: {sentence}")
    return found


def _keep(name: str, item: Any, kept: dict[str, Any]) -> None:
    """Every array of a group, those of its inner groups too, under its path."""
    if isinstance(item, h5py.Dataset):
        kept[name] = item[...]


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _plain(value: Any, path: Path, name: str) -> Any:
    """An attribute as Python has it; what was kept as JSON is read again."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if isinstance(value, str) and value[:1] in "{[":
        try:
            return json.loads(value)
        except (ValueError, RecursionError):
            raise DataError(f"{path}: its {name} is no JSON; make it again with eaid simulate") from None
    return value.tolist() if hasattr(value, "tolist") else value
