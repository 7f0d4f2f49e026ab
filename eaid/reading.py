"""Logs → steps: what the user may say about logs, and the one way from files or tables to a `StepSet`."""

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import isfinite
from pathlib import Path
from typing import Any, cast

from eaid.apparatus import Apparatus
from eaid.errors import DataError, UsageError, unknown
from eaid.files import sha256_of
from eaid.limits import check_all
from eaid.logs.folders import files_of
from eaid.logs.manifest import apply, manifest_of
from eaid.logs.moves import is_recorded
from eaid.logs.options import ReadOptions
from eaid.logs.read import read_what_can_be
from eaid.logs.run import Kind, Run
from eaid.logs.together import columns_told
from eaid.progress import Progress, no_progress
from eaid.steps.baseline import baseline_rule
from eaid.steps.build import stepset_of
from eaid.steps.cut_runs import StepOptions, cut_runs, settled_steps
from eaid.steps.edges import Edge, edges
from eaid.steps.not_steps import looks_like
from eaid.steps.stepset import StepSet

KINDS = ("clutch", "friction-force", "friction-speed")


def apparatus_from(text: str | Apparatus | None, kind: str | None) -> Apparatus | None:
    """The rig that `«apparatus»` describes; what it leaves out is the paper's. None where nothing is said."""
    if not text or isinstance(text, Apparatus):
        return text or None
    numbers: dict[str, float] = {}
    known = [field.name for field in fields(Apparatus)]
    for name, value in pairs("«apparatus»", text).items():
        if name not in known:
            raise UsageError(unknown("«apparatus»", name, known))
        try:
            numbers[name] = int(value) if name == "surfaces" else float(value)
        except ValueError:
            raise UsageError(f"«apparatus» {name}={value}: is no number") from None
        if not (isfinite(numbers[name]) and numbers[name] > 0):
            raise UsageError(f"«apparatus» {name}={value}: must be above zero")
    rig = replace(Apparatus(surfaces=1 if kind in KINDS[1:] else 2), **cast(Any, numbers))
    if rig.inner_radius_m >= rig.outer_radius_m:
        raise UsageError("«apparatus»: inner_radius_m must be below outer_radius_m")
    return rig


def pairs(option: str, text: str | Mapping[str, Any] | None) -> dict[str, str]:
    """`time=Time,output="Load Cell"` as a dictionary; raises UsageError where it is written otherwise."""
    if not text or isinstance(text, Mapping):
        return {role: str(name) for role, name in (text or {}).items()}
    found: dict[str, str] = {}
    # a quote may open after the equals sign: move it in front of the pair, where csv expects it
    moved = re.sub(r'(^|,)\s*(\w+)\s*=\s*"', r'\1"\2=', text)
    try:
        cells = next(csv.reader([moved], skipinitialspace=True))
    except (csv.Error, StopIteration):
        raise UsageError(f"{option} {text!r}: holds a line break; write all pairs on one line") from None
    for pair in cells:
        role, equals, name = pair.partition("=")
        role, name = role.strip(), name.strip()
        if not equals or not role or not name:
            raise UsageError(
                f"{option} {text}: write role=name pairs with commas between them, as time=Time,output=Force"
            )
        if role in found:
            raise UsageError(f"{option} {text}: says {role} twice")
        found[role] = name
    return found


def _typed(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, Mapping):
        return ",".join(f'{role}="{name}"' for role, name in value.items())
    if isinstance(value, Apparatus):
        return ",".join(f"{field.name}={getattr(value, field.name)}" for field in fields(value))
    return str(value)


@dataclass(frozen=True)
class InputOptions:
    """What may be said about logs, by the names of the options; a manifest stands in for what was not."""

    columns: str | Mapping[str, Any] | None = None
    """`time=Time,input=Volts`, or a mapping of role to column."""
    units: str | Mapping[str, str] | None = None
    name_pattern: str | None = None
    step_at: float | None = None
    until: float | None = None
    repair: bool = False
    kind: str | None = None
    levels: str | None = None
    baseline: str = "auto"
    sign: str = "auto"
    variable: str | None = None
    rate_hz: float | None = None
    rest: float = 0.0
    apparatus: str | Apparatus | None = None
    join: bool = False

    def given(self) -> dict[str, str | float | bool]:
        """What was said, so that it can be done again."""
        plain = InputOptions()
        said = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: value if isinstance(value, float | bool) else _typed(value)
            for name, value in said.items()
            if value != getattr(plain, name)
        }

    def reading(self) -> ReadOptions:
        """What the readers of logs need of them; raises UsageError where one is wrong."""
        if self.kind is not None and self.kind not in KINDS:
            raise UsageError(unknown("«kind»", self.kind, KINDS))
        if self.rate_hz is not None and not self.rate_hz > 0:
            raise UsageError(f"«rate_hz» {self.rate_hz:g}: must be above zero")
        check_all(rest=self.rest, step_at=self.step_at, until=self.until)
        return ReadOptions(
            columns=pairs("«columns»", self.columns),
            units=pairs("«units»", self.units),
            name_pattern=self.name_pattern,
            step_at_s=self.step_at,
            until_s=self.until,
            repair=self.repair,
            kind=cast("Kind | None", self.kind),
            variable=self.variable,
            rate_hz=self.rate_hz,
            join=self.join,
        )

    def stepping(self) -> StepOptions:
        """What finding steps needs of them."""
        if self.sign not in ("auto", "keep"):
            raise UsageError(f"«sign» {self.sign}: must be auto or keep")
        return StepOptions(
            kind=cast("Kind | None", self.kind),
            levels=self.levels,
            baseline=baseline_rule(self.baseline),
            keep_sign=self.sign == "keep",
            rest=self.rest,
            apparatus=apparatus_from(self.apparatus, self.kind),
        )


