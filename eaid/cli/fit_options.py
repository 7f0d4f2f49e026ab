"""The options of `eaid fit`, and what their texts mean."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eaid.cli import console
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.fitting.options import FitOptions
    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet

PARTS = ("friction", "nonlinear", "linear", "release", "steps")
NOT_TO_BE_USED = 4
"""Exit code of a fit that did not converge, or that a stop-finding speaks against; it is written, marked."""

Data = Annotated[list[Path], typer.Argument(metavar="DATA…", help="A data.h5, log files, or folders of them.")]
Model = Annotated[
    str | None,
    typer.Option(help="Models, with commas: friction,nonlinear,linear; all that the kind allows if not given."),
]
Share = Annotated[str, typer.Option(help="C, share of the fast part: a number between 0 and 1, or free.")]
Weights = Annotated[str, typer.Option(help="equal: every sample alike; sd: each level by the spread of its repeats.")]
Loss = Annotated[str, typer.Option(help="squares, or huber for logs with spikes and drop-outs.")]
HoldOut = Annotated[str | None, typer.Option(help="Levels not fitted, on which the error is reported: 40,70.")]
BoundsOption = Annotated[
    str, typer.Option("--bounds", help="b0 of one level: zero-offset, pooled-offset, pooled-dynamics.")
]
BoundsLevels = Annotated[str | None, typer.Option(help="Levels over which B_m and B_M are taken: 20:100 or 30,40,90.")]
Estimator = Annotated[
    str,
    typer.Option(help="Nonlinear model: auto (the one that the evidence supports), joint (the paper's) or two-stage."),
]
Shape = Annotated[str, typer.Option(help="Steps between levels: auto (by the evidence), one, two, free or overshoot.")]
Ci = Annotated[str, typer.Option(help="Intervals: robust, bootstrap, profile, white or none.")]
DeadTime = Annotated[
    str, typer.Option(help="Dead time of each single step in seconds: auto (by the evidence), 0 or another number.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Tell all findings and show all tables.")]


Tables = Annotated[bool, typer.Option("--tables", help="Show all numbers as tables.")]


def show(result: "Fit", tables: bool, verbose: bool) -> None:
    """The fit in a few lines, or all of its tables."""
    from eaid.results.summary import fit_summary

    for line in fit_summary(result, findings=0):
        console.line(line)
    if not tables:
        return
    from eaid.cli.fit_tables import tables as show_tables

    show_tables(result, verbose)
    if result.recorded is not None:
        from eaid.cli.fit_recorded import recorded_tables

        recorded_tables(result)


def share_of(text: str) -> float | None:
    """C of `--share`: a number, or None for free."""
    if text == "free":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"«share» {text}: give a number between 0 and 1, or free") from None


def dead_time_of(text: str) -> float | None:
    """θ of `--dead-time`: a number of seconds, or None for auto."""
    if text == "auto":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"«dead_time» {text}: give auto, or a time in seconds") from None


def models_of(text: str | None) -> tuple[str, ...] | None:
    """The models of `--model`; None: all."""
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise UsageError("«model»: name at least one of friction, nonlinear, linear")
    return names


def numbers(option: str, text: str | None) -> tuple[float, ...]:
    """`40,70` as numbers."""
    try:
        return tuple(float(word) for word in (text or "").split(",") if word.strip())
    except ValueError:
        raise UsageError(f"«{option}» {text}: write levels with commas between them, as 40,70") from None


def with_bounds_levels(options: "FitOptions", text: str | None, stepset: "StepSet") -> "FitOptions":
    """The options with the levels that `--bounds-levels` picks from the set: 20:100 or 30,40,90."""
    if text is None:
        return options
    from dataclasses import replace

    there = [level.level for level in stepset.levels]
    low, colon, high = text.partition(":")
    if colon:
        ends = numbers("bounds_levels", f"{low or '-inf'},{high or 'inf'}")
        kept = tuple(u for u in there if ends[0] <= u <= ends[1])
    else:
        wanted = numbers("bounds_levels", text)
        kept = tuple(u for u in there if any(abs(u - w) <= 1e-9 * max(1.0, abs(u)) for w in wanted))
    if not kept:
        raise UsageError(f"«bounds_levels» {text}: holds none of the levels {', '.join(f'{u:g}' for u in there)}")
    return replace(options, bounds_levels=kept)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


LogsAs = Annotated[
    str,
    typer.Option(
        "--logs-as",
        help="auto: logs whose input does more than step from rest are fitted as recorded; steps, or recorded: all.",
    ),
]
Duty = Annotated[str | None, typer.Option("--duty", help="Recorded logs: identified inputs, as 10:100.")]
Instrument = Annotated[
    bool, typer.Option("--instrument", help="Recorded closed loops: the simulated duty as an instrument.")
]


def logs_as(text: str) -> str:
    """How logs are taken."""
    if text not in ("auto", "steps", "recorded"):
        raise UsageError(f"«logs_as» {text}: must be auto, steps or recorded")
    return text
