"""Figs. 7 and 8: step responses of the clutch with the nonlinear, Eqs. (4)–(7), and the linear model, Eq. (8)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.fitting.side_by_side import nonlinear_estimates
from eaid.models import linear, nonlinear
from eaid.models.parameters import SHARE, Linear, Nonlinear
from eaid.report import published, style
from eaid.report.figures.friction import LABELS
from eaid.report.figures.steps import draw_steps
from eaid.report.tables import unit_of_input, unit_of_output
from eaid.steps.stepset import StepSet


def nonlinear_of(fit: Mapping[str, Any]) -> Nonlinear:
    """The nonlinear model of a fit.json."""
    part = fit["nonlinear"]
    low, high = part["u_range"]
    return Nonlinear(
        tuple(part["tau1"]), tuple(part["tau2"]), tuple(part["Ts"]), (low, high), float(part.get("C") or SHARE)
    )


def linear_of(fit: Mapping[str, Any]) -> Linear:
    """The pooled linear model of a fit.json."""
    part = fit["linear"]
    return Linear(part["a0"], part["b0"], part["c0"])


def rmse_notes(rows: list[Mapping[str, Any]] | None) -> dict[float, str]:
    """Each level's RMSE as written behind its name."""
    return {float(row["level"]): f"{row['rmse']:.3f}" for row in rows or [] if row.get("rmse") is not None}


def nonlinear_model(data: StepSet, fit: Mapping[str, Any] | None) -> Figure:
    """Fig. 7: mean ± sd per duty, Eq. (4) dashed, and each level's RMSE [N·m] behind its duty."""
    figure, (axes,) = style.sheet(style.PAGE_IN, 3.6)
    if fit and fit.get("nonlinear"):
        model = nonlinear_of(fit)
        fitted = {level.level: (lambda t, u=level.level: nonlinear.step_response(model, t, u)) for level in data.levels}
        draw_steps(axes, data, fitted, rmse_notes(fit["nonlinear"].get("per_level")), spread=True)
    else:
        draw_steps(axes, data, {}, spread=True)
    return figure


def linear_model(data: StepSet, fit: Mapping[str, Any]) -> Figure:
    """Fig. 8: mean per duty and the one linear model of all of them, Eq. (8), dashed."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.9)
    model = linear_of(fit)
    fitted = {level.level: (lambda t, u=level.level: linear.step_response(model, t, u)) for level in data.levels}
    draw_steps(axes, data, fitted)
    return figure


BEYOND = 3.0
"""A curve that leaves the single levels by more than this factor is cut: τ2 without end would hide all the rest."""
OTHERS = ((style.ORANGE, "-."), (style.GREEN, (0, (4, 1, 1, 1, 1, 1))))
"""Colour and line of the estimates beside the one that is used."""


def _over(unit: str) -> str:
    """Label of the axis that levels run along."""
    return "Duty (%)" if unit == "%" else f"Level ({unit})" if unit else "Level"


def polynomials(fit: Mapping[str, Any]) -> Figure:
    """T_s, τ1 and τ2 over the duty: every estimate, the single levels with their intervals, and Table III."""
    figure, axes = style.sheet(style.PAGE_IN, 2.3, 1, 3)
    model = nonlinear_of(fit)
    u = np.linspace(*model.u_range, 200)
    tau1, tau2 = nonlinear.time_constants(model, u)
    curves = {"Ts": nonlinear.steady_torque(model, u), "tau1": tau1, "tau2": tau2}
    levels = (fit.get("friction") or {}).get("levels") or []
    own, *others = nonlinear_estimates(fit["nonlinear"]).items()
    unit = unit_of_input(fit)
    for mark, name, panel in zip("abc", ("Ts", "tau1", "tau2"), axes, strict=True):
        panel.plot(u, curves[name], color=style.BLUE, label=own[0].replace(", equal weights", " fit"))
        top = float(np.max(curves[name]))
        if levels:
            at = np.array([row["level"] for row in levels], dtype=float)
            values = np.array([row[name] for row in levels], dtype=float)
            reach = np.zeros((2, len(levels)))
            for i, row in enumerate(levels):
                interval = (row.get("ci95") or {}).get(name)
                if interval and None not in interval:
                    reach[:, i] = [max(values[i] - interval[0], 0), max(interval[1] - values[i], 0)]
            panel.errorbar(
                at, values, yerr=reach, fmt="o", color=style.BLACK, capsize=1.6, elinewidth=0.7, label="single levels"
            )
            seen = float(np.max(np.minimum(values + reach[1], 1.6 * values)))
            top = min(max(top, seen), BEYOND * seen)
        for (said, other), (colour, line) in zip(others, OTHERS, strict=False):
            terms = other.get(name)
            if terms and all(isinstance(c, int | float) for c in terms):
                curve = np.polynomial.polynomial.polyval(u, terms)
                label = said.replace(", equal weights", " fit")
                panel.plot(u, curve, color=colour, linestyle=line, linewidth=0.9, label=label)
        if name != "Ts" and unit == "%":  # Table III's T_s gives 0.06 N·m at full duty: a line on the floor
            paper = np.polynomial.polynomial.polyval(u, published.TABLE_III[name])
            panel.plot(u, paper, color=style.VERMILLION, linestyle=":", label="published")
        panel.set(xlabel=_over(unit), ylabel=LABELS[name].replace("N·m", unit_of_output(fit)), ylim=(0, 1.15 * top))
        style.letter(panel, mark)
    axes[1].legend(loc="best")
    return figure


def input_gain(fit: Mapping[str, Any]) -> Figure:
    """B of each level [%·s/(N·m)] over the duty, with the bounds B_m and B_M that the robust gains take from it."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.2)
    part = fit["linear"]
    rows = [row for row in part.get("per_level") or [] if row.get("B") is not None]
    axes.plot(
        [row["level"] for row in rows],
        [row["B"] for row in rows],
        "o-",
        color=style.BLUE,
        label=r"each level, $B=1/b_0$",
    )
    bounds = part.get("bounds") or {}
    for name, line in (("B_m", "--"), ("B_M", "-.")):
        if bounds.get(name) is not None:
            axes.axhline(bounds[name], color=style.VERMILLION, linestyle=line, label=f"${name}$ = {bounds[name]:.3g}")
    unit, out = unit_of_input(fit), unit_of_output(fit)
    if unit == "%":
        low, high = published.TABLE_IV["B_m"], published.TABLE_IV["B_M"]
        axes.axhspan(low, high, color=style.GREY, alpha=0.15, lw=0, label="published range")
    axes.set(xlabel=_over(unit), ylabel=f"$B$ ({unit or 'input'} s/({out}))")
    axes.set_ylim(0, None)
    axes.legend(loc="best")
    return figure
