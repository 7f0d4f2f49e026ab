"""National Instruments TDMS: channels in groups, with waveform properties (start, offset, increment) and units.

Values come scaled, as npTDMS scales them. Channels without waveform properties are columns of equally long vectors, of
which one has to be the time.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.foreign.signals import Signal, seconds, tables_of_signals
from eaid.logs.table import Cells, Table


def read_tdms(path: Path, source: str) -> list[Table]:
    """Tables of a TDMS file: the channels with a sample rate together, and the vectors of each group."""
    import nptdms

    file = nptdms.TdmsFile.read_metadata(str(path))
    if file.file_status.incomplete_final_segment:
        raise DataError(f"{source}: is cut short: its last segment ends early; copy it again, or record it again")
    signals: list[Signal] = []
    vectors: dict[tuple[str, int], list[tuple[str, str]]] = {}
    dropped: list[str] = []
    channels = [channel for group in file.groups() for channel in group.channels()]
    starts = [channel.properties.get("wf_start_time") for channel in channels]
    known = [start for start in starts if isinstance(start, np.datetime64) and not np.isnat(start)]
    origin = min(known, default=None)
    for channel, start in zip(channels, starts, strict=True):
        kind = np.dtype(channel.dtype).kind
        if not len(channel) or kind not in "fiubM":
            dropped.append(str(channel.name))
            continue
        said = channel.properties
        unit = str(said.get("unit_string") or said.get("NI_UnitDescription") or "")
        increment = said.get("wf_increment")
        group, name = str(channel.group_name), str(channel.name)
        if kind == "M" or not isinstance(increment, float) or not 0 < increment < np.inf:
            vectors.setdefault((group, len(channel)), []).append((name, "s" if kind == "M" else unit))
            continue
        begin = float(said.get("wf_start_offset") or 0.0)
        if origin is not None and start in known:
            begin += float((start - origin) / np.timedelta64(1, "ns")) * 1e-9
        clock = (begin, increment, len(channel))
        signals.append(Signal(name, unit, group, clock, partial(_signal, path, group, name, begin, increment)))
    tables = tables_of_signals(source, signals)
    for (group, _), columns in vectors.items():
        names = tuple(name for name, _ in columns)
        units = tuple(unit for _, unit in columns)
        tables.append(Table(group, names, partial(_vectors, path, group, names), units, dropped=tuple(dropped)))
    if not tables:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables


def _read(path: Path, group: str, name: str) -> np.ndarray[Any, Any]:
    import nptdms

    with nptdms.TdmsFile.open(str(path)) as file:
        return np.asarray(file[group][name][:])


def _signal(path: Path, group: str, name: str, begin: float, increment: float) -> tuple[Array, Array]:
    values = np.asarray(_read(path, group, name), dtype=np.float64)
    return np.asarray(begin + np.arange(len(values)) * increment, dtype=np.float64), values


def _vectors(path: Path, group: str, names: Sequence[str], wanted: Sequence[int]) -> Cells:
    columns = [_read(path, group, names[i]) for i in wanted]
    return Cells(tuple(seconds(values) if values.dtype.kind == "M" else values for values in columns))
