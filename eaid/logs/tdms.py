"""National Instruments TDMS: channels in groups, with waveform properties (start, offset, increment) and units.

Values come scaled, as npTDMS scales them. Channels without waveform properties are columns of equally long vectors, of
which one has to be the time.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.logs.extras import damage_told, library
from eaid.logs.sheet import Cells, Sheet
from eaid.logs.signals import Signal, seconds, sheets_of_signals

WHAT = "TDMS"
MOST_SCALES = 100
"""Scales of one channel, one behind the other; npTDMS makes room for as many as a file says."""


def read_tdms(path: Path, source: str) -> list[Sheet]:
    """Sheets of a TDMS file: the channels with a sample rate together, and the vectors of each group."""
    nptdms = library("nptdms", source, WHAT)
    size = path.stat().st_size
    signals: list[Signal] = []
    vectors: dict[tuple[str, int], list[tuple[str, str]]] = {}
    with damage_told(source, WHAT):
        file = nptdms.TdmsFile.read_metadata(str(path))
        channels = [channel for group in file.groups() for channel in group.channels()]
        for item in (file, *file.groups(), *channels):
            _check_scales(item.properties, source)
        for channel in channels:
            if len(channel) > size:
                raise DataError(
                    f"{source}: {channel.name} claims {len(channel):.3g} values in a file of {size:,} bytes; "
                    f"copy or save it again"
                )
        starts = [channel.properties.get("wf_start_time") for channel in channels]
        known = [start for start in starts if isinstance(start, np.datetime64) and not np.isnat(start)]
        origin = min(known, default=None)
        for channel, start in zip(channels, starts, strict=True):
            kind = np.dtype(channel.dtype).kind
            if not len(channel) or kind not in "fiubM":
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
            signals.append(Signal(name, unit, group, clock, _signal(path, source, group, name, begin, increment)))
    sheets = sheets_of_signals(source, signals)
    for (group, _), columns in vectors.items():
        names = tuple(name for name, _ in columns)
        units = tuple(unit for _, unit in columns)
        sheets.append(Sheet(group, names, _vectors(path, source, group, names), units))
    if not sheets:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return sheets


def _check_scales(said: Mapping[str, Any], source: str) -> None:
    """Refuse properties that claim more scales than any channel has."""
    named = [int(found[1]) + 1 for key in said if (found := re.match(r"NI_Scale\[(\d+)\]", key))]
    claimed = max([int(said.get("NI_Number_Of_Scales", 0)), *named])
    if claimed > MOST_SCALES:
        raise DataError(f"{source}: claims {claimed:.3g} scales for a channel; copy or save it again")


def _read(path: Path, source: str, group: str, name: str) -> Any:
    nptdms = library("nptdms", source, WHAT)
    with damage_told(source, WHAT), nptdms.TdmsFile.open(str(path)) as file:
        return file[group][name][:]


def _signal(
    path: Path, source: str, group: str, name: str, begin: float, increment: float
) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        values = np.asarray(_read(path, source, group, name), dtype=np.float64)
        return np.asarray(begin + np.arange(len(values)) * increment, dtype=np.float64), values

    return load


def _vectors(path: Path, source: str, group: str, names: Sequence[str]) -> Callable[[Sequence[int]], Cells]:
    def load(wanted: Sequence[int]) -> Cells:
        columns = []
        for i in wanted:
            values = np.asarray(_read(path, source, group, names[i]))
            columns.append(read_only(seconds(values) if values.dtype.kind == "M" else values))
        return Cells(tuple(columns))

    return load
