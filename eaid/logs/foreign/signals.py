"""Files of signals, each recorded on a clock of its own → tables: TDMS of National Instruments, ASAM MDF 3 and 4.

Measuring systems write channels at different rates, and robots write topics whenever they come (`ros`). A table of such
signals has one column `time`; what is read goes by the clock of the output, whose samples are taken as they are. A
signal of another clock is held: its value at a time is the last one before. Samples before the first value of any
signal are left out. Both are a finding.
"""

import logging
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.table import Cells, Table, seconds


@dataclass(frozen=True)
class Signal:
    """One channel and when it was sampled."""

    name: str
    unit: str
    group: str  # Where in the file it stands; empty where there are no groups
    clock: Hashable  # Signals of one clock share their times
    load: Callable[[], tuple[Array, Array]]  # Times [s] and values, shape (n,) each


def tables_of_signals(source: str, signals: Sequence[Signal]) -> list[Table]:
    """One table of all signals where their names tell them apart, else one a group."""
    alike = max(Counter(signal.name for signal in signals).values(), default=0) > 1
    groups: dict[str, list[Signal]] = {}
    for signal in signals:
        groups.setdefault(signal.group if alike else "", []).append(signal)
    return [
        Table(
            group, ("time", *(one.name for one in members)), partial(_on_one_clock, source, members),
            ("s", *(one.unit for one in members)),
        )
        for group, members in groups.items()
    ]  # fmt: skip


def _on_one_clock(source: str, signals: Sequence[Signal], wanted: Sequence[int]) -> Cells:
    """Columns on the times of the first signal among them; column 0 is those times themselves."""
    taken = [signals[i - 1] for i in wanted if i]
    clocks: dict[Hashable, Array] = {}
    loaded: dict[str, Array] = {}
    for signal in taken:
        if signal.name not in loaded:
            times, values = signal.load()
            if not len(values):
                raise DataError(f"{source}: {signal.name} holds no samples; record the log again")
            if len(times) != len(values):
                raise DataError(
                    f"{source}: {signal.name} has {len(values)} samples at {len(times)} times; save the file again"
                )
            clocks[signal.clock], loaded[signal.name] = times, values
    base = clocks[taken[0].clock]
    places: dict[Hashable, NDArray[np.intp]] = {}
    for clock, times in clocks.items():
        if clock != taken[0].clock:
            if not (np.diff(times) >= 0).all():
                names = " and ".join(one.name for one in taken if one.clock == clock)
                raise DataError(f"{source}: the times of {names} fall; sort them, or export the log as CSV")
            places[clock] = np.searchsorted(times, base, side="right") - 1
    begun = np.ones(len(base), dtype=bool)
    for place in places.values():
        begun &= place >= 0
    if not begun.any():
        raise DataError(f"{source}: its signals were not recorded at the same time; record the log again")
    columns = []
    for i in wanted:
        values, held = (loaded[signals[i - 1].name], places.get(signals[i - 1].clock)) if i else (base, None)
        columns.append(values if begun.all() and held is None else values[begun if held is None else held[begun]])
    if not places:
        return Cells(tuple(columns))
    others = " and ".join(one.name for one in taken if one.clock in places)
    told = finding("signals-held", source, columns=others, left_out=len(base) - len(columns[0]))
    return Cells(tuple(columns), findings=(told,))


