"""Figs. 7 and 8: step responses of the clutch with the nonlinear, Eqs. (4)–(7), and the linear model, Eq. (8); B."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.models import linear
from eaid.report import published, style
from eaid.report.figures import steps
from eaid.report.figures.panels import MODEL
from eaid.report.figures.steps import draw_steps, end_of, fine_times, label_ends, nonlinear_curves, some_levels
from eaid.report.figures.values import points
from eaid.report.ready import Ready, caption
from eaid.report.results import Results
from eaid.report.rig import gain, level_text, over, overlaid, quantity
from eaid.report.thin import thinned
from eaid.results.common import ci95_of
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet


def _rmse_notes(fit: Fit | None) -> dict[float, str]:
    """Each level's RMSE as written behind its name."""
    rows = fit.nonlinear.per_level if fit is not None and fit.nonlinear is not None else ()
    return {row.level: f"{row.rmse:.3f}" for row in rows if row.rmse is not None}


def nonlinear_ready(data: StepSet, results: Results) -> Ready:
    """Fig. 7, from the clutch dataset; the model where it was fitted."""
    fit = results.fit("clutch")
    models = nonlinear_curves(fit, data)
    several = [row for row in data.levels if len(row.runs) > 1 and models]
    inside = [np.abs(row.mean - models[row.level](row.time_s)) <= row.sd for row in several]
    share = 100 * float(np.mean(np.concatenate(inside))) if inside else None
    said = caption("nonlinear", fitted=bool(models), inside_pct=share, out=data.output_unit)
    live = partial(steps.live, data, models, _rmse_notes(fit))
    return Ready(partial(nonlinear_model, data, fit), said, lambda: (live(),))


def nonlinear_model(data: StepSet, fit: Fit | None) -> Figure:
    """Fig. 7: mean ± sd per level, Eq. (4) dashed, and each level's RMSE behind its name."""
    figure, (axes,) = style.page(3.6)
    said = f"Eq. (4), RMSE ({data.output_unit})"
    draw_steps(axes, data, nonlinear_curves(fit, data), _rmse_notes(fit), spread=True, said=said)
    return figure


def linear_ready(data: StepSet, fit: Fit) -> Ready | None:
    """Fig. 8, from the clutch dataset and its linear model."""
    if fit.linear is None:
        return None
    goals = {row.level: linear.steady_torque(fit.linear.parameters, row.level) for row in data.levels}
    missed = [(abs(goals[row.level] - end_of(row.mean)), row.level) for row in data.levels]
    below = [level_text(level, data.input_unit) for level, goal in goals.items() if goal <= 0]
    units = {"unit": data.input_unit, "out": data.output_unit}
    said = caption("linear", near=min(missed), far=max(missed), below=below, **units)
    return Ready(partial(linear_model, data, fit), said)


def linear_model(data: StepSet, fit: Fit) -> Figure:
    """Fig. 8: (a) what was measured and (b) the one linear model of all levels, Eq. (8), on the same scale.

    Where the model lies below zero in the end, which no clutch does, it is left out.
    """
    figure, (measured, modelled) = style.page(2.9, 1, 2, sharey=True)
    assert fit.linear is not None
    model = fit.linear.parameters
    levels = some_levels(data.levels, 14)
    longest = max(float(one.time_s[-1]) for one in levels)
    fine = fine_times(longest)
    ends: list[list[tuple[float, str, str]]] = [[], []]
    for one, colour in zip(levels, style.level_colours(len(levels)), strict=True):
        text = level_text(one.level, data.input_unit)
        measured.plot(*thinned(one.time_s, one.mean, 800), color=colour, linewidth=1.2)
        ends[0].append((end_of(one.mean), text, colour))
        if (goal := linear.steady_torque(model, one.level)) > 0:
            modelled.plot(fine, linear.step_response(model, fine, one.level), color=colour, linestyle=(0, (4, 2)))
            ends[1].append((goal, text, colour))
    measured.set_ylim(0, None)
    for mark, axes, placed, said in zip("ab", (measured, modelled), ends, ("measured", "linear model"), strict=True):
        axes.set(xlabel="Time since the step (s)", xlim=(0, longest))
        style.letter(axes, mark, said)
        label_ends(axes, placed, longest)
    measured.set_ylabel(quantity(data.output_unit))
    return figure


def input_gain_ready(fit: Fit, results: Results) -> Ready | None:
    """Input gain of each level."""
    bounds = fit.linear.bounds if fit.linear is not None else None
    known = [(row.B, row.level) for row in fit.linear.per_level if row.B is not None] if fit.linear is not None else []
    if not known and (bounds is None or bounds.B_m is None):
        return None
    return Ready(partial(input_gain, fit, results.paper), caption("gain", known=known, unit=fit.data.input_unit))


def input_gain(fit: Fit, asked: bool | None = None) -> Figure:
    """B of each level over the level, with its intervals, and the bounds B_m and B_M that the robust gains take."""
    figure, (axes,) = style.column(2.4)
    part, unit = fit.linear, fit.data.input_unit
    assert part is not None
    rows = [(row.level, row.B, ci95_of(row, "B")) for row in part.per_level if row.B is not None]
    if rows:
        at, values, intervals = zip(*rows, strict=True)
        points(axes, at, np.array(values), intervals, fmt="o-", color=style.BLUE, linewidth=0.9)
    bounds = {"$B_m$": part.bounds.B_m, "$B_M$": part.bounds.B_M} if part.bounds else {}
    known = {name: value for name, value in bounds.items() if value is not None}
    for value in known.values():
        axes.axhline(value, color=style.VERMILLION, linestyle=MODEL["linestyle"], linewidth=MODEL["linewidth"])
    if overlaid(fit.data, asked):
        low, high = published.TABLE_IV["B_m"], published.TABLE_IV["B_M"]
        axes.axhspan(low, high, facecolor="#EDEDED", edgecolor="#C8C8C8", hatch="...", lw=0, zorder=0)
        axes.text(0.02, (low + high) / 2, "published", transform=axes.get_yaxis_transform(), va="center",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    axes.set(xlabel=over(unit), ylabel=f"Input gain $B$ ({gain(unit, fit.data.output_unit)})")
    axes.set_ylim(0, None)
    ends = [(value, f"{name} = {value:.3g}", style.VERMILLION) for name, value in known.items()]
    label_ends(axes, ends, axes.get_xlim()[1])
    return figure
