"""`eaid plan`: what to record next, for intervals of a wanted width."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import DataError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from eaid.synth.plants import Plant
    from eaid.uncertainty.design import Plan, Rig, Step, Wanted
    from eaid.uncertainty.noise import Noise

CHECK_RATE_HZ = 100.0


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
        bool, typer.Option("--check/--no-check", help="Synthesise the experiment and measure the widths it gives.")
    ] = True,
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
    from eaid.files import refuse_to_overwrite
    from eaid.store import input_record, read_json, stamped
    from eaid.uncertainty.design import Rig, run_order, wanted_of

    assert output is not None
    duty_file = output.with_suffix(".duty.csv")
    for path in (output, duty_file):
        refuse_to_overwrite(path, force)
    wanted = wanted_of(want)
    faults = [
        f"--{name} {value:g}: give {least} or more"
        for name, value, least in (
            ("idle", idle, 0), ("release", release, 0), ("longest-hold", longest, 5), ("most-levels", most, 4)
        )
        if not least <= value < float("inf")
    ]  # fmt: skip
    if faults:
        raise UsageError(*faults)
    rig = Rig(idle_s=idle, release_s=release, most_levels=most, longest_hold_s=longest)
    source = read_json(fit, "fit", console.warn)
    found, plant, noise, word = planned(source, str(fit), wanted, rig)
    if word:
        console.warn(word)
    steps = run_order(found, rig, seed)
    measured = measure(found, plant, noise, seed) if check else None
    write(output, duty_file, steps, plant.kind, force)
    result = stamped(
        "eaid/plan/1",
        {
            "inputs": [input_record(fit)],
            "seed": seed,
            "wanted": {one.parameter: one.half_width_pct for one in wanted},
            "met": found.met,
            "levels": found.levels,
            "hold_s": found.hold_s,
            "repeats": found.repeats,
            "time_on_rig_s": found.time_s,
            "half_width_pct": found.half_width_pct,
            "measured_half_width_pct": measured,
            "runs": [vars(step) for step in steps],
        },
    )
    if json:
        console.print_json(result)
    else:
        tables(found, {one.parameter: one.half_width_pct for one in wanted}, measured, plant)
    if not found.met:
        console.warn(shortfall(found, {one.parameter: one.half_width_pct for one in wanted}, noise))
    console.say(f"{output}, {duty_file}: {len(steps)} runs, {found.time_s / 60:.0f} minutes on the rig")
    console.say(
        "record whole blocks in the order given, not sweeps: a drift would else look like one scatter of all levels"
    )
    return 0


def planned(
    source: dict[str, Any], name: str, wanted: "Sequence[Wanted]", rig: "Rig"
) -> "tuple[Plan, Plant, Noise, str | None]":
    """The plan for the model that a fit.json holds, its plant, the noise taken, and a word on that."""
    from eaid.fitting.result import nonlinear_from_json
    from eaid.synth.plants import clutch, of_fit
    from eaid.uncertainty.design import level_sets, plan
    from eaid.uncertainty.noise import noise_from_json

    noise, word = noise_from_json(source)
    if source.get("nonlinear"):
        part = source["nonlinear"]
        if part.get("two_stage") and (part.get("agreement") or {}).get("believe") != "joint":
            # the estimate that is not bent by run-to-run scatter
            source = {**source, "nonlinear": {**part, **part["two_stage"]}}
        model = nonlinear_from_json(source)
        plant = clutch(model, name)
        found = plan(plant.at, level_sets(model.u_range, rig.most_levels), wanted, noise, rig)
        return found, plant, noise, word
    kind = (source.get("data") or {}).get("kind")
    if kind not in ("friction-force", "friction-speed") or not (source.get("friction") or {}).get("levels"):
        raise DataError(f"{name}: holds neither a nonlinear nor a friction model to plan with; run eaid fit again")
    plant = of_fit(source, kind, name)
    return plan(plant.at, [plant.levels], wanted, noise, rig, polynomial=False), plant, noise, word


def measure(found: "Plan", plant: "Plant", noise: "Noise", seed: int) -> dict[str, float]:
    """Synthesise the planned experiment, fit it, and give the half-widths that its own intervals have [%]."""
    from dataclasses import replace
    from math import sqrt

    from eaid.fitting.fit import fit as fit_models
    from eaid.fitting.options import FitOptions
    from eaid.steps.build import StepOptions, build_stepset
    from eaid.synth.disturbance import NONE
    from eaid.synth.logs import Protocol, synthesise
    from eaid.uncertainty.intervals import IntervalOptions, intervals

    memory_s = 0.05
    disturbance = replace(
        NONE,
        white_nm=sqrt(noise.sensor_nm2_s * CHECK_RATE_HZ),
        coloured=sqrt(noise.ripple_s / (2 * memory_s)),
        coloured_s=memory_s,
        gain_scatter=min(noise.scatter[0], 0.3),
        tau1_scatter=noise.scatter[1],
        tau2_scatter=noise.scatter[2],
    )
    runs = []
    with console.progress("synthesising the plan", len(found.levels)) as advance:
        for i, (level, hold_s) in enumerate(zip(found.levels, found.hold_s, strict=True)):
            protocol = Protocol((level,), found.repeats, 1.0, hold_s, 0.0, CHECK_RATE_HZ)
            runs += synthesise(plant, protocol, disturbance, seed + 1000 * i)
            advance()
    stepset = build_stepset(runs, StepOptions(kind=plant.kind))
    models = ("friction", "nonlinear") if plant.kind == "clutch" else ("friction",)
    again = fit_models(stepset, FitOptions(models=models))
    sure = intervals(stepset, again, IntervalOptions(study_models=False))
    rows = (
        sure.nonlinear["two_stage"]["curves"]
        if sure.nonlinear and "two_stage" in sure.nonlinear
        else (sure.friction or {"levels": []})["levels"]
    )
    widths = {}
    for name in ("Ts", "tau1", "tau2"):
        ends = [row["ci95"][name] for row in rows]
        known = [100 * ((b / a) ** 0.5 - 1) for a, b in (end for end in ends if end)]
        widths[name] = max(known) if known and len(known) == len(ends) else float("inf")
    return widths


def write(output: Path, duty_file: Path, steps: "Sequence[Step]", kind: str, force: bool) -> None:
    """The run table and the duty file, both whole or neither."""
    from eaid.files import all_written_whole
    from eaid.uncertainty.design import duty_breaks

    rows = ["order,level,repeat,idle_s,hold_s,release_s"]
    rows += [f"{s.order},{s.level:g},{s.repeat},{s.idle_s:g},{s.hold_s:g},{s.release_s:g}" for s in steps]
    column = {"clutch": "duty_pct", "friction-force": "force_n", "friction-speed": "speed_rpm"}[kind]
    breaks = [f"time_s,{column}", *(f"{at:g},{duty:g}" for at, duty in duty_breaks(steps))]
    with all_written_whole((output, duty_file), force) as parts:
        for part, lines in zip(parts, (rows, breaks), strict=True):
            part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def tables(found: "Plan", wanted: dict[str, float], measured: dict[str, float] | None, plant: "Plant") -> None:
    """The plan for people."""
    unit = {"clutch": "%", "friction-force": "N", "friction-speed": "RPM"}[plant.kind]
    console.table(
        f"What to record: {found.repeats} repeats of each level, in the order of the run table",
        [f"level [{unit}]", "hold [s]"],
        [[f"{level:g}", f"{hold:g}"] for level, hold in zip(found.levels, found.hold_s, strict=True)],
    )
    rows = []
    for name, width in found.half_width_pct.items():
        own = "-" if measured is None else f"{measured[name]:.3g}"
        rows.append([name, f"{wanted[name]:g}" if name in wanted else "-", f"{width:.3g}", own])
    columns = ["parameter", "wanted [%]", "predicted [%]", "synthesised and measured [%]"]
    console.table("Half-width of the 95 % intervals at the worst level", columns, rows)


def shortfall(found: "Plan", wanted: dict[str, float], noise: "Noise") -> str:
    """Which width no experiment within the limits reaches, and what stands in the way."""
    name, width = max(wanted.items(), key=lambda item: found.half_width_pct[item[0]] / item[1])
    scatter = dict(zip(("Ts", "tau1", "tau2"), noise.scatter, strict=True))[name]
    cause = (
        f"runs differ by {100 * scatter:.2g} %, and {found.repeats} repeats only average that"
        if scatter > 0.01
        else "a longer --longest-hold or a quieter sensor is needed"
    )
    return f"{name} comes to {found.half_width_pct[name]:.3g} %, not {width:g} %, with all that is allowed: {cause}"
