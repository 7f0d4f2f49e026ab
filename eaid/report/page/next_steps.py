"""What to do next, at most three things each with its command, and the commands that make the same files again."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace

from eaid.errors import DataError
from eaid.export.export import offered
from eaid.options import PlanOptions
from eaid.planning.recordings import plan_recordings
from eaid.report.figures.steps import some_of
from eaid.report.results import Given, Results
from eaid.report.rig import level_text
from eaid.report.tables import level, listed
from eaid.report.tables.gains import BEYOND_GAINS, called, conditions_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.plan import Plan
from eaid.shown import counted

NAMED = 3
"""Most levels that are named."""
LONGER = 4.0
"""Where the record does not determine τ2, holds are so many times as long as now."""


def what_to_record(fit: Fit) -> tuple[str, str] | None:
    """The next recordings in words, and the options of `eaid plan` for them; None where nothing can be planned."""
    if fit.recorded is not None:
        words = _inputs_to_hold(fit)
        return None if words is None else (words, "--excitation")
    options = PlanOptions(check=False)
    recorded_s = math.ceil(max(fit.data.record_s, default=0.0))
    longer = recorded_s > options.longest_hold_s
    if longer:
        options = replace(options, longest_hold_s=float(recorded_s))
    try:
        plan = plan_recordings(fit, options)
    except DataError:
        return None
    return _planned(fit, plan), f"--longest-hold {recorded_s}" if longer else ""


def _planned(fit: Fit, plan: Plan) -> str:
    unit = fit.data.input_unit
    if len(plan.levels) == 1:
        at = level_text(plan.levels[0], unit)
        return f"Record two more levels beside {at}, three times each, {plan.hold_s[0]:.0f} s held"
    if any(one.code == "plan-rests-on-a-guess" for one in plan.findings):
        held = min(max(plan.hold_s), math.ceil(LONGER * max(fit.data.record_s, default=math.inf)))
        levels = some_of(plan.levels, NAMED)
        return f"Record {_named(levels, unit)} three times each, held {held:.0f} s, then fit and plan again"
    holds = " to ".join(f"{one:.0f}" for one in sorted({min(plan.hold_s), max(plan.hold_s)}))
    ends = f"{level(plan.levels[0])} to {level_text(plan.levels[-1], unit)}"
    cost = f"{plan.time_on_rig_s / 60:.0f} min" if plan.time_on_rig_s < 6000 else f"{plan.time_on_rig_s / 3600:.0f} h"
    times = f"at least {counted(plan.repeats, 'time')}"  # not simulated here, which may ask for more
    return f"Record {len(plan.levels)} levels, {ends}, {times} each, held {holds} s ({cost} or more)"


def _inputs_to_hold(fit: Fit) -> str | None:
    """The inputs about which a log never asked, and for how long they want to be held."""
    missed = next((one for one in fit.findings if one.code == "never-asked"), None)
    near = {one.level: one.time_s for one in fit.recorded.asked} if fit.recorded is not None else {}
    if missed is None or not missed.levels:
        return None
    levels = some_of(missed.levels, NAMED)
    longest = max((near.get(one, 0.0) for one in levels), default=0.0)
    held = f", for {LONGER * longest:.2g} s each" if longest > 0 else ""
    return f"Hold {_named(levels, fit.data.input_unit)}{held}, coming from below"


def _named(levels: Sequence[float], unit: str) -> str:
    return f"{listed([level(one) for one in levels])} {unit}".rstrip()


MENDED = {"rho": "--alpha reached", "phi": "--phi data", "Q_M": "--reference multisine"}
"""Condition of the guarantee → the option by which tune-rc meets it."""


@dataclass(frozen=True)
class Step:
    """One thing to do next, and the command that does it."""

    why: str
    command: str


def next_steps(results: Results) -> tuple[Step, ...]:
    """At most three things to do, each with its command."""
    clutch = next((fit for fit in results.fits if fit.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None:
        return _without_fit(results)
    fit_json = shlex.quote(fit.path)
    usable = fit.result.verdict.usable
    gains = next(iter(results.gains), None) if usable else None
    steps: list[Step] = []
    linear = clutch.result.linear if clutch is not None and not results.gains and usable else None
    if linear is not None and linear.a0 > 0 and linear.b0 > 0:
        steps.append(Step("Design the controllers", f"eaid tune-rc {fit_json} -o gains.json"))
    if gains is not None:
        steps += _better_gains(gains, fit_json)
        if not any(replay.result.head.scenario == "multisine" for replay in results.replays):
            line = f"eaid simulate {fit_json} {shlex.quote(gains.path)} --scenario multisine -o multisine.h5"
            steps.append(Step("Try the controllers on the fitted model", line))
    if record := what_to_record(fit.result):
        why, options = record
        steps.append(Step(why, f"eaid plan {fit_json} {options}".rstrip() + " -o plan.csv"))
    if gains is not None:
        holds = all(row.holds for row in conditions_of(gains.result))
        why = "Take these gains to the rig" if holds else "Take these gains to the rig, without a guarantee"
        laws = offered(gains.result, fit.result)
        only = f" --law {','.join(laws)}" if laws else ""
        if laws != ():
            steps.append(Step(why, f"eaid export {shlex.quote(gains.path)} --as c{only} -o rig"))
    return tuple(steps[:3])


def _better_gains(gains: Given[Gains], fit_json: str) -> list[Step]:
    """Gains whose guarantee holds, where an option of tune-rc meets a condition that is missed."""
    missing = [row for row in conditions_of(gains.result) if row.holds is False]
    if any(row.name in BEYOND_GAINS for row in missing):
        return []
    options = " ".join(MENDED[row.name] for row in missing if row.name in MENDED)
    if not options:
        return []
    why = f"Ask for gains whose guarantee holds ({', '.join(called(row) for row in missing)})"
    typed = shlex.join(gains.result.command) or fit_json  # what was asked for stays
    return [Step(why, f"eaid tune-rc {typed} {options} -o {shlex.quote(gains.path)} --force")]


def _without_fit(results: Results) -> tuple[Step, ...]:
    """The data are fitted; a log whose input was not recorded first needs that."""
    if any(not run.has_input for run, _edges in results.edge_logs):
        why = "For a model, record the input (what the controller commands) as one more column, then"
        return (Step(why, "eaid fit LOGS -o fit.json"),)
    return tuple(Step("Fit the data", f"eaid fit {shlex.quote(data.path)} -o fit.json") for data in results.data[:1])


def commands(results: Results) -> list[str]:
    """Command lines that make these files again; a result of the Python API says so."""
    made = [("fit", fit.path, fit.result.command) for fit in results.fits]
    made += [("tune-rc", gains.path, gains.result.command) for gains in results.gains]
    made += [("simulate", replay.path, replay.result.head.command) for replay in results.replays]
    made += [("couple", walls.path, walls.result.command) for walls in results.couplings]
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.path)}" for data in results.data]
    for command, path, words in made:
        line = shlex.join(["eaid", command, *words, "-o", path])
        lines.append(line if words else f"{path}: made in Python by eaid.{command.replace('-', '_')}")
    return [*lines, shlex.join(["eaid", "report", *(given.path for given in results.every), "-o", "report"])]
