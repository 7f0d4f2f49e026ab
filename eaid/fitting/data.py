"""What the fits of the curve share: every sample of the levels, and the few weighted points that stand for them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points, compress
from eaid.fitting.samples import Record, full_sums
from eaid.steps.stepset import Level


@dataclass(frozen=True, eq=False)
class Data:
    """The mean curves of L levels. Fitting the mean is exact: Σ_r |y_r − f|² = Σ_r |y_r − ȳ|² + R |ȳ − f|²."""

    u: Array
    """Level of each curve, in the set's input unit, shape (L,)."""
    records: tuple[Record, ...]
    together: Array | None = None
    """The curves as one array, (L, n), where all share one grid; `records` are its rows then."""

    @property
    def samples(self) -> int:
        """Samples of all mean curves together."""
        return sum(len(record.y) for record in self.records)

    @property
    def longest_s(self) -> float:
        """Length of the longest record [s]."""
        return max(float(record.t_s[-1]) for record in self.records)

    @cached_property
    def energy(self) -> float:
        """Sum of squared data, all samples."""
        return float((self.points.root_y**2).sum())

    @cached_property
    def points(self) -> Points:
        """The compressed curves."""
        records = self.records
        return compress([r.t_s for r in records], [r.y for r in records], self.together, [r.uniform for r in records])

    def sums(self, theta: Array) -> tuple[Array, Array]:
        """Squared residuals of each level over every sample, (L,), and their gradient by θ, (4, L)."""
        return full_sums(theta, self.records, self.together)

    def one(self, index: int) -> "Data":
        """One level of it."""
        row = slice(index, index + 1)
        together = None if self.together is None else self.together[row]
        alone = Data(self.u[row], self.records[row], together)
        alone.__dict__["points"] = self.points.rows(row)
        return alone


def data_of(levels: Sequence[Level]) -> Data:
    """The mean curves of some levels; those on one grid share their times."""
    u = np.array([level.level for level in levels], dtype=np.float64)
    first = levels[0]
    alike = all(
        level.time_s is first.time_s or (level.uniform and np.array_equal(level.time_s, first.time_s))
        for level in levels
    )
    if not alike:
        return Data(u, tuple(Record(one.time_s, one.mean, one.uniform) for one in levels))
    together = np.empty((len(levels), len(first.time_s)))
    for row, level in zip(together, levels, strict=True):
        runs = level.ordered_runs
        np.matmul(np.full(len(runs), 1 / len(runs)), runs, out=row)
    records = tuple(Record(first.time_s, row, first.uniform) for row in together)
    return Data(u, records, together)
