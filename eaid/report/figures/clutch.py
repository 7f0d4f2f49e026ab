"""Figs. 7 and 8: step responses of the clutch with the nonlinear, Eqs. (4)–(7), and the linear model, Eq. (8); B."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.models import linear, nonlinear
from eaid.report import rig, style
from eaid.report import rig as published
from eaid.report.figures import steps
from eaid.report.figures.panels import MODEL
from eaid.report.figures.steps import (
    draw_steps,
    end_of,
    fine_times,
    label_ends,
    nonlinear_curves,
    single_curves,
    some_levels,
)
from eaid.report.figures.values import axis_label, intervals_of, points
from eaid.report.live import thinned
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, gain, level_text, of_the_paper, over, overlaid, quantity
from eaid.report.style import Ready, caption
from eaid.results.common import Interval, ci95_of
from eaid.results.fit import Fit, Friction, FrictionLevel
from eaid.steps.noise import block_means
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
        low, high = rig.TABLE_IV["B_m"], rig.TABLE_IV["B_M"]
        axes.axhspan(low, high, facecolor="#EDEDED", edgecolor="#C8C8C8", hatch="...", lw=0, zorder=0)
        axes.text(0.02, (low + high) / 2, "published", transform=axes.get_yaxis_transform(), va="center",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    axes.set(xlabel=over(unit), ylabel=f"Input gain $B$ ({gain(unit, fit.data.output_unit)})")
    axes.set_ylim(0, None)
    ends = [(value, f"{name} = {value:.3g}", style.VERMILLION) for name, value in known.items()]
    label_ends(axes, ends, axes.get_xlim()[1])
    return figure


@dataclass(frozen=True, eq=False)
class Held:
    """Mean of a level's repeats, held and then released; time from the step, idle output subtracted."""

    level: float
    time_s: Array
    torque: Array
    release_s: float

    @property
    def lost_pct(self) -> float:
        """Torque lost from peak to release [% of the peak], by means of twentieths."""
        means = block_means(self.torque[self.time_s <= self.release_s])
        return 100 * max(0.0, 1 - float(means[-1] / means.max())) if means.max() > 0 else 0.0

    @property
    def left_pct(self) -> float:
        """Torque left at the end of the log [% of the torque when held], by means of twentieths."""
        held = float(block_means(self.torque[self.time_s <= self.release_s])[-1])
        left = float(block_means(self.torque[self.time_s > self.release_s])[-1])
        return 100 * left / held if held > 0 else 0.0


def hold_ready(data: StepSet) -> Ready | None:
    """Fig. 6, where the dataset holds releases."""
    levels, unit = held_levels(data), data.input_unit
    if not levels:
        return None
    draw = partial(hold_and_release, levels, unit, data.output_unit)
    return Ready(draw, caption("held", top=levels[0], unit=unit))


