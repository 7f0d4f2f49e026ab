"""`eaid ingest`: logs → a table of levels, what is doubtful in their runs, and data.h5."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.console import shortened
from eaid.cli.form import OUTPUT, Common, argument, takes, written
from eaid.cli.printed import Edges, LogEdges
from eaid.declared import option, part
from eaid.errors import on_command_line
from eaid.findings import say
from eaid.logs.run import Run
from eaid.options import ReadOptions
from eaid.report.tables.data import between_levels, highest_slips, levels_recorded, slips_table
from eaid.report.tables.table import Cell, Name, Table, columns
from eaid.shown import counted
from eaid.steps.edges import Edge
from eaid.steps.stepset import StepSet


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, ReadOptions):
    """What `eaid ingest` takes."""

    logs: list[Path] = argument("LOG…", "Log files, folders of them, or a data.h5.")
    output: Path = written("data.h5")
    write_manifest: bool = option(
        False, "Also write dataset.toml beside the logs: the next call needs no options.", OUTPUT
    )
    edges: bool = option(
        False, "List the edges of the output instead, as of a closed loop; logs are kept whole.", OUTPUT
    )


@takes(Arguments)
def command(args: Arguments) -> None:
    """Read logs in any supported format, find steps, levels and repeats, and write one tidy dataset.

    Prints a line for each level and each step between levels, and what is wrong or doubtful.

    Example: eaid ingest bench/ --columns input=Volts --units output=mNm -o data.h5
    """
    from eaid.apparatus import Apparatus
    from eaid.cli import inputs
    from eaid.cli.printed import Ingested
    from eaid.files import refuse_to_overwrite
    from eaid.logs.dataset import write_dataset
    from eaid.logs.folders import files_read
    from eaid.reading import read_edges

    options = part(ReadOptions, args)
    refuse_to_overwrite(args.output, args.force, files_read(args.logs))
    if args.edges:
        logs = read_edges(args.logs, options, console.warn)
        whole = [run for run, _edges in logs]
        rig = options.apparatus or whole[0].apparatus or Apparatus()
        kind = options.kind or whole[0].kind or "clutch"
        write_dataset(args.output, whole, kind=kind, apparatus=rig, force=args.force)
        print_edges(logs, args.json)
        console.done(args.output, f"{counted(len(logs), 'log')} as recorded", f"eaid report {args.output}")
        return
    runs, stepset = inputs.runs_from(args.logs, options, seen=console.say)
    if args.write_manifest:
        from eaid.logs import folders
        from eaid.logs.folders import files_of

        said = {**options.stated(), "kind": stepset.kind}
        at = folders.write_manifest(files_of(args.logs), runs, said, args.force)
        console.say(f"{at}: written; eaid ingest {at.parent} needs no options now")
    write_dataset(args.output, runs, kind=stepset.kind, apparatus=stepset.apparatus, force=args.force)  # type: ignore[arg-type]
    if args.json:
        console.print_json(Ingested.of(stepset), "ingest")
    else:
        print_tables(stepset)
    console.done(
        args.output,
        f"{counted(len(runs), 'run')}, {counted(len(stepset.levels), 'level')}",
        f"eaid fit {args.output}",
    )


MOST = 20
"""Steps from level to level that are listed; all are in the file and in --json."""


def print_tables(data: StepSet) -> None:
    """The tables on stdout."""
    made = f", synthetic: {data.synthetic}" if data.synthetic else ""
    rates = sorted(run.rate_hz for run in data.runs) or [0.0]
    rate = " to ".join(dict.fromkeys(f"{one:.5g}" for one in (rates[0], rates[-1])))
    what = f"{counted(len(data.levels), 'level')}, {counted(len(data.runs), 'run')}"
    console.line(f"{data.kind}: {what}, {rate} Hz{made}")
    between = [step for step in data.level_steps if step.from_level != 0.0 and step.level != 0.0]
    doubts: tuple[tuple[Cell, ...], ...] = tuple(
        (console.PREFIX[one.severity], Name(shortened(one.subject)), Name(on_command_line(say(one))))
        for one in data.all_findings
    )
    console.show(levels_recorded(data))
    console.show(between_levels(between[:MOST], data))
    if len(between) > MOST:
        console.line(f"and {len(between) - MOST} more")
    console.show(slips_table(highest_slips(data), data))
    console.show(Table("Doubts", "", columns("", "run", "what"), doubts))


def print_edges(found: Sequence[tuple[Run, tuple[Edge, ...]]], json: bool) -> None:
    """A table of the edges of each log, or JSON, on stdout."""
    if json:
        console.print_json(Edges(tuple(LogEdges(run.name, each) for run, each in found)))
        return
    for run, each in found:
        unit = run.output_unit
        rows: tuple[tuple[Cell, ...], ...] = tuple(
            (run.start_s + one.at_s, one.before, one.after, one.rise_s, one.overshoot_pct, one.settling_s)
            for one in each
        )
        heads = columns(
            ("at", "s"), ("from", unit), "to", ("rise", "s", 3), ("overshoot", "%", 3), ("settled in", "s", 3)
        )
        console.show(Table(run.name, f"{counted(len(each), 'edge')} of its output.", heads, rows))
