"""What all ways of cutting a log need: a part of it as a run, whether it has an input, the end of a hold."""

from dataclasses import replace

import numpy as np

from eaid.arrays import Array, read_only
from eaid.logs.run import Run
from eaid.steps.plateaus import Plateau, tolerance

OFFSET = 0.05
"""Share of its largest value within which a measured input counts as zero."""


def has_input(run: Run) -> bool:
    """True where the log has an input column."""
    return bool(len(run.input)) and not bool(np.isnan(run.input[0]) and np.isnan(run.input[-1]))


def part_of(run: Run, start: int, stop: int, **changes: object) -> Run:
    """Samples start … stop − 1 of a log as a run of its own, with other changes."""
    beside = {name: getattr(run, name) for name in ("reference_nm", "position")}
    held = {name: None if values is None else read_only(values[start:stop]) for name, values in beside.items()}
    return replace(
        run,
        time_s=read_only(run.time_s[start:stop]),
        input=read_only(run.input[start:stop]),
        output=read_only(run.output[start:stop]),
        **{"cut": True, **held, **changes},  # type: ignore[arg-type]
    )


def sample_s(run: Run) -> float:
    """Mean sample time of a log [s]."""
    return float(run.time_s[-1] - run.time_s[0]) / (len(run.time_s) - 1)


def end_of(output: Array, hold: Plateau) -> float:
    """Output at the end of a hold: mean of its last twentieth."""
    return float(output[hold.stop - max(1, hold.count // 20) : hold.stop].mean())


def zero_of(run: Run) -> float:
    """How far from zero an input is still at rest: a commanded duty is exact, a measured input has an offset."""
    if not has_input(run):
        return 0.0
    offset = OFFSET * float(np.abs(run.input).max()) if run.input_unit != "%" else 0.0
    return max(tolerance(run.input), offset)
