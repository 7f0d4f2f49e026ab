"""Fitted values over the level, with their 95 % intervals; the rig: one PWM period, shear stress over the field."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.report import panels as ink
from eaid.report import rig
from eaid.report.panels import Axis, Band, Line, Note, Panel, Sheet, over
from eaid.report.results import Results
from eaid.report.rig import of_the_paper
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.models import Trend
from eaid.results.summary import ENDLESS_S

VALUES = ("Ts", "tau1", "tau2")
VALUE_NAMES = {"Ts": "Steady value T_s", "tau1": "Fast constant τ1", "tau2": "Slow constant τ2",
         "C_f": "Friction coefficient C_f"}  # fmt: skip
TALL = 1.6  # An interval that reaches beyond so many times its value does not set the axis


def value_panel(
    x: Axis, fit: Fit, name: str, levels: Sequence[float], values: Array, intervals: Sequence[Interval],
    model: Line | None, published: Line | None, legend: bool,
) -> Panel:  # fmt: skip
    """A fitted value over the level: its model, the single levels with their intervals, what was published."""
    low, high = np.array([(np.nan, np.nan) if ends is None else ends for ends in intervals]).reshape(-1, 2).T
    ends = np.minimum(low, values), np.maximum(high, values)  # nan: not known, and no whisker
    known, at = np.isfinite(low), np.asarray(levels)
    whiskers = ends[0][known], ends[1][known]
    lines = [Line(at[known], values[known], "at each level, 95 %", dash="", marker="o", ends=whiskers)]
    if not known.all():
        lines.append(Line(at[~known], values[~known], "interval not known", dash="", marker="o", fill="white"))
    size = np.abs(values)
    top = float(np.nanmax(np.where(known, np.minimum(ends[1], TALL * size), size), initial=0.0))
    if model is not None:
        peak = float(np.nanmax(model.y, initial=0.0))
        top = top if top and peak > 3 * top and name in ("tau1", "tau2") else max(top, peak)
        # only where the axis holds it: τ2 without end would hide all the rest
        lines.insert(0, replace(model, y=np.where(model.y < 1.3 * top, model.y, np.nan), color=ink.BLUE, width=1.1))
    if published is not None and (published.y < 1.1 * top).any():  # no name of a line that the axis does not hold
        lines.append(replace(published, name="published", color=ink.VERMILLION, dash=":", width=1.1))
    unit = {"C_f": "1", "Ts": fit.data.output_unit}.get(name, "s")
    y = Axis(VALUE_NAMES[name], unit, (0.0, 1.1 * top) if top else (None, None))
    return Panel(x, y, lines, legend="over" if legend else "", columns=6, tight=False)


def without_endless(values: Array, name: str) -> Array:
    """Values, with nan for time constants without end, which no axis can hold."""
    return values if name == "Ts" else np.where(values > ENDLESS_S, np.nan, values)


def value_panels(fit: Fit) -> list[Panel]:
    """T_s, τ1 and τ2, a panel each: the levels of a fit, its nonlinear model where there is one, and Table III."""
    rows, part = fit.level_values, fit.nonlinear
    panels, one_lag = [], fit.plant_ is not None and fit.plant_.kind == "lag"
    for name in VALUES[: 2 if one_lag else 3]:
        values = without_endless(np.array([getattr(row, name) for row in rows], dtype=float), name)
        model = published = None
        if part is not None:
            u = np.linspace(*part.u_range, 200)
            tau1, tau2 = part.parameters.time_constants(u)
            curves = {"Ts": part.parameters.steady(u), "tau1": tau1, "tau2": tau2}
            model = Line(u, without_endless(curves[name], name), "model")
            if of_the_paper(fit.data) and name != "Ts":  # Table III's T_s gives 0.06 N·m at full duty
                published = Line(u, np.polynomial.polynomial.polyval(u, rig.TABLE_III[name]))
        levels, intervals = [row.level for row in rows], [ci95_of(row, name) for row in rows]
        x, low, high = over(fit.data.input_unit), min(levels, default=0.0), max(levels, default=0.0)
        if low < high:  # alike in all panels, also where one level alone has a value
            x = replace(x, limits=(low - 0.05 * (high - low), high + 0.05 * (high - low)))
        panels.append(value_panel(x, fit, name, levels, values, intervals, model, published, name == "tau1"))
    return panels


def polynomials(fit: Fit) -> Sheet | None:
    """T_s, τ1 and τ2 over the level: the model, the single levels with their intervals, and Table III."""
    if fit.nonlinear is None or len(fit.level_values) == 1:
        return None
    panels = value_panels(fit)
    return Sheet(panels, 2.5, columns=len(panels), shared=False)


def trends(fit: Fit) -> Sheet | None:
    """Figs. 4 and 5: the levels with their intervals, their trend and the published one, a panel a value."""
    part, stress = fit.friction, fit.friction is not None and fit.friction.over_stress
    if part is None or len(part.levels) < 2:
        return None
    sizes = fit.data.apparatus if stress and fit.data.output_unit == "N·m" else None
    names = ("Ts", "tau1", "C_f", "tau2") if sizes is not None else VALUES
    paper = rig.TABLE_I
    if fit.data.kind == "friction-speed":
        # Table II's tau2 is two equal rates of opposite weight: at the printed digits no curve is left to draw.
        names, paper = ("tau1", "Ts", "tau2"), {name: rig.TABLE_II[name] for name in ("Ts", "tau1")}
    x = np.array([row.stress_kpa if stress else row.level for row in part.levels], dtype=float)
    fine = np.linspace(x.min(), x.max(), 200)
    along = Axis("Normal stress", "kPa") if stress else over(fit.data.input_unit)
    panels: list[Panel] = []
    for name in names:
        key = "Ts" if name == "C_f" else name
        # Eq. (1): C_f is T_s by what a coefficient of 1 would give
        per = [sizes.friction_coefficient(1.0, one) if sizes and name == "C_f" else 1.0 for one in x]
        values = np.array(per) * [getattr(row, key) for row in part.levels]
        ends = [ci95_of(row, key) for row in part.levels]
        scaled = [end and (k * end[0], k * end[1]) for k, end in zip(per, ends, strict=True)]
        fitted = part.trends.get(name)
        trend = Line(fine, fitted.predict(fine), "trend") if fitted is not None and fitted.coefficients else None
        published = None
        if name in paper and of_the_paper(fit.data):
            known = paper[name][1]
            published = Line(fine, Trend("linear" if len(known) == 2 else "double-exponential", known).predict(fine))
        panels.append(value_panel(along, fit, name, x.tolist(), values, scaled, trend, published, not panels))
    four = len(names) == 4
    return Sheet(panels, 4.2 if four else 2.4, columns=2 if four else 3, shared=four)


def pwm_period(results: Results) -> Sheet | None:
    """Fig. 2: one PWM period of a clutch like the paper's: (a) voltage, (b) the ideal torque as a share of full duty's.

    Eq. (2): duty = 2 P_a / P; P_a is the time at +V and the time at −V, the rest of the period is 0.
    """
    fit, data = results.fit("clutch"), results.data_of("clutch")
    about = fit.data if fit is not None else data
    if about is None or not of_the_paper(about):
        return None
    rig = about.apparatus or Apparatus()
    duty_pct, v = 60.0, rig.voltage_v
    period_ms = 1e3 / rig.pwm_hz
    active_ms, half = period_ms * duty_pct / 200, period_ms / 2
    edges = np.array([0, 0, active_ms, active_ms, half, half, half + active_ms, half + active_ms, period_ms])
    on = np.array([0, 1, 1, 0, 0, 1, 1, 0, 0])
    sizes = (("P_a", active_ms, -0.45 * v), (f"P = {period_ms:.2f} ms", period_ms, -1.5 * v))
    lines = [Line(edges, v * on * np.where(np.arange(9) < 4, 1, -1), width=1.1)]
    lines += [Line((0.0, end), (y, y), width=0.6, marker="|", size=5) for _text, end, y in sizes]
    notes = [Note(text, end / 2, y, va="bottom") for text, end, y in sizes]
    time = Axis("Time", "ms", (0.0, period_ms))
    volts = Axis("Voltage", "V", (-1.75 * v, 1.25 * v), ticks={u: f"{u:g}".replace("-", "−") for u in (-v, 0.0, v)})
    torque = Axis("Ideal\ntorque", "1", (0.0, 1.2), ticks={0.0: "0", 1.0: "1"})
    panels = [
        Panel(time, volts, lines, notes=notes, title=f"duty 2 P_a/P = {duty_pct:.0f} %"),
        Panel(time, torque, [Line(edges, on, color=ink.BLUE, width=1.1)], [Band(edges, 0 * on, on, ink.BLUE, 0.15)]),
    ]
    return Sheet(panels, 2.5, ink.COLUMN_IN, ratios=(1.7, 1))


def shear_per_field(fit: Fit) -> Sheet | None:
    """Fig. 9, Eq. (1): shear stress over the field of this clutch at its highest level, with lines of equal merit."""
    if fit.nonlinear is None or not of_the_paper(fit.data):
        return None
    rig, model, top = fit.data.apparatus or Apparatus(), fit.nonlinear.parameters, fit.nonlinear.u_range[1]
    field, shear = rig.field_v_per_um, rig.shear_kpa(float(model.steady(top)))
    x, merit = np.array([0.0, 2 * field]), shear / field
    factors, said = (0.5, 1.0, 2.0), f"{shear:.2f} kPa\nat {field:.2f} V/µm"
    lines = [Line(x, factor * merit * x, color=ink.GREY, dash="--", width=0.8) for factor in factors]
    notes = [Note(f"{factor * merit:.2g}", 1.01, factor, "xy", ha="left") for factor in factors[:2]]
    notes += [
        Note(f"{2 * merit:.2g}", 0.5, 1.01, "xy", va="bottom"),
        Note("kPa/\n(V/µm)", 1.01, 0.86, "xy", ha="left", va="top"),
        Note(f"this clutch,\n{said}", 1.1 * field, 0.97 * shear, ha="left", va="top", boxed=True),
    ]
    lines.append(Line([field], [shear], color=ink.BLUE, dash="", marker="s", size=7, fill="white"))
    axes = Axis("Electric field", "V/µm", (0.0, 2 * field)), Axis("Shear stress", "kPa", (0.0, 2 * shear))
    return Sheet([Panel(*axes, lines, notes=notes, tight=False)], 2.5, ink.COLUMN_IN)


def margins_panel(gains: Gains) -> Panel:
    """Gain margins of the laws over the held input; none is drawn where the gain has no limit."""
    points = [one for one in gains.margins.points if not one.falling] if gains.margins is not None else []
    lines: list[Line] = []
    for name in gains.margins.worst if gains.margins is not None else ():
        x = np.array([point.duty_pct for point in points])
        y = np.array([getattr(point.loops.get(name), "gain_db", None) for point in points], dtype=float)
        if any(np.allclose(y, line.y, rtol=0.03, equal_nan=True) for line in lines):
            continue  # of RC's own margins
        colour, dash, marker = ink.controller_look(name)
        lines.append(Line(x, y, rig.controller_name(name), colour, dash, marker=marker))
    return Panel(over(gains.input_unit), Axis("Gain margin", "dB", (0.0, None)), lines, legend="above", tight=False)
