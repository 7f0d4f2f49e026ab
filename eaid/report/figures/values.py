"""Fitted values over the level, with their 95 % intervals: one fit, or two over each other (two days, two rigs)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import nonlinear
from eaid.models.parameters import Nonlinear
from eaid.report import style
from eaid.report.rig import apparatus_of, level_values, over
from eaid.results.common import Interval
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel, Trend
from eaid.results.nonlinear import CurveLevel, Estimate
from eaid.results.summary import ENDLESS_S

NAMES = {"Ts": "Steady value $T_s$", "tau1": r"Fast constant $\tau_1$", "tau2": r"Slow constant $\tau_2$"}
LOOKS = ((style.BLUE, "-", "o"), (style.VERMILLION, "--", "s"))
"""Colour, line and marker of the first fit and of the second."""
TALL = 1.6
"""An interval that reaches beyond so many times its value does not set the axis."""
BEYOND = 3.0
"""A curve that leaves the single levels by more than this factor is cut: τ2 without end would hide all the rest."""


def axis_label(name: str, unit: str) -> str:
    """Label of an axis along which a fitted value runs."""
    if name == "C_f":
        return "Friction coefficient $C_f$ (1)"
    return f"{NAMES[name]} ({unit if name == 'Ts' else 's'})"


def intervals_of(rows: Sequence[FrictionLevel | CurveLevel], name: str) -> list[Interval]:
    """The 95 % intervals of one value at the levels."""
    return [getattr(row.ci95, name) if row.ci95 else None for row in rows]


def points(axes: Axes, x: Sequence[float], values: Array, ends: Sequence[Interval], **look: object) -> float:
    """Values with their 95 % intervals where there are any; the highest end that is to be seen."""
    low, high = (
        np.array([value if one is None else one[k] for value, one in zip(values, ends, strict=True)]) for k in (0, 1)
    )
    far = [np.maximum(values - low, 0), np.maximum(high - values, 0)]
    axes.errorbar(x, values, yerr=far, **{"fmt": "o", "capsize": 1.6, "elinewidth": 0.7, **look})  # type: ignore[arg-type]
    return highest(np.minimum(values + far[1], TALL * np.abs(values)))


def highest(values: Array) -> float:
    """The largest of the values that are known; 0 where none is."""
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else 0.0


def top_of(curve: Array, seen: float) -> float:
    """The highest value that an axis holds, of a curve and of levels whose highest end is `seen`; 0 without one."""
    return min(max(highest(curve), seen), BEYOND * seen) if seen else highest(curve)


def values_of(rows: Sequence[FrictionLevel | CurveLevel], name: str) -> Array:
    """One value of every level, shape (n,); nan for a time constant without end."""
    return ended(np.array([getattr(row, name) for row in rows], dtype=float), name)


def ended(values: Array, name: str) -> Array:
    """Values, with nan for time constants without end, which no axis can hold."""
    return values if name == "Ts" else np.where(values > ENDLESS_S, np.nan, values)


def nonlinear_of(part: Estimate) -> Nonlinear:
    """The nonlinear model of an estimate."""
    return Nonlinear(part.tau1, part.tau2, part.Ts, part.u_range, part.C)


def values_over(part: Estimate, u: Array) -> dict[str, Array]:
    """T_s, τ1 and τ2 of an estimate over the input."""
    model = nonlinear_of(part)
    tau1, tau2 = nonlinear.time_constants(model, u)
    return {"Ts": nonlinear.steady_torque(model, u), "tau1": ended(tau1, "tau1"), "tau2": ended(tau2, "tau2")}


def curves_over(fit: Fit) -> tuple[Array, dict[str, Array]]:
    """Inputs, and T_s, τ1 and τ2 over them: the nonlinear model, else the trends; empty where neither was fitted."""
    if fit.nonlinear is not None:
        u = np.linspace(*fit.nonlinear.u_range, 150)
        return u, values_over(fit.nonlinear, u)
    part = fit.friction
    known = {name: one for name, one in (part.trends if part else {}).items() if name in NAMES and one.coefficients}
    if part is None or not known:
        return np.empty(0), {}
    u = np.linspace(part.levels[0].level, part.levels[-1].level, 150)
    x = apparatus_of(fit.data).stress_kpa(1.0) * u if over_stress(fit) else u
    return u, {name: ended(trend_values(one, x), name) for name, one in known.items()}


def trend_values(trend: Trend, x: Array) -> Array:
    """A fitted trend over stress or speed, by its form."""
    c = trend.coefficients
    if trend.form == "linear":
        return np.asarray(c[0] * x + c[1])
    if trend.form == "merged-exponential":
        return np.asarray((c[0] + c[1] * x) * np.exp(c[2] * x))
    return np.asarray(c[0] * np.exp(c[1] * x) + c[2] * np.exp(c[3] * x))


def over_stress(fit: Fit) -> bool:
    """Whether the fitted values run over the normal stress."""
    part = fit.friction
    return part is not None and part.over == "stress_kpa" and all(row.stress_kpa is not None for row in part.levels)


def draw_curves(panels: Sequence[Axes], fits: Sequence[tuple[str, Fit]]) -> None:
    """The models' T_s, τ1 and τ2 over the level, a panel each, of every fit."""
    for name, panel in zip(NAMES, panels, strict=True):
        tops = [0.0]
        for (said, fit), (colour, line, _marker) in zip(fits, LOOKS, strict=False):
            u, curves = curves_over(fit)
            if name in curves:
                panel.plot(u, curves[name], color=colour, linestyle=line, label=said)
                tops.append(highest(curves[name]))
        panel.set(xlabel=over(fits[0][1].data.input_unit), ylim=(0, 1.1 * max(tops) or 1.0))


def draw_values(panels: Sequence[Axes], fits: Sequence[tuple[str, Fit]], with_curves: bool = True) -> None:
    """T_s, τ1 and τ2, a panel each: the levels of each fit, and its nonlinear model where there is one."""
    for (said, fit), (colour, line, marker) in zip(fits, LOOKS, strict=False):
        rows = level_values(fit)
        u, curves = curves_over(fit) if with_curves and fit.nonlinear is not None else (np.empty(0), {})
        for name, panel in zip(NAMES, panels, strict=True):
            values = values_of(rows, name)
            seen = 0.0
            if np.isfinite(values).any():
                look = {"fmt": marker, "color": colour, "label": said}
                seen = points(panel, [row.level for row in rows], values, intervals_of(rows, name), **look)
            top = top_of(curves.get(name, np.empty(0)), seen)
            if curves:
                panel.plot(u, curves[name], color=colour, linestyle=line, label=None if rows else said)
            panel.set_ylim(0, max(1.1 * top or 1.0, panel.get_ylim()[1] if said != fits[0][0] else 0.0))
    for panel in panels:
        panel.set_xlabel(over(fits[0][1].data.input_unit))


def two_fits(fits: Sequence[tuple[str, Fit]]) -> Figure:
    """T_s, τ1 and τ2 of both fits over the level."""
    figure, axes = style.page(2.5, 1, 3)
    draw_values(axes, [(name if len(name) <= 48 else f"…{name[-47:]}", fit) for name, fit in fits])
    for mark, name, panel in zip("abc", NAMES, axes, strict=True):
        panel.set_ylabel(axis_label(name, fits[0][1].data.output_unit))
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    return figure
