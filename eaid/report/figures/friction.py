"""Figs. 3–5: friction steps with their fitted curves, Eq. (3), and what was fitted over stress and over speed."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import friction
from eaid.models.parameters import SHARE, Friction
from eaid.report import published, style
from eaid.report.figures.steps import draw_steps
from eaid.report.rig import apparatus_of
from eaid.steps.stepset import StepSet

LABELS = {
    "Ts": "Steady torque $T_s$ (N·m)",
    "tau1": r"Fast constant $\tau_1$ (s)",
    "tau2": r"Slow constant $\tau_2$ (s)",
    "C_f": "Friction coefficient $C_f$ (1)",
}


def curve_of(level: Mapping[str, Any], share: float) -> Friction:
    """The fitted curve of one level of a fit.json."""
    return Friction(level["Ts"], level["tau1"], level["tau2"], level.get("C") or share)


def friction_steps(data: StepSet, fit: Mapping[str, Any] | None) -> Figure:
    """Torque over time at each level, mean of the repeats (solid) and the fitted Eq. (3) (dashed)."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.9)
    fitted: dict[float, Callable[[Array], Array]] = {}
    if fit:
        share = float(fit.get("C") or SHARE)
        for row in fit.get("levels", []):
            p = curve_of(row, share)
            fitted[float(row["level"])] = lambda t, p=p: friction.step_response(p, t)  # type: ignore[misc]
    draw_steps(axes, data, fitted)
    return figure


def trend_values(trend: Mapping[str, Any], x: Array) -> Array:
    """A fitted trend over stress or speed, by its form in fit.json."""
    c = [float(value) for value in trend["coefficients"]]
    if trend["form"] == "linear":
        return np.asarray(c[0] * x + c[1])
    if trend["form"] == "merged-exponential":
        return np.asarray((c[0] + c[1] * x) * np.exp(c[2] * x))
    return np.asarray(c[0] * np.exp(c[1] * x) + c[2] * np.exp(c[3] * x))


def trend_x(fit_data: Mapping[str, Any], levels: list[float]) -> Array:
    """What the trends run over: stress [kPa] of a force set, the speed [RPM] itself otherwise."""
    if fit_data.get("kind") == "friction-force":
        rig = apparatus_of(fit_data)
        return np.array([rig.stress_kpa(level) for level in levels])
    return np.array(levels)


def friction_coefficients(fit: Mapping[str, Any], x_kpa: Array) -> tuple[Array, Array]:
    """C_f of each level [1], shape (L,), and its interval, shape (L, 2), from the steady torques by Eq. (1)."""
    rig = apparatus_of(fit["data"])
    rows = fit["friction"]["levels"]
    values = np.array([rig.friction_coefficient(row["Ts"], x) for row, x in zip(rows, x_kpa, strict=True)])
    ends = np.full((len(rows), 2), np.nan)
    for i, row in enumerate(rows):
        if interval := (row.get("ci95") or {}).get("Ts"):
            ends[i] = [np.nan if end is None else rig.friction_coefficient(end, x_kpa[i]) for end in interval]
    return values, ends


def _panel(axes: Axes, fit: Mapping[str, Any], name: str, x: Array, paper: Callable[[Array], Array] | None) -> None:
    rows = fit["friction"]["levels"]
    if name == "C_f":
        values, ends = friction_coefficients(fit, x)
    else:
        values = np.array([row[name] for row in rows], dtype=float)
        ends = np.full((len(rows), 2), np.nan)
        for i, row in enumerate(rows):
            interval = (row.get("ci95") or {}).get(name)
            if interval and None not in interval:
                ends[i] = interval
    reach = np.abs(np.nan_to_num(ends - values[:, None]))
    axes.errorbar(
        x, values, yerr=reach.T, fmt="o", color=style.BLACK, capsize=1.6, elinewidth=0.7, label="fitted, 95 % interval"
    )
    fine = np.linspace(x.min(), x.max(), 200)
    trend = (fit["friction"].get("trends") or {}).get(name)
    top = np.nanmax(np.where(np.isfinite(ends[:, 1]), np.minimum(ends[:, 1], 2 * values), values))
    if trend and trend.get("coefficients"):
        axes.plot(fine, trend_values(trend, fine), color=style.BLUE, label="trend")
        top = max(top, float(np.max(trend_values(trend, fine))))
    if paper is not None:
        axes.plot(fine, paper(fine), color=style.VERMILLION, linestyle=":", label="published")
    axes.set(ylabel=LABELS[name], ylim=(0, 1.12 * top))


def friction_over_stress(fit: Mapping[str, Any]) -> Figure:
    """Fig. 4: T_s, τ1, C_f and τ2 over the normal stress [kPa], with their trends and Table I's."""
    figure, axes = style.sheet(style.PAGE_IN, 4.0, 2, 2, sharex=True)
    x = trend_x(fit["data"], [row["level"] for row in fit["friction"]["levels"]])
    for mark, name, panel in zip("abcd", ("Ts", "tau1", "C_f", "tau2"), axes, strict=True):
        _panel(panel, fit, name, x, published.OVER_STRESS[name])
        style.letter(panel, mark)
    for panel in axes[2:]:
        panel.set_xlabel("Normal stress (kPa)")
    axes[0].legend(loc="lower right")
    return figure


def friction_over_speed(fit: Mapping[str, Any]) -> Figure:
    """Fig. 5: τ1, T_s and τ2 over the rotation speed [RPM], with their trends and what Table II prints."""
    figure, axes = style.sheet(style.PAGE_IN, 2.3, 1, 3)
    x = trend_x(fit["data"], [row["level"] for row in fit["friction"]["levels"]])
    for mark, name, panel in zip("abc", ("tau1", "Ts", "tau2"), axes, strict=True):
        # Table II's tau2 is two equal rates of opposite weight: at the printed digits no curve is left to draw.
        _panel(panel, fit, name, x, None if name == "tau2" else published.OVER_SPEED[name])
        panel.set_xlabel("Rotation speed (RPM)")
        style.letter(panel, mark)
    axes[0].legend(loc="upper right")
    return figure
