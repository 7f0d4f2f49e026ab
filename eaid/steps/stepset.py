"""What the fits take: levels of averaged repeats, on a time axis that starts at the step."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array


@dataclass(frozen=True, eq=False)
class Level:
    """The repeats of one level on their common grid; baseline subtracted, inverted inputs made positive."""

    level: float
    """Input of the step, in the set's input unit."""
    time_s: Array
    """Time since the step [s], shape (n,), time_s[0] ≥ 0; the first sample at the level is t = 0."""
    runs: Array
    """Output of each repeat [N·m or `output_unit`], shape (R, n)."""
    names: tuple[str, ...]
    """Name of the run behind each row of `runs`."""

    @cached_property
    def uniform(self) -> bool:
        """True where `time_s` is t_0 + k·dt, to a millionth of dt."""
        count = len(self.time_s)
        if count < 2:
            return False
        first = float(self.time_s[0])
        dt = (float(self.time_s[-1]) - first) / (count - 1)
        off = np.arange(count) * dt
        off += first
        off -= self.time_s
        return bool(max(-off.min(), off.max()) <= 1e-6 * dt)

    @cached_property
    def mean(self) -> Array:
        """Mean of the repeats, shape (n,): what is fitted."""
        return np.asarray(self.runs.mean(axis=0))

    @property
    def sd(self) -> Array:
        """Standard deviation of the repeats (n − 1), shape (n,); zeros for a single run."""
        if len(self.runs) == 1:
            return np.zeros_like(self.time_s)
        return np.asarray(self.runs.std(axis=0, ddof=1))


@dataclass(frozen=True)
class RunRecord:
    """One row of the run table: where a run came from and what is doubtful in it."""

    name: str
    source: str
    sha256: str
    level: float
    repeat: int
    baseline_nm: float
    step_s: float
    """Step instant on the log's own clock [s]."""
    samples: int
    """Samples in the active window."""
    rate_hz: float
    edge: str
    """"rising", or "falling" for a release."""
    warnings: tuple[str, ...] = ()
    lost_pct: float | None = None
    """Torque lost while the input is held, peak to end [%] (Fig. 6); None for a release."""
    left_pct: float | None = None
    """Torque left at the end of a release [% of the held torque] (Fig. 6); None for a rising step."""


@dataclass(frozen=True, eq=False)
class StepSet:
    """All steps of one experiment."""

    kind: str
    """clutch, friction-force or friction-speed."""
    input_unit: str
    output_unit: str
    apparatus: Apparatus
    levels: tuple[Level, ...]
    """Rising steps, by level."""
    releases: tuple[Level, ...] = ()
    """Falling steps, by the level they fall from; output still relative to the idle baseline."""
    runs: tuple[RunRecord, ...] = ()
    warnings: tuple[str, ...] = ()
    """What is doubtful in the set as a whole."""
    synthetic: str | None = None
    """What made the data, where they are not recorded; None: a rig."""
    extra: dict[str, object] = field(default_factory=dict)
