"""How well a torque follows its reference; each number with its definition.

Errors are reference − true torque. Over n samples of interval dt:

    largest     max |e|                              RMS  √(Σ e²/n)            mean  Σ |e|/n
    IAE         Σ |e| dt                             duty step  Σ |u_k − u_{k−1}|/(n − 1)
    saturated   share of samples whose duty lies at or beyond a limit (0 and 100 %, or the gains' own)

A step of the reference from r0 to r1, y = (T − r0)/(r1 − r0), watched until the next step:

    rise        from the first y = 10 % to the first y = 90 %, between samples by a straight line
    overshoot   max(y) − 1, at least 0, in percent of the step
    settling    time after the step beyond which |y − 1| stays within 2 % until the next step

What is never reached is None. A tone A sin(2πft) of the reference over whole periods: gain and phase of the
least-squares fundamental of the torque (a constant fitted beside it) against that of the reference.
"""

import math
from functools import lru_cache

import numpy as np

from eaid.arrays import Array
from eaid.results.gains import Tracking
from eaid.results.replay import StepMetrics, ToneMetrics


def tracking(
    reference_nm: Array, torque_nm: Array, duty_pct: Array, dt_s: float, limits_pct: tuple[float, float] = (0.0, 100.0)
) -> Tracking:
    """Errors [N·m], IAE [N·m·s], duty activity [%] and saturation [1] over all samples given, shapes (n,)."""
    # in place: long columns are sooner overwritten than memory is had for more of them
    error = reference_nm - torque_nm
    np.abs(error, out=error)
    largest, total = float(error.max()), float(error.sum())
    np.multiply(error, error, out=error)
    steps = duty_pct[1:] - duty_pct[:-1]
    np.abs(steps, out=steps)
    saturated = (duty_pct <= limits_pct[0]) | (duty_pct >= limits_pct[1])
    return Tracking(
        max_abs_error_nm=largest,
        rms_error_nm=math.sqrt(float(error.mean())),
        mean_abs_error_nm=total / len(error),
        iae_nm_s=total * dt_s,
        mean_abs_duty_step_pct=float(steps.mean()) if len(steps) else 0.0,
        saturated_fraction=int(np.count_nonzero(saturated)) / len(saturated),
    )


def step(torque_nm: Array, from_nm: float, to_nm: float, dt_s: float) -> StepMetrics:
    """Rise time [s], overshoot [%] and settling time [s] of one step; torque from the step's sample on, shape (n,)."""
    y = (torque_nm - from_nm) / (to_nm - from_nm)
    low, high = _first_crossing(y, 0.1), _first_crossing(y, 0.9)
    return StepMetrics(
        from_nm=from_nm,
        to_nm=to_nm,
        rise_time_s=(high - low) * dt_s if low is not None and high is not None else None,
        overshoot_pct=max(0.0, float(y.max()) - 1.0) * 100,
        settling_s=_settling(np.abs(y - 1.0), dt_s),
    )


def _first_crossing(y: Array, level: float) -> float | None:
    """Samples until y first reaches a level, between samples by a straight line; 0 where it begins there."""
    reached = y >= level
    k = int(reached.argmax())
    if not reached[k]:
        return None
    if k == 0:
        return 0.0
    return k - 1 + float((level - y[k - 1]) / (y[k] - y[k - 1]))


def _settling(away: Array, dt_s: float) -> float | None:
    """Time [s] from which |y − 1| stays within 2 %; None: never."""
    outside = away > 0.02
    if outside[-1]:
        return None
    late = int(outside[::-1].argmax())  # 0: never outside
    return float(len(away) - late) * dt_s if late else 0.0


def fundamental(values: Array, frequency_hz: float, dt_s: float) -> complex:
    """Complex amplitude of the least-squares sine at a frequency (against sin 2πft, t = 0 at the first sample),
    shape (n,)."""
    sine, cosine = (_weights(len(values), frequency_hz, dt_s) * values).sum(axis=1).tolist()
    return complex(sine, cosine)


@lru_cache(maxsize=32)  # reference and torque, each controller and each plant ask for the same tones
def _weights(samples: int, frequency_hz: float, dt_s: float) -> Array:
    """What each sample adds to the amplitudes of sine and cosine in the least-squares fit, shape (2, samples)."""
    angle = 2 * math.pi * frequency_hz * (np.arange(samples) * dt_s)
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones(samples)])
    return np.linalg.pinv(columns, rcond=samples * np.finfo(np.float64).eps)[:2]


def tone(reference_nm: Array, torque_nm: Array, frequency_hz: float, dt_s: float) -> ToneMetrics:
    """Gain [dB], phase [°] and mean absolute error [N·m] at one frequency, over whole periods, shapes (n,)."""
    ratio = fundamental(torque_nm, frequency_hz, dt_s) / fundamental(reference_nm, frequency_hz, dt_s)
    return ToneMetrics(
        frequency_hz=frequency_hz,
        gain_db=20 * math.log10(abs(ratio)) if ratio != 0 else None,
        phase_deg=math.degrees(math.atan2(ratio.imag, ratio.real)),
        mean_abs_error_nm=float(np.abs(reference_nm - torque_nm).mean()),
    )
