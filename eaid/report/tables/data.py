"""Tables of what was recorded: runs, levels, steps from level to level, slips, edges; of the files of a report."""

from collections import Counter
from collections.abc import Iterable

from msgspec.structs import replace

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.report.results import KINDS, Results
from eaid.report.tables import Cell, Name, Table, columns, level, table_of
from eaid.steps.stepset import LevelStep, RunRecord, StepSet


def warnings_of(run: RunRecord) -> tuple[str, ...]:
    """What a run warns of, as sentences that do not name it again; notes are no warnings."""
    warnings = [replace(found, subject="this run") for found in run.findings if found.severity != "note"]
    return tuple(("stop: " if one.severity == "stop" else "") + on_command_line(say(one)) for one in warnings)


def runs_table(data: StepSet) -> Table:
    """One row a run, those with warnings first."""
    return table_of(
        "Runs", "The idle output is the mean before the step; it is subtracted before fitting.",
        sorted(data.runs, key=lambda run: not warnings_of(run)),
        ("run", lambda run: Name(run.name)), (("level", data.input_unit), lambda run: level(run.level)),
        ("edge", "edge"), ("repeat", "repeat"), ("samples", "samples"), (("rate", "Hz"), "rate_hz"),
        (("idle", data.output_unit, 3), "baseline_nm"),
        ("warnings", lambda run: Name("; ".join(warnings_of(run)))) if any(map(warnings_of, data.runs)) else None,
    )  # fmt: skip


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    falls = Counter({release.level: len(release.names) for release in data.releases})
    rows: list[tuple[Cell, ...]] = []
    for averaged in data.levels:
        mean = averaged.mean
        runs = [run for run in data.runs if run.name in averaged.names]
        idle = [run.baseline_nm for run in runs]
        before: Cell = idle[0] if len(idle) == 1 else (min(idle), max(idle)) if idle else None
        warned = sum(1 for run in data.runs if run.level == averaged.level and warnings_of(run))
        rise = float(mean[-max(1, len(mean) // 10) :].mean())
        lost_pct = round(max((run.lost_pct or 0.0 for run in runs), default=0.0))
        held_s = float(averaged.time_s[-1])
        rows.append((level(averaged.level), len(averaged.names), warned, before, rise, lost_pct, held_s,
                     falls[averaged.level]))  # fmt: skip
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


def files_table(results: Results) -> Table:
    """The files given to the report and, for each fit, the logs behind it."""
    rows: list[tuple[Cell, ...]] = [
        *((Name(data.path), f"data, {KINDS[data.result.kind]}", Name(data.sha256)) for data in results.data),
        *((Name(fit.path), f"fit, {KINDS[fit.result.data.kind]}", Name(fit.sha256)) for fit in results.fits),
        *((Name(gains.path), "gains", Name(gains.sha256)) for gains in results.gains),
        *((Name(one.path), Name(f"replay, {one.result.head.scenario}"), Name(one.sha256)) for one in results.replays),
        *((Name(walls.path), "virtual walls", Name(walls.sha256)) for walls in results.couplings),
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
