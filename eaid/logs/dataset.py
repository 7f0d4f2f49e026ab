"""data.h5: the tidy dataset, `/runs/<name>/{time_s,input,torque_nm}` with its facts as attributes (docs/contract.md).

Columns are compressed by gzip after shuffling: on recorded torque 0.31 of the raw size, read as fast as lzf (0.34).
No time stamps, names in order: the same runs give the same bytes.
"""

import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.files import hdf5_written_whole
from eaid.findings import Finding, finding
from eaid.logs.hdf import attributes, open_hdf5
from eaid.logs.rows import checked
from eaid.logs.run import INPUT_UNITS, Run
from eaid.logs.table import plain
from eaid.options import ExperimentKind
from eaid.version import __version__

SCHEMA = "eaid/data/1"
# Each dataset's name and the field of `Run`; the columns that every run has, and those that some have
DATASET_COLUMNS = {"time_s": "time_s", "input": "input", "torque_nm": "output"}
BESIDE = {"reference_nm": "reference_nm", "position": "position"}
INGEST_AGAIN = "ingest the logs again"


class _Root(msgspec.Struct, omit_defaults=True):
    """Attributes of the file, but for those of the rig."""

    schema: str = ""
    eaid: str = ""
    kind: str = "clutch"
    input_unit: str | None = None
    output_unit: str = "N·m"
    synthetic: str | None = None


class _Facts(msgspec.Struct):
    """Attributes of a run, each a field of `Run`; all of them may be missing."""

    level: float | None = None
    repeat: int | None = None
    step_s: float | None = None
    baseline: float | None = msgspec.field(default=None, name="baseline_nm")
    until_s: float | None = None
    held: float | None = msgspec.field(default=None, name="before_nm")
    source: str | None = None
    sha256: str | None = None
    edge: str | None = None
    from_level: float | None = None
    start_s: float = 0.0
    position_unit: str = ""
    rest_s: float | None = None
    rest_moved: float = 0.0
    swept: bool = False


def write_dataset(
    path: Path, runs: Sequence[Run], *, kind: ExperimentKind, apparatus: Apparatus | None, force: bool = False
) -> None:
    """Write runs as data.h5, whole or not at all: steps, or logs as they were recorded, without a level."""
    made_by = sorted({run.synthetic for run in runs if run.synthetic})
    input_unit = min((run.input_unit for run in runs), default=INPUT_UNITS[kind])
    output_unit = min((run.output_unit for run in runs), default="N·m")
    root = _Root(SCHEMA, __version__, kind, input_unit, output_unit, "; ".join(made_by) or None)
    with hdf5_written_whole(path, force) as file:
        rig = dataclasses.asdict(apparatus) if apparatus is not None else {}
        for name, value in (msgspec.structs.asdict(root) | rig).items():
            if value is not None:
                file.attrs[name] = value
        folder = file.create_group("runs")
        for run in runs:
            group = folder.create_group(run.name.replace("/", "_"))
            for name, field in (DATASET_COLUMNS | BESIDE).items():
                if (values := getattr(run, field)) is not None:
                    group.create_dataset(
                        name, data=np.asarray(values, dtype=np.float64), chunks=(min(len(values), 1 << 17),),
                        compression="gzip", compression_opts=4, shuffle=True, track_times=False,
                    )  # fmt: skip
            for fact in msgspec.structs.fields(_Facts):
                value = getattr(run, fact.name)
                if value != fact.default and (fact.name != "edge" or run.level is not None):
                    group.attrs[fact.encode_name] = value
            if run.findings:
                group.attrs["findings"] = msgspec.json.encode(run.findings).decode()