def held_levels(data: StepSet) -> list[Held]:
    """Levels whose rise and release were both recorded: the highest, the middle and the lowest of them."""
    rising = {level.level: level for level in data.levels}
    found = []
    for release in data.releases:
        if (step := rising.get(release.level)) is None:
            continue
        dt = float(step.time_s[-1] - step.time_s[0]) / max(len(step.time_s) - 1, 1)
        end = float(step.time_s[-1]) + dt
        time = np.concatenate([step.time_s, end + release.time_s])
        found.append(Held(release.level, time, np.concatenate([step.mean, release.mean]), end - dt / 2))
    if len(found) <= 3:
        return found[::-1]
    return [found[-1], found[len(found) // 2], found[0]]


def hold_and_release(levels: Sequence[Held], input_unit: str, output_unit: str) -> Figure:
    """Output over time, the held stretch shaded; the shares lost while held and left after release are written."""
    figure, (axes,) = style.column(2.7)
    looks = [(style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-.")]
    axes.axvspan(0, levels[0].release_s, color="#E8E8E8", lw=0)
    for run, (colour, line) in zip(levels, looks, strict=False):
        label = f"{level_text(run.level, input_unit)}: lost {run.lost_pct:.1f} %, left {run.left_pct:.1f} %"
        label = label.replace("-", "−")
        t, y = thinned(run.time_s, run.torque, 1500)
        axes.plot(t, y, color=colour, linestyle=line, linewidth=0.9, label=label)
    axes.set(xlabel="Time since the step (s)", ylabel=quantity(output_unit), xlim=(0, float(levels[0].time_s[-1])))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.12 * (high - low))  # the words stand above every curve
    for text, at in (("input on", levels[0].release_s / 2), ("off", (levels[0].release_s + levels[0].time_s[-1]) / 2)):
        axes.annotate(text, (float(at), 0.985), xycoords=("data", "axes fraction"), ha="center", va="top")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def pwm_ready(results: Results) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not of_the_paper(fit.data if fit is not None else data, results.paper):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    return Ready(partial(pwm_period, rig), caption("pwm")) if rig is not None else None


def pwm_period(rig: Apparatus, duty_pct: float = 60.0) -> Figure:
    """One PWM period at a duty [%]: (a) voltage [V], (b) the ideal torque as a share of the torque at full duty.

    Eq. (2): duty = 2 P_a / P; P_a is the time at +V and the time at −V, the rest of the period is 0.
    """
    figure, (voltage, torque) = style.column(2.5, 2, 1, sharex=True, height_ratios=(1.7, 1))
    period_ms = 1e3 / rig.pwm_hz
    active_ms = period_ms * duty_pct / 200
    half, v = period_ms / 2, rig.voltage_v
    edges = [0, 0, active_ms, active_ms, half, half, half + active_ms, half + active_ms, period_ms]
    voltage.plot(edges, [0, v, v, 0, 0, -v, -v, 0, 0], color=style.BLACK)
    torque.plot(edges, [0, 1, 1, 0, 0, 1, 1, 0, 0], color=style.BLUE)
    torque.fill_between(edges, [0, 1, 1, 0, 0, 1, 1, 0, 0], color=style.BLUE, alpha=0.15, linewidth=0)
    for text, end, height in ((r"$P_a$", active_ms, -0.45 * v), (rf"$P$ = {period_ms:.2f} ms", period_ms, -1.5 * v)):
        voltage.annotate("", (0, height), (end, height), arrowprops={"arrowstyle": "<->", "lw": 0.6, "shrinkA": 0})
        voltage.text(end / 2, height, text, ha="center", va="bottom")
    voltage.set(ylabel="Voltage (V)", ylim=(-1.75 * v, 1.25 * v), yticks=[-v, 0, v])
    torque.set(ylabel="Ideal\ntorque (1)", xlabel="Time (ms)", xlim=(0, period_ms), ylim=(0, 1.2), yticks=np.arange(2))
    style.letter(voltage, "a", f"duty 2 $P_a$/$P$ = {duty_pct:.0f} %")
    style.letter(torque, "b")
    return figure


def shear_ready(fit: Fit, results: Results) -> Ready | None:
    """Fig. 9, of the paper's kind of clutch only."""
    if fit.nonlinear is None or not of_the_paper(fit.data, results.paper):
        return None
    field, stress = shear_point(fit)
    top, unit = fit.nonlinear.u_range[1], fit.data.input_unit
    return Ready(partial(shear_per_field, fit), caption("shear", field=field, stress=stress, level=top, unit=unit))


def shear_point(fit: Fit) -> tuple[float, float]:
    """Electric field [V/µm] and shear stress [kPa] of this clutch at its highest identified duty, Eq. (1)."""
    assert fit.nonlinear is not None
    rig, model = apparatus_of(fit.data), fit.nonlinear.parameters
    return rig.field_v_per_um, rig.shear_kpa(float(nonlinear.steady_torque(model, model.u_range[1])))


def shear_per_field(fit: Fit) -> Figure:
    """This clutch's point, a hollow square as the paper marks adjustable rotary actuators, and lines of equal merit."""
    figure, (axes,) = style.column(2.5)
    field, shear = shear_point(fit)
    x, merit = np.array([0.0, 2 * field]), shear / field
    for factor in (0.5, 1.0, 2.0):
        axes.plot(x, factor * merit * x, color=style.GREY, linestyle="--", linewidth=0.8)
        right = factor <= 1
        at = (1.01, factor / 1.0 if right else 1.0) if right else (0.5, 1.01)
        axes.annotate(
            f"{factor * merit:.2g}", at, xycoords="axes fraction", va="center" if right else "bottom",
            ha="left" if right else "center",
        )  # fmt: skip
    axes.plot([field], [shear], "s", color=style.BLUE, markerfacecolor="white", markeredgewidth=1.4, markersize=7)
    axes.annotate(
        f"this clutch,\n{shear:.2f} kPa", (field, shear), (12, -4), textcoords="offset points", va="top",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip
    axes.set(xlabel="Electric field (V/µm)", ylabel="Shear stress (kPa)", xlim=(0, 2 * field), ylim=(0, 2 * shear))
    axes.text(1.01, 0.86, "kPa/\n(V/µm)", transform=axes.transAxes, va="top")
    axes.grid(visible=False)
    return figure


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
