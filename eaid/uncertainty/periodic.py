"""The periodic part of a rig's ripple, a turn of the rotor for example: torque f (1 + r sin(2πt/P + φ)), φ by chance.

Noise without a memory loses its weight with the square root of a record's length, a sine with the length itself: a plan
that takes one for the other promises too little for short holds and too much for long ones. The period P is the highest
peak in the power of the residuals along f e^(2πit/P), pooled over all runs; none is told where no peak stands out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Friction
from eaid.steps.noise import block_means
from eaid.steps.stepset import Level
from eaid.uncertainty.levels import LevelEstimate, log_jacobian
from eaid.uncertainty.run_statistics import run_residuals

LEAST_TURNS = 2.0
"""Turns within a record below which a sine and a slow exponential cannot be told apart."""
SHORTEST_S = 1.0
"""The Bartlett windows reach 2 s, and see what turns faster as the noise that it is."""
PER_RECORD = 4
"""Frequencies that are tried in 1/(length of the record)."""
STANDS_OUT = 4.0
"""How many times the median power of its octave on either side a peak has to have."""
BINS = 512


@dataclass(frozen=True)
class Periodic:
    """A periodic ripple."""

    period_s: float
    amplitude: float
    """r, as a share of the output."""

    def variance(self, curve: Friction, hold_s: float) -> Array:
        """What it adds to the variance of (log T_s, log τ1, log τ2) of one run, its phase by chance, shape (3,)."""
        count = max(400, round(40 * hold_s / self.period_s))
        t: Array = (np.arange(count, dtype=np.float64) + 0.5) * (hold_s / count)
        jacobian = log_jacobian(curve, t)
        turned = np.linalg.lstsq(jacobian, self.amplitude * _wave(jacobian[:, 0], t, self.period_s), rcond=None)[0]
        return np.asarray(0.5 * (turned**2).sum(axis=1))


def _wave(fitted: Array, time_s: Array, period_s: float) -> Array:
    """f cos and f sin, shape (n, 2)."""
    angle = 2 * np.pi * time_s / period_s
    return np.stack([fitted * np.cos(angle), fitted * np.sin(angle)], axis=1)


@dataclass(frozen=True, eq=False)
class _Binned:
    """One level in bins of a few samples, its output in units of T_s."""

    time_s: Array
    residual: Array
    """Of each run about its own curve, shape (R, B)."""
    jacobian: Array
    """∂f/∂log θ, f itself first, shape (B, k)."""
    record_s: float
    steady: float
    """T_s."""

    @classmethod
    def of(cls, level: Level, one: LevelEstimate) -> Self:
        """The level's samples, averaged."""
        time_s, noise = block_means(level.time_s, BINS), block_means(one.noise_nm, BINS)
        jacobian = log_jacobian(one.curve, time_s, one.share_free) / one.curve.Ts
        return cls(time_s, noise / one.curve.Ts, jacobian, one.runs.duration_s, one.curve.Ts)

    @property
    def fitted(self) -> Array:
        """f, shape (B,)."""
        return np.asarray(self.jacobian[:, 0])

    def power(self, frequency_hz: Array) -> Array:
        """Power of the residuals along f e^(2πit/P), summed over the runs, shape of `frequency_hz`."""
        along = (self.residual * self.fitted) @ np.exp(-2j * np.pi * np.outer(self.time_s, frequency_hz))
        return np.asarray(
            np.sort(np.abs(along) ** 2, axis=0).sum(axis=0) / max(float(self.fitted @ self.fitted), 1e-300)
        )

    def sizes(self, frequency_hz: float) -> tuple[Array, float]:
        """Squared amplitude of each run along what its own curve cannot follow, and the power that this explains."""
        basis = np.linalg.qr(self.jacobian)[0]
        wave = _wave(self.fitted, self.time_s, 1 / frequency_hz)
        wave = wave - basis @ (basis.T @ wave)
        size = np.linalg.lstsq(wave, self.residual.T, rcond=None)[0]
        return np.sort((size**2).sum(axis=0)), float(np.sort(((wave @ size) ** 2).sum(axis=0)).sum())

    def without(self, frequency_hz: float) -> Self:
        """The same with the residuals that a sine leaves too."""
        both = np.hstack([self.jacobian, _wave(self.fitted, self.time_s, 1 / frequency_hz)])
        return replace(self, residual=run_residuals(self.residual, np.zeros(1), both))


def periodic_part(levels: Sequence[Level], estimates: Sequence[LevelEstimate]) -> tuple[Periodic, Array, Array] | None:
    """The periodic ripple of these levels, and the noise beside it: its density [output²·s] and f² of the levels, (L,).

    The amplitude is taken along what a run's own curve cannot follow, less what noise alone gives there; the density is
    the mean over the frequencies away from the peak. None where no peak stands out.
    """
    binned = [_Binned.of(level, one) for level, one in zip(levels, estimates, strict=True)]
    frequency_hz = _grid(binned)
    found = _peak(binned, frequency_hz)
    if found is None:
        return None
    at, ratio = found
    square = float(np.mean(np.concatenate([one.sizes(at)[0] for one in binned])))
    away = frequency_hz[np.abs(frequency_hz - at) > 1.5 / min(one.record_s for one in binned)]
    left = [one.without(at) for one in binned]
    density = [one.steady**2 * one.record_s / one.residual.size * float(one.power(away).mean()) for one in left]
    square_of_f = [one.steady**2 * float((one.fitted**4).sum() / (one.fitted**2).sum()) for one in left]
    return Periodic(1 / at, float(np.sqrt(square * (1 - 1 / ratio)))), np.array(density), np.array(square_of_f)


def _grid(levels: Sequence[_Binned]) -> Array:
    """Frequencies that are tried [Hz]."""
    longest, shortest = (ends([one.record_s for one in levels]) for ends in (max, min))
    return np.arange(LEAST_TURNS / shortest, 1 / SHORTEST_S, 1 / (PER_RECORD * longest))


def _peak(levels: Sequence[_Binned], frequency: Array) -> tuple[float, float] | None:
    """Frequency of the highest peak [Hz], and how far it stands out; None where none does."""
    if len(frequency) < PER_RECORD:
        return None
    step, shortest = frequency[1] - frequency[0], min(one.record_s for one in levels)
    power = np.sum([one.power(frequency) for one in levels], axis=0)
    place = int(power.argmax())
    apart = np.abs(frequency - frequency[place])
    near = power[(apart > 1.5 / shortest) & (apart < frequency[place])]
    if not 0 < place < len(frequency) - 1 or not len(near) or not power[place] > STANDS_OUT * np.median(near):
        return None
    # the curves take part of a slow sine with them: the peak is looked for again in what they leave
    tried = frequency[place] + step * np.arange(-2, 3)
    explained = [sum(one.sizes(float(f))[1] for one in levels) for f in tried]
    i = int(np.clip(np.argmax(explained), 1, 3))
    before, here, after = explained[i - 1 : i + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(tried[i] + step * np.clip(shift, -1, 1)), float(power[place] / np.median(near))
