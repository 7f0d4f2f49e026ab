"""Tables of what was recorded: runs, levels, steps from level to level, slips, edges."""

from collections import Counter
from collections.abc import Iterable

from eaid.report.tables import Cell, Name, Table, level, table_of
from eaid.shown import number
from eaid.steps.step import hold_of
from eaid.steps.stepset import Level, LevelStep, RunRecord, StepSet


def is_warned(run: RunRecord) -> bool:
    """Whether a run has warnings; notes are none."""
    return any(found.severity != "note" for found in run.findings)


def distinct(runs: Iterable[RunRecord]) -> set[tuple[str, float, int]]:
    """Runs, a rise and its release as the one run that they are."""
    return {(run.source, run.level, run.repeat) for run in runs}


def runs_table(data: StepSet) -> Table:
    """One row a run."""
    return table_of(
        "Runs", "The idle output is the mean before the step; it is subtracted before fitting.", data.runs,
        ("run", lambda run: Name(run.name)), (("level", data.input_unit), lambda run: level(run.level)),
        ("edge", "edge"), ("repeat", "repeat"), ("warned", is_warned), ("samples", "samples"),
        (("rate", "Hz"), "rate_hz"), (("idle", data.output_unit, 3), "baseline_nm"),
    )  # fmt: skip


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    falls = Counter({release.level: len(release.names) for release in data.releases})
    runs = {one.level: [run for run in data.runs if run.name in one.names] for one in data.levels}
    warned = Counter(of for _source, of, _repeat in distinct(filter(is_warned, data.runs)))

    def before(one: Level) -> Cell:
        idle = [run.baseline_nm for run in runs[one.level]]
        if not idle:
            return None
        low, high = min(idle), max(idle)
        return low if number(low, 3) == number(high, 3) else (low, high)

    return table_of(
        "Levels", "Held: the rise in the last tenth. Lost: from the peak to there. Means of the runs.", data.levels,
        (("level", data.input_unit), lambda one: level(one.level)), ("runs", lambda one: len(one.names)),
        ("warned", lambda one: warned[one.level]), (("before", data.output_unit, 3), before),
        (("held", data.output_unit), lambda one: float(hold_of(one.runs).held.mean())),
        (("lost", "%"), lambda one: round(hold_of(one.runs).lost_pct)),
        (("for", "s"), lambda one: float(one.time_s[-1])), ("falls", lambda one: falls[one.level]),
    )  # fmt: skip


def between_levels(steps: Iterable[LevelStep], data: StepSet) -> Table:
    """One row a step from one level to another."""
    unit, out = data.input_unit, data.output_unit
    return table_of(
        "Steps from level to level", "", steps,
        (("from", unit), lambda step: level(step.from_level)), ("to", lambda step: level(step.level)),
        (("start", out), "start"), (("change", out), "change"), (("gain", f"{out}/{unit}" if unit else out), "gain"),
        (("held", "s"), lambda step: float(step.time_s[-1])),
    )  # fmt: skip


def slips_table(data: StepSet) -> Table:
    """Of each level the run whose output peaks highest before it slips; the loading over the way where it is known."""
    slipping = sorted((run for run in data.runs if run.slip is not None), key=lambda run: run.slip.peak)  # type: ignore[union-attr]
    highest = {run.level: run for run in slipping}  # the last one of a level stays
    way, out = next((run.slip.unit for run in slipping if run.slip and run.slip.unit), ""), data.output_unit
    return table_of(
        "Slips",
        "Peak, output after the slip, and slope of the loading.",
        [highest[u] for u in sorted(highest)],
        ("run", lambda run: Name(run.name)), (("level", data.input_unit), lambda run: level(run.level)),
        (("peak", out, 3), "slip.peak"), (("at", "s", 3), "slip.peak_s"),
        (("at", way, 3), "slip.moved") if way else None, (("after", out, 3), "slip.after"),
        (("loading", f"{out}/{way or 's'}", 3), "slip.stiffness" if way else "slip.stiffness_per_s"),
    )  # fmt: skip
