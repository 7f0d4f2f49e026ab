"""How well a model follows its data: residuals over time and per level, their autocorrelation, levels held out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import friction, linear, nonlinear
from eaid.models.parameters import SHARE
from eaid.report import style
from eaid.report.figures.clutch import linear_of, nonlinear_of
from eaid.report.figures.friction import curve_of
from eaid.report.thin import thinned
from eaid.steps.stepset import StepSet


def residuals_of(data: StepSet, fit: Mapping[str, Any], model: str) -> list[tuple[float, Array, Array]]:
    """Level, time [s] and measured mean − model [N·m] of each level that the model covers."""
    found = []
    if model == "friction":
        share = float(fit["friction"].get("C") or SHARE)
        curves = {float(row["level"]): curve_of(row, share) for row in fit["friction"].get("levels") or []}
    for level in data.levels:
        t = level.time_s
        if model == "nonlinear":
            predicted = nonlinear.step_response(nonlinear_of(fit), t, level.level)
        elif model == "linear":
            predicted = linear.step_response(linear_of(fit), t, level.level)
        elif level.level in curves:
            predicted = friction.step_response(curves[level.level], t)
        else:
            continue
        found.append((level.level, t, level.mean - predicted))
    return found


def autocorrelation(residual: Array, lags: Sequence[int]) -> Array:
    """Autocorrelation of a residual at given lags [1], shape of `lags`, by FFT; 1 at lag 0."""
    centred = residual - residual.mean()
    n = len(centred)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(centred, size)) ** 2
    every = np.fft.irfft(power, size)[:n]
    if every[0] <= 0:
        return np.zeros(len(lags))
    return np.asarray(every[np.asarray(lags)] / every[0])


def residuals(data: StepSet, fit: Mapping[str, Any], model: str) -> Figure:
    """(a) residual over time [N·m], (b) RMSE per level [N·m], the key to the colours, (c) autocorrelation over lag."""
    figure, (over_time, per_level, over_lag) = style.sheet(style.PAGE_IN, 2.5, 1, 3, width_ratios=(1.5, 1, 1))
    rows = residuals_of(data, fit, model)
    colours = style.level_colours(len(rows))
    for (_level, t, r), colour in zip(rows, colours, strict=True):
        smooth_t, smooth_r = thinned(t, _smoothed(r), 500)
        over_time.plot(smooth_t, smooth_r, color=colour, linewidth=0.8)
    over_time.axhline(0, color=style.BLACK, linewidth=0.6)
    over_time.set(xlabel="Time since the step (s)", ylabel=f"Measured − model ({data.output_unit})")
    over_time.set_xlim(0, max(float(t[-1]) for _, t, _ in rows))
    levels = [level for level, _, _ in rows]
    rms = [float(np.sqrt(np.mean(r**2))) for _, _, r in rows]
    per_level.bar(levels, rms, width=0.6 * min(np.diff(levels), default=1.0), color=colours, edgecolor="black", lw=0.4)
    per_level.set(
        xlabel=f"Level ({data.input_unit})" if data.input_unit else "Level", ylabel=f"RMSE ({data.output_unit})"
    )
    for (_level, t, r), colour in zip(rows, colours, strict=True):
        dt = float(t[-1] - t[0]) / max(len(t) - 1, 1)
        longest = max(2, min(len(r) // 4, round(2.0 / dt)))
        lags = np.unique(np.concatenate([[0], np.geomspace(1, longest, 60).astype(int)]))
        over_lag.plot(lags * dt, autocorrelation(r, list(lags)), color=colour, linewidth=0.8)
    over_lag.axhline(0, color=style.BLACK, linewidth=0.6)
    over_lag.set(xlabel="Lag (s)", ylabel="Autocorrelation (1)", ylim=(-0.55, 1.05))
    for mark, axes in zip("abc", (over_time, per_level, over_lag), strict=True):
        style.letter(axes, mark)
    return figure


def _smoothed(r: Array) -> Array:
    width = max(1, len(r) // 200)
    if width == 1:
        return r
    cut = len(r) // width * width
    means = r[:cut].reshape(-1, width).mean(axis=1)
    return np.asarray(np.interp(np.arange(len(r)), (np.arange(len(means)) + 0.5) * width, means))
