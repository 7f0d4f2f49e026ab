"""`eaid plan`: what to record next, for intervals of a wanted width."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.cli.form import Common, Seeded, argument, option, refuse_idle, taken, takes, written
from eaid.cli.words import factors

if TYPE_CHECKING:
    from eaid.results.plan import Plan
    from eaid.results.recorded import Excitation

WHAT, RIG = "What is wanted", "What the rig allows"


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Seeded):
    """What `eaid plan` is told."""

    fit: Path = argument("FIT", "A fit.json.")
    want: dict[str, float] | None = option(
        None, "Half-widths in percent at the worst level; by itself Ts=3,tau1=5,tau2=10.", WHAT, read=factors,
        shown="NAME=PERCENT,…",
    )  # fmt: skip
    excitation: bool = option(False, "One sequence of duties for one recording, in place of steps.", WHAT)
    check: bool = option(True, "Simulate the experiment and measure the widths it gives.", WHAT)
    idle_s: float = option(10.0, "Input 0 before each step [s].", RIG, "--idle")
    release_s: float = option(10.0, "Input 0 after each step, recorded [s].", RIG, "--release")
    longest_hold_s: float = option(120.0, "Longest hold [s].", RIG, "--longest-hold")
    most_levels: int = option(12, "Most levels to record.", RIG)
    limits: str | None = option(
        None, "Of the excitation: duty=10:100,hold=0.3:30,rate=200,rest=5,work=60,engagements=4, duty and rate in "
        "the input's unit; by itself the duty's range is that of the fit.", RIG, shown="NAME=VALUE,…",
    )  # fmt: skip
    output: Path = written("plan.csv")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Which levels, hold times, repeats and order to record next, for wanted interval widths.

    Writes the run table (plan.csv) and, beside it, the whole session as an input file for the rig
    (plan.duty.csv: time_s,duty_pct or another input in its unit, each value held until the next). Every run ends
    with a recorded release.

    Example: eaid plan fit.json --want Ts=2,tau2=7 --longest-hold 60 -o plan.csv
    """
    import msgspec

    from eaid import api
    from eaid.cli import plan_tables
    from eaid.files import refuse_to_overwrite
    from eaid.planning.recordings import PlanOptions
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit

    files = [args.output] if args.excitation else [args.output, args.output.with_suffix(".duty.csv")]
    for path in files:
        refuse_to_overwrite(path, args.force, (args.fit,))
    if args.excitation:
        refuse_idle(args, ("idle_s", "release_s", "longest_hold_s", "most_levels"), "with --excitation")
    else:
        refuse_idle(args, ("limits",), "without --excitation")
    fit, doubts = codec.read(args.fit, "fit", Fit)
    if args.excitation:
        from eaid.planning.excitation import ExcitationOptions

        limits = plan_tables.limits_of(args.limits, fit.plant.u_range, fit.data.input_unit)
        options = taken(ExcitationOptions, args, limits=limits)
        plan: Plan | Excitation = api.plan_excitation(fit, options, progress=console.progress)
    else:
        plan = api.plan(fit, taken(PlanOptions, args), progress=console.progress)
    plan = msgspec.structs.replace(plan, inputs=(Input.of(args.fit),), command=args.words)
    plan_tables.write(files, plan, fit.data.kind, args.force)
    if args.json:
        console.print_json(plan, "plan")
    else:
        plan_tables.show(plan, args.idle_s, args.release_s)
    console.tell((*doubts, *plan.findings))
    console.say(f"{', '.join(map(str, files))}: {plan_tables.cost(plan)}")
