"""ASAM MDF 3 and 4: channel groups, each with a master channel of times; units and linear conversions applied.

A conversion that is a formula written in the file is not run: the channel is refused.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.extras import damage_told, library
from eaid.logs.sheet import Sheet
from eaid.logs.signals import Signal, sheets_of_signals

WHAT = "MDF"
MOST_RATIO = 200
"""A group that unpacks to more than this many times the size of its file is a bomb (recorded logs: about 10)."""
_NUMBERS_V4 = range(6)
"""Data types of MDF 4 that are integers and floats, either byte order."""
_NUMBERS_V3 = (*range(4), *range(9, 17))
_FORMULA = {2: 10, 3: 10, 4: 3}
"""Conversion type of a formula, by major version."""


def is_mdf(head: bytes) -> bool:
    """True for the first bytes of an MDF file, closed or not."""
    return head.startswith((b"MDF     ", b"UnFinMF "))


def read_mdf(path: Path, source: str) -> list[Sheet]:
    """Sheets of an MDF file: all channels together where their names differ, else one a group."""
    asammdf = library("asammdf", source, WHAT)
    with path.open("rb") as raw:
        if raw.read(8) == b"UnFinMF ":
            raise DataError(f"{source}: was not closed by its recorder; open it there and save it again")
    signals: list[Signal] = []
    with damage_told(source, WHAT), _open(asammdf, path) as file:
        version = int(str(file.version)[0])
        numbers = _NUMBERS_V4 if version >= 4 else _NUMBERS_V3
        size = path.stat().st_size
        for g, group in enumerate(file.groups):
            count = int(group.channel_group.cycles_nr)
            spare = int(getattr(group.channel_group, "invalidation_bytes_nr", 0))
            claimed = max(count, 1) * max(8, int(group.channel_group.samples_byte_nr) + spare)
            if claimed > max(MOST_RATIO * size, 1 << 24):
                raise DataError(
                    f"{source}: group {g + 1} claims {claimed:.3g} bytes in a file of {size:,} bytes; no log does"
                )
            master = file.masters_db.get(g)
            name = str(getattr(group.channel_group, "acq_name", "") or f"group {g + 1}")
            if master is None or not count:
                continue
            for c, channel in enumerate(group.channels):
                if c == master or channel.data_type not in numbers:
                    continue
                formula = any(_is_formula(one, version) for one in (channel, group.channels[master]))
                load = _formula(source, str(channel.name)) if formula else _loader(path, source, g, c)
                signals.append(Signal(str(channel.name), _unit(channel), name, g, load))
    if not signals:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return sheets_of_signals(source, signals)


@contextmanager
def _open(asammdf: Any, path: Path) -> Iterator[Any]:
    """The file as asammdf sees it: as open bytes, since by its name it would be unpacked, copied or cleared away."""
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # its words on damage are said in ours
    for version in ("mdf_v3.MDF3", "mdf_v4.MDF4"):
        module, _, name = version.partition(".")
        _end_quietly(getattr(import_module(f"asammdf.blocks.{module}"), name))
    with path.open("rb") as raw, asammdf.MDF(raw) as file:
        yield file


def _end_quietly(kind: Any) -> None:
    """Objects of damaged files end half-built, which Python would print a traceback about."""
    if kind.__del__ is not _closed:
        kind.__del__ = _closed


def _closed(file: Any) -> None:
    with suppress(Exception):
        file.close()


def _is_formula(channel: Any, version: int) -> bool:
    return channel.conversion is not None and channel.conversion.conversion_type == _FORMULA[min(version, 4)]


def _unit(channel: Any) -> str:
    said = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion is not None else "")
    return (said.decode("latin-1") if isinstance(said, bytes) else str(said or "")).strip("\0 ")


def _formula(source: str, name: str) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        raise DataError(
            f"{source}: {name} is scaled by a formula in the file, which eaid does not run; export it with its values"
        )

    return load


def _loader(path: Path, source: str, group: int, channel: int) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        asammdf = library("asammdf", source, WHAT)
        with damage_told(source, WHAT), _open(asammdf, path) as file:
            signal = file.get(group=group, index=channel, raw=False)
            if signal.samples.dtype.kind not in "fiub" or signal.samples.ndim != 1:
                raise DataError(f"{source}: {signal.name} holds words or tables, not numbers; choose another channel")
            times = np.asarray(signal.timestamps, dtype=np.float64)
            values = np.asarray(signal.samples, dtype=np.float64)
            invalid = signal.invalidation_bits
            if invalid is not None:
                values = np.where(np.asarray(invalid), np.nan, values)
            return times, values

    return load
