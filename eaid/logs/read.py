"""Logs → runs: every file of a call, in any format, or DataFrames, all their faults at once."""

import hashlib
import itertools
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import median
from eaid.declared import forms, given_options
from eaid.errors import DataError, UsageError
from eaid.files import LOG_ENDINGS, is_as_written, sha256_of
from eaid.findings import Finding, finding
from eaid.logs.columns import chosen_table
from eaid.logs.folders import files_of
from eaid.logs.formats import ForeignReader, format_of, unread
from eaid.logs.run import Run, numbered
from eaid.logs.table import Cells, LogTable, seconds
from eaid.logs.to_run import run_of
from eaid.logs.units import split_name
from eaid.options import Columns, ReadOptions
from eaid.shown import counted, pandas

PLAIN = ReadOptions()
# Options that do nothing on a dataset, whose columns are known
OF_COLUMNS = ("columns", "units", "name_pattern", "step_at", "until", "variable", "rate_hz")
UNIT_STEPS = (60.0, 3600.0, 86_400.0, 1e3, 1e6, 1e9)  # Factors between units of time
SECONDS_ASSUMED = {"unit-assumed", "time-unclear", "time-doubtful", "whole-seconds"}
FEWEST_RUN_ROWS = 20  # Of a run of a long table on the average: a column that changes more often tells none
MOST_KEYS = 8  # Columns that are looked at for one that tells runs apart
RUN = "run"  # What a column is that tells several runs apart, and what one of a DataFrame is called


def read_runs(paths: Sequence[Path], options: ReadOptions = PLAIN) -> list[Run]:
    """Runs of all logs, in the order given; raises DataError with a sentence for every fault of every log."""
    runs, faults = read_what_can_be(files_of(paths), options)
    if faults:
        raise DataError(*faults)
    return runs


def read_like(logs: Any, options: ReadOptions, before: Mapping[str, Any]) -> list[Run]:
    """Runs of files or tables, read as the logs of a fit were `before` where nothing else is said.

    Columns and units stand; the rate is taken where these logs say no time either.
    """
    given = options
    read: Callable[[Any, ReadOptions], list[Run]] = read_runs if isinstance(logs, Sequence) else runs_from_frames
    options = given_options(ReadOptions, None, {k: v for k, v in before.items() if k in forms(Columns)} | given.given())
    try:
        return read(logs, options)
    except UsageError:  # a dataset says all itself
        return read(logs, given)
    except DataError as fault:
        timeless = any("called time" in one or "columns have" in one for one in fault.sentences)
        if not isinstance(before.get("rate_hz"), float) or options.rate_hz is not None or not timeless:
            raise
    return read(logs, replace(options, rate_hz=before["rate_hz"]))


def read_what_can_be(
    files: Sequence[Path], options: ReadOptions, advance: Callable[[], None] = lambda: None
) -> tuple[list[Run], list[str]]:
    """Runs of the good logs, and the faults of the others; `advance` is called after every file."""

    def of_file(path: Path) -> tuple[list[Run], list[str]]:
        try:
            return read_file(path, options, foreign)
        except DataError as fault:
            return [], list(fault.sentences)
        except OSError as fault:
            return [], [f"{path}: cannot be read ({fault.strerror or fault}); check the file"]

    runs: list[Run] = []
    faults: list[str] = []
    workers = min(4, os.cpu_count() or 1)
    # the parser and the checksum work outside the interpreter's lock; a single file is broken off at once
    with closing(ForeignReader()) as foreign, ThreadPoolExecutor(workers) as pool:
        try:
            for of_log, wrong in (pool.map if len(files) > 1 else map)(of_file, files):
                runs.extend(of_log)
                faults.extend(wrong)
                advance()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    idle = next((name for name in OF_COLUMNS if name in options.given()), None)
    if idle and runs and all(run.dataset for run in runs):
        raise UsageError(f"«{idle}»: does nothing on {runs[0].dataset}, a dataset, which says all itself; leave it out")
    return named_apart(runs, options), faults


def read_file(path: Path, options: ReadOptions, foreign: ForeignReader) -> tuple[list[Run], list[str]]:
    """Runs of one file (a dataset holds many), and the faults of its other runs."""
    source = str(path)
    if not path.is_file():
        raise DataError(f"{source}: is no plain file; give a log or a folder of logs")
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise DataError(f"{source}: is empty; record the log again")
    form = format_of(head)
    if form.name == "not read":
        raise DataError(f"{source}: is {unread(head)}")
    sha256 = sha256_of(path)
    name = path.name
    for ending in (*LOG_ENDINGS, ".txt", ".h5", ".hdf5", ".xlsx"):
        name = name[: -len(ending)] if name.lower().endswith(ending) else name
    with foreign.alone if form.reader else nullcontext():
        sealed = form.name == "HDF5" and is_as_written(path) is not None
        tables = [] if sealed else foreign.tables(form, path, source)
        if not tables:
            from eaid.logs.dataset import read_dataset  # HDF5 takes long to load, and text needs none

            return read_dataset(path, source, sha256, options.repair)
        return _runs_of(name or path.name, sha256, tables, options, path.name)


