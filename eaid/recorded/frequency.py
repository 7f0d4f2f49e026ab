"""Frequency response of a recorded log, with the models' on the same input.

    H(f) = S_uy(f)/S_uu(f),   γ²(f) = |S_uy|²/(S_uu S_yy),   Welch: Hann windows that overlap by half

The 95 % region of H is a disc of radius |H| √(2/(2K − 2) F(2, 2K − 2) (1 − γ²)/γ²), K the independent stretches. A
model's response is the same estimate made of what the model gives on the recorded input, so that what a nonlinear
model shows is its describing function under that very input.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch
from scipy.stats import f as f_distribution

from eaid.arrays import Array
from eaid.estimate.record import RecordedLog
from eaid.estimate.response import from_rest
from eaid.models.parameters import Linear, Nonlinear
from eaid.replay.plant import plant_parameters, plant_terms
from eaid.results.recorded import Response

STRETCHES = 8
"""Stretches that a log is cut into, without their overlap."""
APART = 0.947
"""Part of the stretches that overlap which count as independent."""
POINTS = 80
"""Frequencies that are given, at most, log-spaced."""
POWER = 3e-3
"""A frequency at which the input has less than this part of its greatest power was not excited."""
LEAST_ROWS = 1024
SWITCHES = 50
"""Changes of a two-level input that make a binary sequence of it."""


def responses(
    logs: Sequence[RecordedLog], acting: Sequence[RecordedLog], plant: Nonlinear, line: Linear | None
) -> tuple[Response, ...]:
    """Of logs whose input moves all the time or switches often; a loop's duty answers the output and has none.

    `acting` are the logs with the input as it acted, behind a dead time.
    """
    moving = [
        frequency_response(log, acted, plant, line)
        for log, acted in zip(logs, acting, strict=True)
        if log.reference is None and len(log.input) >= LEAST_ROWS and (not log.stepwise or _switches(log))
    ]
    return tuple(moving)


def _switches(log: RecordedLog) -> bool:
    return len(log.changes) >= SWITCHES and len(np.unique(log.input)) <= 3


def frequency_response(log: RecordedLog, acted: RecordedLog, plant: Nonlinear, line: Linear | None) -> Response:
    """The recorded response of a log, and those of the models on the input that acted."""
    first = int(np.argmax(log.input > 0)) if log.input[0] == 0 else 0
    t = log.time_s[first:] - log.time_s[first]
    rate = (len(t) - 1) / float(t[-1])
    grid = np.arange(len(t)) / rate
    length = len(t) // STRETCHES

    def spectra(output: Array) -> tuple[NDArray[np.complex128], Array]:
        """S_uy and S_yy of an output on the even grid, by straight lines between its rows."""
        y = np.interp(grid, t, output[first:])
        return csd(u, y, rate, nperseg=length)[1], welch(y, rate, nperseg=length)[1]

    u = np.interp(grid, t, log.input[first:])
    f, S_uu = welch(u, rate, nperseg=length)
    rows = np.flatnonzero((f > 0) & (S_uu > POWER * S_uu[1:].max()))
    if len(rows) > POINTS:
        wanted = np.geomspace(f[rows[0]], f[rows[-1]], POINTS)
        rows = np.unique(rows[np.abs(f[rows][:, None] - wanted).argmin(axis=0)])
    S_uy, S_yy = spectra(log.output)
    H = (S_uy / np.maximum(S_uu, 1e-300))[rows]
    coherence = np.clip(np.abs(S_uy) ** 2 / np.maximum(S_uu * S_yy, 1e-300), 1e-9, 1.0)[rows]
    spare = 2 * APART * (2 * len(t) // length - 1) - 2
    radius = np.sqrt(2 / spare * float(f_distribution.ppf(0.95, 2, spare)) * (1 - coherence) / coherence)
    size = np.abs(H)
    models: dict[str, tuple[float, ...]] = {}
    for name, one in (("nonlinear", plant), ("linear", line)):
        if one is not None:
            of_model = (spectra(on_input(one, acted))[0] / np.maximum(S_uu, 1e-300))[rows]
            models |= {f"{name}_gain": tuple(np.abs(of_model).tolist()), f"{name}_phase_deg": _phase(of_model)}
    return Response(
        name=log.name,
        frequency_hz=tuple(f[rows].tolist()),
        gain=tuple(size.tolist()),
        gain_low=tuple(np.maximum(size * (1 - radius), 0.0).tolist()),
        gain_high=tuple((size * (1 + radius)).tolist()),
        phase_deg=_phase(H),
        phase_half_width_deg=tuple(np.degrees(np.where(radius < 1, np.arcsin(np.minimum(radius, 1)), np.pi)).tolist()),
        coherence=tuple(coherence.tolist()),
        **models,
    )


def _phase(H: NDArray[np.complex128]) -> tuple[float, ...]:
    return tuple(np.degrees(np.unwrap(np.angle(H))).tolist())


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
