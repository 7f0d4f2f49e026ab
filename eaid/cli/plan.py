"""`eaid plan`: what to record next, for intervals of a wanted width."""

from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, refuse_idle, takes, tell_result, written
from eaid.declared import option
from eaid.files import refuse_to_overwrite, written_whole
from eaid.options import LOGS, PlanOptions


@takes
def command(
    args: Common, how: PlanOptions,
    fit: Path = argument("FIT", "A fit.json."),
    excitation: bool = option(False, "One sequence of duties for one recording, in place of steps.", LOGS),
    output: Path = written("plan.csv"),
) -> None:  # fmt: skip
    """Which levels, hold times, repeats and order to record next, for wanted interval widths.

    Writes the run table (plan.csv) and, beside it, the whole session as an input file for the rig
    (plan.duty.csv: time_s,duty_pct or another input in its unit, each value held until the next). Every run ends
    with a recorded release.

    Example: eaid plan fit.json --want Ts=2,tau2=7 --longest-hold 60 -o plan.csv
    """
    import msgspec

    from eaid.cli.printed import cost, plan_shown
    from eaid.planning.kinds import input_changes
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.plan import Excitation, PlannedRun
    from eaid.synth.files import input_file

    files = [output] if excitation else [output, output.with_suffix(".duty.csv")]
    if excitation:
        refuse_idle(args, ("idle_s", "release_s", "longest_hold_s", "most_levels"), "with --excitation")
    else:
        refuse_idle(args, ("limits",), "without --excitation")
    fitted, warnings = codec.read(fit, eaid.Fit)
    for path in files:
        refuse_to_overwrite(path, args.force, (fit,))
    plan = eaid.plan(fitted, how, excitation=excitation, progress=console.progress)
    plan = msgspec.structs.replace(plan, inputs=(Input.of(fit),), command=args.typed)
    if isinstance(plan, Excitation):
        contents = [input_file(plan.duty, "clutch", plan.input_unit)]
    else:
        rows = [f"{r.order},{r.level:.9g},{r.repeat},{r.idle_s:g},{r.hold_s:g},{r.release_s:g}" for r in plan.runs]
        changes = input_file(input_changes(plan.runs), fitted.data.kind, plan.input_unit)
        contents = [[",".join(PlannedRun.__struct_fields__), *rows], changes]
    with written_whole(*files, force=args.force) as parts:
        for file, lines in zip(parts, contents, strict=True):
            file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    tell_result(args, plan, plan_shown(plan), (*warnings, *plan.findings))
    console.say(f"{', '.join(map(str, files))}: {cost(plan)}")
