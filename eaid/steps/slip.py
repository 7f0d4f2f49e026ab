"""A test in which a loaded contact slips: peak, level after slip, loading stiffness, stick-slip.

At constant speed v the displacement is v·t, so a stiffness per second over v is one per metre; where the position was
recorded, both are given over the displacement.
"""

from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.steps.noise import STANDARD_ERRORS, block_error, block_means, line
from eaid.steps.step import Step

OVER = 0.05
"""Share by which a peak has to exceed the level after it to be a slip."""
LEAST = 0.02
"""Share of the level after the slip below which an oscillation is not worth a word."""
MOST = 0.4
"""Share of the variance behind a slip that has to lie within an octave for it to be stick-slip."""


@dataclass(frozen=True)
class SlipTest:
    """One slip, in the output's unit; displacements are None where the speed is not known."""

    peak: float
    peak_s: float
    """Time of the peak since the step [s]."""
    after: float
    """Level after the slip: mean of the last quarter."""
    stiffness_per_s: float
    """Slope of the loading between 20 and 80 % of the peak [output unit per s]."""
    stick_slip: float | None = None
    """Peak-to-peak amplitude of the oscillation after the slip; None where none stands out."""
    stick_slip_hz: float | None = None

    moved: float | None = None
    """Displacement from the step to the peak [unit of the position]; None where no position was recorded."""
    stiffness: float | None = None
    """Slope of the loading over the displacement [output unit per unit of the position]."""
    unit: str = ""
    """Unit of the position."""


def slip_of_step(step: Step) -> SlipTest | None:
    """The slip of a cut run that rises from rest; None where it has none."""
    if step.run.edge != "rising" or step.run.from_level != 0:
        return None
    position = None if step.run.position is None else step.run.position[step.start :]
    slip = slip_of(step.time_s, step.rise, position)
    return None if slip is None else replace(slip, unit=step.run.position_unit)


def slip_of(time_s: Array, rise: Array, position: Array | None = None) -> SlipTest | None:
    """The slip in a rise from its own start, shapes (n,); None where its peak does not stand out of what follows.

    Where the position is known each stroke slips, whether it peaks or not: its displacement says when.
    """
    count = len(rise)
    if count < 80:
        return None
    width = max(1, count // 200)
    sums = np.concatenate(([0.0], np.cumsum(rise)))
    smooth = (sums[width:] - sums[:-width]) / width
    at = int(smooth.argmax())
    after = float(rise[-(count // 4) :].mean())
    peak, error = float(smooth[at]), block_error(rise) * np.sqrt(10)
    peaks = 0 < at < 0.9 * count and peak - after >= max(OVER * peak, STANDARD_ERRORS * error)
    if not (peaks or position is not None) or peak <= 0 or after <= 0:
        return None
    middle = at + width // 2
    low = int(np.argmax(smooth >= 0.2 * peak))
    high = max(int(np.argmax(smooth >= 0.8 * peak)), low + 1)
    stiffness = line(time_s[low : high + 1], smooth[low : high + 1]).slope
    late = middle + (count - middle) // 4
    amplitude, frequency = _stick_slip(time_s[late:], rise[late:])
    if amplitude is not None and amplitude < LEAST * after:
        amplitude = frequency = None
    moved = over = None
    if position is not None:
        moved = abs(float(position[middle] - position[0]))
        loaded = abs(float(position[high] - position[low]))
        over = stiffness * float(time_s[high] - time_s[low]) / loaded if loaded > 0 else None
    return SlipTest(peak, float(time_s[middle]), after, stiffness, amplitude, frequency, moved, over)


def _stick_slip(time_s: Array, output: Array) -> tuple[float | None, float | None]:
    """Peak-to-peak amplitude and frequency [Hz] of what oscillates behind a slip; (None, None) where nothing does.

    Averaged spectrum of four Hann windows, overlapping by half: the octave about its largest value holds `MOST` of the
    variance; the amplitude is that of a sine of the octave's variance.
    """
    count = 2 * (len(output) // 5)
    if count < 64:
        return None, None
    dt = float(time_s[-1] - time_s[0]) / (len(output) - 1)
    trend = np.interp(np.arange(len(output)), (np.arange(6) + 0.5) * len(output) / 6, block_means(output, 6))
    window = np.hanning(count)
    pieces = [(output - trend)[start : start + count] for start in range(0, len(output) - count + 1, count // 2)]
    power = np.mean([np.abs(np.fft.rfft(window * (piece - piece.mean()))) ** 2 for piece in pieces], axis=0)
    power[:4] = 0.0  # slower than four periods of a window is trend
    best = int(power.argmax())
    if power[best] <= 0:
        return None, None
    near = slice(max(4, round(best / np.sqrt(2))), round(best * np.sqrt(2)) + 1)
    share = float(power[near].sum() / power.sum())
    if share < max(MOST, 4 * (near.stop - near.start) / len(power)):
        return None, None
    variance = 2 * float(power[near].sum()) / (count * (window**2).sum())
    middle = float(power[near] @ np.arange(len(power))[near] / power[near].sum())
    return float(2 * np.sqrt(2 * variance)), middle / (count * dt)
