"""Tables of recorded steps, for the terminal and the page: levels, steps from level to level, slips."""

from collections import Counter
from collections.abc import Iterable

from eaid.report.tables.table import Cell, Name, Table, columns, level
from eaid.steps.stepset import LevelStep, RunRecord, StepSet


def is_doubtful(run: RunRecord) -> bool:
    """Whether anything is said of a run that is more than a note."""
    return any(one.severity != "note" for one in run.findings)


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    doubtful = Counter(run.level for run in data.runs if is_doubtful(run))
    falls = Counter({one.level: len(one.names) for one in data.releases})
    rows: list[tuple[Cell, ...]] = []
    for one in data.levels:
        runs = [run for run in data.runs if run.name in one.names]
        idle = [run.baseline_nm for run in runs]
        start: Cell = idle[0] if len(idle) == 1 else (min(idle), max(idle)) if idle else None
        end = float(one.mean[-max(1, len(one.mean) // 10) :].mean())
        lost = round(max((run.lost_pct or 0.0 for run in runs), default=0.0))
        held = float(one.time_s[-1])
        rows.append((level(one.level), len(one.names), doubtful[one.level], start, end, lost, held, falls[one.level]))
    out = data.output_unit
    heads = columns(
        ("level", data.input_unit), "runs", "doubtful", ("before", out, 3), ("rise", out), ("lost", "%"), ("held", "s"),
        "falls",
    )  # fmt: skip
    said = "Rise: mean of the repeats in the end. Lost: from the peak to there."
    return Table("Levels", said, heads, tuple(rows))


def between_levels(steps: Iterable[LevelStep], data: StepSet) -> Table:
    """One row a step from one level to another."""
    rows: list[tuple[Cell, ...]] = [
        (level(one.from_level), level(one.level), one.start, one.change, one.gain, float(one.time_s[-1]))
        for one in steps
    ]
    unit, out = data.input_unit, data.output_unit
    heads = columns(
        ("from", unit), "to", ("start", out), ("change", out), ("gain", f"{out}/{unit}" if unit else out), ("held", "s")
    )
    return Table("Steps from level to level", "", heads, tuple(rows))


def slips_table(runs: Iterable[RunRecord], data: StepSet) -> Table:
    """One row a run whose output peaks and slips while its input is held; the loading over the way where it is known.

    At a constant speed v the way is v times the time.
    """
    slips = [(run, run.slip) for run in runs if run.slip is not None]
    way = next((slip.unit for _, slip in slips if slip.unit), "")
    rows: list[tuple[Cell, ...]] = [
        (Name(run.name), level(run.level), one.peak, one.peak_s, *((one.moved,) if way else ()), one.after,
         one.stiffness if way else one.stiffness_per_s, one.stick_slip, one.stick_slip_hz)
        for run, one in slips
    ]  # fmt: skip
    out = data.output_unit
    heads = columns(
        "run", ("level", data.input_unit), ("peak", out, 3), ("at", "s", 3), *([("at", way, 3)] if way else []),
        ("after", out, 3), ("loading", f"{out}/{way or 's'}", 3), ("stick-slip", out, 3), ("at", "Hz", 3),
    )  # fmt: skip
    said = "Peak, output after the slip, slope of the loading, and what sticks and slips behind it, peak to peak."
    return Table("Slips", said, heads, tuple(rows))


def highest_slips(data: StepSet) -> list[RunRecord]:
    """Of each level the run with the highest peak."""
    slipping = [(run.slip.peak, run) for run in data.runs if run.slip is not None]
    found = {run.level: run for _, run in sorted(slipping, key=lambda one: one[0])}  # the highest stays
    return [found[key] for key in sorted(found)]
