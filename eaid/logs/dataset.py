"""data.h5: the tidy dataset, `/runs/<name>/{time_s,input,torque_nm}` with its facts as attributes (docs/contract.md).

Columns are compressed by gzip after shuffling: on recorded torque 0.31 of the raw size, read as fast as lzf (0.34).
No time stamps, names in order: the same runs give the same bytes.
"""

import dataclasses
import hashlib
import math
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import h5py
import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.files import hdf5_written_whole
from eaid.findings import Finding
from eaid.logs.hdf import digest_of, open_hdf5, text
from eaid.logs.run import INPUT_UNITS, Kind, Run
from eaid.version import __version__

SCHEMA = "eaid/data/1"
COLUMNS = ("time_s", "input", "torque_nm")
MORE = ("reference_nm", "position")
"""Columns that not every run has."""
LARGEST_START_S = 1e6
"""First time beyond which a run is counted from its own start [s]."""


def write_dataset(
    path: Path,
    runs: Sequence[Run],
    *,
    kind: Kind,
    apparatus: Apparatus,
    force: bool = False,
) -> None:
    """Write runs as data.h5, whole or not at all; `level`, `step_s` and `baseline` of each must be known."""
    units = {run.input_unit for run in runs}, {run.output_unit for run in runs}
    raw = sum(8 * 4 * len(run.time_s) for run in runs)
    with hdf5_written_whole(path, force, raw) as file:
        file.attrs["schema"] = SCHEMA
        file.attrs["eaid"] = __version__
        file.attrs["kind"] = kind
        file.attrs["input_unit"] = min(units[0], default=INPUT_UNITS[kind])
        file.attrs["output_unit"] = min(units[1], default="N·m")
        made_by = sorted({run.synthetic for run in runs if run.synthetic})
        if made_by:
            file.attrs["synthetic"] = "; ".join(made_by)
        for field in dataclasses.fields(apparatus):
            file.attrs[field.name] = getattr(apparatus, field.name)
        folder = file.create_group("runs")
        for run in runs:
            _write_run(folder, run)
        file.attrs["digest"] = digest_of(file)


def _write_run(folder: Any, run: Run) -> None:
    group = folder.create_group(run.name.replace("/", "_"))
    columns = {"time_s": run.time_s, "input": run.input, "torque_nm": run.output}
    if run.reference_nm is not None:
        columns["reference_nm"] = run.reference_nm
    if run.position is not None:
        columns["position"] = run.position
    for name, values in columns.items():
        group.create_dataset(
            name, data=np.asarray(values, dtype=np.float64), chunks=(min(len(values), 1 << 17),), compression="gzip",
            compression_opts=4, shuffle=True, track_times=False,
        )  # fmt: skip
    facts = {
        "level": run.level, "repeat": run.repeat, "step_s": run.step_s, "baseline_nm": run.baseline,
        "until_s": run.until_s, "before_nm": run.held, "source": run.source, "sha256": run.sha256,
        "edge": run.edge, "from_level": run.from_level, "start_s": run.start_s or None,
        "position_unit": run.position_unit or None, "rest_s": run.rest_s,
        "rest_moved": run.rest_moved or None,
    }  # fmt: skip
    for name, value in facts.items():
        if value is not None:
            group.attrs[name] = value
    if run.findings:
        group.attrs["findings"] = msgspec.json.encode(run.findings).decode()


class _Facts(msgspec.Struct):
    """Attributes of a run, all of which may be missing."""

    level: float | None = None
    repeat: int | None = None
    step_s: float | None = None
    until_s: float | None = None
    baseline_nm: float | None = None
    before_nm: float | None = None
    from_level: float | None = None
    start_s: float | None = None
    rest_s: float | None = None
    rest_moved: float | None = None
    position_unit: str = ""
    edge: str | None = None
    source: str = ""
    sha256: str = ""
    findings: str = "[]"

    def __post_init__(self) -> None:
        for field in self.__struct_fields__:
            value = getattr(self, field)
            if isinstance(value, float) and not math.isfinite(value):
                setattr(self, field, None)


def read_dataset(
    path: Path, source: str, sha256: str, each: Callable[[Run], Run] = lambda run: run
) -> tuple[list[Run], list[str]]:
    """Runs of a data.h5, in the order of their names, and what is wrong with the others, a sentence each.

    `each` is applied to every run before the next is read: what it shortens never lies in memory all at once.
    """
    with open_hdf5(path, source) as file:
        root = dict(file.attrs.items())
        schema = text(root.get("schema", ""))
        if schema != SCHEMA:
            raise DataError(
                f"{source}: its schema is {schema!r}, and this eaid reads {SCHEMA!r}; ingest the logs again"
            )
        kind = text(root.get("kind", "clutch"))
        if kind not in INPUT_UNITS:
            raise DataError(f"{source}: its kind is {kind!r}; it must be one of {', '.join(INPUT_UNITS)}")
        names = sorted(file["runs"]) if isinstance(file.get("runs"), h5py.Group) else []
        if not names:
            raise DataError(f"{source}: holds no runs; ingest the logs again")
        shared: dict[str, Any] = {
            "kind": kind,
            "input_unit": text(root.get("input_unit", INPUT_UNITS[kind])),
            "output_unit": text(root.get("output_unit", "N·m")),
            "apparatus": _apparatus(root, source),
            "synthetic": text(root["synthetic"]) if "synthetic" in root else None,
            "dataset": source,
        }
        unpacked = _Unpacked()
        runs: list[Run] = []
        faults: list[str] = []
        for name in names:
            try:
                runs.append(each(_read_run(file["runs"][name], name, sha256, unpacked, shared)))
            except DataError as fault:
                faults.extend(fault.sentences)
        return runs, faults


