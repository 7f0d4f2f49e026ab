"""What to do next, at most three things each with its command, and the commands that make the same files again."""

import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.errors import DataError
from eaid.options import PlanOptions
from eaid.planning.recordings import plan_recordings
from eaid.report.figures.steps import some_levels
from eaid.report.page.known import Known
from eaid.report.results import Given, Results
from eaid.report.rig import level_text, rising
from eaid.report.tables.gains import called, conditions_of
from eaid.report.tables.table import SYMBOLS, level, listed
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.plan import Plan
from eaid.results.summary import believed_levels

NAMED = 3
"""Most levels that are named."""
MOST_REPEATS = 20
COUNTS = {1: "once", 2: "twice", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven", 8: "eight", 9: "nine"}
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
        levels = some_levels(plan.levels, NAMED)
        return f"Record {_named(levels, unit)} three times each, held {held:.0f} s, then fit and plan again"
    more = _more_repeats(fit, plan)
    if 0 < len(more) <= NAMED and max(more.values()) <= MOST_REPEATS:
        held = math.ceil(max(np.interp(list(more), plan.levels, plan.hold_s)))
        return f"Record {_named(list(more), unit)} {_times(max(more.values()))} more, {held} s each"
    holds = " to ".join(f"{one:.0f}" for one in sorted({min(plan.hold_s), max(plan.hold_s)}))
    ends = f"{level(plan.levels[0])} to {level_text(plan.levels[-1], unit)}"
    cost = f"{plan.time_on_rig_s / 60:.0f} min" if plan.time_on_rig_s < 6000 else f"{plan.time_on_rig_s / 3600:.0f} h"
    cost += _best(plan)
    return f"Record {len(plan.levels)} levels, {ends}, {_times(plan.repeats)} each, held {holds} s ({cost})"


def _best(plan: Plan) -> str:
    """What falls short even so."""
    missed = next((one.values for one in plan.findings if one.code == "plan-falls-short"), None)
    if missed is None or not isinstance(width := missed["width_pct"], float):
        return ""
    return f"; {SYMBOLS[str(missed['parameter'])]} to ± {width:.2g} % at best"


def _more_repeats(fit: Fit, plan: Plan) -> Mapping[float, int]:
    """Level → further repeats for the plan's widths, of the levels that miss any of them."""
    counts = Counter(one.level for one in rising(fit.data.sources))
    found = {}
    for row in believed_levels(fit):
        ends = [ci95_of(row, name) for name in plan.wanted]
        over = max(_half_width_pct(one) / width for one, width in zip(ends, plan.wanted.values(), strict=True))
        repeats = counts.get(row.level, 0)
        if over > 1 and repeats:
            found[row.level] = MOST_REPEATS + 1 if math.isinf(over) else math.ceil((over**2 - 1) * repeats)
    return found


def _half_width_pct(ends: Interval) -> float:
    """Half-width of an interval as a share of the value, by its logarithm [%]; infinite where it says nothing."""
    if ends is None or ends[0] <= 0:
        return math.inf
    return 100 * math.expm1(min(0.5 * math.log(ends[1] / ends[0]), 50.0))


def _inputs_to_hold(fit: Fit) -> str | None:
    """The inputs about which a log never asked, and for how long they want to be held."""
    missed = next((one for one in fit.findings if one.code == "never-asked"), None)
    near = {one.level: one.time_s for one in fit.recorded.asked} if fit.recorded is not None else {}
    if missed is None or not missed.levels:
        return None
    levels = some_levels(missed.levels, NAMED)
    longest = max((near.get(one, 0.0) for one in levels), default=0.0)
    held = f", for {LONGER * longest:.2g} s each" if longest > 0 else ""
    return f"Hold {_named(levels, fit.data.input_unit)}{held}, coming from below"


def _times(count: int) -> str:
    """`once`, `twice`, `three times`: no digit beside that of a level."""
    return COUNTS.get(count, f"{count}") + (" times" if count > 2 else "")


def _named(levels: Sequence[float], unit: str) -> str:
    return f"{listed([level(one) for one in levels])} {unit}".rstrip()


MENDED = {"rho": "--alpha reached", "phi": "--phi data", "Q_M": "--reference multisine"}
"""Condition of the guarantee → the option by which tune-rc meets it."""


@dataclass(frozen=True)
class Step:
    """One thing to do next, and the command that does it."""

    why: str
    command: str


def next_steps(results: Results, known: Known) -> tuple[Step, ...]:
    """At most three things to do, each with its command."""
    clutch = next((fit for fit in results.fits if fit.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None:
        return _without_fit(results)
    fit_json = shlex.quote(fit.path)
    stopped = any(found.severity == "stop" for found in known["model"])
    gains = None if stopped else next(iter(results.gains), None)
    steps: list[Step] = []
    if not results.gains and clutch is not None and may_be_controlled(clutch.result) and not stopped:
        steps.append(Step("Design the controllers", f"eaid tune-rc {fit_json} -o gains.json"))
    if gains is not None:
        steps += _better_gains(gains, fit_json)
        if not any(replay.result.head.scenario == "multisine" for replay in results.replays):
            line = f"eaid simulate {fit_json} --gains {shlex.quote(gains.path)} --scenario multisine -o multisine.h5"
            steps.append(Step("Try the controllers on the fitted model", line))
    if record := what_to_record(fit.result):
        why, options = record
        steps.append(Step(why, f"eaid plan {fit_json} {options}".rstrip() + " -o plan.csv"))
    if gains is not None:
        holds = all(row.holds for row in conditions_of(gains.result))
        why = "Take these gains to the rig" if holds else "Take these gains to the rig, without a guarantee"
        steps.append(Step(why, f"eaid export {shlex.quote(gains.path)} --as c -o rig"))
    return tuple(steps[:3])


def _better_gains(gains: Given[Gains], fit_json: str) -> list[Step]:
    """Gains whose guarantee holds, where an option of tune-rc meets a condition that is missed."""
    missing = [row for row in conditions_of(gains.result) if row.holds is False]
    options = " ".join(MENDED[row.name] for row in missing if row.name in MENDED)
    if not options:
        return []
    why = f"Ask for gains whose guarantee holds ({', '.join(called(row) for row in missing)})"
    return [Step(why, f"eaid tune-rc {fit_json} {options} -o {shlex.quote(gains.path)} --force")]


def may_be_controlled(fit: Fit) -> bool:
    """Whether tune-rc takes the fit: its linear model is known, and more input gives more output."""
    part = fit.linear
    return part is not None and part.identifiable is not False and part.a0 > 0 and part.b0 > 0


def _without_fit(results: Results) -> tuple[Step, ...]:
    """The data are fitted; a loop's log becomes a model where its input was recorded too."""
    if not results.edge_logs:
        return tuple(
            Step("Fit the data", f"eaid fit {shlex.quote(data.path)} -o fit.json") for data in results.data[:1]
        )
    file = next(data.path for data in results.data if data.result.recorded)
    if all(log.run.has_input for log in results.edge_logs):
        return (Step("Fit the log as it was recorded", f"eaid fit {shlex.quote(file)} -o fit.json"),)
    why = "For a model, record the input (what the controller commands) as one more column, then"
    return (Step(why, "eaid fit LOGS -o fit.json"),)


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
