"""Figs. 3–5: friction steps with their fitted curves, Eq. (3), and what was fitted over stress and over speed."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import published, style
from eaid.report.figures import steps
from eaid.report.figures.steps import draw_steps, single_curves
from eaid.report.figures.values import axis_label, intervals_of, points
from eaid.report.ready import Ready, caption
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, of_the_paper, over, overlaid
from eaid.results.common import Interval
from eaid.results.fit import Fit, Friction, FrictionLevel
from eaid.steps.stepset import StepSet


def friction_steps_ready(results: Results) -> Ready | None:
    """Fig. 3, from the force dataset, else the speed dataset; the fitted curves where there are any."""
    kind = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None:
        return None
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    worst = max(((row.rmse / row.Ts, row.level) for row in rows if row.rmse is not None and row.Ts > 0), default=None)
    said = caption("friction_steps", worst=worst, unit=data.input_unit)
    live = partial(steps.live, data, single_curves(fit))
    return Ready(partial(friction_steps, data, fit), said, lambda: (live(),))


def friction_steps(data: StepSet, fit: Fit | None) -> Figure:
    """Fig. 3: output over time at each level, mean of the repeats and the fitted Eq. (3)."""
    figure, (axes,) = style.column(2.9)
    draw_steps(axes, data, single_curves(fit), said="Eq. (3)")
    return figure


def trends_ready(draw: Callable[[Fit, bool | None], Figure], fit: Fit, results: Results) -> Ready | None:
    """Figs. 4 and 5: what was fitted over stress or speed."""
    if fit.friction is None or len(fit.friction.levels) < 2:
        return None
    said = caption("trends", rows=fit.friction.levels, unit=fit.data.input_unit, out=fit.data.output_unit)
    title = "" if of_the_paper(fit.data, results.paper) else "Fitted values over the level"
    return Ready(partial(draw, fit, results.paper), said, title=title)


def trend_x(part: Friction, fit: Fit) -> tuple[Array, str]:
    """What the trends run over, and its label: stress [kPa], speed [RPM] or the level itself."""
    if part.over_stress:
        return np.array(part.x), "Normal stress (kPa)"
    return np.array([row.level for row in part.levels]), over(fit.data.input_unit)


def friction_coefficients(fit: Fit, rows: Sequence[FrictionLevel], x_kpa: Array) -> tuple[Array, list[Interval]]:
    """C_f of each level [1], shape (L,), and its intervals, from the steady torques by Eq. (1)."""
    rig = apparatus_of(fit.data)
    values = np.array([rig.friction_coefficient(row.Ts, x) for row, x in zip(rows, x_kpa, strict=True)])
    ends: list[Interval] = []
    for end, x in zip(intervals_of(rows, "Ts"), x_kpa, strict=True):
        ends.append(None if end is None else tuple(rig.friction_coefficient(e, x) for e in end))  # type: ignore[arg-type]
    return values, ends


def friction_over_stress(fit: Fit, asked: bool | None = None) -> Figure:
    """Fig. 4: T_s, τ1, C_f and τ2 over the normal stress [kPa] with their trends; over the level on another rig."""
    over_stress = fit.friction is not None and fit.friction.over_stress
    four = over_stress and fit.data.output_unit == "N·m"  # Eq. (1) takes a torque
    return _over(fit, ("Ts", "tau1", "C_f", "tau2") if four else ("Ts", "tau1", "tau2"), published.OVER_STRESS, asked)


def friction_over_speed(fit: Fit, asked: bool | None = None) -> Figure:
    """Fig. 5: τ1, T_s and τ2 over the rotation speed [RPM], with their trends and what Table II prints."""
    # Table II's tau2 is two equal rates of opposite weight: at the printed digits no curve is left to draw.
    known = {name: curve for name, curve in published.OVER_SPEED.items() if name != "tau2"}
    return _over(fit, ("tau1", "Ts", "tau2"), known, asked)


def _over(fit: Fit, names: Sequence[str], paper: Mapping[str, Callable[[Array], Array]], asked: bool | None) -> Figure:
    """Single levels with their intervals, their trend and the published one, a panel a value."""
    part = fit.friction
    assert part is not None
    x, label = trend_x(part, fit)
    fine = np.linspace(x.min(), x.max(), 200)
    figure, axes = style.page(4.2, 2, 2, sharex=True) if len(names) == 4 else style.page(2.4, 1, 3)
    for mark, name, panel in zip("abcd", names, axes, strict=False):
        values, ends = np.array([getattr(row, name) for row in part.levels]), intervals_of(part.levels, name)
        if name == "C_f":
            values, ends = friction_coefficients(fit, part.levels, x)
        top = points(panel, x.tolist(), values, ends, color=style.BLACK, label="each level, 95 %")
        trend = part.trends.get(name)
        if trend is not None and trend.coefficients:
            panel.plot(fine, trend.predict(fine), color=style.BLUE, label="trend")
            top = max(top, float(np.max(trend.predict(fine))))
        if name in paper and overlaid(fit.data, asked):
            panel.plot(fine, paper[name](fine), color=style.VERMILLION, linestyle=":", label="published")
        panel.set_ylabel(axis_label(name, fit.data.output_unit))
        if top > 0:
            panel.set_ylim(0, 1.12 * top)
        style.letter(panel, mark)
    for panel in axes[2:] if len(names) == 4 else axes:
        panel.set_xlabel(label)
    style.legend_over(figure, axes[0])
    return figure
