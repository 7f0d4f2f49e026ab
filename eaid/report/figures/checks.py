"""How a model misses its data: a map of the residuals over time and level, the RMSE of each level, autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import linear
from eaid.report import style
from eaid.report.figures.clutch import linear_of, models_of
from eaid.report.figures.friction import curves_of
from eaid.report.figures.steps import Model
from eaid.report.rig import over
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

STRETCHES = 48
"""Stretches of time on a residual map: each is as much longer as it is later."""
LEVELS = 60
"""Most rows of a residual map."""


def residuals_of(data: StepSet, fit: Fit, model: str) -> list[tuple[float, Array, Array]]:
    """Level, time [s] and measured mean − model of each level that the model covers."""
    if model == "linear" and fit.linear is not None:
        one = linear_of(fit.linear)
        curves: dict[float, Model] = {
            row.level: partial(linear.step_response, one, duty_pct=row.level) for row in data.levels
        }
    else:
        curves = models_of(fit, data) if model == "nonlinear" else curves_of(fit)
    return [
        (row.level, row.time_s, row.mean - curves[row.level](row.time_s)) for row in data.levels if row.level in curves
    ]


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """Mean residuals of stretches of time, a row a level."""

    levels: tuple[float, ...]
    edges_s: Array
    """Ends of the stretches [s], shape (n + 1,)."""
    mean: Array
    """Mean residual, shape (L, n); nan where a level has no sample."""

    @property
    def size(self) -> float:
        """Residual at the ends of the colours: beyond it lie 2 % of the cells."""
        known = np.abs(self.mean[np.isfinite(self.mean)])
        return float(np.quantile(known, 0.98)) or 1e-9 if len(known) else 1e-9


def residual_map(rows: Sequence[tuple[float, Array, Array]]) -> ResidualMap:
    """Residuals as a map: stretches of time grow with the time since the step."""
    if len(rows) > LEVELS:
        rows = [rows[round(k * (len(rows) - 1) / (LEVELS - 1))] for k in range(LEVELS)]
    end = max(float(t[-1]) for _level, t, _r in rows)
    dt = min(float(t[-1] - t[0]) / max(len(t) - 1, 1) for _level, t, _r in rows)
    # No stretch is shorter than a sample: the first is as long as that asks for.
    samples = end / dt
    first = next((k for k in range(2, 400) if k * ((samples / k) ** (1 / (STRETCHES - 1)) - 1) >= 1), samples / 2)
    edges = np.concatenate([[0.0], np.geomspace(min(max(first * dt, end / 2000), end / 2), end, STRETCHES)])
    edges[-1] = np.nextafter(end, np.inf)
    mean = np.full((len(rows), STRETCHES), np.nan)
    for i, (_level, t, r) in enumerate(rows):
        place = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, STRETCHES - 1)
        count = np.bincount(place, minlength=STRETCHES)
        total = np.bincount(place, weights=r, minlength=STRETCHES)
        mean[i, count > 0] = total[count > 0] / count[count > 0]
    return ResidualMap(tuple(level for level, _t, _r in rows), edges, mean)


def residuals(data: StepSet, fit: Fit, model: str) -> Figure:
    """(a) residuals over time and level, hatched where the model lies above the data, (b) RMSE of each level."""
    figure, (over_time, per_level) = style.page(2.7, 1, 2, width_ratios=(2.4, 1))
    rows = residuals_of(data, fit, model)
    found = residual_map(rows)
    places = np.arange(len(found.levels) + 1) - 0.5
    times = np.concatenate([[found.edges_s[1] / 1.6], found.edges_s[1:]])
    colours = TwoSlopeNorm(0.0, -found.size, found.size)
    drawn = over_time.pcolormesh(times, places, found.mean, cmap="PuOr_r", norm=colours, rasterized=True)
    cells = [
        [(times[k], i - 0.5), (times[k + 1], i - 0.5), (times[k + 1], i + 0.5), (times[k], i + 0.5)]
        for i, k in np.argwhere(found.mean < -0.25 * found.size)
    ]  # told apart in grey, too
    over_time.add_collection(PolyCollection(cells, facecolor="none", edgecolor="white", hatch="/////", linewidth=0))
    over_time.set(xscale="log", xlabel="Time since the step (s)", ylabel=over(data.input_unit))
    shown = np.unique(np.linspace(0, len(found.levels) - 1, 12).round().astype(int))
    over_time.set_yticks(shown, [f"{found.levels[k]:.3g}" for k in shown])
    over_time.grid(visible=False)
    bar = figure.colorbar(drawn, ax=over_time, pad=0.01)
    bar.set_label(f"Measured − model ({data.output_unit})")
    rms = [float(np.sqrt(np.mean(r**2))) for _, _, r in rows]
    levels = [level for level, _, _ in rows]
    per_level.plot(rms, levels, "o-", color=style.BLUE, linewidth=0.8)
    per_level.set(xlabel=f"RMSE ({data.output_unit})", ylabel=over(data.input_unit))
    per_level.set_xlim(0, 1.1 * max(rms))
    style.letter(over_time, "a", "(hatched: model above)")
    style.letter(per_level, "b")
    return figure
