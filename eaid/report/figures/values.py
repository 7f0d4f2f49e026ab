"""Fitted values over the level, with their 95 % intervals: of one fit with its estimates, or of two over each other."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from bokeh.models import Range1d
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import nonlinear
from eaid.report import rig, style
from eaid.report.live import Live, Plot
from eaid.report.results import Given, Results
from eaid.report.rig import apparatus_of, level_values, over, overlaid
from eaid.report.style import Ready, caption
from eaid.report.tables.fits import estimates_of
from eaid.report.tables.table import SYMBOLS
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import CurveLevel, Estimate, Fit, FrictionLevel
from eaid.results.summary import ENDLESS_S

NAMES = {"Ts": "Steady value $T_s$", "tau1": r"Fast constant $\tau_1$", "tau2": r"Slow constant $\tau_2$"}
LOOKS = ((style.BLUE, "-", "o"), (style.VERMILLION, "--", "s"))
"""Colour, line and marker of the first fit and of the second."""
ESTIMATES = (
    (style.BLUE, "-", "solid"),
    (style.VERMILLION, "-.", "dashdot"),
    (style.GREEN, (0, (4, 1, 1, 1, 1, 1)), "dotdash"),
    (style.PURPLE, (0, (6, 2)), "dotted"),
)
"""Colour of each estimate of one fit, its line in the figure and in the live plot; the one that is used first."""
TALL = 1.6
"""An interval that reaches beyond so many times its value does not set the axis."""
BEYOND = 3.0
"""A curve that leaves the single levels by more than this factor is cut: τ2 without end would hide all the rest."""
CROSSES = 0.1
"""A curve that is on the axis over less than this share of the inputs only crosses it: it is not drawn."""


def axis_label(name: str, unit: str) -> str:
    """Label of an axis along which a fitted value runs."""
    if name == "C_f":
        return "Friction coefficient $C_f$ (1)"
    return f"{NAMES[name]} ({unit if name == 'Ts' else 's'})"


def intervals_of(rows: Sequence[FrictionLevel | CurveLevel], name: str) -> list[Interval]:
    """The 95 % intervals of one value at the levels."""
    return [ci95_of(row, name) for row in rows]


def ends_of(values: Array, intervals: Sequence[Interval]) -> tuple[Array, Array, float]:
    """Lower and upper end of each value, the value itself where it has no interval; the highest end to be seen."""
    known = [(value, value) if ends is None else ends for value, ends in zip(values, intervals, strict=True)]
    low, high = np.array(known).reshape(-1, 2).T
    low, high = np.minimum(low, values), np.maximum(high, values)
    return low, high, highest(np.minimum(high, TALL * np.abs(values)))


def points(axes: Axes, x: Sequence[float], values: Array, intervals: Sequence[Interval], **look: object) -> float:
    """Values with their 95 % intervals where there are any; the highest end that is to be seen."""
    low, high, seen = ends_of(values, intervals)
    look = {"fmt": "o", "capsize": 1.6, "elinewidth": 0.7, **look}
    axes.errorbar(x, values, yerr=[values - low, high - values], **look)  # type: ignore[arg-type]
    return seen


def highest(values: Array) -> float:
    """The largest of the values that are known; 0 where none is."""
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else 0.0


def top_of(curve: Array, seen: float) -> float:
    """The highest value that an axis holds, of a curve and of levels whose highest end is `seen`; 0 without one."""
    top = min(max(highest(curve), seen), BEYOND * seen) if seen else highest(curve)
    return seen if seen and len(curve) and np.isnan(on_axis(curve, top)).all() else top


def on_axis(curve: Array, top: float) -> Array:
    """A curve where an axis up to about `top` holds it; nan elsewhere, and all along where it only crosses the axis."""
    inside = curve < 1.3 * top
    return np.where(inside & (np.mean(inside) > CROSSES), curve, np.nan)


def values_of(rows: Sequence[FrictionLevel | CurveLevel], name: str) -> Array:
    """One value of every level, shape (n,); nan for a time constant without end."""
    return ended(np.array([getattr(row, name) for row in rows], dtype=float), name)


def ended(values: Array, name: str) -> Array:
    """Values, with nan for time constants without end, which no axis can hold."""
    return values if name == "Ts" else np.where(values > ENDLESS_S, np.nan, values)


def values_over(part: Estimate, u: Array) -> dict[str, Array]:
    """T_s, τ1 and τ2 of an estimate over the input."""
    tau1, tau2 = nonlinear.time_constants(part.parameters, u)
    steady = nonlinear.steady_torque(part.parameters, u)
    return {"Ts": steady, "tau1": ended(tau1, "tau1"), "tau2": ended(tau2, "tau2")}


def curves_over(fit: Fit) -> tuple[Array, dict[str, Array]]:
    """Inputs, and T_s, τ1 and τ2 over them: the nonlinear model, else the trends; empty where neither was fitted."""
    if fit.nonlinear is not None:
        u = np.linspace(*fit.nonlinear.u_range, 150)
        return u, values_over(fit.nonlinear, u)
    part = fit.friction
    trends = part.trends if part else {}
    known = {name: trend for name, trend in trends.items() if name in NAMES and trend.coefficients}
    if part is None or not known:
        return np.empty(0), {}
    u = np.linspace(part.levels[0].level, part.levels[-1].level, 150)
    x = apparatus_of(fit.data).stress_kpa(1.0) * u if part.over_stress else u
    return u, {name: ended(trend.predict(x), name) for name, trend in known.items()}


def polynomials_ready(fit: Fit, results: Results) -> Ready | None:
    """Parameters over the level, with the estimates beside the one that is used."""
    rows = level_values(fit)
    if fit.nonlinear is None or len(rows) == 1:
        return None
    counts = []
    for name in NAMES:
        known = [(row.level, ends) for row in rows if (ends := ci95_of(row, name)) is not None]
        if known:
            curve = values_over(fit.nonlinear, np.array([level for level, _ in known]))[name]
            met = sum(ends[0] <= value <= ends[1] for (_, ends), value in zip(known, curve, strict=True))
            counts.append(f"{SYMBOLS[name]} through {met} of {len(known)}")
    text = caption("over_duty", recorded=fit.recorded is not None, met=counts)
    return Ready(partial(polynomials, fit, results.paper), text, partial(live, fit))


def _curves(fit: Fit, u: Array, name: str) -> tuple[dict[str, Array], float]:
    """One value over the input by every estimate, and the top of its axis; what is far above that is cut."""
    assert fit.nonlinear is not None
    curves = {label: values_over(estimate, u)[name] for label, estimate in estimates_of(fit.nonlinear).items()}
    rows = level_values(fit)
    seen = ends_of(values_of(rows, name), intervals_of(rows, name))[2]
    top = top_of(next(iter(curves.values())), seen)
    return {label: on_axis(y, top) for label, y in curves.items()}, 1.1 * top or 1.0


def polynomials(fit: Fit, asked: bool | None = None) -> Figure:
    """T_s, τ1 and τ2 over the level: every estimate, the single levels with their intervals, and Table III."""
    figure, axes = style.page(2.5, 1, 3)
    assert fit.nonlinear is not None
    u = np.linspace(*fit.nonlinear.u_range, 200)
    rows, single = level_values(fit), "each level, 95 %" if fit.recorded is None else "95 %"
    for mark, name, panel in zip("abc", NAMES, axes, strict=True):
        curves, top = _curves(fit, u, name)
        values = values_of(rows, name)
        for k, ((estimate, y), (colour, line, _)) in enumerate(zip(curves.items(), ESTIMATES, strict=False)):
            look = {"linewidth": 0.9, "label": estimate} if k else {"label": f"{estimate} (used)"}
            panel.plot(u, y, color=colour, linestyle=line, **look)
        if np.isfinite(values).any():
            at = [row.level for row in rows]
            points(panel, at, values, intervals_of(rows, name), color=style.BLACK, label=single)
        if name != "Ts" and overlaid(fit.data, asked):
            # Table III's T_s gives 0.06 N·m at full duty: a line on the floor.
            paper = np.polynomial.polynomial.polyval(u, rig.TABLE_III[name])
            panel.plot(u, paper, color=style.GREY, linestyle=":", label="published")
        panel.set(xlabel=over(fit.data.input_unit), ylabel=axis_label(name, fit.data.output_unit), ylim=(0, top))
        style.letter(panel, mark)
    style.legend_over(figure, axes[1])
    return figure


def live(fit: Fit) -> tuple[Live, ...]:
    """T_s, τ1 and τ2 over the level, a plot each: every estimate, the single levels with their intervals."""
    assert fit.nonlinear is not None
    u = np.linspace(*fit.nonlinear.u_range, 120)
    rows, single = level_values(fit), "level by itself" if fit.recorded is None else "95 %"
    plots = []
    for name, sign in (("Ts", "Tₛ"), ("tau1", "τ1"), ("tau2", "τ2")):
        plot = Plot(wide=False)
        unit = fit.data.output_unit if name == "Ts" else "s"
        p = plot.panel(over(fit.data.input_unit), f"{sign} ({unit})", 300, unit, ("level", fit.data.input_unit))
        curves, top = _curves(fit, u, name)
        values = values_of(rows, name)
        if np.isfinite(values).any():
            low, high, _seen = ends_of(values, intervals_of(rows, name))
            plot.points(p, [row.level for row in rows], values, (low, high), single, style.BLACK)
        for k, ((estimate, y), (colour, _, dash)) in enumerate(zip(curves.items(), ESTIMATES, strict=False)):
            plot.line(p, u, y, estimate, colour, dash, estimate, 1.3 if k else 2.0)
        p.y_range = Range1d(start=0, end=top)
        plots.append(plot.finish())
    return tuple(plots)


def draw_curves(panels: Sequence[Axes], fits: Sequence[tuple[str, Fit]]) -> None:
    """The models' T_s, τ1 and τ2 over the level, a panel each, of every fit."""
    for name, panel in zip(NAMES, panels, strict=True):
        tops = [0.0]
        for (label, fit), (colour, line, _marker) in zip(fits, LOOKS, strict=False):
            u, curves = curves_over(fit)
            if name in curves:
                panel.plot(u, curves[name], color=colour, linestyle=line, label=label)
                tops.append(highest(curves[name]))
        panel.set(xlabel=over(fits[0][1].data.input_unit), ylim=(0, 1.1 * max(tops) or 1.0))


