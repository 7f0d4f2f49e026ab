"""What the fits of the curve share: every sample of the levels, and the few weighted points that stand for them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.estimate.points import LevelRecord, Points, compress
from eaid.findings import Finding, finding
from eaid.results.common import AbsError, HoldOut, LevelError
from eaid.results.models import Linear, Nonlinear
from eaid.steps.noise import block_means
from eaid.steps.stepset import Creep, Level


@dataclass(frozen=True, eq=False)
class Data:
    """The mean curves of L levels. Fitting the mean is exact: Σ_r |y_r − f|² = Σ_r |y_r − ȳ|² + R |ȳ − f|²."""

    u: Array  # Level of each curve, in the set's input unit, shape (L,)
    records: tuple[LevelRecord, ...]
    compressed: Points | None = None  # Where that is done already
    creep: Creep | None = None  # That was taken off

    @property
    def longest_s(self) -> float:
        """Length of the longest record [s]."""
        return max(float(record.t_s[-1]) for record in self.records)

    @property
    def shortest_s(self) -> float:
        """The shortest time from a step to its first sample behind it [s]."""
        return min(float(record.t_s[record.t_s > 0].min()) for record in self.records)

    @cached_property
    def points(self) -> Points:
        """The compressed curves."""
        return self.compressed or compress([r.t_s for r in self.records], [r.y for r in self.records])

    def only(self, rows: Sequence[int]) -> "Data":
        """Some of the levels."""
        at = list(rows)
        return Data(self.u[at], tuple(self.records[k] for k in at), self.points.rows(at), self.creep)


def data_of(levels: Sequence[Level], creep: Creep | None = None) -> Data:
    """The mean curves of some levels, from whose runs a creep was taken off."""
    records = tuple(LevelRecord(level.time_s, level.mean) for level in levels)
    return Data(np.array([level.level for level in levels], dtype=np.float64), records, creep=creep)


MEANS_TAKEN = 50  # Block means of a record that noise is averaged out in, before a model is said to miss the curve
LITTLE_R2 = 0.5  # R² of the block means below which a model explains little
# Part of the output's size (rms of the block means) that the model must miss as well: a flat curve has no R²
MISSED_FAR = 0.25


@dataclass(frozen=True)
class Errors:
    """Errors over some samples, in the output's unit."""

    scores: dict[str, Any]  # rmse, sse, fit_pct, R2
    abs_error: AbsError

    def at(self, level: float) -> LevelError:
        """The same as the errors of one level."""
        return LevelError(level, self.abs_error, **self.scores)


def quality(sse: float, outputs: Sequence[Array]) -> tuple[float | None, float | None]:
    """fit_pct and R2 for a sum of squared residuals; None where the output never changes."""
    samples, total = sum(len(y) for y in outputs), sum(float(y.sum()) for y in outputs)
    spread = sum(float(((y - total / samples) ** 2).sum()) for y in outputs)
    if spread == 0:
        return None, None
    return 100 * (1 - float(np.sqrt(sse / spread))), 1 - sse / spread


def errors(outputs: Sequence[Array], residuals: Sequence[Array]) -> Errors:
    """Errors over all samples of some levels: mean curves and the model's residuals, (n_l,) each."""
    samples, sse = sum(len(r) for r in residuals), sum(float(r @ r) for r in residuals)
    mean, square = sum(float(np.abs(r).sum()) for r in residuals) / samples, sse / samples
    sd = float(np.sqrt(max(square - mean**2, 0.0)))
    fit_pct, R2 = quality(sse, outputs)
    return Errors({"rmse": float(np.sqrt(square)), "sse": sse, "fit_pct": fit_pct, "R2": R2}, AbsError(mean, sd))


def hold_out(held_out: Sequence[Level], predicted: Callable[[Level], Array], fitted_rmse: float) -> HoldOut | None:
    """How far the model is from held-out levels, beside the error on the fitted ones; None where none was held out."""
    if not held_out:
        return None
    outputs = [level.mean for level in held_out]
    residuals = [predicted(level) - level.mean for level in held_out]
    total, rows = errors(outputs, residuals), each_level([level.level for level in held_out], outputs, residuals)
    return HoldOut(rows, total.scores["rmse"], fitted_rmse, total.abs_error)


def each_level(levels: Sequence[float], outputs: Sequence[Array], residuals: Sequence[Array]) -> tuple[LevelError, ...]:
    """Errors of every level by itself."""
    return tuple(errors([y], [r]).at(u) for u, y, r in zip(levels, outputs, residuals, strict=True))


def explains_little(outputs: Sequence[Array], residuals: Sequence[Array]) -> bool:
    """Whether a model misses the curves themselves, whatever the noise on them."""
    y, r = (np.concatenate([block_means(one, MEANS_TAKEN) for one in values]) for values in (outputs, residuals))
    missed, spread = float(r @ r), float(((y - y.mean()) ** 2).sum())
    return missed > (1 - LITTLE_R2) * spread and missed > MISSED_FAR**2 * float(y @ y)


def missed(subject: str, data: Data, residuals: Sequence[Array], model: Nonlinear | Linear) -> list[Finding]:
    """Said where a model misses the curves themselves."""
    if not explains_little([record.y for record in data.records], residuals):
        return []
    return [finding("model-explains-little", subject, R2=model.R2, fit_pct=model.fit_pct)]
