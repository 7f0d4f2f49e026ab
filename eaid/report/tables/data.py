"""Tables of recorded steps and of files: runs, levels, steps from level to level, slips; what the report was given."""

from collections import Counter
from collections.abc import Iterable

from msgspec.structs import replace

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.report.results import KINDS, Results
from eaid.report.rig import controller_name, rising
from eaid.report.tables.table import Cell, Name, Table, columns, level, table_of
from eaid.results.fit import Fit
from eaid.results.replay import Replay
from eaid.shown import counted
from eaid.steps.stepset import LevelStep, RunRecord, StepSet


def doubts_of(run: RunRecord) -> tuple[str, ...]:
    """What is doubtful in a run, as sentences that do not name it again; notes are no doubts."""
    doubts = [replace(found, subject="this run") for found in run.findings if found.severity != "note"]
    return tuple(("stop: " if doubt.severity == "stop" else "") + on_command_line(say(doubt)) for doubt in doubts)


def runs_tables(data: StepSet) -> tuple[Table, Table]:
    """The doubtful runs with what is doubtful in each, and the fine ones."""
    doubtful: list[tuple[Cell, ...]] = []
    fine: list[tuple[Cell, ...]] = []
    for run in data.runs:
        doubts = doubts_of(run)
        row: tuple[Cell, ...] = (Name(run.name), level(run.level), run.edge, run.repeat)
        if doubts:
            doubtful.append((*row, Name("; ".join(doubts))))
        else:
            fine.append((*row, run.samples, run.rate_hz, run.baseline_nm))
    heads = columns("run", ("level", data.input_unit), "edge", "repeat")
    of_fine = columns("samples", ("rate", "Hz"), ("idle", data.output_unit, 3))
    read_first = "Read these before their numbers are used."
    idle = "The idle output is the mean before the step; it is subtracted before fitting."
    return (
        Table("Doubtful runs", read_first, (*heads, *columns("what is doubtful")), tuple(doubtful)),
        Table("Runs without a doubt", idle, (*heads, *of_fine), tuple(fine)),
    )


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    doubtful = Counter(run.level for run in data.runs if doubts_of(run))
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
        rows.append((level(u), len(names), doubtful[u], before, rise, lost_pct, held_s, falls[u]))
    out = data.output_unit
    heads = columns(
        ("level", data.input_unit), "runs", "doubtful", ("before", out, 3), ("rise", out), ("lost", "%"), ("held", "s"),
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
    slips = [(run, run.slip) for run in runs if run.slip is not None]
    way = next((slip.unit for _, slip in slips if slip.unit), "")
    rows: list[tuple[Cell, ...]] = [
        (Name(run.name), level(run.level), slip.peak, slip.peak_s, *((slip.moved,) if way else ()), slip.after,
         slip.stiffness if way else slip.stiffness_per_s, slip.stick_slip, slip.stick_slip_hz)
        for run, slip in slips
    ]  # fmt: skip
    out = data.output_unit
    heads = columns(
        "run", ("level", data.input_unit), ("peak", out, 3), ("at", "s", 3), *([("at", way, 3)] if way else []),
        ("after", out, 3), ("loading", f"{out}/{way or 's'}", 3), ("stick-slip", out, 3), ("at", "Hz", 3),
    )  # fmt: skip
    caption = "Peak, output after the slip, slope of the loading, and what sticks and slips behind it, peak to peak."
    return Table("Slips", caption, heads, tuple(rows))


def highest_slips(data: StepSet) -> list[RunRecord]:
    """Of each level the run with the highest peak."""
    slipping = [(run.slip.peak, run) for run in data.runs if run.slip is not None]
    highest = {run.level: run for _peak, run in sorted(slipping, key=lambda pair: pair[0])}  # the last one stays
    return [highest[u] for u in sorted(highest)]


def files_table(results: Results) -> Table:
    """The files given to the report and, for each fit, the logs behind it."""
    rows: list[tuple[Cell, ...]] = [
        *((Name(fit.path), "fit", _of_fit(fit.result), Name(fit.sha256)) for fit in results.fits),
        *((Name(gains.path), "gains", "robust and PI gains", Name(gains.sha256)) for gains in results.gains),
        *((Name(run.path), "replay", Name(_of_replay(run.result)), Name(run.sha256)) for run in results.replays),
    ]
    for data in results.data:
        counts = Counter(averaged.level for averaged in data.result.levels for _ in averaged.names)
        rows.append((Name(data.path), "data", f"{KINDS[data.result.kind]}: {_levels(counts)}", Name(data.sha256)))
    fingerprints = {given.sha256 for given in results.every}
    for fit in results.fits:
        logs = [(log.path, log.sha256) for log in fit.result.data.inputs or fit.result.data.sources]
        for path, sha in dict.fromkeys(logs):
            if sha not in fingerprints:
                rows.append((Name(path), Name(f"log behind {fit.path}"), None, Name(sha or "–")))
    caption = "What was given to this report, and the logs that the fits name. The fingerprint (SHA-256) tells one "
    heads = columns("file", "what it is", "holds", "fingerprint")
    return Table("Files", f"{caption}version of a file from another.", heads, tuple(rows))


def _of_fit(fit: Fit) -> str:
    models = [name for name in ("friction", "nonlinear", "linear", "release") if getattr(fit, name) is not None]
    counts = Counter(source.level for source in rising(fit.data.sources))
    text = f"{KINDS[fit.data.kind]}: {', '.join(models) or 'no model'}"
    return f"{text}; {_levels(counts)}" if counts else text


def _of_replay(replay: Replay) -> str:
    names = [controller_name(name) for name in replay.records]
    return f"{replay.head.scenario or 'replay'}: {', '.join(names) if len(names) < 6 else f'{len(names)} runs'}"


def _levels(counts: "Counter[float | None] | Counter[float]") -> str:
    if not counts:
        return "no level"
    least, most = min(counts.values()), max(counts.values())
    runs = f"{least}" if least == most else f"{least} to {most}"
    return f"{counted(len(counts), 'level')}, {runs} run{'s' if most != 1 else ''} each"