class _Unpacked:
    """Columns by their packed bytes: what runs have in common, such as a time axis, is unpacked once and shared."""

    def __init__(self) -> None:
        self._known: WeakValueDictionary[bytes, Array] = WeakValueDictionary()
        self._last: deque[Array] = deque(maxlen=6)
        """Kept for the next run, whatever becomes of the runs before."""

    def __getitem__(self, stored: h5py.Dataset) -> Array:
        if stored.chunks is None:
            return read_only(stored[()])
        packed = hashlib.sha256(
            repr((stored.shape, stored.dtype, stored.chunks, stored.compression, stored.shuffle)).encode()
        )
        for k in range(stored.id.get_num_chunks()):
            packed.update(stored.id.read_direct_chunk(stored.id.get_chunk_info(k).chunk_offset)[1])
        key = packed.digest()
        if (values := self._known.get(key)) is None:
            values = self._known[key] = read_only(stored[()])
        self._last.append(values)
        return values


def _plain(value: Any) -> Any:
    """An attribute as Python has it."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.size == 1):
        value = value.item()
    return text(value) if isinstance(value, bytes) else value


def _apparatus(attributes: Mapping[str, Any], source: str) -> Apparatus | None:
    """The rig of a dataset: one attribute a field, or all as JSON in one attribute `apparatus`."""
    said: dict[str, Any] = {}
    if "apparatus" in attributes:
        try:
            said = msgspec.json.decode(text(attributes["apparatus"]), type=dict[str, Any])
        except (msgspec.MsgspecError, ValueError):
            raise DataError(f"{source}: its apparatus is not a JSON object; ingest the logs again") from None
    names = {field.name for field in dataclasses.fields(Apparatus)}
    said = {name: _plain(value) for name, value in {**said, **attributes}.items() if name in names}
    try:
        return msgspec.convert(said, Apparatus, strict=False) if said else None
    except msgspec.ValidationError:
        raise DataError(f"{source}: its apparatus holds what is no number; ingest the logs again") from None


def _read_run(group: h5py.Group, name: str, sha256: str, unpacked: "_Unpacked", shared: dict[str, Any]) -> Run:
    where = f"{shared['dataset']}: run {name}"
    try:
        columns = {column: unpacked[group[column]] for column in (*COLUMNS, *MORE) if column in group}
        said = {key: _plain(value) for key, value in group.attrs.items()}
    except (OSError, RuntimeError, ValueError, TypeError):
        raise DataError(f"{where} is damaged and cannot be read; ingest the logs again") from None
    missing = [column for column in COLUMNS if column not in columns]
    if missing:
        raise DataError(f"{where} has no {' and no '.join(missing)}; ingest the logs again")
    if len({values.shape for values in columns.values()}) > 1 or columns["time_s"].ndim != 1:
        raise DataError(f"{where} has columns of different shape; ingest the logs again")
    try:
        facts = msgspec.convert(said, _Facts, strict=False)
        findings = msgspec.json.decode(facts.findings, type=tuple[Finding, ...])
    except msgspec.MsgspecError as fault:
        found = re.search(r"`\$\.(\w+)`$", str(fault))
        what = f"its {found[1]} is no number" if found else "its findings cannot be read"
        raise DataError(f"{where}: {what}; ingest the logs again") from None

    time_s, first = columns["time_s"], float(columns["time_s"][0]) if len(columns["time_s"]) else 0.0
    if abs(first) > LARGEST_START_S:  # a dataset of a script, on a clock since 1970
        time_s = read_only(time_s - first)
    else:
        first = 0.0
    return Run(
        name=name,
        time_s=time_s,
        input=columns["input"],
        output=columns["torque_nm"],
        source=facts.source or shared["dataset"],
        sha256=facts.sha256 or sha256,
        level=facts.level,
        repeat=facts.repeat,
        step_s=None if facts.step_s is None else facts.step_s - first,
        until_s=None if facts.until_s is None else facts.until_s - first,
        baseline=facts.baseline_nm,
        edge="falling" if facts.edge == "falling" else "rising",
        reference_nm=columns.get("reference_nm"),
        position=columns.get("position"),
        position_unit=facts.position_unit,
        findings=findings,
        start_s=(facts.start_s or 0.0) + first,
        from_level=facts.from_level or 0.0,
        held=facts.before_nm,
        rest_s=facts.rest_s,
        rest_moved=facts.rest_moved or 0.0,
        cut=facts.edge is not None,
        **shared,
    )
