"""Logs → runs: every file of a call, in any format, all their faults at once."""

import os
import re
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.logs.checks import checked
from eaid.logs.columns import ROLES, Roles, input_default, match_columns, scale_of
from eaid.logs.dataset import is_dataset, read_dataset
from eaid.logs.folders import files_of
from eaid.logs.formats import format_of
from eaid.logs.hdf import is_hdf5
from eaid.logs.join import joined
from eaid.logs.options import ReadOptions
from eaid.logs.run import INPUT_UNITS, Kind, Run
from eaid.logs.sheet import Sheet
from eaid.logs.spool import LONG, extent, on_disk, sample, times

NOTHING_SAID = ReadOptions()
IN_MEMORY = 1 << 27
"""Bytes of columns that the runs of a call hold in memory; those of further runs lie on disk."""


def name_regex(pattern: str) -> re.Pattern[str]:
    """Regular expression of a `--name-pattern`; raises UsageError where it names neither level nor repeat."""
    parts = re.split(r"\{(level|repeat)\}", pattern)
    if len(parts) == 1:
        raise UsageError(f"--name-pattern {pattern}: holds neither {{level}} nor {{repeat}}")
    if len(set(parts[1::2])) < len(parts[1::2]):
        raise UsageError(f"--name-pattern {pattern}: holds a field twice")
    forms = {"level": r"(?P<level>[+-]?\d+(?:[.,]\d+)?)", "repeat": r"(?P<repeat>\d+)"}
    return re.compile("".join(forms[part] if i % 2 else re.escape(part) for i, part in enumerate(parts)))


def read_runs(
    paths: Sequence[Path], options: ReadOptions = NOTHING_SAID, on_file: Callable[[], None] = lambda: None
) -> list[Run]:
    """Runs of all logs, in the order given; raises DataError with a sentence for every fault of every log."""
    runs, faults = read_what_can_be(paths, options, on_file)
    if faults:
        raise DataError(*faults)
    return runs


def read_what_can_be(
    paths: Sequence[Path], options: ReadOptions, on_file: Callable[[], None] = lambda: None
) -> tuple[list[Run], list[str]]:
    """Runs of the good logs, and the faults of the others; `on_file` is called after each file."""
    unknown = [role for role in (*options.columns, *options.units) if role not in ROLES]
    if unknown:
        raise UsageError(f"--columns and --units know time, input, output and reference, not {unknown[0]}")
    pattern = name_regex(options.name_pattern) if options.name_pattern else None
    files = files_of(paths)

    room = _Room(IN_MEMORY)

    def one(path: Path) -> tuple[list[Run], list[str]]:
        try:
            found, wrong = read_file(path, options, pattern)
            return [run if room.takes(run) else _on_disk(run) for run in found], wrong
        except DataError as fault:
            return [], list(fault.sentences)
        except OSError as fault:
            return [], [f"{path}: cannot be read ({fault.strerror or fault}); check the file"]

    runs: list[Run] = []
    faults: list[str] = []

    def collect(read: Iterable[tuple[list[Run], list[str]]]) -> None:
        for found, wrong in read:
            runs.extend(found)
            faults.extend(wrong)
            on_file()

    workers = min(4, os.cpu_count() or 1, len(files))
    if workers <= 1:
        collect(map(one, files))
    else:  # the parser and the checksum work outside the interpreter's lock
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(workers) as pool:
            try:
                collect(pool.map(one, files))
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
    if options.join and not faults:
        try:
            runs = joined(runs)
        except DataError as fault:
            return [], list(fault.sentences)
    return _named_apart(runs), faults


class _Room:
    """How much memory is left for the columns of runs, whoever reads them."""

    def __init__(self, left: int) -> None:
        self._left, self._lock = left, threading.Lock()

    def takes(self, run: Run) -> bool:
        """Whether the columns of a run fit; those of a long one lie on disk anyway."""
        with self._lock:
            self._left -= 0 if len(run.time_s) >= LONG else 3 * run.time_s.nbytes
            return self._left >= 0 or len(run.time_s) >= LONG


def _on_disk(run: Run) -> Run:
    """A run whose columns lie on disk, since the memory is full of others."""
    columns = [run.time_s, run.input, run.output]
    reference = [] if run.reference_nm is None else [run.reference_nm]
    time, input_, output, *rest = on_disk(*columns, *reference)
    return replace(run, time_s=time, input=input_, output=output, reference_nm=rest[0] if rest else None)


