"""What recorded logs excite: levels that are held, or the range of inputs that move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.recorded.log import RecordedLog

ALIKE = 1e-3
"""Inputs that differ by less than this part of the largest are one level."""
MANY = 60
"""Levels beyond which inputs count as moving."""
TAIL = 0.01
"""Part of the acting time that a moving input may spend below, and above, the identified range."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the logs excite."""

    levels: Array
    """Held levels, or the ends of the range where the inputs move."""
    low: float
    high: float
    stepwise: bool

    @property
    def basis(self) -> Array:
        """Levels over which the models are laid out."""
        if self.stepwise and len(self.levels) > 1:
            return np.unique([*self.levels, self.low, self.high])
        if self.stepwise:
            return self.levels
        return np.linspace(self.low, self.high, 11) if self.high > self.low else np.array([self.low])

    @property
    def shown(self) -> Array:
        """Inputs at which curves are given: the levels where they are few, else eleven over the range."""
        few = self.stepwise and 0 < len(self.basis) <= 12
        return self.basis if few else np.linspace(self.low, self.high, 11)


def levels_of(logs: Sequence[RecordedLog]) -> Array:
    """The different inputs above rest, rising; those within a thousandth of the largest taken together."""
    values = np.unique(np.concatenate([log.input[log.changes] for log in logs]))
    values = values[values > 0]
    return np.asarray(values[np.append(True, np.diff(values) > ALIKE * values[-1])], dtype=np.float64)


def inputs_of(logs: Sequence[RecordedLog], wanted: tuple[float, float] | None) -> Inputs:
    """Levels and range that the logs excite, or the range that was asked for."""
    levels = levels_of(logs)
    stepwise = all(log.stepwise for log in logs) and len(levels) <= MANY
    if wanted is not None:
        inside = levels[(levels >= wanted[0]) & (levels <= wanted[1])]
        return Inputs(inside if stepwise else np.array(wanted), *wanted, stepwise)
    if stepwise:
        return Inputs(levels, float(levels[0]), float(levels[-1]), True)
    values, weights = [np.concatenate(part) for part in zip(*((log.input, log.dt_s) for log in logs), strict=True)]
    acting = values > 0
    values, weights = values[acting], weights[acting]
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    ends = np.minimum(np.searchsorted(share, [TAIL, 1 - TAIL]), len(order) - 1)
    low, high = values[order][ends].tolist()
    return Inputs(np.array([low, high]) if high > low else np.array([low]), low, high, False)
