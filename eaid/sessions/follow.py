"""At the rig: each new log of a folder is read once it is whole, and held against what the rig's sessions foresee.

A file is whole when neither its size nor its time has changed for some looks, twice as many as it ever stood still
for while it grew, and for longer where its last row is not ended, or where it holds no more seconds than have passed
since it came: a logger may write it as it records, and flush it every few seconds. What is expected of a step is
the next session's T_s given the steps before it that were as expected, widened by how much single runs scatter.
"""

import csv
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from eaid.errors import DataError, UsageError
from eaid.levels.workflow import fit_steps
from eaid.logs.folders import MANIFEST, files_of, logs_meant, read_manifest
from eaid.logs.read import read_runs
from eaid.logs.run import Run
from eaid.options import FitOptions, ReadOptions
from eaid.reading import steps_in
from eaid.results.fit import Fit
from eaid.sessions.model import steps_known
from eaid.sessions.rig import Rig
from eaid.sessions.today import on_plant

LOOK_S = 0.5  # From one look at the folder to the next [s]
WAITS, UNFINISHED = 1, 12  # Looks for which a file has to stand still, and one whose last row is not ended
FLUSHED_S = 5.0  # From which on a log holds more than a logger that writes as it records has recorded since it came [s]
ROWS_END = {".csv", ".txt", ".tsv", ".dat", ".log", ".lvm"}  # Logs whose rows end in a new line
State = tuple[int, float]


def whole_files(
    paths: Sequence[Path], silence_s: float, lasts_s: Callable[[Path], float] = lambda _: np.inf
) -> Iterator[Path]:
    """New files one by one, each once it is whole, and again where it grows after all; ends after so much silence [s],
    0: never. `lasts_s` tells how many seconds a log holds."""
    before, done, quiet_s, came = dict[Path, State](), dict[Path, State](), 0.0, dict[Path, float]()
    lasted = dict[Path, tuple[State, float]]()
    there: set[Path] | None = None  # What no logger is writing
    still, paused = Counter[Path](), Counter[Path]()  # Looks that it stands still, and that it stood so while it grew
    while not silence_s or quiet_s < silence_s:
        now = dict[Path, State]()
        for folder in paths:
            with suppress(DataError):  # no log yet
                now |= {file: (of.st_size, of.st_mtime) for file in files_of([folder]) for of in (file.stat(),)}
        for file in now:
            same = before.get(file) == now[file]
            if not same and file in before:
                paused[file] = max(paused[file], still[file] + 1)
            still[file] = still[file] + 1 if same else 0
        pending = [file for file, state in now.items() if done.get(file) != state]
        there = set(now) if there is None else there
        came |= dict.fromkeys(now.keys() - came.keys(), time.monotonic())
        stood = [file for file in pending if still[file] >= max(WAITS, 2 * paused[file]) and ended(file, still[file])]
        for file in stood:
            if file not in lasted or lasted[file][0] != now[file]:  # read once for each state of it
                lasted[file] = now[file], np.inf if file in there else lasts_s(file)
        age_s = {file: time.monotonic() - came[file] for file in stood}
        fresh = [one for one in stood if still[one] >= UNFINISHED or lasted[one][1] > age_s[one] + FLUSHED_S]
        quiet_s = 0.0 if now != before or pending else quiet_s + LOOK_S
        before = now
        done |= {file: now[file] for file in fresh}
        yield from fresh
        time.sleep(LOOK_S)


def ended(file: Path, still: int) -> bool:
    """Whether the last row of a log is ended, or has not been for so long that it stays so."""
    if file.suffix.lower() not in ROWS_END or still >= UNFINISHED:
        return True
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - 1))
        return opened.read(1) in (b"\n", b"\r", b"\0")  # the last of UTF-16


