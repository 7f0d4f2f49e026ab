"""TDMS files of National Instruments → tables: the channels of one clock, and the vectors of each group."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.errors import DataError
from eaid.logs.table import Cells, LogTable, seconds, with_times

WaveformClock = tuple[float, float]  # Time of the first sample, and sample time [s]


def read_tdms(path: Path, source: str) -> list[LogTable]:
    """Tables of a TDMS file: channels with waveform properties for each clock, and where their names are not enough for
    each group; the others as vectors of one length."""
    import nptdms

    file = nptdms.TdmsFile.open(str(path))
    if file.file_status.incomplete_final_segment:
        raise DataError(f"{source}: is cut short: its last segment ends early; copy it again, or record it again")
    found: list[tuple[Any, str, WaveformClock | None]] = []
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
            found.append((channel, "s" if kind == "M" else unit, None))
            continue
        begin = float(facts.get("wf_start_offset") or 0.0)
        if origin is not None and start in known:
            begin += float((start - origin) / np.timedelta64(1, "ns")) * 1e-9
        found.append((channel, unit, (begin, increment)))
    if not found:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    found.sort(key=lambda one: one[2] is None)
    waves = [channel.name for channel, _, clock in found if clock is not None]
    alike = len(set(waves)) < len(waves)
    tables: dict[tuple[str, WaveformClock | None, int], list[tuple[Any, str]]] = {}
    for channel, unit, clock in found:
        group = str(channel.group_name) if alike or clock is None else ""
        tables.setdefault((group, clock, len(channel)), []).append((channel, unit))
    return [_channel_table(name, columns, dropped, clock) for (name, clock, _), columns in tables.items()]


def _channel_table(
    name: str, columns: Sequence[tuple[Any, str]], dropped: Sequence[str], clock: WaveformClock | None = None
) -> LogTable:
    """A table of channels with their units, behind a column of times where they have a clock."""
    channels, units = [channel for channel, _ in columns], tuple(unit for _, unit in columns)
    labels, timed = tuple(str(channel.name) for channel in channels), clock is not None

    def load(wanted: Sequence[int]) -> Cells:
        values = (np.asarray(channels[i - timed][:]) for i in wanted)
        return Cells(tuple(seconds(one) if one.dtype.kind == "M" else one for one in values))

    if clock is None:
        return LogTable(name, labels, load, units, dropped=tuple(dropped))
    return LogTable(name, ("time", *labels), partial(with_times, load, *clock), ("s", *units))
