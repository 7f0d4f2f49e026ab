"""Synthetic logs as a folder of plain eaid CSV, one run a file, each headed by what it is."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from eaid.errors import UsageError
from eaid.files import folder_written_whole, refuse_inputs_within
from eaid.logs.run import INPUT_UNITS, Run

PLAIN = {"clutch": "duty_pct", "friction-force": "force_n", "friction-speed": "speed_rpm"}
"""Input of a plain eaid CSV, by kind,"""
NAMES = {"clutch": "input", "friction-force": "force", "friction-speed": "speed"}
"""and its name in another unit."""

PATTERN = "synthetic-*.csv"
"""Only files of this name are ever replaced or removed,"""
LEFT_OVER = ".synthetic-*.part"
"""and what a killed command left of them."""


def refuse_folder(folder: Path, force: bool, inputs: Iterable[Path] = ()) -> None:
    """Leave an existing folder alone unless the user says otherwise; one with a rig's logs or an input, always."""
    if not folder.exists():
        if not folder.parent.is_dir():
            raise UsageError(f"{folder}: the folder {folder.parent} does not exist; make it first")
        return
    if not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give a folder, or a name that ends in .h5")
    if not force:
        raise UsageError(f"{folder}: exists already; give «force» to overwrite it, or another «output»")
    others = sorted(path.name for path in folder.iterdir() if not (path.match(PATTERN) or path.match(LEFT_OVER)))
    if others:
        raise UsageError(f"{folder}: holds {others[0]}, which eaid synth did not make; give another «output»")
    refuse_inputs_within(folder, inputs)


def write_folder(folder: Path, runs: Sequence[Run], force: bool) -> None:
    """One CSV a run, all at once or none; with `force`, a folder of earlier synthetic runs is replaced."""
    refuse_folder(folder, force)
    with folder_written_whole(folder) as part:
        for run in runs:
            (part / f"{run.name}.csv").write_text(as_csv(run), encoding="utf-8", newline="\n")
        refuse_folder(folder, force)


def input_column(kind: str, unit: str) -> str:
    """Name of the input's column: `duty_pct`, `force_n`, `speed_rpm`, or one with another unit, `input (V)`."""
    return PLAIN[kind] if unit == INPUT_UNITS[kind] else f"{NAMES[kind]} ({unit})"


def as_csv(run: Run) -> str:
    """The text of one file: every number with the digits that give it back exactly; other units stand in the header."""
    output = "torque_nm" if run.output_unit == "N·m" else f"output ({run.output_unit})"
    columns = {"time_s": run.time_s, input_column(run.kind or "clutch", run.input_unit): run.input, output: run.output}
    if run.reference_nm is not None:
        columns["reference_nm"] = run.reference_nm
    lines = [f"# synthetic: {run.synthetic}", ",".join(columns)]
    lines += [",".join(map(repr, row)) for row in zip(*(each.tolist() for each in columns.values()), strict=True)]
    return "\n".join(lines) + "\n"
