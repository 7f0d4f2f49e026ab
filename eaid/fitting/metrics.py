"""How far a model is from the averaged repeats: RMSE, |error|, R² and what part of the curve it explains.

With y the mean curve, ŷ the model: R2 = 1 − ‖y − ŷ‖²/‖y − mean y‖², fit_pct = 100 (1 − ‖y − ŷ‖/‖y − mean y‖).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.results.common import AbsError, HoldOut, LevelError
from eaid.steps.noise import block_means
from eaid.steps.stepset import Level

BLOCKS = 50
"""Block means of a record that noise is averaged out in, before a model is said to miss the curve."""
LITTLE = 0.5
"""R² of the block means below which a model explains little."""
FAR = 0.25
"""Part of the output's size (rms of the block means) that the model must miss as well: a flat curve has no R²."""


@dataclass(frozen=True)
class Errors:
    """Errors over some samples, in the output's unit."""

    rmse: float
    sse: float
    abs_error: AbsError
    fit_pct: float | None
    R2: float | None

    def at(self, level: float) -> LevelError:
        """The same as the errors of one level."""
        return LevelError(level, self.abs_error, rmse=self.rmse, sse=self.sse, fit_pct=self.fit_pct, R2=self.R2)


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
    return Errors(float(np.sqrt(square)), sse, AbsError(mean, sd), *quality(sse, outputs))


def hold_out(held_out: Sequence[Level], predicted: Callable[[Level], Array], fitted_rmse: float) -> HoldOut | None:
    """How far the model is from held-out levels, beside the error on the fitted ones; None where none was held out."""
    if not held_out:
        return None
    outputs = [level.mean for level in held_out]
    residuals = [predicted(level) - level.mean for level in held_out]
    total = errors(outputs, residuals)
    rows = [errors([y], [r]).at(level.level) for level, y, r in zip(held_out, outputs, residuals, strict=True)]
    return HoldOut(tuple(rows), total.rmse, fitted_rmse, total.abs_error)


def explains_little(outputs: Sequence[Array], residuals: Sequence[Array]) -> bool:
    """Whether a model misses the curves themselves, whatever the noise on them."""
    y, r = (np.concatenate([block_means(one, BLOCKS) for one in values]) for values in (outputs, residuals))
    missed, spread = float(r @ r), float(((y - y.mean()) ** 2).sum())
    return missed > (1 - LITTLE) * spread and missed > FAR**2 * float(y @ y)
