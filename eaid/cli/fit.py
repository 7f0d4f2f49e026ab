"""`eaid fit`: logs or a dataset → fit.json, its tables, and what is to be doubted of it."""

import sys
from pathlib import Path

from eaid.cli import console, inputs
from eaid.cli import fit_options as options_
from eaid.cli.options import Force, Json, Output, Quiet, Seed


def command(
    data: options_.Data,
    output: Output = Path("fit.json"),
    model: options_.Model = None,
    share: options_.Share = "0.85",
    estimator: options_.Estimator = "auto",
    weights: options_.Weights = "equal",
    loss: options_.Loss = "squares",
    hold_out: options_.HoldOut = None,
    bounds: options_.BoundsOption = "zero-offset",
    bounds_levels: options_.BoundsLevels = None,
    shape: options_.Shape = "auto",
    dead_time: options_.DeadTime = "auto",
    ci: options_.Ci = "robust",
    logs_as: options_.LogsAs = "auto",
    duty: options_.Duty = None,
    instrument: options_.Instrument = False,
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
    tables: options_.Tables = False,
    verbose: options_.Verbose = False,
    force: Force = False,
) -> int:
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a fit did not converge, or explains little; the result is written, marked.
    """
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite
    from eaid.findings import stops
    from eaid.fitting.options import FitOptions, check
    from eaid.results import codec
    from eaid.uncertainty.workflow import fit_steps

    assert output is not None
    refuse_to_overwrite(output, force, data)
    options = FitOptions(
        options_.models_of(model), options_.share_of(share), weights, loss, options_.numbers("hold_out", hold_out),
        bounds, estimator=estimator, shape=shape, dead_time_s=options_.dead_time_of(dead_time), ci=ci, seed=seed,
        workers=options_.processors(),
    )  # fmt: skip
    check(options)
    stepset = inputs.stepset_from(
        data, options_.logs_as(logs_as),
        columns=columns, units=units, name_pattern=name_pattern, step_at=step_at, until=until, repair=repair,
        kind=kind, levels=levels, baseline=baseline, sign=sign, variable=variable, rate=rate, rest=rest,
        apparatus=apparatus, join=join,
    )  # fmt: skip
    if stepset.recorded:
        from eaid.cli.fit_recorded import duty_of
        from eaid.recorded.entry import fit_whole

        result = fit_whole(stepset, options, duty_of(duty), instrument)
    else:
        options = options_.with_bounds_levels(options, bounds_levels, stepset)
        with console.progress("bootstrap refits", options.draws if ci == "bootstrap" else 0) as advance:
            result = fit_steps(stepset, options, advance)
    codec.write(output, result, "fit", force)
    if json:
        sys.stdout.write(codec.dumps(result, "fit"))
    else:
        options_.show(result, tables or verbose, verbose)
    console.tell(result.findings, verbose)
    parts = ", ".join(name for name in options_.PARTS if getattr(result, name))
    after = f"; next: eaid tune-rc {output}" if result.linear is not None else ""
    console.say(f"{output}: {parts}{after}; --tables shows all numbers")
    if result.converged and not stops(result.findings):
        return 0
    console.fail(f"{output}: is written and marked; do not use its numbers")
    return options_.NOT_TO_BE_USED
