"""Signals, each recorded on a clock of its own → tables.

Measuring systems write channels at different rates, and robots write topics whenever they come. A table of such signals
has one column `time`; what is read goes by the clock of the output, whose samples are taken as they are. A signal of
another clock is held: its value at a time is the last one before. Samples before the first value of any signal are left
out. Both are a finding.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import finding
from eaid.logs.table import Cells, Table

TIME = "time"


@dataclass(frozen=True)
class Signal:
    """One channel and when it was sampled."""

    name: str
    unit: str
    group: str
    """Where in the file it stands; empty where there are no groups."""
    clock: Hashable
    """Signals of one clock share their times."""
    load: Callable[[], tuple[Array, Array]]
    """Times [s] and values, shape (n,) each."""


def tables_of_signals(source: str, signals: Sequence[Signal]) -> list[Table]:
    """One table of all signals where their names tell them apart, else one a group."""
    counts = Counter(signal.name for signal in signals)
    if max(counts.values(), default=0) <= 1:
        return [_table(source, "", signals)] if signals else []
    groups: dict[str, list[Signal]] = {}
    for signal in signals:
        groups.setdefault(signal.group, []).append(signal)
    return [_table(source, group, members) for group, members in groups.items()]


def _table(source: str, name: str, signals: Sequence[Signal]) -> Table:
    def load(wanted: Sequence[int]) -> Cells:
        return _on_one_clock(source, [signals[i - 1] if i else None for i in wanted])

    columns = (TIME, *(signal.name for signal in signals))
    return Table(name, columns, load, ("s", *(signal.unit for signal in signals)))


def _on_one_clock(source: str, wanted: Sequence[Signal | None]) -> Cells:
    """Values of the wanted signals on the times of the first of them; None stands for the times themselves."""
    first = next(signal for signal in wanted if signal is not None)
    clocks: dict[Hashable, Array] = {}
    loaded: dict[str, Array] = {}
    for signal in wanted:
        if signal is not None and signal.name not in loaded:
            times, values = signal.load()
            if not len(values):
                raise DataError(f"{source}: {signal.name} holds no samples; record the log again")
            if len(times) != len(values):
                raise DataError(
                    f"{source}: {signal.name} has {len(values)} samples at {len(times)} times; save the file again"
                )
            clocks[signal.clock], loaded[signal.name] = times, values
    base = clocks[first.clock]
    places: dict[Hashable, NDArray[np.intp]] = {}
    for clock, times in clocks.items():
        if clock != first.clock:
            if not (np.diff(times) >= 0).all():
                names = " and ".join(s.name for s in wanted if s is not None and s.clock == clock)
                raise DataError(f"{source}: the times of {names} fall; sort them, or export the log as CSV")
            places[clock] = np.searchsorted(times, base, side="right") - 1
    begun = np.ones(len(base), dtype=bool)
    for place in places.values():
        begun &= place >= 0
    if not begun.any():
        raise DataError(f"{source}: its signals were not recorded at the same time; record the log again")
    whole = bool(begun.all())
    columns = []
    for signal in wanted:
        values = base if signal is None else loaded[signal.name]
        if signal is not None and signal.clock in places:
            values = values[places[signal.clock][begun]]
        elif not whole:
            values = values[begun]
        columns.append(read_only(values))
    of_other_clocks = " and ".join(signal.name for signal in wanted if signal is not None and signal.clock in places)
    left_out = len(base) - int(begun.sum())
    findings = (finding("signals-held", source, columns=of_other_clocks, left_out=left_out),) if of_other_clocks else ()
    return Cells(tuple(columns), findings=findings)


def seconds(stamps: NDArray[Any], start: Any = None) -> Array:
    """Seconds since `start` (default: the first) of datetime64 or timedelta64 stamps, to the nanosecond."""
    gone = (stamps - (stamps[0] if start is None else start)).astype("timedelta64[ns]").astype(np.int64)
    return np.asarray(gone / 1e9, dtype=np.float64)
