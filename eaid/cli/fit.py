"""`eaid fit`: logs or a dataset → fit.json, with a verdict and what the data cannot tell."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console, inputs
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.fitting.options import FitOptions
    from eaid.fitting.result import Fit
    from eaid.steps.stepset import StepSet

NOT_CONVERGED = 4
"""Exit code of a fit that did not converge; its result is written all the same, marked."""
CI = ("robust", "bootstrap", "profile", "white", "none")

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
Estimator = Annotated[str, typer.Option(help="Nonlinear model: joint (the paper's) or two-stage.")]
Ci = Annotated[str, typer.Option(help="Intervals: robust, bootstrap, profile, white or none.")]


def command(
    data: Data,
    output: Output = Path("fit.json"),
    model: Model = None,
    share: Share = "0.85",
    estimator: Estimator = "joint",
    weights: Weights = "equal",
    loss: Loss = "squares",
    hold_out: HoldOut = None,
    bounds: BoundsOption = "zero-offset",
    bounds_levels: BoundsLevels = None,
    ci: Ci = "robust",
    columns: inputs.Columns = None,
    units: inputs.Units = None,
    name_pattern: inputs.NamePattern = None,
    step_at: inputs.StepAt = None,
    until: inputs.Until = None,
    repair: inputs.Repair = False,
    kind: inputs.KindOption = None,
    levels: inputs.Levels = None,
    baseline: inputs.Baseline = "auto",
    sign: inputs.Sign = "auto",
    variable: inputs.Variable = None,
    rate: inputs.Rate = None,
    rest: inputs.Rest = 0.0,
    join: inputs.Join = False,
    apparatus: inputs.ApparatusOption = None,
    seed: Seed = 0,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> int:
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a fit did not converge; the result is written, marked.
    """
    console.be_quiet(quiet)
    one_thread()
    from eaid.files import refuse_to_overwrite
    from eaid.fitting.options import FitOptions, check

    assert output is not None
    refuse_to_overwrite(output, force)
    if ci not in CI:
        raise UsageError(f"--ci {ci}: must be one of {', '.join(CI)}")
    options = FitOptions(
        models=None if model is None else tuple(name.strip() for name in model.split(",") if name.strip()),
        share=share_of(share),
        weights=weights,
        loss=loss,
        hold_out=numbers("--hold-out", hold_out),
        bounds=bounds,
        estimator=estimator,
    )
    check(options)
    stepset = inputs.stepset_from(
        data, columns=columns, units=units, name_pattern=name_pattern, step_at=step_at, until=until, repair=repair,
        kind=kind, levels=levels, baseline=baseline, sign=sign, variable=variable, rate=rate, rest=rest,
        apparatus=apparatus, join=join,
    )  # fmt: skip
    options = with_bounds_levels(options, bounds_levels, stepset)
    result, fit = fitted(stepset, options, ci, seed)
    from eaid.cli.fit_tables import tables
    from eaid.cli.interval_tables import interval_tables
    from eaid.store import write_json

    write_json(output, result, force)
    if json:
        console.print_json(result)
    else:
        tables(result)
        interval_tables(result)
    tell_doubts(stepset)
    for part in ("friction", "nonlinear", "linear", "release"):
        for warning in result.get(part, {}).get("warnings", []):
            console.warn(f"{part}: {warning}")
    for warning in result["warnings"]:
        console.warn(warning)
    console.say(
        f"{output}: {', '.join(name for name in ('friction', 'nonlinear', 'linear', 'release') if name in result)}"
    )
    if not fit.converged:
        console.fail(f"{output}: a fit did not converge; the result is written and marked, do not use its numbers")
        return NOT_CONVERGED
    return 0


def one_thread() -> None:
    """Keep BLAS on one thread: these kernels are short, and thread pools fight over them and start slowly."""
    import os
    import sys

    if "numpy" not in sys.modules:
        for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
            os.environ.setdefault(name, "1")


def share_of(text: str) -> float | None:
    """C of `--share`: a number, or None for free."""
    if text == "free":
        return None
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--share {text}: give a number between 0 and 1, or free") from None


def numbers(option: str, text: str | None) -> tuple[float, ...]:
    """`40,70` as numbers."""
    try:
        return tuple(float(word) for word in (text or "").split(",") if word.strip())
    except ValueError:
        raise UsageError(f"{option} {text}: write levels with commas between them, as 40,70") from None


def with_bounds_levels(options: "FitOptions", text: str | None, stepset: "StepSet") -> "FitOptions":
    """The options with the levels that `--bounds-levels` picks from the set: 20:100 or 30,40,90."""
    if text is None:
        return options
    from dataclasses import replace

    there = [level.level for level in stepset.levels]
    low, colon, high = text.partition(":")
    if colon:
        ends = numbers("--bounds-levels", f"{low or '-inf'},{high or 'inf'}")
        kept = tuple(u for u in there if ends[0] <= u <= ends[1])
    else:
        wanted = numbers("--bounds-levels", text)
        kept = tuple(u for u in there if any(abs(u - w) <= 1e-9 * max(1.0, abs(u)) for w in wanted))
    if not kept:
        raise UsageError(f"--bounds-levels {text}: holds none of the levels {', '.join(f'{u:g}' for u in there)}")
    return replace(options, bounds_levels=kept)


def fitted(stepset: "StepSet", options: "FitOptions", ci: str, seed: int) -> "tuple[dict[str, Any], Fit]":
    """The body of fit.json, and the fit behind it."""
    from dataclasses import asdict

    from eaid.fitting.fit import fit
    from eaid.fitting.to_json import to_json
    from eaid.store import stamped
    from eaid.uncertainty.intervals import IntervalOptions, attach, intervals

    found = fit(stepset, options)
    how = IntervalOptions(ci=ci, seed=seed, estimator=options.estimator, workers=processors())
    with console.progress("bootstrap refits", how.draws if ci == "bootstrap" else 0) as advance:
        sure = intervals(stepset, found, how, advance)
    told = {"options": {**asdict(options), "share": options.share if options.share is not None else "free", "ci": ci}}
    body = attach(to_json(found, stepset), sure, options.estimator)
    return stamped("eaid/fit/1", {**told, "seed": seed, **body}), found


def processors() -> int:
    """Processors that this process may use."""
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def tell_doubts(stepset: "StepSet") -> None:
    """The doubts about the logs on stderr: one line for all runs that share one, with the first run's numbers."""
    import re

    for warning in stepset.warnings:
        console.warn(warning)
    alike: dict[str, list[tuple[str, str]]] = {}
    for run in stepset.runs:
        for warning in run.warnings:
            kind = re.sub(r"[-+]?\d[\d.e+-]*", "#", warning.split(":")[0])
            alike.setdefault(kind, []).append((run.name, warning))
    for told in alike.values():
        name, warning = told[0]
        more = f" (and {len(told) - 1} more runs, see eaid ingest)" if len(told) > 1 else ""
        console.warn(f"{name}: {warning}{more}")
