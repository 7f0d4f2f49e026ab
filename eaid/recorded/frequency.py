"""Frequency response of a recorded log, with the models' on the same input, and how nonlinear it is.

    H(f) = S_uy(f)/S_uu(f),   γ²(f) = |S_uy|²/(S_uu S_yy),   Welch: Hann windows that overlap by half

The 95 % region of H is a disc of radius |H| √(2/(2K − 2) F(2, 2K − 2) (1 − γ²)/γ²), K the independent stretches. An
input of a few tones is taken line by line over the whole log instead. Where it repeats, three times or more, the first
period is left to settle; lines that the periods share and the input lacks are harmonics, the lines between are noise.
A model's response is the same estimate made of what the model gives on the recorded input, so that what a nonlinear
model shows is its describing function under that very input.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch
from scipy.stats import f as f_distribution

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.estimate.record import RecordedLog
from eaid.estimate.response import from_rest
from eaid.models.parameters import Linear, Nonlinear
from eaid.replay.plant import plant_parameters, plant_terms
from eaid.results.recorded import Response

STRETCHES = 8
"""Stretches that a log is cut into, without their overlap."""
POINTS = 80
"""Frequencies that are given, at most, log-spaced."""
POWER = 3e-3
"""A frequency at which the input has less than this part of its greatest power was not excited."""
TONES = 0.05
"""An input with 99.9 % of its power in fewer than this part of all lines is made of tones."""
LEAST_ROWS = 256
SWITCHES = 50
"""Changes of a two-level input that make a binary sequence of it."""


@dataclass(frozen=True, eq=False)
class ResponseEstimate:
    """H, coherence, and the radius of the region relative to |H|, at some frequencies; shapes (m,)."""

    frequency_hz: Array
    H: NDArray[np.complex128]
    coherence: Array
    radius: Array
    distortion: float
    """Output power that is no linear answer to the input, over that which is."""
    averages: float


def responses(
    logs: Sequence[RecordedLog], acting: Sequence[RecordedLog], plant: Nonlinear, line: Linear | None
) -> tuple[Response, ...]:
    """Of logs whose input moves all the time or switches often; a loop's duty answers the output and has none.

    `acting` are the logs with the input as it acted, behind a dead time.
    """
    free = [
        two
        for two in zip(logs, acting, strict=True)
        if two[0].reference is None and len(two[0].input) >= 4 * LEAST_ROWS
    ]
    return tuple(
        frequency_response(log, plant, line, acted) for log, acted in free if not log.stepwise or _switches(log)
    )


def _switches(log: RecordedLog) -> bool:
    return len(log.changes) >= SWITCHES and len(np.unique(log.input)) <= 3


def frequency_response(
    log: RecordedLog, plant: Nonlinear | None = None, line: Linear | None = None, acted: RecordedLog | None = None
) -> Response:
    """The recorded response of a log, and those of the models on its input, or on the one that acted.

    Raises `DataError` where the log is too short or its input hardly moves.
    """
    first = int(np.argmax(log.input > 0)) if log.input[0] == 0 else 0
    t = log.time_s[first:] - log.time_s[first]
    if len(t) < LEAST_ROWS:
        raise DataError(f"{log.source or log.name}: {len(t)} rows under load are too few for a frequency response")
    dt_s = float(t[-1] / (len(t) - 1))
    grid = np.arange(len(t)) * dt_s

    def even(values: Array) -> Array:
        """On the even grid, by straight lines between the rows."""
        return np.asarray(np.interp(grid, t, values[first:]))

    u, y = even(log.input), even(log.output)
    if np.ptp(u) == 0:
        raise DataError(f"{log.source or log.name}: its input does not move under load; there is no response to take")
    period = period_of(u)
    kept = slice(period, period * (len(u) // period)) if period else slice(0, len(u))  # the first one settles
    u, y = u[kept], y[kept]
    periods = len(u) // period if period else 1
    tones = tones_of(u)
    recorded = _estimate(u, y, dt_s, tones, periods)
    models: dict[str, ResponseEstimate] = {}
    for name, one in (("nonlinear", plant), ("linear", line)):
        if one is not None:
            models[name] = _estimate(u, even(on_input(one, acted or log))[kept], dt_s, tones, periods)
    nonlinear, linear = models.get("nonlinear"), models.get("linear")
    size, radius = np.abs(recorded.H), recorded.radius
    leak = linear.distortion if linear is not None else 0.0
    return Response(
        name=log.name,
        frequency_hz=tuple(recorded.frequency_hz.tolist()),
        gain=tuple(size.tolist()),
        gain_low=tuple(np.maximum(size * (1 - radius), 0.0).tolist()),
        gain_high=tuple((size * (1 + radius)).tolist()),
        phase_deg=_phase(recorded),
        phase_half_width_deg=tuple(np.degrees(np.where(radius < 1, np.arcsin(np.minimum(radius, 1)), np.pi)).tolist()),
        coherence=tuple(recorded.coherence.tolist()),
        nonlinear_gain=() if nonlinear is None else tuple(np.abs(nonlinear.H).tolist()),
        nonlinear_phase_deg=() if nonlinear is None else _phase(nonlinear),
        linear_gain=() if linear is None else tuple(np.abs(linear.H).tolist()),
        linear_phase_deg=() if linear is None else _phase(linear),
        harmonics_pct=100 * recorded.distortion**0.5 if periods > 1 and tones is not None else None,
        model_harmonics_pct=None if nonlinear is None else 100 * max(nonlinear.distortion - leak, 0.0) ** 0.5,
        periodic=period > 0,
        averages=recorded.averages,
    )


def _phase(one: ResponseEstimate) -> tuple[float, ...]:
    return tuple(np.degrees(np.unwrap(np.angle(one.H))).tolist())


def on_input(p: Nonlinear | Linear, log: RecordedLog) -> Array:
    """What a model gives on the log's input, from rest, (n,)."""
    dt_s = np.array(log.dt_s)
    if isinstance(p, Linear):
        tau = 1 / p.a0

        def line(duty: Array) -> tuple[Array, Array, Array]:
            return np.where(duty > 0, (p.b0 * duty + p.c0) * tau, 0.0), np.full(len(duty), tau), np.full(len(duty), tau)

        return from_rest(log.input, dt_s, line, 1.0, None, 0.0)
    plant = plant_parameters(p)

    def curves(duty: Array) -> tuple[Array, Array, Array]:
        tau1, tau2, steady = np.array([plant_terms(plant, one) for one in duty.tolist()]).T
        return steady, tau1, tau2

    return from_rest(log.input, dt_s, curves, p.C, p.release, p.u_range[0])


