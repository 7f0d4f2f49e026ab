"""Logs → runs: every file of a call, in any format, all their faults at once."""

import itertools
import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.files import LOGS, is_as_written, sha256_of
from eaid.findings import Finding, finding
from eaid.logs.dataset import read_dataset
from eaid.logs.folders import files_of
from eaid.logs.formats import ForeignReader, format_of, unread
from eaid.logs.run import Run
from eaid.logs.text import read_text
from eaid.logs.to_run import checked, run_of
from eaid.options import ReadOptions
from eaid.shown import counted, listed


def levels_in_names(runs: Sequence[Run]) -> None:
    """Raise DataError where the inputs say only on or off, but outputs and numbers in the logs' names differ.

    Taken as they are, logs of different levels would count as repeats of one.
    """
    guessed = {"input-unnamed", "input-by-its-steps"}
    switched = [
        run
        for run in runs
        if guessed & {one.code for one in run.findings}
        and not run.dataset
        and run.level is None
        and set(np.unique(run.input)) <= {0.0, 1.0}
    ]
    swings = [float(np.ptp(np.nanquantile(run.output, (0.02, 0.98)))) for run in switched]
    if len(switched) < 2 or max(swings) < 1.5 * min(swings):  # outputs that are alike are repeats
        return
    if (pattern := differing_number([run.name for run in switched])) is None:
        return
    taken = dict(switched[0].taken)["input"]
    raise DataError(
        f"{switched[0].source} and {len(switched) - 1} more: {taken} says only on or off, and the names of the logs "
        f'differ in a number; say that it is the level with «name_pattern» "{pattern}", or that 1 is the level of all '
        f'with «columns» input="{taken}"'
    )


def differing_number(names: Sequence[str]) -> str | None:
    """The first number in which some names differ as a pattern: `test_{level}V_`; None where they are not alike.

    Names count as alike where they differ in their numbers only.
    """
    parts = [re.split(r"(\d+(?:\.\d+)?)", name) for name in names]
    if len({tuple(one[::2]) for one in parts}) != 1:
        return None
    for k in range(1, len(parts[0]), 2):
        if len({one[k] for one in parts}) > 1:
            return f"{parts[0][k - 1]}{{level}}{parts[0][k + 1]}"
    return None


def scales_compared(runs: Sequence[Run]) -> list[Run]:
    """Runs in %; one that stays within 1 while others go to 100 is a fraction, and says so.

    Those of datasets were compared when they were ingested.
    """
    in_pct = (run.input_unit == "%" and not run.dataset and len(run.input) > 0 for run in runs)
    largest = [float(np.abs(run.input).max()) if pct else np.nan for run, pct in zip(runs, in_pct, strict=True)]
    most = np.nanmax(largest) if not np.isnan(largest).all() else 0.0
    if not most > 1.5:
        return list(runs)
    others = {round(one, 3) for one in largest if one > 1.5}
    compared = []
    for run, top in zip(runs, largest, strict=True):
        if 0 < top < 1 or (top == 1 and 100.0 in others):
            run = replace(run, findings=(*run.findings, finding("input-in-fractions", run.name, other=float(most))))
        compared.append(run)
    return compared


UNIT_STEPS = (60.0, 3600.0, 86_400.0, 1e3, 1e6, 1e9)
"""Factors between units of time."""
SECONDS_ASSUMED = {"unit-assumed", "time-brief", "time-in-whole-numbers", "time-too-long", "time-too-fast"}


def clocks_compared(runs: Sequence[Run]) -> list[Run]:
    """Runs; one whose unit of time nobody says is told where its stamps lie as far from the usual as units do."""
    steps = [float(np.median(np.diff(run.time_s[:10_000]))) if len(run.time_s) > 1 else np.nan for run in runs]
    middle = sorted(steps)[len(steps) // 2] if steps else np.nan
    compared = list(runs)
    for i, run in enumerate(runs):
        of_time = {one.code for one in run.findings if one.values.get("role", "time") == "time"}
        others = steps[1 - i] if len(runs) == 2 else middle
        factor = max(steps[i], others) / min(steps[i], others)
        if of_time & SECONDS_ASSUMED and any(abs(factor / one - 1) < 0.02 for one in UNIT_STEPS):
            said = finding("time-unit-differs", run.name, usual_s=steps[i], others_s=others)
            compared[i] = replace(run, findings=(*run.findings, said))
    return compared


def columns_told(runs: Sequence[Run]) -> list[str]:
    """Which columns were taken of logs, and which were left, a sentence for all logs that are alike."""
    alike: Counter[tuple[str, str]] = Counter()
    for run in runs:
        if run.taken:
            units = {"time": "s", "input": run.input_unit, "output": run.output_unit, "position": run.position_unit}
            taken = [f"{role} = {name} [{units.get(role) or '?'}]" for role, name in run.taken]
            alike[", ".join(taken), ", ".join(run.left) or "none"] += 1
    return [f"columns of {counted(n, 'log')}: {taken}; left: {left}" for (taken, left), n in alike.items()]


def named_apart(runs: Sequence[Run]) -> list[Run]:
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


def joined(runs: Sequence[Run]) -> list[Run]:
    """Runs of one level and repeat (as their names say; all, where they say nothing) joined by time.

    Raises DataError where two overlap in time, or differ in what they hold.
    """
    groups: dict[tuple[float | None, int | None], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.level, run.repeat), []).append(run)
    return [_joined(sorted(members, key=lambda run: run.start_s)) for members in groups.values()]


