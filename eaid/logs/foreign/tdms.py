"""TDMS files of National Instruments → tables: the channels of one clock, and the vectors of each group."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.table import Cells, LogTable, seconds

WaveformClock = tuple[float, float, int]  # Time of the first sample and sample time [s], and the number of samples


def read_tdms(path: Path, source: str) -> list[LogTable]:
    """Tables of a TDMS file: channels with waveform properties for each clock, and where their names are not enough for
    each group; the others as vectors of one length."""
    import nptdms

    file = nptdms.TdmsFile.open(str(path))
    if file.file_status.incomplete_final_segment:
        raise DataError(f"{source}: is cut short: its last segment ends early; copy it again, or record it again")
    waves: list[tuple[Any, str, WaveformClock]] = []
    vectors: dict[tuple[str, int], list[tuple[Any, str]]] = {}
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
        facts = channel.properties
        unit = str(facts.get("unit_string") or facts.get("NI_UnitDescription") or "")
        increment = facts.get("wf_increment")
        if kind == "M" or not isinstance(increment, float) or not 0 < increment < np.inf:
            place = vectors.setdefault((str(channel.group_name), len(channel)), [])
            place.append((channel, "s" if kind == "M" else unit))
            continue
        begin = float(facts.get("wf_start_offset") or 0.0)
        if origin is not None and start in known:
            begin += float((start - origin) / np.timedelta64(1, "ns")) * 1e-9
        waves.append((channel, unit, (begin, increment, len(channel))))
    alike = len({channel.name for channel, _, _ in waves}) < len(waves)
    timed: dict[tuple[str, WaveformClock], list[tuple[Any, str]]] = {}
    for channel, unit, clock in waves:
        timed.setdefault((str(channel.group_name) if alike else "", clock), []).append((channel, unit))
    tables = [_channel_table(name, columns, (), clock) for (name, clock), columns in timed.items()]
    tables += [_channel_table(name, columns, dropped) for (name, _), columns in vectors.items()]
    if not tables:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables


def _channel_table(
    name: str, columns: Sequence[tuple[Any, str]], dropped: Sequence[str], clock: WaveformClock | None = None
) -> LogTable:
    """A table of channels with their units, behind a column of times where they have a clock."""
    labels, units = [str(channel.name) for channel, _ in columns], [unit for _, unit in columns]
    if clock is not None:
        labels, units = ["time", *labels], ["s", *units]

    def load(wanted: Sequence[int]) -> Cells:
        values = []
        for i in wanted:
            if clock is not None and i == 0:
                values.append(clock[0] + np.arange(clock[2]) * clock[1])
                continue
            column = np.asarray(columns[i - (clock is not None)][0][:])
            values.append(seconds(column) if column.dtype.kind == "M" else column)
        return Cells(tuple(values))

    return LogTable(name, tuple(labels), load, tuple(units), dropped=tuple(dropped))