def draw_values(panels: Sequence[Axes], fits: Sequence[tuple[str, Fit]], with_curves: bool = True) -> None:
    """T_s, τ1 and τ2, a panel each: the levels of each fit, and its nonlinear model where there is one."""
    for (label, fit), (colour, line, marker) in zip(fits, LOOKS, strict=False):
        rows = level_values(fit)
        u, curves = curves_over(fit) if with_curves and fit.nonlinear is not None else (np.empty(0), {})
        for name, panel in zip(NAMES, panels, strict=True):
            values = values_of(rows, name)
            seen = 0.0
            if np.isfinite(values).any():
                look = {"fmt": marker, "color": colour, "label": label}
                seen = points(panel, [row.level for row in rows], values, intervals_of(rows, name), **look)
            top = top_of(curves.get(name, np.empty(0)), seen)
            if curves:
                panel.plot(u, on_axis(curves[name], top), color=colour, linestyle=line, label=None if rows else label)
            panel.set_ylim(0, max(1.1 * top or 1.0, panel.get_ylim()[1] if label != fits[0][0] else 0.0))
    for panel in panels:
        panel.set_xlabel(over(fits[0][1].data.input_unit))


def two_fits_ready(pair: tuple[Given[Fit], Given[Fit]]) -> Ready:
    """Two fits of one kind over each other."""
    first, second = ({row.level: row for row in level_values(given.result)} for given in pair)
    parted: dict[str, list[str]] = {}
    for name in NAMES:
        for level in (level for level in first if level in second):
            a, b = ci95_of(first[level], name), ci95_of(second[level], name)
            if a is not None and b is not None and (a[1] < b[0] or b[1] < a[0]):
                parted.setdefault(SYMBOLS[name], []).append(f"{level:.4g}")
    text = caption("compare", parted=parted, unit=pair[0].result.data.input_unit)
    return Ready(lambda: two_fits([(given.path, given.result) for given in pair]), text)


def two_fits(fits: Sequence[tuple[str, Fit]]) -> Figure:
    """T_s, τ1 and τ2 of both fits over the level."""
    figure, axes = style.page(2.5, 1, 3)
    draw_values(axes, [(name if len(name) <= 48 else f"…{name[-47:]}", fit) for name, fit in fits])
    for mark, name, panel in zip("abc", NAMES, axes, strict=True):
        panel.set_ylabel(axis_label(name, fits[0][1].data.output_unit))
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    return figure
