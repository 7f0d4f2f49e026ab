"""`eaid plan`: what to record next, for intervals of a wanted width."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import DataError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from eaid.synth.plants import Plant
    from eaid.uncertainty.design import Plan, Rig, Step, Wanted
    from eaid.uncertainty.noise import Noise


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
    from eaid.cli.plan_check import checked
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
    make, plant, noise, words = planned(source, str(fit), rig)
    for word in words:
        console.warn(word)
    measured = None
    if check:
        found, measured = checked(make, wanted, plant, noise, share_of(source), seed)
    else:
        found = make(wanted)
    within = {**found.half_width_pct, **(measured or {})}
    met = all(within[one.parameter] <= one.half_width_pct for one in wanted)
    steps = run_order(found, rig, seed)
    unit = unit_of(source, plant.kind)
    write(output, duty_file, steps, column_of(unit), force)
    result = stamped(
        "eaid/plan/1",
        {
            "inputs": [input_record(fit)],
            "seed": seed,
            "wanted": {one.parameter: one.half_width_pct for one in wanted},
            "met": met,
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
        tables(found, rig, {one.parameter: one.half_width_pct for one in wanted}, measured, unit)
    if not met:
        console.warn(shortfall(within, found, {one.parameter: one.half_width_pct for one in wanted}, noise))
    console.say(f"{output}, {duty_file}: {len(steps)} runs, {found.time_s / 60:.0f} minutes on the rig")
    console.say(
        "record whole blocks in the order given, not sweeps: a drift would else look like one scatter of all levels"
    )
    return 0


def planned(
    source: dict[str, Any], name: str, rig: "Rig"
) -> "tuple[Callable[[Sequence[Wanted]], Plan], Plant, Noise, list[str]]":
    """What makes a plan for the model that a fit.json holds, its plant, the noise taken, and words on these."""
    from eaid.fitting.stored import nonlinear_from_json, not_identifiable_because
    from eaid.synth.plants import clutch, of_fit
    from eaid.uncertainty.design import level_sets, plan
    from eaid.uncertainty.noise import noise_from_json

    noise, word = noise_from_json(source)
    words = [word] if word else []
    judged = (source.get("uncertainty") or {}).get("adequacy") or {}
    words += [f"the fit says: {text}; a plan for that model cannot mend it" for text in judged.get("warnings") or []]
    if source.get("nonlinear"):
        part = source["nonlinear"]
        if part.get("identifiable") is False:
            why = "; ".join(not_identifiable_because(source, "nonlinear"))
            words.append(
                f"the fit itself is not identifiable ({why}): the plan rests on a guess; record a few levels by it, "
                "fit, and plan again"
            )
        model = nonlinear_from_json(source)
        plant = clutch(model, name)
        levels = level_sets(model.u_range, rig.most_levels)
        return (lambda wanted: plan(plant.at, levels, wanted, noise, rig)), plant, noise, words
    kind = (source.get("data") or {}).get("kind")
    if kind not in ("friction-force", "friction-speed") or not (source.get("friction") or {}).get("levels"):
        raise DataError(f"{name}: holds neither a nonlinear nor a friction model to plan with; run eaid fit again")
    plant = of_fit(source, kind, name)
    make = lambda wanted: plan(plant.at, [plant.levels], wanted, noise, rig, polynomial=False)  # noqa: E731
    return make, plant, noise, words


def share_of(source: dict[str, Any]) -> float:
    """C of the model that is planned with."""
    from eaid.models.parameters import SHARE

    for name in ("nonlinear", "friction"):
        share = (source.get(name) or {}).get("C")
        if isinstance(share, int | float):
            return float(share)
    return SHARE


def unit_of(source: dict[str, Any], kind: str) -> str:
    """Unit of the input, as the fit says; empty where its levels have none."""
    said = (source.get("data") or {}).get("input_unit")
    return said if isinstance(said, str) else {"clutch": "%", "friction-force": "N", "friction-speed": "RPM"}[kind]


def column_of(unit: str) -> str:
    """Name of the duty file's input column, with its unit."""
    known = {"%": "duty_pct", "N": "force_n", "RPM": "speed_rpm"}
    return known.get(unit) or (f"input_{unit.lower()}" if unit.isalnum() else "input")


def write(output: Path, duty_file: Path, steps: "Sequence[Step]", column: str, force: bool) -> None:
    """The run table and the duty file, both whole or neither."""
    from eaid.files import all_written_whole
    from eaid.uncertainty.design import duty_breaks

    rows = ["order,level,repeat,idle_s,hold_s,release_s"]
    rows += [f"{s.order},{s.level:g},{s.repeat},{s.idle_s:g},{s.hold_s:g},{s.release_s:g}" for s in steps]
    breaks = [f"time_s,{column}", *(f"{at:g},{duty:g}" for at, duty in duty_breaks(steps))]
    with all_written_whole((output, duty_file), force) as parts:
        for part, lines in zip(parts, (rows, breaks), strict=True):
            part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def tables(found: "Plan", rig: "Rig", wanted: dict[str, float], measured: dict[str, float] | None, unit: str) -> None:
    """The plan for people."""
    console.table(
        f"What to record: {found.repeats} repeats of each level, in the order of the run table; each run idles for "
        f"{rig.idle_s:g} s before its step and is recorded for {rig.release_s:g} s after its release",
        [f"level [{unit}]" if unit else "level", "hold [s]"],
        [[f"{level:g}", f"{hold:g}"] for level, hold in zip(found.levels, found.hold_s, strict=True)],
    )
    rows = []
    for name, width in found.half_width_pct.items():
        own = "-" if measured is None else f"{measured[name]:.3g}"
        rows.append([name, f"{wanted[name]:g}" if name in wanted else "-", f"{width:.3g}", own])
    columns = ["parameter", "wanted [%]", "predicted [%]", "synthesised and measured [%]"]
    console.table("Half-width of the 95 % intervals at the worst level", columns, rows)


def shortfall(within: dict[str, float], found: "Plan", wanted: dict[str, float], noise: "Noise") -> str:
    """Which width no experiment within the limits reaches, and what stands in the way."""
    name, width = max(wanted.items(), key=lambda item: within[item[0]] / item[1])
    scatter = dict(zip(("Ts", "tau1", "tau2"), noise.scatter, strict=True))[name]
    cause = (
        f"runs differ by {100 * scatter:.2g} %, and {found.repeats} repeats only average that"
        if scatter > 0.01
        else "a longer --longest-hold or a quieter sensor is needed"
    )
    if within[name] == float("inf"):
        return f"{name} stays undetermined at a level with all that is allowed: a longer --longest-hold is needed"
    symbol = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2"}[name]
    return f"{symbol} comes to {within[name]:.3g} %, not {width:g} %, with all that is allowed: {cause}"