def _named_apart(runs: list[Run]) -> list[Run]:
    """Runs with names of their own: the folder's name before a name that comes twice, then a number behind it."""
    counts = Counter(run.name for run in runs)
    apart = [
        replace(run, name=f"{Path(run.source).resolve().parent.name}-{run.name}") if counts[run.name] > 1 else run
        for run in runs
    ]
    seen: Counter[str] = Counter()
    for i, run in enumerate(apart):
        seen[run.name] += 1
        if seen[run.name] > 1:
            apart[i] = replace(run, name=f"{run.name}-{seen[run.name]}")
    return apart


def read_file(path: Path, options: ReadOptions, pattern: re.Pattern[str] | None) -> tuple[list[Run], list[str]]:
    """Runs of one file (a dataset holds many), and the faults of its other runs."""
    source = str(path)
    if not path.is_file():
        raise DataError(f"{source}: is no plain file; give a log or a folder of logs")
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise DataError(f"{source}: is empty; record the log again")
    sha256 = sha256_of(path)
    if is_hdf5(head) and is_dataset(path):
        runs, faults = read_dataset(path, source, sha256)
        good = []
        for run in runs:
            try:
                good.append(checked_run(run, options))
            except DataError as fault:
                faults.extend(fault.sentences)
        return good, faults
    sheets = format_of(head).read(path, source)
    sheet, roles = _choose(source, sheets, options)
    return [_run(path, source, sha256, sheet, roles, options, pattern)], []


def checked_run(run: Run, options: ReadOptions) -> Run:
    """A run of a dataset, its rows checked like those of a log."""
    columns = {"time": run.time_s, "input": run.input, "output": run.output}
    if np.isnan(run.input).all():
        del columns["input"]
    keep, notes = checked(run.where, columns, (), lambda i: i + 1, "sample", options.repair)
    if keep is None:
        return run
    return replace(
        run,
        time_s=read_only(run.time_s[keep]),
        input=read_only(run.input[keep]),
        output=read_only(run.output[keep]),
        reference_nm=None if run.reference_nm is None else read_only(run.reference_nm[keep]),
        notes=(*run.notes, *notes),
    )


def _choose(source: str, sheets: list[Sheet], options: ReadOptions) -> tuple[Sheet, Roles]:
    """The one sheet that is a log: the one named, else the only one whose columns match."""
    if options.variable is not None:
        named = [sheet for sheet in sheets if sheet.name == options.variable]
        if not named:
            names = ", ".join(sheet.name or "(no name)" for sheet in sheets[:12])
            raise DataError(f"{source}: holds no table {options.variable} for --variable; it holds {names}")
        return named[0], match_columns(source, named[0], options)
    good: list[tuple[Sheet, Roles]] = []
    faults: list[DataError] = []
    for sheet in sheets:
        try:
            good.append((sheet, match_columns(source, sheet, options)))
        except DataError as fault:
            faults.append(fault)
    if not good:
        if len(sheets) == 1:
            raise faults[0]
        held = "; ".join(
            f"{sheet.name or 'table'}: {', '.join(c or '?' for c in sheet.columns[:8])}" for sheet in sheets[:6]
        )
        raise DataError(
            f"{source}: no table in it has columns of time and torque ({held}); choose with --variable and --columns"
        )
    full = [pair for pair in good if pair[1].inputs] or good
    if len(full) > 1:
        names = ", ".join(sheet.name for sheet, _ in full[:12])
        raise DataError(
            f"{source}: holds several tables that may be the log ({names}); choose one with --variable NAME"
        )
    return full[0]


