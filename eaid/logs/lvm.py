"""LabVIEW measurement files (.lvm): text with a header, and one or more segments with a header each.

The column of times is made here, whatever the file has: X_Columns One (a column of its own), Multi (one a channel, all
alike) or No (X0 + i Delta_X). Segments follow each other: where their times start anew, the clock times in their
headers tell how far apart they are.
"""

import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from eaid.arrays import read_only
from eaid.errors import DataError
from eaid.logs.sheet import BadCell, Cells, Sheet

END = "***End_of_Header***"
HEADER_LINES = 100
"""Lines of one header; more means that its end is missing."""


@dataclass(frozen=True)
class _File:
    path: Path
    encoding: str
    separator: str
    decimal: str
    own_times: str
    """No, One or Multi."""


@dataclass(frozen=True)
class _Segment:
    names: tuple[str, ...]
    """Channels, without the times and the comment."""
    places: tuple[int, ...]
    """Cell of each channel in a row."""
    times: tuple[int, ...]
    """Cells of times in a row."""
    cells: int
    """Cells of a row with a comment; one less without."""
    units: tuple[str, ...]
    x0: float
    dx: float
    started: float
    """Clock time in the header [s]; NaN where there is none."""


def read_lvm(path: Path, source: str) -> list[Sheet]:
    """The one sheet of a LabVIEW measurement file; raises DataError where its header cannot be followed."""
    file = _opened(path, source)
    first = next((item for _, item in _items(file, source) if isinstance(item, _Segment)), None)
    if first is None:
        raise DataError(f"{source}: has a header but no channels; record the log again")

    def load(columns: Sequence[int]) -> Cells:
        return _load(file, source, first, columns)

    return [Sheet("", ("time", *first.names), load, ("s", *first.units))]


def _opened(path: Path, source: str) -> _File:
    with path.open("rb") as raw:
        head = raw.read(1 << 16)
    try:
        head.decode("utf-8")
        encoding = "utf-8-sig"
    except UnicodeDecodeError as fault:
        encoding = "cp1252" if fault.start < len(head) - 4 else "utf-8-sig"
    separator, said = "\t", {}
    for line in head.decode(encoding, errors="replace").splitlines()[:HEADER_LINES]:
        if line.startswith("Separator") and len(line) > 9:
            separator = {"Comma": ",", "Tab": "\t"}.get(line[10:].strip(" ,\t"), line[9])
        if line.startswith(END):
            break
        key, _, value = line.partition(separator)
        said[key.strip()] = value.strip(" \t")
    else:
        raise DataError(f"{source}: its header has no end ({END}); copy or save it again")
    own = said.get("X_Columns", "One").strip(separator)
    if own not in ("No", "One", "Multi"):
        raise DataError(f"{source}: its X_Columns is {own!r}, not No, One or Multi; save it again")
    decimal = said.get("Decimal_Separator", ".").strip(separator + " ") or ","
    return _File(path, encoding, separator, decimal, own)


def _items(file: _File, source: str) -> Iterator[tuple[int, _Segment | list[str]]]:
    """Segment headers and rows of numbers, each with its line from 1."""
    said: dict[str, list[str]] = {}
    state, since = "file header", 0
    special = False
    with file.path.open(encoding=file.encoding, errors="replace", newline=None) as lines:
        for number, raw in enumerate(lines, start=1):
            line = raw.rstrip("\n")
            bare = line.strip(" \t,;" if file.separator != "," else " ,")
            if bare.startswith("***Start_Special***") or special:
                special = not bare.startswith("***End_Special***")
                continue
            if state == "rows" and bare and not line.startswith(("Channels", END)):
                yield number, line.split(file.separator)
            elif not bare:
                continue
            elif bare.startswith(END):
                state = "names" if state == "header" else "header"
                since, said = number, said if state == "names" else {}
            elif state == "names":
                yield number, _segment(file, source, said, line.split(file.separator), number)
                state = "rows"
            else:
                if state == "rows":
                    state, said, since = "header", {}, number
                key, *values = line.split(file.separator)
                said[key.strip()] = [value.strip() for value in values]
                if number - since > HEADER_LINES:
                    raise DataError(f"{source}: its header at line {since + 1} has no end ({END}); save it again")