def _runs_of(
    name: str, sha256: str, tables: Sequence[LogTable], options: ReadOptions, file: str
) -> tuple[list[Run], list[str]]:
    """The run of a file's tables, or the runs of a long one and what is wrong with the others."""
    try:
        return [run_of(name, sha256, tables, options, file)], []
    except DataError:
        if not (parts := _parts_of(tables, options)):
            raise
    runs, faults = list[Run](), list[str]()
    for column, value, table in parts:
        label = f"{name}-{column}{value:g}"
        digest = hashlib.sha256(f"{sha256} {label}".encode()).hexdigest()
        try:
            run = run_of(label, digest, [table], options, file)
        except DataError as fault:
            faults.extend(fault.sentences)
            continue
        left = tuple(one for one in run.left if one != column)
        runs.append(replace(run, taken=(*run.taken, (RUN, column)), left=left))
    return runs, faults


def _parts_of(tables: Sequence[LogTable], options: ReadOptions) -> list[tuple[str, float, LogTable]]:
    """Of a long table, the rows of several runs one below the other: the column that tells the runs apart, what stands
    there, and the rows, of each run. Its time falls where the next run begins, and some column that is nothing else
    changes there. None of a table of one log."""
    table, roles = chosen_table(tables, options)
    keys = [column for column in range(len(table.columns)) if column not in roles.taken][:MOST_KEYS]
    if roles.time is None or not keys:
        return []
    time, *values = table.load([roles.time, *keys]).values
    falls = np.flatnonzero(np.diff(time) < 0) + 1
    for column, key in zip(keys, values, strict=True):
        begins = np.flatnonzero(np.diff(key) != 0) + 1
        if len(falls) and np.isin(falls, begins).all() and FEWEST_RUN_ROWS * (len(begins) + 1) <= len(key):
            whole = replace(table, load=lru_cache(maxsize=8)(table.load))  # each column is read once for all runs
            ends = itertools.pairwise([0, *begins.tolist(), len(key)])
            return [(table.label(column), float(key[a]), _rows_of(whole, a, b)) for a, b in ends]
    return []


def _rows_of(table: LogTable, first: int, end: int) -> LogTable:
    """Some rows of a table as one of their own."""

    def load(wanted: Sequence[int]) -> Cells:
        cells = table.load(tuple(wanted))
        bad = tuple(replace(one, row=one.row - first) for one in cells.bad if first <= one.row < end)
        return Cells(tuple(values[first:end] for values in cells.values), bad, ((0, cells.row(first)),))

    return replace(table, load=load)


