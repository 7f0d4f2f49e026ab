"""Tables of what was recorded: runs, levels, steps from level to level, slips, edges; of the files of a report."""

from collections import Counter
from collections.abc import Iterable

from msgspec.structs import replace

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.report.results import KINDS, Results
from eaid.report.tables import Cell, Name, Part, Table, columns, level, table_of
from eaid.steps.stepset import LevelStep, RunRecord, StepSet


def warnings_of(run: RunRecord) -> tuple[str, ...]:
    """What a run warns of, as sentences that do not name it again; notes are no warnings."""
    warnings = [replace(found, subject="this run") for found in run.findings if found.severity != "note"]
    return tuple(("stop: " if one.severity == "stop" else "") + on_command_line(say(one)) for one in warnings)


def runs_tables(data: StepSet) -> tuple[Table, Table]:
    """The runs with warnings, and those without."""
    warned = [run for run in data.runs if warnings_of(run)]
    fine = [run for run in data.runs if not warnings_of(run)]
    heads: tuple[Part[RunRecord], ...] = (
        ("run", lambda run: Name(run.name)), (("level", data.input_unit), lambda run: level(run.level)),
        ("edge", "edge"), ("repeat", "repeat"),
    )  # fmt: skip
    idle = "The idle output is the mean before the step; it is subtracted before fitting."
    return (
        table_of("Runs with warnings", "Read these before their numbers are used.", warned, *heads,
                 ("warnings", lambda run: Name("; ".join(warnings_of(run))))),
        table_of("Runs without a warning", idle, fine, *heads, ("samples", "samples"), (("rate", "Hz"), "rate_hz"),
                 (("idle", data.output_unit, 3), "baseline_nm")),
    )  # fmt: skip


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    warned = Counter(run.level for run in data.runs if warnings_of(run))
    falls = Counter({release.level: len(release.names) for release in data.releases})
    rows: list[tuple[Cell, ...]] = []
    for averaged in data.levels:
        u, mean, names = averaged.level, averaged.mean, averaged.names
        runs = [run for run in data.runs if run.name in names]
        idle = [run.baseline_nm for run in runs]
        before: Cell = idle[0] if len(idle) == 1 else (min(idle), max(idle)) if idle else None
        rise = float(mean[-max(1, len(mean) // 10) :].mean())
        lost_pct = round(max((run.lost_pct or 0.0 for run in runs), default=0.0))
        held_s = float(averaged.time_s[-1])
        rows.append((level(u), len(names), warned[u], before, rise, lost_pct, held_s, falls[u]))
    out = data.output_unit
    heads = columns(
        ("level", data.input_unit), "runs", "warned", ("before", out, 3), ("rise", out), ("lost", "%"), ("held", "s"),
        "falls",
    )  # fmt: skip
    caption = "Rise: mean of the repeats in the end. Lost: from the peak to there."
    return Table("Levels", caption, heads, tuple(rows))


def between_levels(steps: Iterable[LevelStep], data: StepSet) -> Table:
    """One row a step from one level to another."""
    unit, out = data.input_unit, data.output_unit
    return table_of(
        "Steps from level to level", "", steps,
        (("from", unit), lambda step: level(step.from_level)), ("to", lambda step: level(step.level)),
        (("start", out), "start"), (("change", out), "change"), (("gain", f"{out}/{unit}" if unit else out), "gain"),
        (("held", "s"), lambda step: float(step.time_s[-1])),
    )  # fmt: skip


def slips_table(runs: Iterable[RunRecord], data: StepSet) -> Table:
    """One row a run whose output peaks and slips while its input is held; the loading over the way where it is known.

    At a constant speed v the way is v times the time.
    """
    slipping = [run for run in runs if run.slip is not None]
    way, out = next((run.slip.unit for run in slipping if run.slip and run.slip.unit), ""), data.output_unit
    return table_of(
        "Slips",
        "Peak, output after the slip, and slope of the loading.",
        slipping,
        ("run", lambda run: Name(run.name)), (("level", data.input_unit), lambda run: level(run.level)),
        (("peak", out, 3), "slip.peak"), (("at", "s", 3), "slip.peak_s"),
        (("at", way, 3), "slip.moved") if way else None, (("after", out, 3), "slip.after"),
        (("loading", f"{out}/{way or 's'}", 3), "slip.stiffness" if way else "slip.stiffness_per_s"),
    )  # fmt: skip


def highest_slips(data: StepSet) -> list[RunRecord]:
    """Of each level the run with the highest peak."""
    slipping = [(run.slip.peak, run) for run in data.runs if run.slip is not None]
    highest = {run.level: run for _peak, run in sorted(slipping, key=lambda pair: pair[0])}  # the last one stays
    return [highest[u] for u in sorted(highest)]


def files_table(results: Results) -> Table:
    """The files given to the report and, for each fit, the logs behind it."""
    rows: list[tuple[Cell, ...]] = [
        *((Name(fit.path), f"fit, {KINDS[fit.result.data.kind]}", Name(fit.sha256)) for fit in results.fits),
        *((Name(gains.path), "gains", Name(gains.sha256)) for gains in results.gains),
        *((Name(one.path), Name(f"replay, {one.result.head.scenario}"), Name(one.sha256)) for one in results.replays),
        *((Name(data.path), f"data, {KINDS[data.result.kind]}", Name(data.sha256)) for data in results.data),
    ]
    fingerprints = {given.sha256 for given in results.every}
    for fit in results.fits:
        logs = [(log.path, log.sha256) for log in fit.result.data.inputs or fit.result.data.sources]
        for path, sha in dict.fromkeys(logs):
            if sha not in fingerprints:
                rows.append((Name(path), Name(f"log behind {fit.path}"), Name(sha or "–")))
    caption = "What was given to this report, and the logs that the fits name. The fingerprint (SHA-256) tells one "
    return Table("Files", f"{caption}version of a file from another.", columns("file", "what it is", "fingerprint"),
                 tuple(rows))  # fmt: skip
