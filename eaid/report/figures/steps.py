"""Step responses on one pair of axes: the mean of each level, ± sd, its model, and the level at the curve's end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from bokeh.models import ColumnDataSource, Range1d
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, TwoSlopeNorm

from eaid.arrays import Array
from eaid.models import linear, nonlinear
from eaid.report import style
from eaid.report.figures.values import axis_label, points
from eaid.report.live import MODEL, Live, Plot, thinned
from eaid.report.results import Results
from eaid.report.rig import level_text, over, quantity
from eaid.report.style import Ready, caption
from eaid.results.fit import Fit, StepShape
from eaid.steps.stepset import LevelStep, StepSet

Model = Callable[[Array], Array]
T = TypeVar("T")
LABELLED = 14
"""Most levels that are named at the ends of their curves; beyond, a colour bar names them."""
DRAWN, LIVE = 40, 24
"""Most levels that are drawn, and most of a live plot: more hide each other."""


def nonlinear_curves(fit: Fit | None, data: StepSet) -> dict[float, Model]:
    """Level → the nonlinear model's step response."""
    if fit is None or fit.nonlinear is None:
        return {}
    model = fit.nonlinear.parameters
    return {one.level: partial(nonlinear.step_response, model, duty_pct=one.level) for one in data.levels}


def single_curves(fit: Fit | None) -> dict[float, Model]:
    """Level → its own fitted curve."""
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    return {row.level: row.predict for row in rows}


def some_levels(levels: Sequence[T], most: int = DRAWN) -> list[T]:
    """All levels, or so many of them spread evenly, the first and the last among them."""
    if len(levels) <= most:
        return list(levels)
    return [levels[round(k * (len(levels) - 1) / (most - 1))] for k in range(most)]


