"""ASAM MDF 3 and 4: channel groups, each with a master channel of times; units and conversions applied by asammdf.

A conversion that is a formula written in the file is not run: the channel is refused.
"""

import logging
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.foreign.signals import Signal, tables_of_signals
from eaid.logs.table import Table

NUMBERS = {3: (*range(4), *range(9, 17)), 4: tuple(range(6))}
"""Data types that are integers and floats, either byte order, by major version."""
FORMULA = {3: 10, 4: 3}
"""Conversion type of a formula, by major version."""


def read_mdf(path: Path, source: str) -> list[Table]:
    """Tables of an MDF file: all channels together where their names differ, else one a group."""
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
            if c != master and channel.data_type in NUMBERS[version]:
                made = [one.conversion for one in (channel, group.channels[master]) if one.conversion is not None]
                formula = any(bool(one.conversion_type == FORMULA[version]) for one in made)
                load = partial(_signal, source, file, str(channel.name), g, c, formula)
                signals.append(Signal(str(channel.name), _unit(channel), name, g, load))
    if not signals:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return tables_of_signals(source, signals)


def _unit(channel: Any) -> str:
    said = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion is not None else "")
    return (said.decode("latin-1") if isinstance(said, bytes) else str(said or "")).strip("\0 ")


def _signal(source: str, file: Any, name: str, group: int, channel: int, formula: bool) -> tuple[Array, Array]:
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
