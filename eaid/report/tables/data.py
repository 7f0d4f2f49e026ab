"""Tables of data and files: the doubtful runs, the fine ones, and what was given to the report."""

from collections import Counter

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.report.results import KINDS, Results
from eaid.report.rig import controller_name
from eaid.report.tables.table import Cell, Name, Table, columns, level
from eaid.results.fit import Fit
from eaid.steps.stepset import RunRecord, StepSet


def doubts_of(run: RunRecord) -> tuple[str, ...]:
    """What is doubtful in a run, as sentences; notes are no doubts."""
    stop = {"stop": "stop: "}
    return tuple(stop.get(o.severity, "") + on_command_line(say(o)) for o in run.findings if o.severity != "note")


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


def files_table(results: Results) -> Table:
    """The files given to the report and, for each fit, the logs behind it."""
    rows: list[tuple[Cell, ...]] = [
        *((Name(one.path), "fit", _of_fit(one.result), Name(one.source.sha256)) for one in results.fits),
        *((Name(one.path), "gains", "robust and PI gains", Name(one.source.sha256)) for one in results.gains),
    ]
    for replay in results.replays:
        names = [controller_name(name) for name in replay.result.records]
        said = ", ".join(names) if len(names) < 6 else f"{len(names)} runs"
        rows.append((Name(replay.path), "replay", Name(f"{replay.result.head.scenario or 'replay'}: {said}"),
                     Name(replay.source.sha256)))  # fmt: skip
    for data in results.data:
        counts = Counter(one.level for one in data.result.levels for _ in one.names)
        said = f"{KINDS[data.result.kind]}: {_levels(counts)}"
        rows.append((Name(data.path), "data", Name(said), Name(data.source.sha256)))
    given = {source.sha256 for source in results.sources}
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


def _levels(counts: "Counter[float | None] | Counter[float]") -> str:
    if not counts:
        return "no level"
    least, most = min(counts.values()), max(counts.values())
    runs = f"{least}" if least == most else f"{least} to {most}"
    return f"{len(counts)} level{'s' if len(counts) != 1 else ''}, {runs} run{'s' if most != 1 else ''} each"