def period_of(u: Array) -> int:
    """Rows after which an input repeats itself, three times or more; 0 where it does not."""
    for count in range(3, 13):
        period = len(u) // count
        if period >= LEAST_ROWS // 2 and np.abs(u[period:] - u[:-period]).max() < 1e-3 * np.ptp(u):
            return period
    return 0


def tones_of(u: Array) -> NDArray[np.intp] | None:
    """Lines of an input that is made of a few tones of the log's own length; None for any other."""
    power = np.abs(np.fft.rfft(u - u.mean())) ** 2
    order = np.argsort(power)[::-1]
    count = int(np.searchsorted(np.cumsum(power[order]), 0.999 * power.sum())) + 1
    if count > TONES * len(power) or count > 400:
        return None
    lines = np.sort(order[:count])
    return np.asarray(lines[(lines > 0) & (power[lines] > POWER * power.max())])


def _estimate(u: Array, y: Array, dt_s: float, tones: NDArray[np.intp] | None, periods: int) -> ResponseEstimate:
    return _welch(u, y, dt_s) if tones is None or len(tones) < 2 else _lines(u, y, dt_s, tones, periods)


def _lines(u: Array, y: Array, dt_s: float, lines: NDArray[np.intp], periods: int) -> ResponseEstimate:
    """Tone by tone: noise is the power of lines around each, of several periods those that no period repeats."""
    n = len(u)
    U, Y = np.fft.rfft(u - u.mean()), np.fft.rfft(y - y.mean())
    H = Y[lines] / U[lines]
    between = np.ones(len(Y), dtype=bool)
    between[lines] = between[0] = False
    every = np.arange(len(Y)) % periods == 0
    repeated = between & every
    if periods > 1:
        between &= ~every
    noise = np.empty(len(lines))
    for k, at in enumerate(lines):
        near = np.arange(max(1, at - 12), min(len(Y), at + 13))
        near = near[between[near]]
        noise[k] = float(np.median(np.abs(Y[near]) ** 2) / np.log(2)) if len(near) else 0.0
    signal = np.abs(Y[lines]) ** 2
    radius = np.sqrt(3.0 * noise / np.maximum(signal, 1e-300))  # χ² with two degrees of freedom: −ln 0.05
    coherence = np.clip(1 - noise / np.maximum(signal, 1e-300), 0.0, 1.0)
    reach = np.arange(len(Y)) <= 6 * int(lines.max())
    harmonics, floor = np.abs(Y[repeated & reach]) ** 2, np.abs(Y[between & reach]) ** 2
    mean = float(floor.mean()) if periods > 1 and len(floor) else 0.0
    distortion = max(float((harmonics - mean).sum()), 0.0) / max(float(signal.sum()), 1e-300)
    return ResponseEstimate(lines / (n * dt_s), H, coherence, radius, distortion, float(periods))


def _welch(u: Array, y: Array, dt_s: float) -> ResponseEstimate:
    """Averaged over stretches."""
    length = max(LEAST_ROWS // 2, len(u) // STRETCHES)
    rate = 1 / dt_s
    f, S_uu = welch(u, rate, nperseg=length)
    S_yy, S_uy = welch(y, rate, nperseg=length)[1], csd(u, y, rate, nperseg=length)[1]
    count = 2 * len(u) // length - 1
    K = max(0.947 * count, 2.0)
    excited = (f > 0) & (S_uu > POWER * S_uu[f > 0].max())
    rows = np.flatnonzero(excited)
    if len(rows) > POINTS:
        wanted = np.geomspace(f[rows[0]], f[rows[-1]], POINTS)
        rows = np.unique(rows[np.abs(f[rows][:, None] - wanted).argmin(axis=0)])
    H = S_uy / np.maximum(S_uu, 1e-300)
    coherence = np.clip(np.abs(S_uy) ** 2 / np.maximum(S_uu * S_yy, 1e-300), 0.0, 1.0)
    quantile = float(f_distribution.ppf(0.95, 2, 2 * K - 2))
    g = np.maximum(coherence[rows], 1e-9)
    radius = np.sqrt(2 / (2 * K - 2) * quantile * (1 - g) / g)
    linear = float((coherence * S_yy)[excited].sum())
    other = float(((1 - coherence) * S_yy)[f > 0].sum())
    return ResponseEstimate(f[rows], H[rows], coherence[rows], radius, other / max(linear, 1e-300), K)
