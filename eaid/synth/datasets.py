"""The three synthetic datasets that ship with eaid (`datasets/make.py` makes them), and logs written as one.

All are the reference plant (specification 6) at the paper's 1 kHz with the default disturbance and seed 0; the same
call makes the same bytes again, as long as HDF5's own compressor is the same version. Torques are rounded to the
sensor's 1/1024 N·m, so the numbers themselves do not depend on the last digit of a machine's exponential.
"""

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from eaid.apparatus import Apparatus
from eaid.errors import UsageError
from eaid.logs.dataset import write_dataset
from eaid.logs.run import Run
from eaid.options import EXPERIMENTS
from eaid.steps.cut import cut


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
