"""Logs as every command takes them: the input options, under the same names, and the one function that reads."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from eaid.cli import console
from eaid.errors import DataError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from eaid.apparatus import Apparatus
    from eaid.logs.options import ReadOptions
    from eaid.logs.run import Kind, Run
    from eaid.steps.build import StepOptions
    from eaid.steps.stepset import StepSet

KINDS = ("clutch", "friction-force", "friction-speed")

Logs = Annotated[list[Path], typer.Argument(metavar="LOG…", help="Log files, folders of them, or a data.h5.")]
Columns = Annotated[
    str | None,
    typer.Option(help='Column of each role, by name or number: time=Time,input=Volts,output="Load Cell".'),
]
Units = Annotated[str | None, typer.Option(help="Unit that a column is in: time=us,output=g.")]
NamePattern = Annotated[
    str | None,
    typer.Option(help="Level and repeat from file names, found anywhere in them: '_V={level}_', 'run{repeat}'."),
]
StepAt = Annotated[float | None, typer.Option(help="Step instant, in seconds of the log.")]
Until = Annotated[float | None, typer.Option(help="End of the active window, in seconds of the log.")]
Repair = Annotated[bool, typer.Option("--repair", help="Drop bad rows, up to 1 % of a log, and say how many.")]
KindOption = Annotated[str | None, typer.Option("--kind", help="Experiment: clutch, friction-force or friction-speed.")]
Levels = Annotated[str | None, typer.Option(help="Levels to keep: 30:100 or 30,40,90.")]
KeepBaseline = Annotated[bool, typer.Option("--keep-baseline", help="Do not subtract the idle output.")]
Baseline = Annotated[
    str,
    typer.Option(help="Value before each step: auto (its last rest), first, none, VALUE, or FROM:TO in s to the step."),
]
Sign = Annotated[str, typer.Option(help="auto: an output recorded inverted is turned; keep: never.")]
Variable = Annotated[
    str | None, typer.Option(help="Table of a file with several: a MAT variable, an HDF5 path, a TDMS group.")
]
Rate = Annotated[float | None, typer.Option(help="Sample rate of logs without a time column, in Hz.")]
Join = Annotated[bool, typer.Option("--join", help="The logs are one run that the logger cut: join them by time.")]
Rest = Annotated[float, typer.Option(help="Input at rest, in its own unit; levels are counted from it.")]
ApparatusOption = Annotated[
    str | None,
    typer.Option("--apparatus", help="The rig, where it is not the paper's: inner_radius_m=0.03,surfaces=1."),
]


def apparatus_from(text: str | None, kind: str | None) -> "Apparatus | None":
    """The rig that `--apparatus` describes; what it leaves out is the paper's. None where nothing is said."""
    if not text:
        return None
    from dataclasses import fields
    from math import isfinite

    from eaid.apparatus import Apparatus

    numbers: dict[str, Any] = {"surfaces": 1 if kind in KINDS[1:] else 2}
    known = [field.name for field in fields(Apparatus)]
    for name, value in pairs("--apparatus", text).items():
        if name not in known:
            raise UsageError(f"--apparatus: knows {', '.join(known)}, not {name}")
        try:
            numbers[name] = int(value) if name == "surfaces" else float(value)
        except ValueError:
            raise UsageError(f"--apparatus {name}={value}: is no number") from None
        if not (isfinite(numbers[name]) and numbers[name] > 0):
            raise UsageError(f"--apparatus {name}={value}: must be above zero")
    rig = Apparatus(**numbers)
    if rig.inner_radius_m >= rig.outer_radius_m:
        raise UsageError("--apparatus: inner_radius_m must be below outer_radius_m")
    return rig


def pairs(option: str, text: str | None) -> dict[str, str]:
    """`time=Time,output="Load Cell"` as a dictionary; raises UsageError where it is written otherwise."""
    if not text:
        return {}
    import csv

    found: dict[str, str] = {}
    # a quote may open after the equals sign: move it in front of the pair, where csv expects it
    import re

    moved = re.sub(r'(^|,)\s*(\w+)\s*=\s*"', r'\1"\2=', text)
    for pair in next(csv.reader([moved], skipinitialspace=True)):
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


