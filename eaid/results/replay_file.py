"""replay.h5: `/<name>/{time_s, reference_nm, torque_nm, duty_pct}` at the control rate, written whole or not at all.

Beside them, where they differ: `measured_nm` (what the controller read), `applied_pct` (mean duty on the clutch until
the next sample); and what a scenario adds. What the replay says of itself are root attributes, the metrics of a group
its attribute `metrics` (JSON), what it is its attribute `role`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.files import hdf5_written_whole
from eaid.findings import Finding
from eaid.logs.hdf import nodes, open_hdf5
from eaid.results.codec import digest_of, from_plain, to_plain
from eaid.results.replay import Head, Metrics, Record, Replay
from eaid.version import __version__

REPLAY_SCHEMA = "eaid/replay/1"
LARGEST_DRAWN = 1e30  # Size from which no value of a column is believed: figures are drawn in single precision
SIMULATE_AGAIN = "make it again with eaid simulate"


def plain_head(head: Head) -> dict[str, object]:
    """What a replay says of itself, as files have it; what it does not have is left out."""
    content = {key: value for key, value in to_plain(head).items() if value is not None}
    for name in ("band_quantiles", "not_usable", "findings"):
        if not content[name]:
            del content[name]
    if head.findings:
        content["warnings"] = [each["text"] for each in content["findings"]]
    return {"eaid": __version__, **content}


def plain_metrics(metrics: Metrics) -> dict[str, object]:
    """The metrics that a group has; inside steps and tones a number that is never reached stays null."""
    return {key: value for key, value in to_plain(metrics).items() if value not in (None, [], {})}


def as_json(replay: Replay) -> dict[str, object]:
    """What `simulate --json` prints: the head, and every group's metrics under the part it plays."""
    controllers, log = (
        {name: plain_metrics(metrics) for name, metrics in each.items()}
        for each in (replay.metrics(), replay.metrics("recorded-input"))
    )
    content = {"schema": REPLAY_SCHEMA, **plain_head(replay.head), "controllers": controllers}
    if log:
        content["log"] = log
    return {"schema": REPLAY_SCHEMA, "eaid": __version__, "digest": digest_of(content), **content}


def write_replay(path: Path, replay: Replay, force: bool = False) -> None:
    """Write a replay; attributes that are no number or text are kept as JSON. The same input gives the same bytes."""
    with hdf5_written_whole(path, force) as file:
        file.attrs["schema"] = REPLAY_SCHEMA
        for name, value in plain_head(replay.head).items():
            file.attrs[name] = value if isinstance(value, str | int | float) else msgspec.json.encode(value).decode()
        for name, record in replay.records.items():
            group = file.create_group(name)
            for column, values in {**record.columns, **record.tables}.items():
                array = np.asarray(values)
                squeezed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if array.ndim else {}
                group.create_dataset(column, data=array, track_times=False, **squeezed)
            group.attrs["role"] = record.role
            group.attrs["metrics"] = msgspec.json.encode(plain_metrics(record.metrics)).decode()


def read_replay_file(path: Path) -> tuple[Replay, tuple[Finding, ...]]:
    """A file of `REPLAY_SCHEMA`, groups in the file's order, and findings about what was left out; DataError where a
    value has another type than its key."""
    left_out: list[Finding] = []
    with open_hdf5(path, str(path)) as file:
        content = {key: _plain_attribute(value, path, key) for key, value in file.attrs.items()}
        records = {}
        for name, group in file.items():
            if not isinstance(group, h5py.Group) or "time_s" not in group:
                continue
            arrays = {key: item[...] for key, item in nodes(group) if isinstance(item, h5py.Dataset)}
            columns = _columns(arrays, f"{path}: {name}")
            tables = {key: array for key, array in arrays.items() if key not in columns}
            numbers = _plain_attribute(group.attrs.get("metrics", "{}"), path, "metrics")
            role = _plain_attribute(group.attrs.get("role", "controller"), path, "role")
            records[name] = Record(columns, from_plain(numbers, Metrics, f"{path}: {name}", left_out), tables, role)
        content.setdefault("scenario", "")
        return Replay(from_plain(content, Head, str(path), left_out), records), tuple(left_out)


def _columns(arrays: Mapping[str, Any], where: str) -> dict[str, Array]:
    """The arrays that are as long as the time, as numbers; raises DataError where they are none."""
    time = arrays["time_s"] if "time_s" in arrays else np.empty(0)
    if time.ndim != 1 or len(time) < 2:
        raise DataError(f"{where}: its time_s is no column of two samples or more; {SIMULATE_AGAIN}")
    columns = {}
    for key, array in arrays.items():
        if array.shape != time.shape or "/" in key:
            continue
        if array.dtype.kind not in "fiub" or not (np.abs(array.astype(np.float64)) < LARGEST_DRAWN).all():
            raise DataError(f"{where}: its {key} holds what is no number; {SIMULATE_AGAIN}")
        columns[key] = read_only(array)
    return columns


def _plain_attribute(value: Any, path: Path, name: str) -> Any:
    """An attribute as Python has it; what was kept as JSON is read again."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if isinstance(value, str) and value.startswith(("{", "[")):
        try:
            return msgspec.json.decode(value)
        except (msgspec.DecodeError, RecursionError):
            raise DataError(f"{path}: its {name} is no JSON; {SIMULATE_AGAIN}") from None
    return value.tolist() if hasattr(value, "tolist") else value
