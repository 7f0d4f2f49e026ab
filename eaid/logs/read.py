"""Logs → runs: every file of a call, in any format, all their faults at once."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from eaid.errors import DataError, UsageError
from eaid.files import LOGS, sha256_of
from eaid.findings import finding
from eaid.logs.checks import checked
from eaid.logs.dataset import read_dataset
from eaid.logs.folders import files_of
from eaid.logs.foreign.ask import ForeignReader
from eaid.logs.formats import DATASET, format_of, unread
from eaid.logs.run import Run
from eaid.logs.text import read_text
from eaid.logs.to_run import Origin, run_of
from eaid.logs.together import counted_once, joined, levels_in_names, named_apart, scales_compared
from eaid.options import ReadOptions
from eaid.sealed import is_as_written

PLAIN = ReadOptions()


@dataclass(frozen=True)
class Hear:
    """What is called while logs are read."""

    file: Callable[[], None] = lambda: None
    """After each file."""
    share: Callable[[str, float], None] = lambda _source, _share: None
    """How much of a long log is read, from 0 to 1."""
    run: Callable[[Run], Run] = lambda run: run
    """Each run of a dataset, before the next is read, so that long ones need not lie in memory together."""


UNHEARD = Hear()


def read_runs(paths: Sequence[Path], options: ReadOptions = PLAIN, hear: Hear = UNHEARD) -> list[Run]:
    """Runs of all logs, in the order given; raises DataError with a sentence for every fault of every log."""
    runs, faults = read_what_can_be(paths, options, hear)
    if faults:
        raise DataError(*faults)
    return runs


def read_what_can_be(paths: Sequence[Path], options: ReadOptions, hear: Hear = UNHEARD) -> tuple[list[Run], list[str]]:
    """Runs of the good logs, and the faults of the others."""
    files = files_of(paths)

    def of_file(path: Path) -> tuple[list[Run], list[str]]:
        try:
            return read_file(path, options, foreign, hear)
        except DataError as fault:
            return [], list(fault.sentences)
        except OSError as fault:
            return [], [f"{path}: cannot be read ({fault.strerror or fault}); check the file"]

    runs: list[Run] = []
    faults: list[str] = []
    workers = min(4, os.cpu_count() or 1)
    # the parser and the checksum work outside the interpreter's lock; a single file is broken off at once
    with ForeignReader() as foreign, ThreadPoolExecutor(workers) as pool:
        try:
            for of_log, wrong in (pool.map if len(files) > 1 else map)(of_file, files):
                runs.extend(of_log)
                faults.extend(wrong)
                hear.file()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    _refuse_what_does_nothing(runs, options)
    return together(runs, faults, options)


def together(runs: Sequence[Run], faults: list[str], options: ReadOptions) -> tuple[list[Run], list[str]]:
    """Runs of one call: none counted twice, joined where that is wanted, compared, named apart."""
    once = counted_once(runs)
    if not faults:
        try:
            levels_in_names(once)
            if options.join:
                once = joined(once)
        except DataError as fault:
            return [], list(fault.sentences)
    return named_apart(once if "input" in options.units else scales_compared(once)), faults


def _refuse_what_does_nothing(runs: Sequence[Run], options: ReadOptions) -> None:
    """Refuse options that say how columns are to be read where only datasets are given, whose columns are known."""
    if not runs or not all(run.dataset for run in runs):
        return
    given = {
        "columns": options.columns, "units": options.units, "name_pattern": options.name_pattern,
        "step_at": options.step_at, "until": options.until, "variable": options.variable,
        "rate_hz": options.rate_hz, "join": options.join,
    }  # fmt: skip
    said = [name for name, value in given.items() if value is not None and value is not False and value != {}]
    useless = next(iter(said), None)  # an instant of 0 s is one, though 0 == False
    if useless is not None:
        where = runs[0].dataset
        raise UsageError(f"«{useless}»: does nothing on {where}, a dataset, which says all itself; leave it out")


def read_file(path: Path, options: ReadOptions, foreign: ForeignReader, hear: Hear) -> tuple[list[Run], list[str]]:
    """Runs of one file (a dataset holds many), and the faults of its other runs."""
    source = str(path)
    if not path.is_file():
        raise DataError(f"{source}: is no plain file; give a log or a folder of logs")
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise DataError(f"{source}: is empty; record the log again")
    if (remedy := unread(head)) is not None:
        raise DataError(f"{source}: is {remedy}")
    form = format_of(head)
    sha256 = sha256_of(path)
    origin = Origin(_stem(path), source, sha256, path.name)
    if not form.reader:
        return [run_of(origin, read_text(path, source, partial(hear.share, source)), options)], []
    with foreign.alone:
        if form.name == "HDF5" and (is_as_written(path) is not None or foreign.tables(DATASET, path, source)):
            return read_dataset(path, source, sha256, lambda run: _of_dataset(options, hear, run))
        tables = foreign.tables(form, path, source)
        return [run_of(origin, tables, options)], []


def _of_dataset(options: ReadOptions, hear: Hear, run: Run) -> Run:
    _check_level(run)
    return hear.run(_checked_run(run, options))


def _checked_run(run: Run, options: ReadOptions) -> Run:
    """A run of a dataset, its rows checked like those of a log."""
    columns = {"time": run.time_s, "input": run.input, "output": run.output}
    if np.isnan(run.input).all():
        del columns["input"]
    keep = checked(run.where, columns, (), lambda i: i + 1, "sample", options.repair)
    if keep is None:
        return run
    dropped = finding("rows-dropped", run.name, dropped=len(run.time_s) - len(keep), count=len(run.time_s))
    return run.part(keep, findings=(*run.findings, dropped))


def _check_level(run: Run) -> None:
    """Refuse a cut run whose stored level is neither what its input goes to nor what it comes from."""
    if not run.cut or run.level is None or run.step_s is None or np.isnan(run.input).any():
        return
    at = int(np.searchsorted(run.time_s, run.step_s - 1e-9))
    parts = (run.input[at:], run.input[:at])
    ends = [abs(float(np.median(part))) for part in parts if len(part)]
    expected = len(parts[run.edge == "falling"])
    if expected and not any(abs(end - abs(run.level)) <= 0.02 * max(abs(run.level), end) + 1e-9 for end in ends):
        raise DataError(
            f"{run.where}: its level is {run.level:g}, its input goes to {ends[0]:g} {run.input_unit}; "
            f"ingest the logs again"
        )


def _stem(path: Path) -> str:
    name = path.name
    for ending in (*LOGS, ".txt", ".h5", ".hdf5"):
        name = name[: -len(ending)] if name.lower().endswith(ending) else name
    return name or path.name
