"""Figs. 7 and 8: step responses of the clutch with the nonlinear, Eqs. (4)–(7), and the linear model, Eq. (8)."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.models import linear, nonlinear
from eaid.models.parameters import Linear
from eaid.report import published, style
from eaid.report.figures.steps import MODEL, Model, draw_steps, end_of, fine_times, label_ends, some_levels
from eaid.report.figures.values import axis_label, intervals_of, nonlinear_of, points, top_of, values_of, values_over
from eaid.report.rig import gain, level_text, level_values, over, overlaid, quantity
from eaid.report.tables.fits import estimates_of
from eaid.report.thin import thinned
from eaid.results.common import LevelError
from eaid.results.fit import Fit
from eaid.results.linear import Pooled
from eaid.steps.stepset import StepSet


def linear_of(part: Pooled) -> Linear:
    """The pooled linear model."""
    return Linear(part.a0, part.b0, part.c0)


def rmse_notes(rows: Sequence[LevelError]) -> dict[float, str]:
    """Each level's RMSE as written behind its name."""
    return {row.level: f"{row.rmse:.3f}" for row in rows if row.rmse is not None}


def models_of(fit: Fit | None, data: StepSet) -> dict[float, Model]:
    """Level → the nonlinear model's step response."""
    if fit is None or fit.nonlinear is None:
        return {}
    model = nonlinear_of(fit.nonlinear)
    return {one.level: partial(nonlinear.step_response, model, duty_pct=one.level) for one in data.levels}


def nonlinear_model(data: StepSet, fit: Fit | None) -> Figure:
    """Fig. 7: mean ± sd per level, Eq. (4) dashed, and each level's RMSE behind its name."""
    figure, (axes,) = style.page(3.6)
    notes = rmse_notes(fit.nonlinear.per_level) if fit is not None and fit.nonlinear is not None else {}
    draw_steps(axes, data, models_of(fit, data), notes, spread=True, said=f"Eq. (4), RMSE ({data.output_unit})")
    return figure


def linear_model(data: StepSet, fit: Fit) -> Figure:
    """Fig. 8: (a) what was measured and (b) the one linear model of all levels, Eq. (8), on the same scale.

    Where the model lies below zero in the end, which no clutch does, it is left out.
    """
    figure, (measured, modelled) = style.page(2.9, 1, 2, sharey=True)
    assert fit.linear is not None
    model = linear_of(fit.linear)
    levels = some_levels(data.levels, 14)
    longest = max(float(one.time_s[-1]) for one in levels)
    fine = fine_times(longest)
    ends: list[list[tuple[float, str, str]]] = [[], []]
    for one, colour in zip(levels, style.level_colours(len(levels)), strict=True):
        text = level_text(one.level, data.input_unit)
        measured.plot(*thinned(one.time_s, one.mean, 800), color=colour, linewidth=1.2)
        ends[0].append((end_of(one.mean), text, colour))
        if linear.steady_torque(model, one.level) > 0:
            modelled.plot(fine, linear.step_response(model, fine, one.level), color=colour, linestyle=(0, (4, 2)))
            ends[1].append((linear.steady_torque(model, one.level), text, colour))
    measured.set_ylim(0, None)
    for mark, axes, placed, said in zip("ab", (measured, modelled), ends, ("measured", "linear model"), strict=True):
        axes.set(xlabel="Time since the step (s)", xlim=(0, longest))
        style.letter(axes, mark, said)
        label_ends(axes, placed, longest)
    measured.set_ylabel(quantity(data.output_unit))
    return figure


OTHERS = ((style.VERMILLION, "-."), (style.GREEN, (0, (4, 1, 1, 1, 1, 1))), (style.PURPLE, (0, (6, 2))))
"""Colour and line of the estimates beside the one that is used."""


def polynomials(fit: Fit, asked: bool | None = None) -> Figure:
    """T_s, τ1 and τ2 over the level: every estimate, the single levels with their intervals, and Table III."""
    figure, axes = style.page(2.5, 1, 3)
    part, unit = fit.nonlinear, fit.data.input_unit
    assert part is not None
    u = np.linspace(*part.u_range, 200)
    rows, alone = level_values(fit), fit.recorded is None
    (own, used), *others = estimates_of(part).items()
    curves = values_over(used, u)
    for mark, name, panel in zip("abc", ("Ts", "tau1", "tau2"), axes, strict=True):
        panel.plot(u, curves[name], color=style.BLUE, label=f"{own} (used)")
        seen, values = 0.0, values_of(rows, name)
        if np.isfinite(values).any():
            said = "each level, 95 %" if alone else "95 %"
            at = [row.level for row in rows]
            seen = points(panel, at, values, intervals_of(rows, name), color=style.BLACK, label=said)
        top = top_of(curves[name], seen)
        for (said, other), (colour, line) in zip(others, OTHERS, strict=False):
            panel.plot(u, values_over(other, u)[name], color=colour, linestyle=line, linewidth=0.9, label=said)
        if name != "Ts" and overlaid(fit.data, asked):
            # Table III's T_s gives 0.06 N·m at full duty: a line on the floor.
            paper = np.polynomial.polynomial.polyval(u, published.TABLE_III[name])
            panel.plot(u, paper, color=style.GREY, linestyle=":", label="published")
        panel.set(xlabel=over(unit), ylabel=axis_label(name, fit.data.output_unit), ylim=(0, 1.1 * top or 1.0))
        style.letter(panel, mark)
    style.legend_over(figure, axes[1])
    return figure


def input_gain(fit: Fit, asked: bool | None = None) -> Figure:
    """B of each level over the level, with its intervals, and the bounds B_m and B_M that the robust gains take."""
    figure, (axes,) = style.column(2.4)
    part, unit = fit.linear, fit.data.input_unit
    assert part is not None
    rows = [(row.level, row.B, row.ci95.B if row.ci95 else None) for row in part.per_level if row.B is not None]
    if rows:
        at, values, intervals = zip(*rows, strict=True)
        points(axes, at, np.array(values), intervals, fmt="o-", color=style.BLUE, linewidth=0.9)
    bounds = part.bounds
    ends = []
    for name, value in (("$B_m$", bounds.B_m if bounds else None), ("$B_M$", bounds.B_M if bounds else None)):
        if value is not None:
            axes.axhline(value, **{**MODEL, "color": style.VERMILLION})
            ends.append((value, f"{name} = {value:.3g}", style.VERMILLION))
    if overlaid(fit.data, asked):
        low, high = published.TABLE_IV["B_m"], published.TABLE_IV["B_M"]
        axes.axhspan(low, high, facecolor="#EDEDED", edgecolor="#C8C8C8", hatch="...", lw=0, zorder=0)
        axes.text(0.02, (low + high) / 2, "published", transform=axes.get_yaxis_transform(), va="center",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    axes.set(xlabel=over(unit), ylabel=f"Input gain $B$ ({gain(unit, fit.data.output_unit)})")
    axes.set_ylim(0, None)
    label_ends(axes, ends, axes.get_xlim()[1])
    return figure
