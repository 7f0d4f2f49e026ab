"""Does the output fall while the input is held? No sum of rising exponentials shows that (space charge, slip)."""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.steps.noise import line
from eaid.steps.stepset import Level
from eaid.uncertainty.student_t import t_quantile

OVERSHOOT = 0.05
"""Output lost under hold beyond which no monotone curve is right."""
CHANCE = 0.01
"""Probability at which noise alone would be told to be a decay under hold."""
SINGLE_CHANCE = 0.001
"""The same for a single run, whose peak the same noise has chosen."""
SINGLE_DEGREES = 4.0
"""Degrees of freedom given to the scatter of a single smoothed run."""


def overshoot(level: Level) -> float:
    """Share of its peak that the mean output loses while the input is held, smoothed over a fiftieth of the record."""
    smooth = _smooth(level.mean)
    peak = float(smooth.max())
    return float((peak - smooth[-1]) / peak) if peak > 0 else 0.0


def _smooth(values: Array) -> Array:
    """Moving means over a fiftieth of the record, along the last axis."""
    width = max(1, values.shape[-1] // 50)
    sums = np.cumsum(np.concatenate([np.zeros((*values.shape[:-1], 1)), values], axis=-1), axis=-1)
    return np.asarray((sums[..., width:] - sums[..., :-width]) / width)


def decays(levels: Sequence[Level]) -> list[tuple[float, float]]:
    """(level, share of the peak lost) where the output falls under hold by more than `OVERSHOOT` and than chance.

    The peak of a run is looked for in the other runs, so that noise does not make one. The falls of the runs of a level
    are then compared with what they scatter, pooled over the levels (t test, one in a hundred); the fall of a single
    run with what its own smoothed output scatters about a straight line after the peak (one in a thousand).
    """
    falls = [_falls(level) for level in levels]
    spare = sum(len(fall) - 1 for fall in falls)
    pooled = sum(float(((fall - fall.mean()) ** 2).sum()) for fall in falls) / max(spare, 1)
    found = []
    for level, fall in zip(levels, falls, strict=True):
        lost = overshoot(level)
        error = np.sqrt(pooled / len(fall)) if len(fall) > 1 else _single_error(level)
        degrees, chance = (float(spare), CHANCE) if len(fall) > 1 else (SINGLE_DEGREES, SINGLE_CHANCE)
        if lost > OVERSHOOT and fall.mean() > t_quantile(degrees, 1 - 2 * chance) * error:
            found.append((level.level, lost))
    return found


def _falls(level: Level) -> Array:
    """What each run loses from its peak to its end, relative to the peak, shape (R,)."""
    smooth = _smooth(level.runs)
    others = smooth if len(smooth) == 1 else smooth.sum(axis=0) - smooth
    peak = np.take_along_axis(smooth, others.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.asarray((peak - smooth[:, -1]) / np.maximum(np.abs(peak), 1e-300))


def _single_error(level: Level) -> float:
    """Standard error of the fall of a single run, from its smoothed output about a line after the peak."""
    smooth = _smooth(level.mean)
    after = smooth[int(smooth.argmax()) :: max(1, len(level.mean) // 50)]
    if len(after) < 4 or smooth.max() <= 0:
        return np.inf
    left = line(np.arange(len(after)), after).left
    return float(np.sqrt(2 * (left @ left) / (len(after) - 2)) / smooth.max())
