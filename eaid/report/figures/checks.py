"""How a model misses its data: a map of the residuals over time and level, the RMSE of each level, autocorrelation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import matplotlib as mpl
import numpy as np
from bokeh.models import ColumnDataSource, HoverTool, LinearColorMapper, Range1d
from bokeh.models.annotations import ColorBar
from matplotlib.collections import PolyCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import linear
from eaid.report import style
from eaid.report.figures.steps import Model, nonlinear_curves, single_curves
from eaid.report.live import Live, Plot, bare
from eaid.report.rig import level_text, over
from eaid.report.style import Ready, caption
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

STRETCHES = 48
"""Stretches of time on a residual map: each is as much longer as it is later."""
NO_SAMPLE = "#DCDCDC"
"""Stretches of time in which a level has no sample."""
LEVELS = 60
"""Most rows of a residual map."""


def residuals_ready(model: str, with_live: bool, data: StepSet, fit: Fit) -> Ready | None:
    """Residual map of one model on the dataset of its kind."""
    rows = residuals_of(data, fit, model) if getattr(fit, model) is not None else []
    if not rows:
        return None
    shown = residual_map(rows)
    i, k = np.unravel_index(np.nanargmax(np.abs(shown.mean)), shown.mean.shape)
    unit, out = data.input_unit, data.output_unit
    value, times = float(shown.mean[i, k]), shown.edges_s[k : k + 2].tolist()
    said = caption("residuals", value=value, level=shown.levels[i], times=times, unit=unit, out=out)
    return Ready(partial(residuals, data, fit, model), said, lambda: (live(shown, unit, out),) if with_live else ())


def residuals_of(data: StepSet, fit: Fit, model: str) -> list[tuple[float, Array, Array]]:
    """Level, time [s] and measured mean − model of each level that the model covers."""
    if model == "linear" and fit.linear is not None:
        one = fit.linear.parameters
        curves: dict[float, Model] = {
            row.level: partial(linear.step_response, one, duty_pct=row.level) for row in data.levels
        }
    else:
        curves = nonlinear_curves(fit, data) if model == "nonlinear" else single_curves(fit)
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
    over_time.set_facecolor(NO_SAMPLE)
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


def ticks(first: float, end: float) -> list[float]:
    """Ticks of a logarithmic axis, few enough to stand apart on a phone, too."""
    decades = np.log10(end / first)
    steps = (1, 2, 5) if decades < 2 else (1, 3) if decades < 3 else (1,)
    every = [round(step * 10.0**k, 6) for k in range(-6, 7) for step in steps]
    return [tick for tick in every if first <= tick <= end]


def live(found: ResidualMap, input_unit: str, output_unit: str) -> Live:
    """The residual map: stretches of time along, levels upward, the mean of measured − model as colour."""
    plot = Plot()
    height = 120 + 26 * min(max(len(found.levels), 4), 16)
    first = found.edges_s[1] / 1.6
    p = plot.panel("Time since the step (s)", over(input_unit), height, output_unit, x_axis_type="log")
    left = np.concatenate([[first], found.edges_s[1:-1]])
    i, k = np.nonzero(np.isfinite(found.mean))
    columns = {"left": left[k], "right": found.edges_s[1:][k], "bottom": i - 0.5, "top": i + 0.5, "z": found.mean[i, k]}
    source = ColumnDataSource({name: values.astype(np.float32) for name, values in columns.items()})
    table = mpl.colormaps["PuOr_r"]
    palette = [mpl.colors.to_hex(table(n / 20)) for n in range(21)]
    mapper = LinearColorMapper(palette=palette, low=-found.size, high=found.size)
    fill = {"field": "z", "transform": mapper}
    drawn = bare(p.quad("left", "right", "top", "bottom", source=source, line_color=None, fill_color=fill))
    hover = p.select_one(HoverTool)
    hover.renderers = [drawn]
    hover.tooltips = [("time", "@left{0.000} to @right{0.000} s"), ("measured − model", "@z{0.0000}")]
    shown = np.unique(np.linspace(0, len(found.levels) - 1, 16).round().astype(int))
    p.yaxis.ticker = [int(n) for n in shown]
    p.yaxis.major_label_overrides = {int(n): level_text(found.levels[n], input_unit) for n in shown}
    p.add_layout(ColorBar(color_mapper=mapper, width=10, title=output_unit, background_fill_color=None), "right")
    end = float(found.edges_s[-1])
    p.xaxis.ticker = ticks(float(first), end)
    p.x_range = Range1d(start=float(first), end=end)
    p.background_fill_color = NO_SAMPLE
    p.y_range = Range1d(start=-0.5, end=len(found.levels) - 0.5)
    return plot.finish()
