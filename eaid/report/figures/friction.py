"""Figs. 3–5: friction steps with their fitted curves, Eq. (3), and what was fitted over stress and over speed."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.report import published, style
from eaid.report.figures.steps import Model, draw_steps
from eaid.report.figures.values import axis_label, intervals_of, over_stress, points, trend_values
from eaid.report.rig import apparatus_of, over, overlaid
from eaid.results.common import Interval
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel
from eaid.steps.stepset import StepSet


def curve(row: FrictionLevel, t_s: Array) -> Array:
    """The fitted curve of one level above its start, Eq. (3), after its dead time."""
    p = Friction(row.Ts, row.tau1, row.tau2, row.C)
    return row.start + friction.step_response(p, np.maximum(t_s - row.delay_s, 0.0))


def curves_of(fit: Fit | None) -> dict[float, Model]:
    """Level → its fitted curve over the time."""
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    return {row.level: partial(curve, row) for row in rows}


def friction_steps(data: StepSet, fit: Fit | None) -> Figure:
    """Fig. 3: output over time at each level, mean of the repeats and the fitted Eq. (3)."""
    figure, (axes,) = style.column(2.9)
    draw_steps(axes, data, curves_of(fit), said="Eq. (3)")
    return figure


def trend_x(fit: Fit) -> tuple[Array, str]:
    """What the trends run over, and its label: stress [kPa], speed [RPM] or the level itself."""
    part = fit.friction
    if part is None:
        return np.empty(0), over(fit.data.input_unit)
    if over_stress(fit):
        return np.array(part.x), "Normal stress (kPa)"
    return np.array([row.level for row in part.levels]), over(fit.data.input_unit)


def friction_coefficients(fit: Fit, x_kpa: Array) -> tuple[Array, list[Interval]]:
    """C_f of each level [1], shape (L,), and its intervals, from the steady torques by Eq. (1)."""
    rig, rows = apparatus_of(fit.data), fit.friction.levels if fit.friction else ()
    values = np.array([rig.friction_coefficient(row.Ts, x) for row, x in zip(rows, x_kpa, strict=True)])
    ends: list[Interval] = []
    for end, x in zip(intervals_of(rows, "Ts"), x_kpa, strict=True):
        ends.append(None if end is None else tuple(rig.friction_coefficient(e, x) for e in end))  # type: ignore[arg-type]
    return values, ends


def _panel(axes: Axes, fit: Fit, name: str, x: Array, paper: Callable[[Array], Array] | None) -> None:
    rows = fit.friction.levels if fit.friction else ()
    trends = fit.friction.trends if fit.friction else {}
    if name == "C_f":
        values, ends = friction_coefficients(fit, x)
    else:
        values, ends = np.array([getattr(row, name) for row in rows]), intervals_of(rows, name)
    top = points(axes, x.tolist(), values, ends, color=style.BLACK, label="each level, 95 %")
    fine = np.linspace(x.min(), x.max(), 200)
    trend = trends.get(name)
    if trend is not None and trend.coefficients:
        axes.plot(fine, trend_values(trend, fine), color=style.BLUE, label="trend")
        top = max(top, float(np.max(trend_values(trend, fine))))
    if paper is not None:
        axes.plot(fine, paper(fine), color=style.VERMILLION, linestyle=":", label="published")
    axes.set(ylabel=axis_label(name, fit.data.output_unit))
    if top > 0:
        axes.set_ylim(0, 1.12 * top)


def friction_over_stress(fit: Fit, asked: bool | None = None) -> Figure:
    """Fig. 4: T_s, τ1, C_f and τ2 over the normal stress [kPa] with their trends; over the level on another rig."""
    x, label = trend_x(fit)
    four = over_stress(fit) and fit.data.output_unit == "N·m"  # Eq. (1) takes a torque
    names = ("Ts", "tau1", "C_f", "tau2") if four else ("Ts", "tau1", "tau2")
    figure, axes = style.page(4.2, 2, 2, sharex=True) if four else style.page(2.4, 1, 3)
    for mark, name, panel in zip("abcd", names, axes, strict=False):
        _panel(panel, fit, name, x, published.OVER_STRESS[name] if overlaid(fit.data, asked) else None)
        style.letter(panel, mark)
    for panel in axes[2:] if four else axes:
        panel.set_xlabel(label)
    style.legend_over(figure, axes[0])
    return figure


def friction_over_speed(fit: Fit, asked: bool | None = None) -> Figure:
    """Fig. 5: τ1, T_s and τ2 over the rotation speed [RPM], with their trends and what Table II prints."""
    figure, axes = style.page(2.4, 1, 3)
    x, label = trend_x(fit)
    for mark, name, panel in zip("abc", ("tau1", "Ts", "tau2"), axes, strict=True):
        # Table II's tau2 is two equal rates of opposite weight: at the printed digits no curve is left to draw.
        known = name != "tau2" and overlaid(fit.data, asked)
        _panel(panel, fit, name, x, published.OVER_SPEED[name] if known else None)
        panel.set_xlabel(label)
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    return figure