@dataclass(frozen=True)
class InputOptions:
    """The input options as typed; a manifest stands in for those that were not."""

    columns: str | None = None
    units: str | None = None
    name_pattern: str | None = None
    step_at: float | None = None
    until: float | None = None
    repair: bool = False
    kind: str | None = None
    levels: str | None = None
    baseline: str = "auto"
    sign: str = "auto"
    variable: str | None = None
    rate: float | None = None
    rest: float = 0.0
    apparatus: str | None = None
    join: bool = False

    def reading(self) -> "ReadOptions":
        """What the readers of logs need of them; raises UsageError where one is wrong."""
        from eaid.logs.options import ReadOptions

        if self.kind is not None and self.kind not in KINDS:
            raise UsageError(f"--kind {self.kind}: must be one of {', '.join(KINDS)}")
        if self.rate is not None and not self.rate > 0:
            raise UsageError(f"--rate {self.rate:g}: must be above zero")
        return ReadOptions(
            columns=pairs("--columns", self.columns),
            units=pairs("--units", self.units),
            name_pattern=self.name_pattern,
            step_at_s=self.step_at,
            until_s=self.until,
            repair=self.repair,
            kind=cast("Kind | None", self.kind),
            variable=self.variable,
            rate_hz=self.rate,
            join=self.join,
        )

    def stepping(self) -> "StepOptions":
        """What finding steps needs of them."""
        from eaid.steps.baseline import baseline_rule
        from eaid.steps.build import StepOptions

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


LONG_LOG = 1 << 26
"""Size of a log [bytes] above which its reading is told tenth by tenth."""


def _tenths() -> "Callable[[str, float], None]":
    """Tells how much of each long log is read, once a tenth."""
    done: dict[str, int] = {}

    def tell(source: str, share: float) -> None:
        tenth = int(10 * share)
        if tenth > done.get(source, 0):
            done[source] = tenth
            console.say(f"{source}: {10 * tenth} % read")

    return tell


def stepset_from(paths: Sequence[Path], **options: Any) -> "StepSet":
    """The step set behind logs, datasets or a manifest; takes the fields of `InputOptions`."""
    return runs_from(paths, **options)[1]


def runs_from(paths: Sequence[Path], **options: Any) -> "tuple[list[Run], StepSet]":
    """Cut runs and their step set; takes the fields of `InputOptions`, and tells all faults of all logs at once."""
    from eaid.files import sha256_of
    from eaid.logs.folders import files_of
    from eaid.logs.manifest import apply, manifest_of
    from eaid.logs.read import read_what_can_be
    from eaid.steps.build import cut_runs, stepset_of

    typed = InputOptions(**options)
    manifest = manifest_of(paths)
    if manifest is None:
        files = files_of(paths, console.warn)
    else:
        files = [entry.path for entry in manifest.logs]
        plain = InputOptions()
        said = {k: v for k, v in manifest.options.items() if getattr(typed, k) == getattr(plain, k)}
        typed = replace(typed, **said)
        for name in manifest.unlisted()[:5]:
            console.warn(f"{manifest.path}: does not list {name}, which is left out")
    reading, stepping = typed.reading(), typed.stepping()
    if any(file.is_file() and file.stat().st_size > LONG_LOG for file in files):
        reading = replace(reading, tell=_tenths())
    with console.progress("reading logs", len(files)) as advance:
        runs, faults = read_what_can_be(files, reading, advance)
    if manifest is not None:
        entries = {str(entry.path): entry for entry in manifest.logs}
        runs = [apply(entries[run.source], run) if run.source in entries else run for run in runs]
    steps, more = cut_runs(runs, stepping)
    if faults or more:
        raise DataError(*faults, *more)
    stepset = stepset_of(steps, stepping)
    if typed.levels is not None:
        kept = {run.name for run in stepset.runs}
        steps = [step for step in steps if step.name in kept]
    inputs = [{"path": str(path), "sha256": sha256_of(path)} for path in paths if path.is_file()]
    return steps, replace(stepset, extra={**stepset.extra, "inputs": inputs})
