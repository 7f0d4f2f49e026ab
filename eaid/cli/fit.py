"""`eaid fit`: logs or a dataset → fit.json, with a verdict and what the data cannot tell."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console, inputs
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.fitting.options import FitOptions
    from eaid.fitting.result import Fit, FrictionFit, LinearFit, NonlinearFit, ReleaseFit
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
    keep_baseline: inputs.KeepBaseline = False,
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
        kind=kind, levels=levels, keep_baseline=keep_baseline, variable=variable, rate=rate, rest=rest,
        apparatus=apparatus, join=join,
    )  # fmt: skip
    options = with_bounds_levels(options, bounds_levels, stepset)
    result, fit = fitted(stepset, options, ci, seed)
    from eaid.cli.sure import interval_tables
    from eaid.store import write_json

    write_json(output, result, force)
    if json:
        console.print_json(result)
    else:
        tables(fit, stepset)
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


def verdict_cell(converged: bool, at_bounds: tuple[str, ...]) -> str:
    """The verdict for a table."""
    if not converged:
        return "NOT CONVERGED"
    return "converged, at a constraint" if at_bounds else "converged"


def tables(fit: "Fit", stepset: "StepSet") -> None:
    """The fit for people, one short table a model."""
    unit, out = stepset.input_unit or "input", stepset.output_unit or "output"
    if fit.friction:
        friction_table(fit.friction, unit, out)
    if fit.nonlinear:
        nonlinear_table(fit.nonlinear, unit, out)
    if fit.linear:
        linear_table(fit.linear, unit, out)
    if fit.release:
        release_table(fit.release, unit, out)


def friction_table(part: "FrictionFit", unit: str, out: str) -> None:
    """T_s, τ1, τ2 of each level, and the trends."""
    rows = [
        [
            f"{f.level:g}", f"{f.curve.Ts:.5g}", f"{f.curve.tau1:.4g}", f"{f.curve.tau2:.4g}", f"{f.curve.C:.3g}",
            "-" if c is None else f"{c:.4g}", f"{f.rmse:.3g}", verdict_cell(f.solver.converged, f.solver.at_bounds),
        ]
        for f, c in zip(part.levels, part.C_f, strict=True)
    ]  # fmt: skip
    columns = [f"level [{unit}]", f"T_s [{out}]", "τ1 [s]", "τ2 [s]", "C", "C_f", f"RMSE [{out}]", "verdict"]
    console.table("Friction curve of each level, Eq. (3)", columns, rows)
    if part.trends:
        rows = [
            [name, trend.over, trend.form, ", ".join(f"{c:.5g}" for c in trend.coefficients), f"{trend.rmse:.3g}"]
            for name, trend in part.trends.items()
        ]
        console.table("Trends", ["value", "over", "form", "coefficients", "RMSE"], rows)


def nonlinear_table(part: "NonlinearFit", unit: str, out: str) -> None:
    """The coefficients, lowest power first."""
    p = part.parameters
    rows = [
        [name, what, ", ".join(f"{c:.6g}" for c in values)]
        for name, what, values in (
            ("τ1(u)", "s", p.tau1),
            ("τ2(u)", "s", p.tau2),
            ("T_s(u)", out, p.Ts),
            ("C", "1", (p.C,)),
            ("u", unit, p.u_range),
            ("RMSE", out, (part.rmse,)),
            ("|error|, mean and sd", out, (part.abs_mean, part.abs_sd)),
        )
    ]
    if part.hold_out:
        rows.append(["RMSE on held-out levels", out, f"{part.hold_out['rmse']:.6g}"])
    rows.append(["verdict", "", verdict_cell(part.solver.converged, part.solver.at_bounds)])
    console.table("Nonlinear model, Eqs. (4)–(7); polynomials lowest power first", ["", "unit", "value"], rows)


def linear_table(part: "LinearFit", unit: str, out: str) -> None:
    """a0, b0, c0, and the bounds of B."""
    p, b = part.parameters, part.bounds
    rows = [
        ["a0", "1/s", f"{p.a0:.6g}"],
        ["b0", f"{out}/(s·{unit})", f"{p.b0:.6g}"],
        ["c0", f"{out}/s", f"{p.c0:.6g}"],
        ["RMSE", out, f"{part.rmse:.6g}"],
        ["B_m … B_M", f"{unit}·s/({out})", f"{_number(b.B_m)} … {_number(b.B_M)} ({b.convention})"],
        ["verdict", "", verdict_cell(part.solver.converged, part.solver.at_bounds)],
    ]
    if part.hold_out:
        rows.insert(4, ["RMSE on held-out levels", out, f"{part.hold_out['rmse']:.6g}"])
    console.table("Linear model, Eq. (8), all levels at once", ["", "unit", "value"], rows)
    rows = [
        [f"{r.level:g}", f"{r.a0:.5g}", f"{r.gain:.5g}", f"{r.b0:.4g}", _number(r.B), f"{r.rmse:.3g}"]
        for r in part.per_level
    ]
    columns = [f"level [{unit}]", "a0 [1/s]", f"gain [{out}]", "b0", "B", f"RMSE [{out}]"]
    console.table(f"Linear model of each level ({b.convention})", columns, rows)


def release_table(part: "ReleaseFit", unit: str, out: str) -> None:
    """Falling beside rising time constants."""
    rows = [
        [
            f"{r.level:g}", f"{r.tau1:.4g}", _number(r.rising_tau1), f"{r.tau2:.4g}", _number(r.rising_tau2),
            f"{r.residual:.3g}", f"{r.rmse:.3g}",
        ]
        for r in part.levels
    ]  # fmt: skip
    rows.append(["all", f"{part.tau1:.4g}", "-", f"{part.tau2:.4g}", "-", "-", f"{part.rmse:.3g}"])
    columns = [
        f"level [{unit}]", "τ1 falling [s]", "τ1 rising [s]", "τ2 falling [s]", "τ2 rising [s]", f"left [{out}]",
        f"RMSE [{out}]",
    ]  # fmt: skip
    console.table("Release, beside the rise", columns, rows)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
