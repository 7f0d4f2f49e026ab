"""Tables of recorded steps and of files: runs, levels, steps from level to level, slips; what the report was given."""

from collections import Counter
from collections.abc import Iterable

from msgspec.structs import replace

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.report.results import KINDS, Results
from eaid.report.rig import controller_name
from eaid.report.tables.table import Cell, Name, Table, columns, level, table_of
from eaid.results.fit import Fit
from eaid.results.replay import Replay
from eaid.steps.stepset import LevelStep, RunRecord, StepSet


def doubts_of(run: RunRecord) -> tuple[str, ...]:
    """What is doubtful in a run, as sentences that do not name it again; notes are no doubts."""
    stop = {"stop": "stop: "}
    doubts = (replace(one, subject="this run") for one in run.findings if one.severity != "note")
    return tuple(stop.get(one.severity, "") + on_command_line(say(one)) for one in doubts)


def runs_tables(data: StepSet) -> tuple[Table, Table]:
    """The doubtful runs with what is doubtful in each, and the fine ones."""
    doubtful: list[tuple[Cell, ...]] = []
    fine: list[tuple[Cell, ...]] = []
    for run in data.runs:
        said = doubts_of(run)
        row: tuple[Cell, ...] = (Name(run.name), level(run.level), run.edge, run.repeat)
        if said:
            doubtful.append((*row, Name("; ".join(said))))
        else:
            fine.append((*row, run.samples, run.rate_hz, run.baseline_nm))
    heads = columns("run", ("level", data.input_unit), "edge", "repeat")
    more = columns("samples", ("rate", "Hz"), ("idle", data.output_unit, 3))
    doubts = "Read these before their numbers are used."
    idle = "The idle output is the mean before the step; it is subtracted before fitting."
    return (
        Table("Doubtful runs", doubts, (*heads, *columns("what is doubtful")), tuple(doubtful)),
        Table("Runs without a doubt", idle, (*heads, *more), tuple(fine)),
    )


def levels_recorded(data: StepSet) -> Table:
    """One row a level: runs, the output before the step and in the end, what is lost while the input is held."""
    doubtful = Counter(run.level for run in data.runs if doubts_of(run))
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
    unit, out = data.input_unit, data.output_unit
    return table_of(
        "Steps from level to level", "", steps,
        (("from", unit), lambda one: level(one.from_level)), ("to", lambda one: level(one.level)),
        (("start", out), "start"), (("change", out), "change"), (("gain", f"{out}/{unit}" if unit else out), "gain"),
        (("held", "s"), lambda one: float(one.time_s[-1])),
    )  # fmt: skip


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


def files_table(results: Results) -> Table:
    """The files given to the report and, for each fit, the logs behind it."""
    rows: list[tuple[Cell, ...]] = [
        *((Name(one.path), "fit", _of_fit(one.result), Name(one.sha256)) for one in results.fits),
        *((Name(one.path), "gains", "robust and PI gains", Name(one.sha256)) for one in results.gains),
        *((Name(one.path), "replay", Name(_of_replay(one.result)), Name(one.sha256)) for one in results.replays),
    ]
    for data in results.data:
        counts = Counter(one.level for one in data.result.levels for _ in one.names)
        rows.append((Name(data.path), "data", f"{KINDS[data.result.kind]}: {_levels(counts)}", Name(data.sha256)))
    given = {one.sha256 for one in results.every}
    for fit in results.fits:
        data_of = fit.result.data
        inputs = [(one.path, one.sha256) for one in data_of.inputs]
        behind = inputs or [(one.path, one.sha256) for one in data_of.sources]
        for path, sha in dict.fromkeys(behind):
            if sha not in given:
                rows.append((Name(path), Name(f"log behind {fit.path}"), None, Name(sha or "–")))
    caption = "What was given to this report, and the logs that the fits name. The fingerprint (SHA-256) tells one "
    heads = columns("file", "what it is", "holds", "fingerprint")
    return Table("Files", f"{caption}version of a file from another.", heads, tuple(rows))


def _of_fit(fit: Fit) -> str:
    models = [name for name in ("friction", "nonlinear", "linear", "release") if getattr(fit, name) is not None]
    counts = Counter(one.level for one in fit.data.sources if one.edge != "falling")
    said = f"{KINDS[fit.data.kind]}: {', '.join(models) or 'no model'}"
    return f"{said}; {_levels(counts)}" if counts else said


def _of_replay(replay: Replay) -> str:
    names = [controller_name(name) for name in replay.records]
    return f"{replay.head.scenario or 'replay'}: {', '.join(names) if len(names) < 6 else f'{len(names)} runs'}"


def _levels(counts: "Counter[float | None] | Counter[float]") -> str:
    if not counts:
        return "no level"
    least, most = min(counts.values()), max(counts.values())
    runs = f"{least}" if least == most else f"{least} to {most}"
    return f"{len(counts)} level{'s' if len(counts) != 1 else ''}, {runs} run{'s' if most != 1 else ''} each"