def followed(
    paths: Sequence[Path], reading: ReadOptions, silence_s: float, unread: set[Path], rig: Rig | None = None,
    plan: Path | None = None,
) -> Iterator[str]:  # fmt: skip
    """A line for each step as it comes, and one for the next by the plan; `unread` takes the files that are no logs.

    DataError where a dataset.toml beside the logs cannot be read.
    """
    for at in (path / MANIFEST for path in paths):
        if at.is_file():  # told before the first log comes
            read_manifest(at)
    rows, shown = planned(plan) if plan else [], dict[Path, list[tuple[float, float]]]()
    held = dict[Path, tuple[Sequence[Run], ReadOptions]]()  # Read to see how long they last

    def read(file: Path) -> tuple[Sequence[Run], ReadOptions]:
        logs, how = logs_meant([file], reading, lambda _: None)  # with what a dataset.toml beside it says
        return read_runs(logs, how), how

    def lasts_s(file: Path) -> float:
        held.pop(file, None)
        with suppress(DataError):
            held[file] = read(file)
        return (
            max((float(run.time_s[-1] - run.time_s[0]) for run in held[file][0]), default=0.0) if file in held else 0.0
        )

    for file in whole_files(paths, silence_s, lasts_s):
        try:
            runs, how = held.pop(file) if file in held else read(file)
            fit = fit_steps(steps := steps_in(runs, how)[1], FitOptions(model=("friction",)))
            fit = on_plant(rig.base, fit, steps) if rig is not None and rig.base is not None else fit
        except DataError as fault:
            unread.add(file)
            yield f"{fault.sentences[0]}; record it again?"
            continue
        unread.discard(file)
        shown = {one: of for one, of in shown.items() if one.exists()} | {file: []}  # without what was renamed
        rows_from_rest = [one for one in fit.friction_levels if one.from_ == 0]
        if not rows_from_rest:
            yield from map(_line_without_step, runs)
        for row in rows_from_rest:
            before = [one for each in shown.values() for one in each]
            try:
                said, fine = _judged_value(fit, row.level, row.Ts, rig, before)
            except DataError as fault:
                said, fine = f"{file}: {fault.sentences[0]}", False
            shown[file] += [(row.level, row.Ts)] if fine else []
            yield said
        if rows:
            yield next_planned(rows, [level for each in shown.values() for level, _ in each], fit.data.input_unit)


def _judged_value(
    fit: Fit, level: float, value: float, rig: Rig | None, shown: Sequence[tuple[float, float]]
) -> tuple[str, bool]:
    """`60 %: T_s 1.58 N·m (expected 1.31 … 1.9) ok`, and whether it is so."""
    data = fit.data
    said = f"{level:.4g} {data.input_unit}".rstrip() + f": T_s {value:.3g} {data.output_unit}".rstrip()
    if rig is None or not value > 0:
        return said, value > 0
    if (data.input_unit, data.output_unit) != (rig.input_unit, rig.main.unit):
        raise DataError(
            f"the steps are in {data.input_unit} and {data.output_unit}, the rig in {rig.input_unit} and "
            f"{rig.main.unit}; say the units with «units»"
        )
    known = steps_known([(*one, rig.main.sd_step) for one in shown])
    low, high = rig.foreseen(np.array([level]), known).of_a_run(rig.main.sd_step**2)
    fine = low <= value <= high
    near = not fine and f"{value:.3g}" in (f"{low:.3g}", f"{high:.3g}")
    ends = " … ".join(f"{end:.{5 if near else 3}g}" for end in (low, high))
    return f"{said} (expected {ends}) {'ok' if fine else 'outside: record again?'}", fine


def _line_without_step(run: Run) -> str:
    """What a log holds that no step from rest is in."""
    inputs = f"{run.input.min():.3g} … {run.input.max():.3g} {run.input_unit}".rstrip() if run.has_input else "no input"
    outputs = f"{run.output.min():.3g} … {run.output.max():.3g} {run.output_unit}".rstrip()
    return (
        f"{run.where}: {run.time_s[-1] - run.time_s[0]:.3g} s, {inputs}, {outputs}; not a step from rest, for which "
        "alone a value is expected; the fit at the end takes it"
    )


def planned(path: Path) -> list[tuple[float, float]]:
    """Level and hold [s] of each run of a plan.csv, in order."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [(float(row["level"]), float(row["hold_s"])) for row in csv.DictReader(file)]
    except (OSError, KeyError, TypeError, ValueError) as fault:
        raise UsageError(f"«plan» {path}: is no plan.csv of eaid plan ({fault}); give one") from None


def next_planned(rows: Sequence[tuple[float, float]], recorded: Sequence[float], unit: str) -> str:
    """The first run of the plan that is still to be recorded."""
    left = Counter(f"{level:.3g}" for level in recorded)
    for level, hold_s in rows:
        if not left[f"{level:.3g}"]:
            return f"next by plan: {level:.4g} {unit}".rstrip() + f", {hold_s:.3g} s"
        left[f"{level:.3g}"] -= 1
    return "next by plan: nothing, all is recorded"
