"""Logs as every command takes them: the input options, under the same names, and the one function that reads."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console

if TYPE_CHECKING:
    from collections.abc import Callable

    from eaid.logs.run import Run
    from eaid.steps.edges import Edge
    from eaid.steps.stepset import StepSet

Logs = Annotated[list[Path], typer.Argument(metavar="LOG…", help="Log files, folders of them, or a data.h5.")]
Columns = Annotated[
    str | None,
    typer.Option(help='Column of each role, by name or number: time=Time,input=Volts,output="Load Cell".'),
]
Units = Annotated[
    str | None,
    typer.Option(help="Unit that a column is in: time=us,output=g; input=/255: 255 counts are the full scale."),
]
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


def stepset_from(paths: Sequence[Path], whole: str = "steps", **options: Any) -> "StepSet":
    """The step set behind logs, datasets or a manifest; takes the fields of `eaid.reading.InputOptions`."""
    return runs_from(paths, whole, **options)[1]


def edges_from(paths: Sequence[Path], **options: Any) -> "list[tuple[Run, tuple[Edge, ...]]]":
    """Logs and the edges of their outputs; takes the fields of `eaid.reading.InputOptions`."""
    from eaid.reading import InputOptions, read_edges

    return read_edges(paths, InputOptions(**options), console.warn)


def runs_from(
    paths: Sequence[Path], whole: str = "steps", columns_told: bool = False, **options: Any
) -> "tuple[list[Run], StepSet]":
    """Cut runs and their step set; takes the fields of `eaid.reading.InputOptions`, `whole` as its `read_steps`."""
    from eaid.reading import InputOptions, read_steps

    long = any(path.is_file() and path.stat().st_size > LONG_LOG for path in paths)
    return read_steps(
        paths,
        InputOptions(**options),
        console.progress,
        console.warn,
        _tenths() if long else lambda _source, _share: None,
        whole,
        console.say if columns_told else lambda _: None,
    )
