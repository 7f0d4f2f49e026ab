"""What is measured of a replay.

Errors are reference − true torque. Over n samples:

    largest     max |e|                              RMS  √(Σ e²/n)            mean  Σ |e|/n
    duty step   Σ |u_k − u_{k−1}|/(n − 1)
    saturated   share of samples whose duty lies at or beyond a limit (0 and 100 %, or the gains' own)

A step of the reference from r0 to r1, y = (T − r0)/(r1 − r0), watched until the next step:

    rise        from the first y = 10 % to the first y = 90 %, between samples by a straight line
    overshoot   max(y) − 1, at least 0, in percent of the step
    settling    time after the step beyond which |y − 1| stays within 2 % until the next step

What is never reached is None. A tone A sin(2πft) of the reference over whole periods: gain and phase of the
least-squares fundamental of the torque (a constant fitted beside it) against that of the reference.
"""

import itertools
import math
from collections.abc import Mapping

import msgspec
import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.replay.references import Reference
from eaid.results.gains import Tracking
from eaid.results.replay import Metrics, StepMetrics, ToneMetrics

MOST_SWINGS = 10  # Of an input from limit to limit, for each turn of the reference, from which it cycles
LIMITED, ASIDE = 0.4, 0.02  # Share of the time at a limit of the input; errors that count, of the highest reference


def lay_at_limit(name: str, columns: Mapping[str, Array], limits: tuple[float, float]) -> list[Finding]:
    """Whether a controller's input lay at a limit so long, away from the reference, that its errors say little of its
    gains, or goes from limit to limit all the time."""
    duty, wanted = columns["duty_pct"], columns["reference_nm"]
    ends = np.sign((duty >= limits[1]).astype(float) - (duty <= limits[0]))
    swings, turns = (int(np.count_nonzero(np.diff(one[one != 0]))) for one in (ends, np.sign(np.diff(wanted))))
    if swings > MOST_SWINGS * (turns + 1):
        return [finding("controller-cycles", name, count=swings, turns=turns)]
    off = np.abs(wanted - columns["torque_nm"]) > ASIDE * np.abs(wanted).max()
    share = float((((duty <= limits[0]) | (duty >= limits[1])) & off).mean())
    return [finding("controller-at-limit", name, share_pct=100 * share)] if share >= LIMITED else []


def tracking_errors(
    columns: Mapping[str, Array], limits_pct: tuple[float, float], counted: "slice | NDArray[np.int64]" = slice(None)
) -> Tracking:
    """Errors [N·m], duty activity [%] and saturation [1] of a replay over the samples that count."""
    reference, torque, duty = (columns[name][counted] for name in ("reference_nm", "torque_nm", "duty_pct"))
    error = np.abs(reference - torque)
    return Tracking(
        max_abs_error_nm=float(error.max()),
        rms_error_nm=math.sqrt(float((error * error).mean())),
        mean_abs_error_nm=float(error.mean()),
        mean_abs_duty_step_pct=float(np.abs(np.diff(duty)).mean()) if len(duty) > 1 else 0.0,
        saturated_fraction=float(((duty <= limits_pct[0]) | (duty >= limits_pct[1])).mean()),
    )


def step(torque_nm: Array, from_nm: float, to_nm: float, dt_s: float) -> StepMetrics:
    """Rise time [s], overshoot [%] and settling time [s] of one step; torque from the step's sample on, shape (n,)."""
    y = (torque_nm - from_nm) / (to_nm - from_nm)
    low, high = _first_crossing(y, 0.1), _first_crossing(y, 0.9)
    outside = np.flatnonzero(np.abs(y - 1.0) > 0.02)
    settled = int(outside[-1]) + 1 if len(outside) else 0
    return StepMetrics(
        from_nm=from_nm,
        to_nm=to_nm,
        rise_time_s=(high - low) * dt_s if low is not None and high is not None else None,
        overshoot_pct=max(0.0, float(y.max()) - 1.0) * 100,
        settling_s=settled * dt_s if settled < len(y) else None,
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


def tone(reference_nm: Array, torque_nm: Array, frequency_hz: float, dt_s: float) -> ToneMetrics:
    """Gain [dB], phase [°] and mean absolute error [N·m] at one frequency, over whole periods, shapes (n,)."""
    angle = 2 * math.pi * frequency_hz * (np.arange(len(torque_nm)) * dt_s)
    waves = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(angle))])
    sines, cosines, _ = np.linalg.lstsq(waves, np.column_stack([torque_nm, reference_nm]))[0].tolist()
    ratio = complex(sines[0], cosines[0]) / complex(sines[1], cosines[1])
    return ToneMetrics(
        frequency_hz=frequency_hz,
        gain_db=20 * math.log10(abs(ratio)) if ratio != 0 else None,
        phase_deg=math.degrees(math.atan2(ratio.imag, ratio.real)),
        mean_abs_error_nm=float(np.abs(reference_nm - torque_nm).mean()),
    )


def measure(columns: Mapping[str, Array], limits_pct: tuple[float, float], reference: Reference) -> Metrics:
    """All metrics of a replay on its reference: tracking, then per step and per tone where there are any."""
    wanted, torque, dt_s = columns["reference_nm"], columns["torque_nm"], reference.dt_s
    measured = [
        step(torque[a:b], float(wanted[a - 1]), float(wanted[a]), dt_s)
        for a, b in itertools.pairwise([*reference.steps, len(torque)])
    ]
    tones = [
        tone(wanted[begin:end], torque[begin:end], frequency_hz, dt_s) for frequency_hz, begin, end in reference.tones
    ]
    return Metrics(
        **msgspec.structs.asdict(tracking_errors(columns, limits_pct, slice(reference.begin, None))),
        counted_from_s=reference.counted_from_s, steps=tuple(measured), frequencies=tuple(tones),
    )  # fmt: skip