def _segment(file: _File, source: str, said: dict[str, list[str]], cells: list[str], line: int) -> _Segment:
    names = [cell.strip().strip('"') for cell in cells]
    while names and not names[-1]:
        names.pop()
    if not names or names[0] != "X_Value":
        raise DataError(f"{source}: line {line} does not name the columns (X_Value first); save it again")
    comment = names[-1] == "Comment"
    times = tuple(i for i, name in enumerate(names) if name == "X_Value")
    places = tuple(i for i, name in enumerate(names) if name != "X_Value" and not (comment and i == len(names) - 1))
    if not places:
        raise DataError(f"{source}: line {line} names no channels; record the log again")
    dimension = next(iter(said.get("X_Dimension", [])), "") or "Time"
    if dimension != "Time":
        raise DataError(f"{source}: its X is {dimension}, not Time: no log; save the signal itself")
    units = said.get("Y_Unit_Label", [])

    def amount(key: str, default: float) -> float:
        text = next((value for value in said.get(key, []) if value), "")
        value = _number(text, file.decimal) if text else default
        if value is None:
            raise DataError(f"{source}: the {key} above line {line} is {text!r}, which is no number; save it again")
        return value

    dx = amount("Delta_X", math.nan)
    if file.own_times == "No" and not dx > 0:
        raise DataError(f"{source}: has neither a column of times nor a Delta_X above 0; save it again")
    return _Segment(
        names=tuple(names[i] for i in places),
        places=places,
        times=times,
        cells=len(names) + (not comment),
        units=tuple(units[k] if k < len(units) else "" for k in range(len(places))),
        x0=amount("X0", 0.0),
        dx=dx,
        started=_clock(said, file.decimal),
    )


def _clock(said: dict[str, list[str]], decimal: str) -> float:
    """Clock time of a segment [s], counted from a fixed day; NaN where the header has none that can be read."""
    day = next((value for value in said.get("Date", []) if value), "")
    clock = next((value for value in said.get("Time", []) if value), "").replace(decimal, ".")
    whole, _, fraction = clock.partition(".")
    try:
        at = datetime.strptime(f"{day} {whole}", "%Y/%m/%d %H:%M:%S")
        return (at - datetime(2000, 1, 1)).total_seconds() + float(f"0.{fraction or 0}")
    except ValueError:
        return math.nan


def _number(text: str, decimal: str) -> float | None:
    text = text.strip()
    if decimal != ".":
        if "." in text:
            return None
        text = text.replace(decimal, ".")
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _load(file: _File, source: str, first: _Segment, columns: Sequence[int]) -> Cells:
    """The wanted columns of all segments, one after another; column 0 is the time."""
    times, rows, bad = array("d"), array("q"), []
    values = {column: array("d") for column in columns if column}
    segments: list[tuple[_Segment, int]] = []
    segment, index = first, 0
    for line, item in _items(file, source):
        if isinstance(item, _Segment):
            segment, index = item, 0
            if segment.names != first.names:
                raise DataError(
                    f"{source}: the channels change at line {line} ({', '.join(segment.names[:8])}, "
                    f"before: {', '.join(first.names[:8])}); split the file there"
                )
            segments.append((segment, len(times)))
            continue
        sample = len(times)
        rows.append(line)
        if not segment.cells - 1 <= len(item) <= segment.cells:
            bad.append(BadCell(sample, -1, str(len(item))))
            times.append(math.nan)
            for column in values.values():
                column.append(math.nan)
            continue
        if file.own_times == "No":
            times.append(segment.x0 + index * segment.dx)
            index += 1
        else:
            own = {item[place] for place in segment.times}
            if len(own) > 1:
                raise DataError(
                    f"{source}: the channels of line {line} have different times; export them on one X column"
                )
            times.append(_cell(item[segment.times[0]], file.decimal, bad, sample, 0))
        for number, column in values.items():
            column.append(_cell(item[segment.places[number - 1]], file.decimal, bad, sample, number))
    time = np.frombuffer(times, dtype=np.float64).copy() if len(times) else np.empty(0)
    _put_apart(time, segments)
    loaded = {number: np.frombuffer(column) if len(column) else np.empty(0) for number, column in values.items()}
    return Cells(tuple(read_only(loaded[column] if column else time) for column in columns), tuple(bad), rows)


def _cell(text: str, decimal: str, bad: list[BadCell], sample: int, column: int) -> float:
    value = _number(text, decimal)
    if value is None or not math.isfinite(value):
        bad.append(BadCell(sample, column, text.strip()[:40]))
        return math.nan
    return value


def _put_apart(time: np.ndarray[tuple[int], np.dtype[np.float64]], segments: list[tuple[_Segment, int]]) -> None:
    """Add each segment's start by the clock where the times of the segments start anew."""
    starts = [start for _, start in segments if 0 < start < len(time)]
    if not any(time[start] <= time[start - 1] for start in starts):
        return
    for (segment, start), stop in zip(segments, [*(start for _, start in segments[1:]), len(time)], strict=True):
        gone = segment.started - segments[0][0].started
        if math.isfinite(gone):
            time[start:stop] += gone
