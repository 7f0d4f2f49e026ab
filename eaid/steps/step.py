"""One cut run seen from its step on: rise, idle, swing, torque lost under hold and left after release (Fig. 6)."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from eaid.arrays import Array
from eaid.logs.run import Run
from eaid.steps.clock import Clock, Clocks, Window
from eaid.steps.noise import block_means


@dataclass(frozen=True, eq=False)
class Step:
    """One cut run seen from its step on: what the checks look at."""

    run: Run
    sign: float = 1.0
    """Sign that makes the set's torque positive."""
    clocks: Clocks = field(default_factory=Clocks)
    """Clocks of the set, where runs share a time axis."""

    @cached_property
    def start(self) -> int:
        """First sample of the active window, which lasts to the end of the run."""
        step = self.run.step_s or 0.0
        return int(np.searchsorted(self.run.time_s, step - 1e-9 * max(1.0, abs(step))))

    @cached_property
    def clock(self) -> Clock:
        """The clock of the whole run."""
        return self.clocks.clock(self.run.time_s)

    @cached_property
    def window(self) -> Window:
        """The time axis of the active window."""
        return self.clocks.window(self.run.time_s, self.start)

    @property
    def time_s(self) -> Array:
        """Time in the active window [s], from 0 at the step."""
        return self.window.time_s

    @cached_property
    def rise(self) -> Array:
        """Output relative to the idle baseline in the active window, its sign as the step's."""
        rise = self.run.output[self.start :] - (self.run.baseline or 0.0)
        return rise if self.sign == 1.0 else self.sign * rise

    @cached_property
    def idle(self) -> Array:
        """Output relative to the baseline before the step."""
        idle = self.run.output[: self.start] - (self.run.baseline or 0.0)
        return idle if self.sign == 1.0 else self.sign * idle

    @property
    def before(self) -> float | None:
        """Output just before the edge, relative to the baseline; None where nothing is recorded before it."""
        return None if self.run.held is None else self.sign * (self.run.held - (self.run.baseline or 0.0))

    @cached_property
    def swing(self) -> float:
        """How far the output goes, at least 0: its largest block mean, or the held one of a release."""
        before = self.before
        found = before if self.run.edge == "falling" and before is not None else float(block_means(self.rise).max())
        return max(found, 0.0)

    @property
    def unit(self) -> str:
        """Unit of the output."""
        return self.run.output_unit


def lost_pct(step: Step) -> float:
    """Torque lost while the input is held, peak to end [% of the peak], by block means."""
    means = block_means(step.rise)
    peak = float(means.max())
    return max(0.0, 100.0 * (peak - float(means[-1])) / peak) if peak > 0 else 0.0


def left_pct(step: Step) -> float:
    """Torque left at the end of a release [% of the held torque], by block means."""
    return 100.0 * float(block_means(step.rise)[-1]) / step.swing if step.swing > 0 else 0.0
