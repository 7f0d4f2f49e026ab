"""Fitted values over the level, with their 95 % intervals."""

from collections.abc import Sequence

import numpy as np
from bokeh.models import Range1d
from matplotlib.axes import Axes

from eaid.arrays import Array
from eaid.models import nonlinear
from eaid.report import rig, style
from eaid.report.live import Plot
from eaid.report.results import Results
from eaid.report.rig import over, overlaid
from eaid.report.style import Ready, caption
from eaid.report.tables.fits import estimates_of
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import CurveLevel, Estimate, Fit, FrictionLevel
from eaid.results.summary import ENDLESS_S, believed_levels

NAMES = {"Ts": "Steady value $T_s$", "tau1": r"Fast constant $\tau_1$", "tau2": r"Slow constant $\tau_2$"}
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


def polynomials(fit: Fit, results: Results) -> Ready | None:
    """T_s, τ1 and τ2 over the level: every estimate, the single levels with their intervals, and Table III.

    The live plots hold the same, a plot each, without Table III.
    """
    part, rows = fit.nonlinear, believed_levels(fit)
    if part is None or len(rows) == 1:
        return None
    single = "95 %"
    figure, axes = style.sheet(style.PAGE_IN, 2.5, 1, 3)
    u, estimates = np.linspace(*part.u_range, 200), estimates_of(part)
    plots = []
    for mark, name, sign, panel in zip("abc", NAMES, ("Tₛ", "τ1", "τ2"), axes, strict=True):
        unit, label = fit.data.output_unit if name == "Ts" else "s", over(fit.data.input_unit)
        curves = {estimate: values_over(one, u)[name] for estimate, one in estimates.items()}
        values, intervals = values_of(rows, name), intervals_of(rows, name)
        at, (low, high, seen) = [row.level for row in rows], ends_of(values, intervals)
        top = top_of(next(iter(curves.values())), seen)
        plot = Plot(wide=False)
        p = plot.panel(label, f"{sign} ({unit})", 300, unit, ("level", fit.data.input_unit))
        for k, ((estimate, y), (colour, line, dash)) in enumerate(zip(curves.items(), ESTIMATES, strict=False)):
            shown = on_axis(y, top)
            look = {"linewidth": 0.9, "label": estimate} if k else {"label": f"{estimate} (used)"}
            panel.plot(u, shown, color=colour, linestyle=line, **look)
            plot.line(p, u, shown, estimate, colour, dash, estimate, 1.3 if k else 2.0)
        if np.isfinite(values).any():
            points(panel, at, values, intervals, color=style.BLACK, label=single)
            plot.points(p, at, values, (low, high), single, style.BLACK)
        if name != "Ts" and overlaid(fit.data, results.paper):
            # Table III's T_s gives 0.06 N·m at full duty: a line on the floor.
            paper = np.polynomial.polynomial.polyval(u, rig.TABLE_III[name])
            panel.plot(u, paper, color=style.GREY, linestyle=":", label="published")
        panel.set(xlabel=label, ylabel=axis_label(name, unit), ylim=(0, 1.1 * top or 1.0))
        style.letter(panel, mark)
        p.y_range = Range1d(start=0, end=1.1 * top or 1.0)
        plots.append(plot.finish())
    style.legend_over(figure, axes[1])
    return Ready(figure, caption("over_duty"), tuple(plots))


def draw_values(panels: Sequence[Axes], fit: Fit) -> None:
    """T_s, τ1 and τ2, a panel each: the levels of a fit, and its nonlinear model where there is one."""
    rows = believed_levels(fit)
    u = np.linspace(*fit.nonlinear.u_range, 150) if fit.nonlinear is not None else np.empty(0)
    curves = values_over(fit.nonlinear, u) if fit.nonlinear is not None else {}
    for name, panel in zip(NAMES, panels, strict=True):
        values = values_of(rows, name)
        seen = 0.0
        if np.isfinite(values).any():
            seen = points(panel, [row.level for row in rows], values, intervals_of(rows, name), color=style.BLUE)
        top = top_of(curves.get(name, np.empty(0)), seen)
        if curves:
            panel.plot(u, on_axis(curves[name], top), color=style.BLUE)
        panel.set(xlabel=over(fit.data.input_unit), ylim=(0, 1.1 * top or 1.0))
