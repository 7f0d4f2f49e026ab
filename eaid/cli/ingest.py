"""`eaid ingest`: logs → a table of levels, what is doubtful in their runs, and data.h5."""

from pathlib import Path
from typing import Annotated, Any

import typer

from eaid.cli import console, ingest_tables, inputs
from eaid.cli.options import Force, Json, Output, Quiet


def command(
    logs: inputs.Logs,
    output: Output = Path("data.h5"),
    columns: inputs.Columns = None,
    units: inputs.Units = None,
    name_pattern: inputs.NamePattern = None,
    step_at: inputs.StepAt = None,
    until: inputs.Until = None,
    repair: inputs.Repair = False,
    kind: inputs.KindOption = None,
    levels: inputs.Levels = None,
    baseline: inputs.Baseline = "auto",
    sign: inputs.Sign = "auto",
    variable: inputs.Variable = None,
    rate: inputs.Rate = None,
    rest: inputs.Rest = 0.0,
    join: inputs.Join = False,
    apparatus: inputs.ApparatusOption = None,
    write_manifest: Annotated[
        bool,
        typer.Option(
            "--write-manifest", help="Also write dataset.toml beside the logs: the next call needs no options."
        ),
    ] = False,
    edges: Annotated[
        bool,
        typer.Option("--edges", help="List the edges of the output instead, as of a closed loop; writes nothing."),
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Read logs in any supported format, find steps, levels and repeats, and write one tidy dataset.

    Prints a line for each level and each step between levels, and what is wrong or doubtful.
    """
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite
    from eaid.logs.dataset import write_dataset

    assert output is not None
    options: dict[str, Any] = {
        "columns": columns, "units": units, "name_pattern": name_pattern, "step_at": step_at, "until": until,
        "repair": repair, "kind": kind, "levels": levels, "baseline": baseline, "sign": sign, "variable": variable,
        "rate": rate, "rest": rest, "apparatus": apparatus, "join": join,
    }  # fmt: skip
    if edges:
        ingest_tables.print_edges(inputs.edges_from(logs, **options), json)
        return
    refuse_to_overwrite(output, force, logs)
    runs, stepset = inputs.runs_from(logs, columns_told=True, **options)
    if write_manifest:
        from eaid.logs import manifest
        from eaid.logs.folders import files_of

        written = manifest.write_manifest(files_of(logs), runs, {**options, "kind": stepset.kind}, force)
        console.say(f"{written}: written; eaid ingest {written.parent} needs no options now")
    write_dataset(output, runs, kind=stepset.kind, apparatus=stepset.apparatus, force=force)  # type: ignore[arg-type]
    if json:
        console.print_json(ingest_tables.as_json(stepset))
    else:
        ingest_tables.print_tables(stepset)
    console.say(f"{output}: {len(runs)} runs, {len(stepset.levels)} levels")
