"""Synthetic logs as files: a folder of plain eaid CSV, one run a file, each headed by what it is, or a data.h5; and the
three synthetic datasets that ship with eaid (`datasets/make.py` makes them).

These are the reference plant (specification 6) at the paper's 1 kHz with the default disturbance and seed 0; the same
call makes the same bytes again, as long as HDF5's own compressor is the same version. Torques are rounded to the
sensor's 1/1024 N·m, so the numbers themselves do not depend on the last digit of a machine's exponential.
"""

import math
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from eaid.apparatus import Apparatus
from eaid.errors import DataError, UsageError
from eaid.files import folder_written_whole, refuse_folder
from eaid.logs.dataset import write_dataset
from eaid.logs.run import INPUT_UNITS, Run
from eaid.options import EXPERIMENTS
from eaid.replay.references import read_rows
from eaid.steps.cut import cut
from eaid.synth.logs import InputSteps

# Input of a plain eaid CSV, by kind,
PLAIN_INPUTS = {"clutch": "duty_pct", "friction-force": "force_n", "friction-speed": "speed_rpm"}
INPUT_OF = {"clutch": "input", "friction-force": "force", "friction-speed": "speed"}  # and its name in another unit

FIRST_LINE = "# synthetic: "  # Only files that begin so are ever replaced or removed


def is_synthetic(_path: Path, ends: bytes) -> bool:
    """Whether a file, by its first bytes, is a synthetic log."""
    return ends.startswith(FIRST_LINE.encode())


def write_folder(folder: Path, runs: Sequence[Run], force: bool) -> None:
    """One CSV a run, all at once or none; with `force`, a folder of earlier synthetic runs is replaced.

    Every number has the digits that give it back exactly; units that are not the usual ones stand in the header.
    """
    with folder_written_whole(folder, is_synthetic) as part:
        for run in runs:
            unit, output = run.input_unit, "torque_nm" if run.output_unit == "N·m" else f"output ({run.output_unit})"
            columns = {"time_s": run.time_s, input_column(run.kind or "clutch", unit): run.input, output: run.output}
            if run.reference_nm is not None:
                columns["reference_nm"] = run.reference_nm
            rows = zip(*(each.tolist() for each in columns.values()), strict=True)
            lines = [f"{FIRST_LINE}{run.synthetic}", ",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]
            (part / f"{run.name}.csv").write_text("\n".join(lines), encoding="utf-8", newline="\n")
        refuse_folder(folder, force, is_synthetic, "eaid synth")


def input_column(kind: str, unit: str) -> str:
    """Name of the input's column: `duty_pct`, `force_n`, `speed_rpm`, or one with another unit, `input (V)`."""
    return PLAIN_INPUTS[kind] if unit == INPUT_UNITS[kind] else f"{INPUT_OF[kind]} ({unit})"


def read_input(path: Path, kind: str = "clutch", unit: str = "%") -> tuple[InputSteps, float]:
    """The changes of the input (from when [s], value) and the length of the log [s]; `DataError` with the bad rows."""
    column = input_column(kind, unit)
    rows = read_rows(path, ("time_s", column), {"input": column})
    duty = column == "duty_pct"
    most, range_said = (100.0, "0 to 100 %") if duty else (math.inf, "0 and above")
    if wrong := [(number, value) for number, (_, value) in rows if not 0 <= value <= most]:
        said = (f"row {number} holds {column} {value:g}, outside {range_said}" for number, value in wrong[:20])
        raise DataError(*(f"{path}: {one}; mend it" for one in said))
    changes = [(time_s - rows[0][1][0], value) for _, (time_s, value) in rows]
    return changes[:-1], changes[-1][0]


def input_file(changes: Sequence[tuple[float, float]], kind: str, unit: str) -> list[str]:
    """The lines of a file that `read_input` reads."""
    return [f"time_s,{input_column(kind, unit)}", *(f"{at:.9g},{value:.9g}" for at, value in changes)]


def write(path: Path, runs: Sequence[Run], force: bool = False) -> None:
    """Write logs as data.h5: cut into their steps, rising and falling, as `eaid ingest` would have found them."""
    kind = runs[0].kind or "clutch"
    # one surface in the friction rig, two in the clutch (specification 1)
    apparatus = Apparatus(surfaces=2 if kind == "clutch" else 1)
    write_dataset(path, [step for run in runs for step in cut(run)], kind=kind, apparatus=apparatus, force=force)


def shipped() -> dict[str, Path]:
    """Where the shipped datasets lie, by kind: in the installed package, or in `datasets/` of a checkout."""
    inside = Path(str(resources.files("eaid"))) / "datasets"
    checkout = Path(__file__).parents[2] / "datasets"
    for folder in (inside, checkout):
        paths: dict[str, Path] = {kind: folder / f"{kind}.h5" for kind in EXPERIMENTS}
        if all(path.is_file() for path in paths.values()):
            return paths
    raise UsageError(f"{inside}: the shipped datasets are missing; install eaid again, or run datasets/make.py")