def read_tdms(path: Path, source: str) -> list[Table]:
    """Tables of a TDMS file: the channels with a sample rate together, and the vectors of each group.

    Values come scaled, as npTDMS scales them. Channels without waveform properties are columns of equally long vectors,
    of which one has to be the time.
    """
    import nptdms

    file = nptdms.TdmsFile.open(str(path))
    if file.file_status.incomplete_final_segment:
        raise DataError(f"{source}: is cut short: its last segment ends early; copy it again, or record it again")
    signals: list[Signal] = []
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
        group = str(channel.group_name)
        if kind == "M" or not isinstance(increment, float) or not 0 < increment < np.inf:
            vectors.setdefault((group, len(channel)), []).append((channel, "s" if kind == "M" else unit))
            continue
        begin = float(facts.get("wf_start_offset") or 0.0)
        if origin is not None and start in known:
            begin += float((start - origin) / np.timedelta64(1, "ns")) * 1e-9
        clock = (begin, increment, len(channel))
        load = partial(_waveform, channel, begin, increment)
        signals.append(Signal(str(channel.name), unit, group, clock, load))
    tables = tables_of_signals(source, signals)
    for (group, _), columns in vectors.items():
        names, units = tuple(str(channel.name) for channel, _ in columns), tuple(unit for _, unit in columns)
        tables.append(Table(group, names, partial(_vectors, columns), units, dropped=tuple(dropped)))
    if not tables:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables


def _waveform(channel: Any, begin: float, increment: float) -> tuple[Array, Array]:
    values = np.asarray(channel[:], dtype=np.float64)
    return np.asarray(begin + np.arange(len(values)) * increment, dtype=np.float64), values


def _vectors(columns: Sequence[tuple[Any, str]], wanted: Sequence[int]) -> Cells:
    values = [np.asarray(columns[i][0][:]) for i in wanted]
    return Cells(tuple(seconds(one) if one.dtype.kind == "M" else one for one in values))


# Data types that are integers and floats, either byte order, by major version
_MDF_NUMBERS = {3: (*range(4), *range(9, 17)), 4: tuple(range(6))}
_MDF_FORMULA = {3: 10, 4: 3}  # Conversion type of a formula, by major version


def read_mdf(path: Path, source: str) -> list[Table]:
    """Tables of an MDF file: all channels together where their names differ, else one a group.

    Units and conversions are applied by asammdf; a conversion that is a formula written in the file is not run: the
    channel is refused.
    """
    import asammdf

    logging.disable(logging.CRITICAL)
    raw = path.open("rb")  # as open bytes, since by its name a file would be unpacked, copied or cleared away
    if raw.read(8) == b"UnFinMF ":
        raise DataError(f"{source}: was not closed by its recorder; open it there and save it again")
    raw.seek(0)
    file: Any = asammdf.MDF(raw)
    version = 4 if str(file.version) >= "4" else 3
    signals: list[Signal] = []
    for g, group in enumerate(file.groups):
        master = file.masters_db.get(g)
        name = str(getattr(group.channel_group, "acq_name", "") or f"group {g + 1}")
        if master is None or not group.channel_group.cycles_nr:
            continue
        for c, channel in enumerate(group.channels):
            if c != master and channel.data_type in _MDF_NUMBERS[version]:
                made = [one.conversion for one in (channel, group.channels[master]) if one.conversion is not None]
                formula = any(bool(one.conversion_type == _MDF_FORMULA[version]) for one in made)
                load = partial(_measured, source, file, str(channel.name), g, c, formula)
                signals.append(Signal(str(channel.name), _unit(channel), name, g, load))
    if not signals:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables_of_signals(source, signals)


def _unit(channel: Any) -> str:
    unit = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion is not None else "")
    return (unit.decode("latin-1") if isinstance(unit, bytes) else str(unit or "")).strip("\0 ")


def _measured(source: str, file: Any, name: str, group: int, channel: int, formula: bool) -> tuple[Array, Array]:
    if formula:
        raise DataError(
            f"{source}: {name} is scaled by a formula in the file, which eaid does not run; export it with its values"
        )
    one = file.get(group=group, index=channel, raw=False, ignore_invalidation_bits=True)
    if one.samples.dtype.kind not in "fiub" or one.samples.ndim != 1:
        raise DataError(f"{source}: {name} holds words or tables, not numbers; choose another channel")
    values = np.asarray(one.samples, dtype=np.float64)
    if one.invalidation_bits is not None:
        values = np.where(np.asarray(one.invalidation_bits), np.nan, values)
    return np.asarray(one.timestamps, dtype=np.float64), values