def read_steps(
    paths: Sequence[Path],
    options: InputOptions,
    progress: Progress = no_progress,
    warn: Callable[[str], None] = lambda _: None,
    tell: Callable[[str, float], None] = lambda _source, _share: None,
    whole: str = "steps",
    seen: Callable[[str], None] = lambda _: None,
) -> tuple[list[Run], StepSet]:
    """The cut runs behind logs, datasets, folders or a manifest, and their step set.

    `seen` hears which columns were taken and which were left, before anything else is done with them.

    `whole` says which logs are not cut and stand in `StepSet.recorded`: none (steps), those whose input does more than
    step from rest (auto), all (recorded).

    Raises
    ------
    DataError
        With the faults of all logs at once.
    """
    manifest = manifest_of(paths)
    if manifest is None:
        files = files_of(paths, warn)
    else:
        files = [Path(entry.file) for entry in manifest.logs]
        plain = InputOptions()
        said = {k: v for k, v in manifest.options.items() if getattr(options, k) == getattr(plain, k)}
        options = replace(options, **cast(Any, said))
        for name in manifest.unlisted()[:5]:
            warn(f"{manifest.path}: does not list {name}, which is left out")
    options.stepping()  # what is wrong in the options is told before anything is read
    with progress("reading logs", len(files)) as advance:
        runs, faults = read_what_can_be(files, replace(options.reading(), tell=tell), advance)
    for sentence in columns_told(runs):
        seen(sentence)
    if manifest is not None:
        entries = {entry.file: entry for entry in manifest.logs}
        runs = [apply(entries[run.source], run) if run.source in entries else run for run in runs]
    return steps_of(runs, options, faults, [path for path in paths if path.is_file()], whole)


def _is_whole(run: Run, rest: float) -> bool:
    """Whether a log is fitted as it was recorded: its input does more than step from rest, or does it too fast."""
    if is_recorded(run, rest):
        return True
    may_be = run.kind in (None, "clutch") and not run.cut and {run.level, run.step_s, run.until_s} == {None}
    return may_be and run.position is None and run.has_input and looks_like(run) is not None


def read_edges(
    paths: Sequence[Path], options: InputOptions, warn: Callable[[str], None] = lambda _: None
) -> list[tuple[Run, tuple[Edge, ...]]]:
    """Logs and the edges of their outputs, whatever their inputs do: rise, overshoot and settling of each."""
    runs, faults = read_what_can_be(files_of(paths, warn), options.reading())
    if faults:
        raise DataError(*faults)
    return [(run, edges(run.time_s, run.output, run.reference_nm)) for run in runs]


def steps_of(
    runs: Sequence[Run],
    options: InputOptions,
    faults: Sequence[str] = (),
    paths: Sequence[Path] = (),
    whole: str = "steps",
) -> tuple[list[Run], StepSet]:
    """The same from runs that are read already; `faults` of reading are raised with those of finding steps."""
    stepping = options.stepping()
    uncut = [run for run in runs if whole == "recorded" or (whole == "auto" and _is_whole(run, options.rest))]
    steps, more = cut_runs([run for run in runs if not any(run is one for one in uncut)], stepping)
    if faults or more:
        raise DataError(*faults, *more)
    if uncut and not steps:
        first = uncut[0]
        rig = stepping.apparatus or first.apparatus or Apparatus()
        stepset = StepSet(options.kind or first.kind or "clutch", first.input_unit, first.output_unit, rig, ())
    else:
        stepset = stepset_of(steps, stepping)
    each = (*stepset.level_steps, *settled_steps(uncut, stepping))
    stepset = replace(stepset, recorded=tuple(uncut), level_steps=each)
    if options.levels is not None:
        kept = {run.name for run in stepset.runs}
        steps = [step for step in steps if step.name in kept]
    inputs = tuple((str(path), sha256_of(path)) for path in paths)
    return steps, replace(stepset, inputs=inputs, reading=options.given(), steps=tuple(steps))