def read_dataset(path: Path, source: str, sha256: str, repair: bool) -> tuple[list[Run], list[str]]:
    """Runs of a data.h5, in the order of their names, and what is wrong with the others, a sentence each."""
    with open_hdf5(path, source) as file:
        stored = attributes(file)
        root = msgspec.convert(stored, _Root, strict=False)
        if root.schema != SCHEMA:
            raise DataError(f"{source}: its schema is {root.schema!r}, and this eaid reads {SCHEMA!r}; {INGEST_AGAIN}")
        if root.kind not in INPUT_UNITS:
            raise DataError(f"{source}: its kind is {root.kind!r}; it must be one of {', '.join(INPUT_UNITS)}")
        names = sorted(file["runs"]) if isinstance(file.get("runs"), h5py.Group) else []
        if not names:
            raise DataError(f"{source}: holds no runs; {INGEST_AGAIN}")
        rig = {field.name: stored[field.name] for field in dataclasses.fields(Apparatus) if field.name in stored}
        try:
            apparatus = msgspec.convert(rig, Apparatus, strict=False) if rig else None
        except msgspec.ValidationError:
            raise DataError(f"{source}: its apparatus holds what is no number; {INGEST_AGAIN}") from None
        none = np.empty(0)
        input_unit = INPUT_UNITS[root.kind] if root.input_unit is None else root.input_unit
        shared = Run(
            "", none, none, none, plain(input_unit), plain(root.output_unit), source, sha256,
            kind=root.kind, apparatus=apparatus, synthetic=_plain(root.synthetic), dataset=source,  # type: ignore[arg-type]
        )  # fmt: skip
        runs: list[Run] = []
        faults: list[str] = []
        for name in names:
            try:
                runs.append(_read_run(file["runs"][name], dataclasses.replace(shared, name=plain(name)), repair))
            except DataError as fault:
                faults.extend(fault.sentences)
        return runs, faults


def _plain(value: Any) -> Any:
    """What JSON holds, its texts without unseen characters."""
    if isinstance(value, list):
        return [_plain(one) for one in value]
    if isinstance(value, dict):
        return {plain(key): _plain(one) for key, one in value.items()}
    return plain(value) if isinstance(value, str) else value


def _read_run(group: h5py.Group, shared: Run, repair: bool) -> Run:
    where = shared.where
    try:
        columns = {
            field: read_only(group[name][()]) for name, field in (DATASET_COLUMNS | BESIDE).items() if name in group
        }
        stored = attributes(group)
    except (OSError, RuntimeError, ValueError, TypeError):
        raise DataError(f"{where} is damaged and cannot be read; {INGEST_AGAIN}") from None
    missing = [name for name, field in DATASET_COLUMNS.items() if field not in columns]
    if missing:
        raise DataError(f"{where} has no {' and no '.join(missing)}; {INGEST_AGAIN}")
    if len({values.shape for values in columns.values()}) > 1 or columns["time_s"].ndim != 1:
        raise DataError(f"{where} has columns of different shape; {INGEST_AGAIN}")
    try:
        facts = msgspec.structs.asdict(msgspec.convert(stored, _Facts))
        written = msgspec.json.decode(str(stored.get("findings", "[]")))
        findings = msgspec.convert(_plain(written), tuple[Finding, ...])
    except msgspec.MsgspecError as fault:
        match = re.search(r"`\$\.(\w+)`$", str(fault))
        what = f"its {match[1]} is no number" if match else "its findings cannot be read"
        raise DataError(f"{where}: {what}; {INGEST_AGAIN}") from None
    endless = {name for name, value in facts.items() if isinstance(value, float) and not math.isfinite(value)}
    fields = {name: _plain(value) for name, value in facts.items() if value not in (None, "") and name not in endless}
    fields |= {"edge": "falling" if facts["edge"] == "falling" else "rising", "cut": facts["edge"] is not None}
    run = dataclasses.replace(shared, **columns, **fields, findings=findings)  # type: ignore[arg-type]  # by field
    rows = {"time": run.time_s, "input": run.input, "output": run.output}
    if np.isnan(run.input).all():
        del rows["input"]
    keep = checked(where, rows, {}, lambda i: f"sample {i + 1}", repair)
    if keep is not None:
        dropped = finding("rows-dropped", run.name, dropped=len(run.time_s) - len(keep), count=len(run.time_s))
        run = run.part(keep, findings=(*run.findings, dropped))
    first = float(run.time_s[0]) if len(run.time_s) else 0.0
    if abs(first) <= 1e6:  # beyond it a run is counted from its own start [s]
        return run
    step_s, until_s = (None if at is None else at - first for at in (run.step_s, run.until_s))
    time_s = read_only(run.time_s - first)  # a dataset of a script, on a clock since 1970
    return dataclasses.replace(run, time_s=time_s, step_s=step_s, until_s=until_s, start_s=run.start_s + first)
