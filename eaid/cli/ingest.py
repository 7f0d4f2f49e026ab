"""`eaid ingest`: logs → a table of runs, and data.h5."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console, inputs
from eaid.cli.options import Force, Json, Output, Quiet

if TYPE_CHECKING:
    from eaid.steps.stepset import StepSet


def as_json(stepset: "StepSet") -> dict[str, Any]:
    """The table of runs, machine-readable."""
    import dataclasses

    from eaid.store import stamped

    return stamped(
        "eaid/ingest/1",
        {
            "kind": stepset.kind,
            "input_unit": stepset.input_unit,
            "output_unit": stepset.output_unit,
            "synthetic": stepset.synthetic,
            "apparatus": dataclasses.asdict(stepset.apparatus),
            "levels": [
                {"level": level.level, "repeats": len(level.names), "samples": len(level.time_s), "runs": level.names}
                for level in stepset.levels
            ],
            "releases": [{"level": level.level, "repeats": len(level.names)} for level in stepset.releases],
            "runs": [dataclasses.asdict(run) for run in stepset.runs],
            "warnings": stepset.warnings,
        },
    )


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
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Read logs in any supported format, find steps, levels and repeats, and write one tidy dataset.

    Prints a table of runs with what is wrong or doubtful in each.
    """
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite
    from eaid.logs.dataset import write_dataset

    assert output is not None
    refuse_to_overwrite(output, force)
    options = {
        "columns": columns, "units": units, "name_pattern": name_pattern, "step_at": step_at, "until": until,
        "repair": repair, "kind": kind, "levels": levels, "baseline": baseline, "sign": sign, "variable": variable,
        "rate": rate, "rest": rest, "apparatus": apparatus, "join": join,
    }  # fmt: skip
    runs, stepset = inputs.runs_from(logs, **options)
    if write_manifest:
        from eaid.logs import manifest
        from eaid.logs.folders import files_of

        written = manifest.write_manifest(files_of(logs), runs, {**options, "kind": stepset.kind}, force)
        console.say(f"{written}: written; eaid ingest {written.parent} needs no options now")
    write_dataset(output, runs, kind=stepset.kind, apparatus=stepset.apparatus, force=force)  # type: ignore[arg-type]
    if json:
        console.print_json(as_json(stepset))
    else:
        for warning in stepset.warnings:
            console.warn(warning)
        _print_table(stepset)
    console.say(f"{output}: {len(runs)} runs, {len(stepset.levels)} levels")


def _print_table(stepset: "StepSet") -> None:
    unit, out = stepset.input_unit or "input", stepset.output_unit or "output"
    rows = [
        [
            run.name, f"{run.level:g}", str(run.repeat), run.edge, f"{run.step_s:.6g}", f"{run.baseline_nm:.4g}",
            str(run.samples), f"{run.rate_hz:.5g}", "; ".join(run.warnings) or "fine",
        ]
        for run in stepset.runs
    ]  # fmt: skip
    made = f", synthetic: {stepset.synthetic}" if stepset.synthetic else ""
    console.table(
        f"{stepset.kind}: {len(stepset.levels)} levels, {len(stepset.runs)} runs{made}",
        [
            "run",
            f"level [{unit}]",
            "repeat",
            "edge",
            "step [s]",
            f"baseline [{out}]",
            "samples",
            "rate [Hz]",
            "doubtful",
        ],
        rows,
    )
