"""TDMS files of National Instruments → tables: the channels with a sample rate together, and the vectors of each group.

Channels may be sampled at different rates. What is read goes by the clock of the output, whose samples are taken as
they are. A channel of another clock is held: its value at a time is the last one before. Samples before the first value
of any channel are left out. Both are a finding.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.table import Cells, Table, seconds


class Waveform(NamedTuple):
    """A channel with a sample rate."""

    channel: Any
    unit: str
    begin: float  # Time of its first sample [s]
    increment: float  # Sample time [s]

    @property
    def clock(self) -> tuple[float, float, int]:
        """Channels of one clock share their times."""
        return self.begin, self.increment, len(self.channel)

    def times(self) -> Array:
        """Times of its samples [s], shape (n,)."""
        return np.asarray(self.begin + np.arange(len(self.channel)) * self.increment, dtype=np.float64)


def read_tdms(path: Path, source: str) -> list[Table]:
    """Tables of a TDMS file, its values as npTDMS scales them.

    The waveforms are one table where their names tell them apart, else one a group. Channels without waveform
    properties are columns of equally long vectors, of which one has to be the time.
    """
    import nptdms

    file = nptdms.TdmsFile.open(str(path))
    if file.file_status.incomplete_final_segment:
        raise DataError(f"{source}: is cut short: its last segment ends early; copy it again, or record it again")
    waves: list[Waveform] = []
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
        waves.append(Waveform(channel, unit, begin, increment))
    alike = len({one.channel.name for one in waves}) < len(waves)
    groups: dict[str, list[Waveform]] = {}
    for one in waves:
        groups.setdefault(str(one.channel.group_name) if alike else "", []).append(one)
    tables = []
    for name, members in groups.items():
        labels = ("time", *(str(one.channel.name) for one in members))
        units = ("s", *(one.unit for one in members))
        tables.append(Table(name, labels, partial(_on_one_clock, source, members), units))
    for (name, _), columns in vectors.items():
        labels, units = tuple(str(channel.name) for channel, _ in columns), tuple(unit for _, unit in columns)
        tables.append(Table(name, labels, partial(_vectors, columns), units, dropped=tuple(dropped)))
    if not tables:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables


def _on_one_clock(source: str, waves: Sequence[Waveform], wanted: Sequence[int]) -> Cells:
    """Columns on the times of the first waveform among them; column 0 is those times themselves."""
    taken = {i: waves[i - 1] for i in wanted if i}
    first = next(iter(taken.values()))
    base = first.times()
    held = {
        i: np.searchsorted(one.times(), base, side="right") - 1 for i, one in taken.items() if one.clock != first.clock
    }
    begun = np.ones(len(base), dtype=bool)
    for places in held.values():
        begun &= places >= 0
    if not begun.any():
        raise DataError(f"{source}: its signals were not recorded at the same time; record the log again")
    columns = []
    for i in wanted:
        values = np.asarray(taken[i].channel[:], dtype=np.float64) if i else base
        columns.append((values[held[i]] if i in held else values)[begun])
    if not held:
        return Cells(tuple(columns))
    names = " and ".join(str(taken[i].channel.name) for i in held)
    told = finding("signals-held", source, columns=names, left_out=len(base) - len(columns[0]))
    return Cells(tuple(columns), findings=(told,))


def _vectors(columns: Sequence[tuple[Any, str]], wanted: Sequence[int]) -> Cells:
    values = [np.asarray(columns[i][0][:]) for i in wanted]
    return Cells(tuple(seconds(one) if one.dtype.kind == "M" else one for one in values))
