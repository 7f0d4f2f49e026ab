"""ASAM MDF 3 and 4: channel groups, each with a master channel of times; units and conversions applied.

A conversion that is a formula written in the file is not run: the channel is refused. The file is opened in a process
of its own (`mdf_apart`).
"""

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.extras import library
from eaid.logs.sheet import Sheet
from eaid.logs.signals import Signal, sheets_of_signals

WHAT = "MDF"
READER: tuple[str, ...] = (sys.executable, "-P", "-m", "eaid.logs.mdf_apart")
LONGEST_S = 600.0


def read_mdf(path: Path, source: str) -> list[Sheet]:
    """Sheets of an MDF file: all channels together where their names differ, else one a group."""
    if find_spec("asammdf") is None:
        library("asammdf", source, WHAT)
    with path.open("rb") as raw:
        if raw.read(8) == b"UnFinMF ":
            raise DataError(f"{source}: was not closed by its recorder; open it there and save it again")

    @lru_cache(maxsize=4)
    def group(number: int) -> Mapping[str, Array]:
        return _asked(path, source, str(number))

    signals = []
    for g, c, name, unit, folder, formula in json.loads(str(_asked(path, source)["channels"])):
        load = _formula(source, name) if formula else _loader(source, name, group, g, c)
        signals.append(Signal(name, unit, folder, g, load))
    if not signals:
        raise DataError(f"{source}: holds no channels of numbers; record the log again")
    return sheets_of_signals(source, signals)


def _asked(path: Path, source: str, *question: str) -> Mapping[str, Array]:
    """Answer of the reading process; raises DataError with its sentence, or where it broke down."""
    places = os.pathsep.join(place for place in sys.path if place)
    try:
        done = subprocess.run(
            [*READER, str(path), *question], env={**os.environ, "PYTHONPATH": places}, stdin=subprocess.DEVNULL,
            capture_output=True, timeout=LONGEST_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise DataError(f"{source}: takes longer than {LONGEST_S:g} s to read; export it as CSV") from None
    if done.returncode == 3:
        raise DataError(f"{source}: {done.stdout.decode('utf-8', errors='replace').strip()}")
    if done.returncode:
        raise DataError(f"{source}: is a damaged MDF file (its reader broke down on it); copy or save it again")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as answer:
        return dict(answer.items())


def _formula(source: str, name: str) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        raise DataError(
            f"{source}: {name} is scaled by a formula in the file, which eaid does not run; export it with its values"
        )

    return load


def _loader(
    source: str, name: str, group: Callable[[int], Mapping[str, Array]], g: int, c: int
) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        answer = group(g)
        if str(c) not in answer:
            raise DataError(f"{source}: {name} holds words or tables, not numbers; choose another channel")
        return answer["times"], answer[str(c)]

    return load
