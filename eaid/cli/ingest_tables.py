"""What `eaid ingest` prints: one line a level, one line a step between levels, and edges."""

from collections.abc import Sequence

from eaid.cli import console
from eaid.cli.console import shortened
from eaid.cli.printed import Edges, LogEdges
from eaid.errors import on_command_line
from eaid.findings import say
from eaid.logs.run import Run
from eaid.report.tables import Cell, Name, Table, columns
from eaid.report.tables.data import between_levels, highest_slips, levels_recorded, slips_table
from eaid.shown import counted
from eaid.steps.edges import Edge
from eaid.steps.stepset import StepSet

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
    warnings: tuple[tuple[Cell, ...], ...] = tuple(
        (console.PREFIX[one.severity], Name(shortened(one.subject)), Name(on_command_line(say(one))))
        for one in data.all_findings
    )
    console.show(levels_recorded(data))
    console.show(between_levels(between[:MOST], data))
    if len(between) > MOST:
        console.line(f"and {len(between) - MOST} more")
    console.show(slips_table(highest_slips(data), data))
    console.show(Table("Warnings", "", columns("", "run", "what"), warnings))


def print_edges(edges: Sequence[tuple[Run, tuple[Edge, ...]]], json: bool) -> None:
    """A table of the edges of each log, or JSON, on stdout."""
    if json:
        console.print_json(Edges(tuple(LogEdges(run.name, each) for run, each in edges)))
        return
    for run, each in edges:
        unit = run.output_unit
        rows: tuple[tuple[Cell, ...], ...] = tuple(
            (run.start_s + one.at_s, one.before, one.after, one.rise_s, one.overshoot_pct, one.settling_s)
            for one in each
        )
        heads = columns(
            ("at", "s"), ("from", unit), "to", ("rise", "s", 3), ("overshoot", "%", 3), ("settled in", "s", 3)
        )
        console.show(Table(run.name, f"{counted(len(each), 'edge')} of its output.", heads, rows))