def end_of(values: Array) -> float:
    """Where a curve ends: the mean of its last fiftieth."""
    return float(np.mean(values[-max(1, len(values) // 50) :]))


def fine_times(t_end: float, points: int = 150) -> Array:
    """Instants at which a model is drawn [s]: dense where it is steep."""
    return np.unique(np.concatenate([[0.0], np.geomspace(1e-3, 1, points) * t_end]))


@dataclass(frozen=True, eq=False)
class Curve:
    """One level: what was measured, its model, and what stands at its end."""

    time_s: Array
    measured: Array
    text: str
    model: Model | None = None
    sd: Array | None = None
    """Half of the band around it; None: no band."""


def draw_curves(axes: Axes, curves: Sequence[Curve], said: str, bar: tuple[Sequence[float], str] | None = None) -> None:
    """Draw each level's curve, its band and its model (dashed, `said` in the legend), and its text at the end.

    `bar` holds levels and label of a colour bar that stands in place of the texts.
    """
    colours = style.level_colours(len(curves))
    longest = max(float(one.time_s[-1]) for one in curves)
    for one, colour in zip(curves, colours, strict=True):
        if one.sd is not None:
            some = slice(None, None, max(1, len(one.time_s) // 400))
            t, mean, sd = one.time_s[some], one.measured[some], one.sd[some]
            axes.fill_between(t, mean - sd, mean + sd, color=colour, alpha=0.2, linewidth=0)
        t, mean = thinned(one.time_s, one.measured, 1200)
        axes.plot(t, mean, color=colour, linewidth=1.5, alpha=0.75, solid_capstyle="round")
        if one.model is not None:
            fine = fine_times(float(one.time_s[-1]))
            axes.plot(fine, one.model(fine), **MODEL)
    axes.set(xlabel="Time since the step (s)", xlim=(0, longest))
    if bar is None:
        ends = [(end_of(one.measured), one.text, colour) for one, colour in zip(curves, colours, strict=True)]
        label_ends(axes, ends, longest)
    else:
        level_bar(axes, *bar)
    spread = " ± sd" if any(one.sd is not None for one in curves) else ""
    axes.plot([], [], color=colours[len(colours) // 2], linewidth=1.5, alpha=0.75, label="measured" + spread)
    if any(one.model is not None for one in curves):
        axes.plot([], [], label=said, **MODEL)
    style.legend_above(axes, 2)


def draw_steps(
    axes: Axes,
    data: StepSet,
    fitted: Mapping[float, Model],
    notes: Mapping[float, str] | None = None,
    spread: bool = False,
    said: str = "model",
) -> None:
    """Draw each level's mean, its model (dashed) and, on request, the band of ± one sd; `notes` follow its name."""
    levels = some_levels(data.levels)
    notes = {level: f": {note}" for level, note in (notes or {}).items()}
    curves = [
        Curve(
            one.time_s, one.mean, level_text(one.level, data.input_unit) + notes.get(one.level, ""),
            fitted.get(one.level), one.sd if spread and len(one.runs) > 1 else None,
        )
        for one in levels
    ]  # fmt: skip
    axes.set_ylabel(quantity(data.output_unit))
    named = len(levels) <= LABELLED
    draw_curves(axes, curves, said, None if named else ([one.level for one in levels], over(data.input_unit)))


def level_bar(axes: Axes, levels: Sequence[float], label: str) -> None:
    """A colour bar of the levels beside the axes."""
    norm = BoundaryNorm(np.concatenate([[0], np.arange(len(levels)) + 1.0]) - 0.5, 256)
    bar = axes.figure.colorbar(ScalarMappable(norm, style.level_map()), ax=axes, label=label, pad=0.02)
    places = np.unique(np.linspace(0, len(levels) - 1, 6).round().astype(int))
    bar.set_ticks(list(places), labels=[f"{levels[k]:.3g}" for k in places])


def label_ends(axes: Axes, ends: Sequence[tuple[float, str, str]], x: float) -> None:
    """Write a text at the right end of each curve, moved apart where curves end close together."""
    low, high = axes.get_ylim()
    height_in = axes.get_window_extent().height / axes.figure.dpi
    gap = (high - low) * 1.15 * style.SMALLEST_PT / 72 / height_in
    ordered = sorted(ends)
    placed = [value for value, _text, _colour in ordered]
    for _ in range(200):  # push neighbours apart, both by half, until none touches
        moved = False
        for i in range(len(placed) - 1):
            if (lack := gap - (placed[i + 1] - placed[i])) > 1e-9 * gap:
                placed[i], placed[i + 1], moved = placed[i] - lack / 2, placed[i + 1] + lack / 2, True
        if not moved:
            break
    for (value, text, colour), place in zip(ordered, placed, strict=True):
        axes.annotate(
            text, (x, value), (1.02, place), xycoords="data", textcoords=("axes fraction", "data"),
            color="black", va="center", annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.8, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip


def live(data: StepSet, fitted: Mapping[float, Model], notes: Mapping[float, str] | None = None) -> Live:
    """Mean ± sd of each level, its model beside it; `notes` follow the model's name when hovered."""
    plot = Plot()
    out = data.output_unit
    p = plot.panel("Time since the step (s)", quantity(out), 420, out)
    levels = some_levels(data.levels, LIVE)
    colours = style.level_colours(len(levels))
    for level, colour in zip(levels, colours, strict=True):
        if len(level.runs) > 1:
            plot.band(p, level.time_s, level.mean - level.sd, level.mean + level.sd, colour)
    ends = []
    for level, colour in zip(levels, colours, strict=True):
        name = level_text(level.level, data.input_unit)
        plot.line(p, level.time_s, level.mean, f"{name}, measured", colour, width=2.4)
        ends.append((end_of(level.mean), name))
        if (model := fitted.get(level.level)) is not None:
            fine = fine_times(float(level.time_s[-1]))
            note = f", RMSE {notes[level.level]}" if notes and level.level in notes else ""
            plot.line(p, fine, model(fine), f"{name}, model{note}", style.BLACK, "dashed", width=1.2)
    ends.sort()
    gap = 0.045 * max(abs(value) for value, _name in ends)
    placed: list[float] = []
    for value, _name in ends:
        placed.append(max(value, placed[-1] + gap) if placed else value)
    longest = float(max(level.time_s[-1] for level in levels))
    names = [name for _value, name in ends]
    words = ColumnDataSource({"x": [1.01 * longest] * len(ends), "y": placed, "text": names})
    p.text("x", "y", text="text", source=words, text_font_size="12px", text_baseline="middle")
    p.x_range = Range1d(start=0, end=(1.03 + 0.022 * max(map(len, names))) * longest)
    return plot.finish()


MOST = 12
"""Most steps that are drawn."""


def level_steps(results: Results) -> Ready | None:
    """Change of output over time since each step from level to level, and the fitted curves (dashed)."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is not None and (pairs := paired(data, fit.steps)):
            figure, (axes,) = style.sheet(style.PAGE_IN, 3.0)
            draw_level_steps(axes, data, fit.steps)
            shares = [(shape.fit_pct, step_text(shape)) for _, shape in pairs if shape.fit_pct is not None]
            return Ready(figure, caption("level_steps", count=len(pairs), worst=min(shares)))
    return None


def step_text(step: StepShape) -> str:
    """A step as it is named: 50 → 100."""
    return f"{step.from_:.3g} → {step.level:.3g}".replace("-", "−")


def paired(data: StepSet, shapes: Sequence[StepShape]) -> list[tuple[LevelStep, StepShape]]:
    """Each recorded step and what was fitted to it."""
    known = {(one.run, one.from_, one.level): one for one in shapes}
    keys = [((one.name, one.from_level, one.level), one) for one in data.level_steps]
    return [(step, known[key]) for key, step in keys if key in known]


def draw_level_steps(axes: Axes, data: StepSet, shapes: Sequence[StepShape]) -> None:
    """Draw them on one pair of axes."""
    curves = [
        Curve(step.time_s, step.output - shape.start, step_text(shape), partial(_change, shape))
        for step, shape in some_levels(paired(data, shapes), MOST)
    ]
    axes.set_ylabel(f"Change of output ({data.output_unit or '1'})")
    draw_curves(axes, curves, "fitted")


def _change(shape: StepShape, t_s: Array) -> Array:
    return shape.predict(t_s) - shape.start


EDGES = (("up", "^", style.BLUE), ("down", "v", style.VERMILLION))
"""Edge, marker and colour."""


def over_level(results: Results) -> Ready | None:
    """Gain Δy/Δu, τ1 and τ2, where there is one, of each step over the level that it goes to, up and down apart."""
    fit = next((one.result for one in results.fits if len(one.result.steps) > 1), None)
    if fit is None:
        return None
    unit, out = fit.data.input_unit, fit.data.output_unit
    labels = {
        "gain": f"Gain ({out or 'output'}/{unit or 'input'})", "tau1": axis_label("tau1", "s"),
        "tau2": axis_label("tau2", "s"),
    }  # fmt: skip
    drawn = [name for name in labels if any(getattr(one, name) is not None for one in fit.steps)]
    figure, axes = style.sheet(style.PAGE_IN, 2.5, 1, len(drawn))
    for mark, name, panel in zip("abc", drawn, axes, strict=False):
        for edge, marker, colour in EDGES:
            rows = [one for one in fit.steps if one.edge == edge and getattr(one, name) is not None]
            if rows:
                values = np.array([getattr(one, name) for one in rows], dtype=float)
                ends = [getattr(one.ci95, name) for one in rows]
                look = {"fmt": marker, "color": colour, "label": edge, "markersize": 5, "alpha": 0.8}
                points(panel, [one.level for one in rows], values, ends, **look)
        panel.set(xlabel=over(unit), ylabel=labels[name])
        low, high = panel.get_ylim()
        if low > 0:
            panel.set_ylim(0, 1.08 * high)
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    gains = {edge: [s.gain for s in fit.steps if s.edge == edge and s.gain is not None] for edge in ("up", "down")}
    return Ready(figure, caption("steps_over_level", edges=gains, units=(unit, out)))


STRETCHES = 48
"""Stretches of time on a residual map: each is as much longer as it is later."""
NO_SAMPLE = "#DCDCDC"
"""Stretches of time in which a level has no sample."""
LEVELS = 60
"""Most rows of a residual map."""


def residual_map(rows: Sequence[tuple[float, Array, Array]]) -> tuple[Array, Array]:
    """Ends of the stretches of time [s], shape (n + 1,), and the mean residuals of each level in them, shape (L, n).

    Stretches grow with the time since the step; nan where a level has no sample.
    """
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
    return edges, mean


def residuals(model: str, data: StepSet, fit: Fit) -> Ready | None:
    """(a) residuals over time and level, hatched where the model lies above the data, (b) RMSE of each level."""
    if model == "linear" and fit.linear is not None:
        step = partial(linear.step_response, fit.linear.parameters)
        curves: dict[float, Model] = {row.level: partial(step, duty_pct=row.level) for row in data.levels}
    else:
        curves = nonlinear_curves(fit, data) if model == "nonlinear" else single_curves(fit)
    covered = [row for row in data.levels if row.level in curves]
    every = [(row.level, row.time_s, row.mean - curves[row.level](row.time_s)) for row in covered]
    if not every:
        return None
    rows = some_levels(every, LEVELS)
    levels = [level for level, _t, _r in rows]
    edges, mean = residual_map(rows)
    size = float(np.quantile(np.abs(mean[np.isfinite(mean)]), 0.98)) or 1e-9  # 2 % of the cells are beyond the colours
    figure, (over_time, per_level) = style.sheet(style.PAGE_IN, 2.7, 1, 2, width_ratios=(2.4, 1))
    times = np.concatenate([[edges[1] / 1.6], edges[1:]])
    drawn = over_time.pcolormesh(
        times, np.arange(len(levels) + 1) - 0.5, mean, cmap="PuOr_r", norm=TwoSlopeNorm(0.0, -size, size),
        rasterized=True,
    )  # fmt: skip
    cells = [
        [(times[k], i - 0.5), (times[k + 1], i - 0.5), (times[k + 1], i + 0.5), (times[k], i + 0.5)]
        for i, k in np.argwhere(mean < -0.25 * size)
    ]  # told apart in grey, too
    over_time.add_collection(PolyCollection(cells, facecolor="none", edgecolor="white", hatch="/////", linewidth=0))
    over_time.set(xscale="log", xlabel="Time since the step (s)", ylabel=over(data.input_unit))
    shown = np.unique(np.linspace(0, len(levels) - 1, 12).round().astype(int))
    over_time.set_yticks(shown, [f"{levels[k]:.3g}" for k in shown])
    over_time.grid(visible=False)
    over_time.set_facecolor(NO_SAMPLE)
    figure.colorbar(drawn, ax=over_time, pad=0.01).set_label(f"Measured − model ({data.output_unit})")
    rms = [float(np.sqrt(np.mean(r**2))) for _level, _t, r in every]
    per_level.plot(rms, [level for level, _t, _r in every], "o-", color=style.BLUE, linewidth=0.8)
    per_level.set(xlabel=f"RMSE ({data.output_unit})", ylabel=over(data.input_unit), xlim=(0, 1.1 * max(rms)))
    style.letter(over_time, "a", "(hatched: model above)")
    style.letter(per_level, "b")
    i, k = np.unravel_index(np.nanargmax(np.abs(mean)), mean.shape)
    furthest = {"value": float(mean[i, k]), "level": levels[i], "times": edges[k : k + 2].tolist()}
    return Ready(figure, caption("residuals", **furthest, unit=data.input_unit, out=data.output_unit))