def _run(
    path: Path,
    source: str,
    sha256: str,
    sheet: Sheet,
    roles: Roles,
    options: ReadOptions,
    pattern: re.Pattern[str] | None,
) -> Run:
    """One log as a run, in the units of SPEC §1, its rows checked."""
    inputs = [column for _, column in roles.inputs]
    others = [column for column in (roles.time, roles.reference) if column is not None]
    wanted = list(dict.fromkeys([roles.output, *others, *inputs]))  # the output's own times are kept
    if sheet.load_long is not None:
        cells = sheet.load_long(wanted, partial(options.tell, source))
    else:
        cells = sheet.load(wanted)
    column = dict(zip(wanted, cells.values, strict=True))
    output = column[roles.output]
    rate = options.rate_hz or sheet.rate_hz
    time_name = sheet.columns[roles.time] if roles.time is not None else ""
    time_scale = scale_of("time", options.units.get("time"), time_name, sheet.unit(roles.time or 0), "s")
    if roles.time is not None:
        time = column[roles.time]
    else:
        assert rate is not None
        time = sheet.starts_s + np.arange(len(output)) / rate
        time_scale = replace(time_scale, factor=1.0)
    kind, which = _input_of(column, roles, source)
    named = {"time": time, "output": output}
    if which is not None:
        named["input"] = column[which]
    labels = {i: sheet.columns[i] or f"column {i + 1}" for i in range(len(sheet.columns))}
    said = [
        (bad.row, "" if bad.column < 0 else labels[bad.column], bad.text)
        for bad in sorted(cells.bad, key=lambda bad: (bad.row, bad.column))
        if bad.column in (-1, *wanted)
    ]
    keep, notes = checked(
        source, named, said, cells.row, "row", options.repair,
        {"time": labels.get(roles.time if roles.time is not None else -1, "time"), "output": labels[roles.output],
         "input": labels[which] if which is not None else ""}, time_scale.factor,
    )  # fmt: skip

    def kept(values: Array, factor: float = 1.0) -> Array:
        chosen = values if keep is None else values[keep]
        return read_only(times(chosen, factor))

    out = scale_of(
        "output", options.units.get("output"), sheet.columns[roles.output], sheet.unit(roles.output), roles.output_unit
    )
    unit = _input_unit(options, kind)
    input_: Array = np.broadcast_to(np.float64(np.nan), len(output) if keep is None else len(keep))  # takes no memory
    if which is not None:
        assert kind is not None
        name = sheet.columns[which]
        into = scale_of("input", options.units.get("input"), name, sheet.unit(which), input_default(kind, name))
        unit, input_ = into.unit, kept(column[which], into.factor)
    level, repeat = _from_name(path, pattern, which is None)
    notes = (*notes, *cells.notes)
    if roles.note:
        notes = (*notes, roles.note)
    return Run(
        name=_stem(path),
        time_s=kept(time, time_scale.factor),
        input=read_only(input_),
        output=kept(output, out.factor),
        input_unit=unit,
        output_unit=out.unit,
        source=source,
        sha256=sha256,
        level=level if which is None else None,
        repeat=repeat,
        step_s=options.step_at_s,
        until_s=options.until_s,
        reference_nm=kept(column[roles.reference]) if roles.reference is not None else None,
        notes=notes,
        kind=options.kind or kind,
        synthetic=sheet.said.get("synthetic"),
    )


def _input_unit(options: ReadOptions, kind: Kind | None) -> str:
    """Unit of levels that come from file names: none, unless the user says one."""
    return options.units.get("input", "") if kind is None else INPUT_UNITS[kind]


def _stem(path: Path) -> str:
    name = path.name
    for ending in (
        ".gz",
        ".csv",
        ".tsv",
        ".txt",
        ".dat",
        ".mat",
        ".h5",
        ".hdf5",
        ".tdms",
        ".lvm",
        ".parquet",
        ".mf4",
        ".bag",
        ".mcap",
    ):
        name = name[: -len(ending)] if name.lower().endswith(ending) else name
    return name or path.name


def _input_of(column: dict[int, Array], roles: Roles, source: str) -> tuple[Kind | None, int | None]:
    """The input among the columns that may be it: the one that changes, where only one does."""
    if len(roles.inputs) <= 1:
        return roles.inputs[0] if roles.inputs else (None, None)
    moving = []
    for kind, which in roles.inputs:
        values = sample(column[which])
        values = values[np.isfinite(values)]
        low, high = extent(values)
        if high - low > 0.2 * max(abs(low), abs(high)):
            moving.append((kind, which))
    if len(moving) == 1:
        return moving[0]
    if roles.inputs[0][0] == "clutch":  # a duty beside the constant speed and force of the rig
        return roles.inputs[0]
    kinds = " and ".join(kind for kind, _ in roles.inputs)
    raise DataError(f"{source}: may be {kinds}, as it has a column of each; say which with --kind")


def _from_name(path: Path, pattern: re.Pattern[str] | None, needed: bool) -> tuple[float | None, int | None]:
    """Level and repeat that the file name tells; raises DataError where a level is needed and the name has none."""
    if pattern is None:
        return None, None
    found = pattern.search(path.name)
    if found is None:
        if needed:
            raise DataError(f"{path}: its name does not match the --name-pattern; rename it or mend the pattern")
        return None, None
    said = found.groupdict()
    level = float(said["level"].replace(",", ".")) if said.get("level") else None
    return level, int(said["repeat"]) if said.get("repeat") else None