def named_apart(runs: Sequence[Run], options: ReadOptions) -> list[Run]:
    """Runs of one call, with names of their own, each told where it lies as far from the others as units do."""
    told: dict[int, Finding] = {}
    if "input" not in options.units:  # those of datasets were compared when they were ingested
        in_pct = [run.input if run.input_unit == "%" and not run.dataset else np.zeros(1) for run in runs]
        largest = [float(np.abs(values).max(initial=0)) for values in in_pct]
        most, whole = max(largest, default=0.0), any(round(top, 3) == 100.0 for top in largest)
        for i, top in enumerate(largest):  # where some go to 100 %, one that stays within 1 is most likely a fraction
            if most > 1.5 and (0 < top < 1 or (top == 1 and whole)):
                told[i] = finding("input-in-fractions", runs[i].name, other=most)
    every = [replace(run, findings=(*run.findings, told[i])) if i in told else run for i, run in enumerate(runs)]
    steps = [median(np.diff(run.time_s[:10_000])) if len(run.time_s) > 1 else np.nan for run in runs]
    middle = sorted(steps)[len(steps) // 2] if steps else np.nan
    for i, run in enumerate(every if "time" not in options.units else ()):
        of_time = {one.code for one in run.findings if one.values.get("role", "time") == "time"}
        others = steps[1 - i] if len(runs) == 2 else middle
        factor = max(steps[i], others) / min(steps[i], others)
        if of_time & SECONDS_ASSUMED and any(abs(factor / one - 1) < 0.02 for one in UNIT_STEPS):
            differs = finding("time-unit-differs", run.name, usual_s=steps[i], others_s=others)
            every[i] = replace(run, findings=(*run.findings, differs))
    counts = Counter(run.name for run in every)
    folders = [f"{Path(run.source).resolve().parent.name}-" if counts[run.name] > 1 else "" for run in every]
    names = numbered(folder + run.name for folder, run in zip(folders, every, strict=True))
    return [run if run.name == name else replace(run, name=name) for run, name in zip(every, names, strict=True)]


def _with_unit(name: str, unit: str) -> str:
    """A column and the unit that it is turned into, which its own name may say."""
    if name.endswith((f"[{unit}]", f"({unit})")):
        return name
    return f"{name} → {unit}" if name.endswith(("]", ")")) and split_name(name)[1] else f"{name} [{unit}]"


def columns_told(runs: Sequence[Run]) -> list[str]:
    """Which columns were taken of logs, and which were left, a sentence for all logs that are alike."""
    alike: Counter[tuple[str, str]] = Counter()
    for run in runs:
        if run.taken:
            units = {"time": "s", "input": run.input_unit, "output": run.output_unit, "position": run.position_unit}
            taken = [
                f"{role} = {name if role == RUN else _with_unit(name, units.get(role) or '?')}"
                for role, name in run.taken
            ]
            alike[", ".join(taken), ", ".join(run.left) or "none"] += 1
    return [f"columns of {counted(n, 'log')}: {taken}; left: {left}" for (taken, left), n in alike.items()]


def runs_from_frames(frames: "pandas.DataFrame | Mapping[str, pandas.DataFrame]", options: ReadOptions) -> list[Run]:
    """Runs of a DataFrame with a column `run` (without one: a single run), or of {name: DataFrame}.

    Columns go by name, as in logs; stamps count as times; `frame.attrs["units"]`, a mapping of column to unit, says
    units that the names do not. Raises DataError with a sentence for every fault of every run.
    """
    runs: list[Run] = []
    faults: list[str] = []
    for name, frame in _runs_of_frame(frames).items():
        try:
            if frame.empty:
                raise DataError(f"{name}: the DataFrame is empty; give rows with columns of time, input and output")
            table = _table_of(name, frame)
            digest = hashlib.sha256(repr((table.columns, table.units)).encode())
            for values in table.load(range(len(table.columns))).values:
                digest.update(np.ascontiguousarray(values).data)
            runs.append(run_of(name, digest.hexdigest(), [table], options))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    return named_apart(runs, options)


def _runs_of_frame(frames: "pandas.DataFrame | Mapping[str, pandas.DataFrame]") -> "dict[str, pandas.DataFrame]":
    if not isinstance(frames, Mapping):
        frame = _with_index(frames)
        if RUN not in frame.columns:
            return {RUN: frame}
        if unnamed := int(frame[RUN].isna().sum()):
            raise DataError(
                f"{unnamed} of {len(frame)} rows have no name in the column {RUN}; say of each row which run it is of"
            )
        frames = dict(iter(frame.drop(columns=RUN).groupby(frame[RUN], sort=False)))
    counts = Counter(str(name) for name in frames)
    if (twice := counts.most_common(1)) and twice[0][1] > 1:
        raise DataError(f"{twice[0][0]}: is the name of two runs, a number and a text; give each a name of its own")
    other = next((name for name, frame in frames.items() if not hasattr(frame, "columns")), None)
    if other is not None:
        raise DataError(f"{other}: is no DataFrame; give pandas.DataFrame(…), or DataFrames by the names of their runs")
    return {str(name): _with_index(frame) for name, frame in frames.items()}


def _with_index(frame: "pandas.DataFrame") -> "pandas.DataFrame":
    """A frame whose index, where it has a name or holds times, is a column."""
    if frame.index.nlevels == 1 and frame.index.dtype.kind in "mM" and frame.index.name is None:
        frame = frame.rename_axis("time")
    return frame.reset_index() if any(name is not None for name in frame.index.names) else frame


def _table_of(name: str, frame: "pandas.DataFrame") -> LogTable:
    columns = {str(label): _array(frame[label]) for label in frame.columns if frame[label].ndim == 1}
    if len(columns) < len(frame.columns):
        raise DataError(f"{name}: several columns have one name; give each a name of its own")
    numbers = {label: values for label, values in columns.items() if values.dtype.kind in "fiub"}
    units = {str(label): "s" for label in frame.columns if frame[label].dtype.kind in "mM"}
    declared = tuple(str({**frame.attrs.get("units", {}), **units}.get(label, "")) for label in numbers)
    dropped = tuple(label for label in columns if label not in numbers)
    values = tuple(numbers.values())
    stamped = tuple(i for i, label in enumerate(numbers) if label in units)
    return LogTable(
        "", tuple(numbers), lambda wanted: Cells(tuple(values[i] for i in wanted)), declared, stamped=stamped,
        dropped=dropped, source=name,
    )  # fmt: skip


def _array(column: "pandas.Series[Any]") -> np.ndarray[Any, Any]:
    """A column as NumPy has it; stamps as seconds since the first; decimals and texts as numbers, if most of it is."""
    zoned = getattr(column.dtype, "tz", None) is not None
    values = column.to_numpy(dtype="datetime64[ns]") if zoned else np.asarray(column)
    if values.dtype.kind in "mM":
        return seconds(values)
    if values.dtype.kind not in "OSU":
        return values
    numbers = pandas.to_numeric(pandas.Series(values), errors="coerce").to_numpy(dtype=np.float64)
    return numbers if len(numbers) and np.isfinite(numbers).mean() > 0.5 else values