def _joined(parts: list[Run]) -> Run:
    first = parts[0]
    if len(parts) == 1:
        return first
    for before, after in itertools.pairwise(parts):
        end, start = before.start_s + float(before.time_s[-1]), after.start_s
        if start <= end:
            again = "; each begins its clock anew" if start == before.start_s else ""
            raise DataError(
                f"{after.where}: begins at {start:.6g} s, before {before.where} ends ({end:.6g} s){again}; "
                f"logs of one run must follow each other in time to be joined"
            )
        for what in ("input_unit", "output_unit"):
            if getattr(before, what) != getattr(after, what):
                raise DataError(
                    f"{after.where}: its {what.replace('_', ' ')} is not that of {before.where}; join like logs"
                )

    def whole(name: str) -> Array | None:
        """A column, where every part has it."""
        present = [column for part in parts if (column := getattr(part, name)) is not None]
        return read_only(np.concatenate(present)) if len(present) == len(parts) else None

    others = [f"{part.source} ({part.sha256[:12]})" for part in parts[1:]]
    found = list[Finding]()
    for part in parts:  # each finding once
        found.extend(one for one in part.findings if one not in found)
    time_s = np.concatenate([part.time_s + (part.start_s - first.start_s) for part in parts])
    columns: dict[str, Any] = {name: whole(name) for name in ("input", "output", "reference_nm", "position")}
    return replace(
        first,
        name=re.sub(r"[-_. ]?(part)?[-_. ]?(?<!\d)0*1$", "", first.name) or first.name,
        time_s=read_only(time_s),
        **columns,
        findings=(*found, finding("logs-joined", first.name, others=listed(others, 3))),
    )


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
    if runs and all(run.dataset for run in runs):  # whose columns are known
        of_columns = ("columns", "units", "name_pattern", "step_at", "until", "variable", "rate_hz", "join")
        if said := [name for name in of_columns if name in options.given()]:
            where = runs[0].dataset
            raise UsageError(f"«{said[0]}»: does nothing on {where}, a dataset, which says all itself; leave it out")
    return together(runs, faults, options)


def together(runs: Sequence[Run], faults: list[str], options: ReadOptions) -> tuple[list[Run], list[str]]:
    """Runs of one call: joined where that is wanted, compared, named apart."""
    each = list(runs)
    if not faults:
        try:
            levels_in_names(each)
            if options.join:
                each = joined(each)
        except DataError as fault:
            return [], list(fault.sentences)
    each = each if "input" in options.units else scales_compared(each)
    return named_apart(each if "time" in options.units else clocks_compared(each)), faults


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
    name = path.name
    for ending in (*LOGS, ".txt", ".h5", ".hdf5"):
        name = name[: -len(ending)] if name.lower().endswith(ending) else name
    if not form.reader:
        tables = read_text(path, source, partial(hear.share, source))
        return [run_of(name or path.name, source, sha256, tables, options, path.name)], []
    with foreign.alone:
        sealed = form.name == "HDF5" and is_as_written(path) is not None
        tables = [] if sealed else foreign.tables(form, path, source)
        if not tables:
            return read_dataset(path, source, sha256, lambda run: hear.run(_checked_run(run, options)))
        return [run_of(name or path.name, source, sha256, tables, options, path.name)], []


def _checked_run(run: Run, options: ReadOptions) -> Run:
    """A run of a dataset, its rows checked like those of a log.

    Raises DataError where a cut run's stored level is neither what its input goes to nor what it comes from.
    """
    if run.cut and run.level is not None and run.step_s is not None and not np.isnan(run.input).any():
        at = int(np.searchsorted(run.time_s, run.step_s - 1e-9))
        parts = (run.input[at:], run.input[:at])
        ends = [abs(float(np.median(part))) for part in parts if len(part)]
        near = (abs(end - abs(run.level)) <= 0.02 * max(abs(run.level), end) + 1e-9 for end in ends)
        if len(parts[run.edge == "falling"]) and not any(near):
            raise DataError(
                f"{run.where}: its level is {run.level:g}, its input goes to {ends[0]:g} {run.input_unit}; "
                f"ingest the logs again"
            )
    columns = {"time": run.time_s, "input": run.input, "output": run.output}
    if np.isnan(run.input).all():
        del columns["input"]
    keep = checked(run.where, columns, (), lambda i: i + 1, "sample", options.repair)
    if keep is None:
        return run
    dropped = finding("rows-dropped", run.name, dropped=len(run.time_s) - len(keep), count=len(run.time_s))
    return run.part(keep, findings=(*run.findings, dropped))
