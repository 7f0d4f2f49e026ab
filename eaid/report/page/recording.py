"""What to record next, in numbers: levels, repeats and holds, from the plan for the fit's own noise and scatter.

At a level whose interval is r times wider than wanted after n repeats, (r² − 1) n more repeats bring the wanted width.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from eaid.errors import DataError
from eaid.options import PlanOptions
from eaid.planning.recordings import plan_recordings
from eaid.report.figures.steps import some_levels
from eaid.report.rig import level_text, rising
from eaid.report.tables.table import SYMBOLS, level, listed
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit
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
