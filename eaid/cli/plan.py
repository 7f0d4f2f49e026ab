"""`eaid plan`: what to record next, for intervals of a wanted width."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.results.plan import Plan


def command(
    fit: Annotated[Path, typer.Argument(metavar="FIT", help="A fit.json.")],
    want: Annotated[
        str, typer.Option("--want", help="Half-widths in percent at the worst level: Ts=3,tau1=5,tau2=10.")
    ] = "Ts=3,tau1=5,tau2=10",
    idle: Annotated[float, typer.Option("--idle", help="Input 0 before each step [s].")] = 10.0,
    release: Annotated[float, typer.Option("--release", help="Input 0 after each step, recorded [s].")] = 10.0,
    longest: Annotated[float, typer.Option("--longest-hold", help="Longest hold that the rig allows [s].")] = 120.0,
    most: Annotated[int, typer.Option("--most-levels", help="Most levels to record.")] = 12,
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Simulate the experiment and measure the widths it gives.")
    ] = True,
    excitation: Annotated[
        bool,
        typer.Option("--excitation", help="One sequence of duties for one recording, in place of steps."),
    ] = False,
    limits: Annotated[
        str | None,
        typer.Option(
            "--limits",
            help="Of the excitation: duty=10:100,hold=0.3:30,rate=200,rest=5,work=60,engagements=4 (%, s, %/s).",
        ),
    ] = None,
    output: Output = Path("plan.csv"),
    seed: Seed = 0,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> int:
    """Which levels, hold times, repeats and order to record next, for wanted interval widths.

    Writes the run table (plan.csv) and, beside it, the whole session as a duty file for the rig (plan.duty.csv:
    time_s,duty_pct, each value held until the next). Every run ends with a recorded release.
    """
    console.be_quiet(quiet)
    import msgspec

    from eaid.files import refuse_to_overwrite
    from eaid.planning import PlanOptions, plan_recordings
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit

    assert output is not None
    if excitation:
        from eaid.cli.plan_excitation import plan_one_recording

        return plan_one_recording(fit, widths_of(want), limits, check, output, seed, json, force)
    duty_file = output.with_suffix(".duty.csv")
    for path in (output, duty_file):
        refuse_to_overwrite(path, force, inputs=(fit,))
    source, doubts = codec.read(fit, "fit", Fit)
    options = PlanOptions(widths_of(want), idle, release, longest, most, check, seed)
    with console.progress("simulating the recordings", 0) as advance:
        found = plan_recordings(source, options, advance)
    found = msgspec.structs.replace(found, inputs=(Input.of(fit),))
    write(output, duty_file, found, force)
    if json:
        sys.stdout.write(codec.dumps(found, "plan"))
    else:
        tables(found, options.idle_s, options.release_s)
    console.tell((*doubts, *found.findings))
    minutes = found.time_on_rig_s / 60
    console.say(f"{output}, {duty_file}: {len(found.runs)} runs, {minutes:.0f} minutes on the rig")
    console.say(
        "record whole blocks in the order given, not sweeps: a drift would else look like one scatter of all levels"
    )
    return 0


def widths_of(text: str) -> dict[str, float]:
    """`tau2=10,Ts=2` as half-widths in percent."""
    found = {}
    for part in text.split(","):
        name, _, number = part.partition("=")
        try:
            found[name.strip()] = float(number.strip().removesuffix("%"))
        except ValueError:
            raise UsageError(f"«want» {text}: write tau2=10,Ts=2: a parameter and a half-width in percent") from None
    return found


def write(output: Path, duty_file: Path, found: "Plan", force: bool) -> None:
    """The run table and the duty file, both whole or neither."""
    from eaid.files import all_written_whole
    from eaid.planning.recordings import input_changes

    unit = found.input_unit
    known = {"%": "duty_pct", "N": "force_n", "RPM": "speed_rpm"}
    column = known.get(unit) or (f"input_{unit.lower()}" if unit.isalnum() else "input")
    rows = ["order,level,repeat,idle_s,hold_s,release_s"]
    rows += [f"{r.order},{r.level:.9g},{r.repeat},{r.idle_s:g},{r.hold_s:g},{r.release_s:g}" for r in found.runs]
    breaks = [f"time_s,{column}", *(f"{at:.9g},{level:.9g}" for at, level in input_changes(found.runs))]
    with all_written_whole((output, duty_file), force) as parts:
        for part, lines in zip(parts, (rows, breaks), strict=True):
            part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def tables(found: "Plan", idle_s: float, release_s: float) -> None:
    """The plan for people."""
    console.table(
        f"What to record: {found.repeats} repeats of each level, in the order of the run table; each run idles for "
        f"{idle_s:g} s before its step and is recorded for {release_s:g} s after its release",
        [f"level [{found.input_unit}]" if found.input_unit else "level", "hold [s]"],
        [[f"{level:g}", f"{hold:g}"] for level, hold in zip(found.levels, found.hold_s, strict=True)],
    )
    measured = found.measured_half_width_pct or {}
    rows = [
        [name, *("-" if width is None else f"{width:.3g}" for width in (found.wanted.get(name), predicted, kept))]
        for name, predicted, kept in ((name, width, measured.get(name)) for name, width in found.half_width_pct.items())
    ]
    columns = ["parameter", "wanted [%]", "predicted [%]", "kept by four of five simulated recordings [%]"]
    console.table("Half-width of the 95 % intervals at the worst level", columns, rows)
