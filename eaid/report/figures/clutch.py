"""Figs. 7 and 8: step responses of the clutch with the nonlinear, Eqs. (4)–(7), and the linear model, Eq. (8); B."""

from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.models import linear, nonlinear
from eaid.report import rig, style
from eaid.report.figures.steps import (
    draw_steps,
    end_of,
    fine_times,
    label_ends,
    live,
    nonlinear_curves,
    single_curves,
    some_levels,
)
from eaid.report.figures.values import axis_label, intervals_of, points
from eaid.report.live import MODEL, thinned
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, gain, level_text, of_the_paper, over, overlaid, quantity
from eaid.report.style import Ready, caption
from eaid.results.common import ci95_of
from eaid.results.fit import Fit
from eaid.steps.noise import block_means
from eaid.steps.stepset import StepSet


def nonlinear_model(data: StepSet, results: Results) -> Ready:
    """Fig. 7: mean ± sd per level; the nonlinear model, Eq. (4), dashed, each level's RMSE behind its name."""
    fit = results.fit("clutch")
    models = nonlinear_curves(fit, data)
    rows = fit.nonlinear.per_level if fit is not None and fit.nonlinear is not None else ()
    notes = {row.level: f"{row.rmse:.3f}" for row in rows if row.rmse is not None}
    several = [row for row in data.levels if len(row.runs) > 1 and models]
    inside = [np.abs(row.mean - models[row.level](row.time_s)) <= row.sd for row in several]
    share = 100 * float(np.mean(np.concatenate(inside))) if inside else None
    figure, (axes,) = style.sheet(style.PAGE_IN, 3.6)
    draw_steps(axes, data, models, notes, spread=True, said=f"Eq. (4), RMSE ({data.output_unit})")
    text = caption("nonlinear", fitted=bool(models), inside_pct=share, out=data.output_unit)
    return Ready(figure, text, (live(data, models, notes),))


def linear_model(data: StepSet, fit: Fit) -> Ready | None:
    """Fig. 8: (a) what was measured and (b) the one linear model of all levels, Eq. (8), on the same scale.

    Where the model lies below zero in the end, which no clutch does, it is left out.
    """
    if fit.linear is None:
        return None
    model, unit = fit.linear.parameters, data.input_unit
    goals = {row.level: linear.steady_torque(model, row.level) for row in data.levels}
    missed = [(abs(goals[row.level] - end_of(row.mean)), row.level) for row in data.levels]
    below = [level_text(level, unit) for level, goal in goals.items() if goal <= 0]
    figure, (measured, modelled) = style.sheet(style.PAGE_IN, 2.9, 1, 2, sharey=True)
    levels = some_levels(data.levels, 14)
    longest = max(float(one.time_s[-1]) for one in levels)
    fine = fine_times(longest)
    ends: list[list[tuple[float, str, str]]] = [[], []]
    for one, colour in zip(levels, style.level_colours(len(levels)), strict=True):
        text = level_text(one.level, unit)
        measured.plot(*thinned(one.time_s, one.mean, 800), color=colour, linewidth=1.2)
        ends[0].append((end_of(one.mean), text, colour))
        if (goal := goals[one.level]) > 0:
            modelled.plot(fine, linear.step_response(model, fine, one.level), color=colour, linestyle=(0, (4, 2)))
            ends[1].append((goal, text, colour))
    measured.set_ylim(0, None)
    for mark, axes, placed, said in zip("ab", (measured, modelled), ends, ("measured", "linear model"), strict=True):
        axes.set(xlabel="Time since the step (s)", xlim=(0, longest))
        style.letter(axes, mark, said)
        label_ends(axes, placed, longest)
    measured.set_ylabel(quantity(data.output_unit))
    text = caption("linear", near=min(missed), far=max(missed), below=below, unit=unit, out=data.output_unit)
    return Ready(figure, text)


def input_gain(fit: Fit, results: Results) -> Ready | None:
    """B of each level over the level, with its intervals, and the bounds B_m and B_M that the robust gains take."""
    part, unit = fit.linear, fit.data.input_unit
    rows = [(row.level, row.B, ci95_of(row, "B")) for row in part.per_level if row.B is not None] if part else []
    bounds = {"$B_m$": part.bounds.B_m, "$B_M$": part.bounds.B_M} if part and part.bounds else {}
    known = {name: value for name, value in bounds.items() if value is not None}
    if not rows and not known:
        return None
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.4)
    if rows:
        at, values, intervals = zip(*rows, strict=True)
        points(axes, at, np.array(values), intervals, fmt="o-", color=style.BLUE, linewidth=0.9)
    for value in known.values():
        axes.axhline(value, color=style.VERMILLION, linestyle=MODEL["linestyle"], linewidth=MODEL["linewidth"])
    if overlaid(fit.data, results.paper):
        low, high = rig.TABLE_IV["B_m"], rig.TABLE_IV["B_M"]
        axes.axhspan(low, high, facecolor="#EDEDED", edgecolor="#C8C8C8", hatch="...", lw=0, zorder=0)
        axes.text(0.02, (low + high) / 2, "published", transform=axes.get_yaxis_transform(), va="center",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    axes.set(xlabel=over(unit), ylabel=f"Input gain $B$ ({gain(unit, fit.data.output_unit)})")
    axes.set_ylim(0, None)
    ends = [(value, f"{name} = {value:.3g}", style.VERMILLION) for name, value in known.items()]
    label_ends(axes, ends, axes.get_xlim()[1])
    return Ready(figure, caption("gain", known=[(B, level) for level, B, _ends in rows], unit=unit))


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


def hold_and_release(data: StepSet) -> Ready | None:
    """Fig. 6: output over time, the held stretch shaded; the shares lost while held and left after release."""
    levels, unit = held_levels(data), data.input_unit
    if not levels:
        return None
    top = levels[0]
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.7)
    looks = [(style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-.")]
    axes.axvspan(0, top.release_s, color="#E8E8E8", lw=0)
    for run, (colour, line) in zip(levels, looks, strict=False):
        label = f"{level_text(run.level, unit)}: lost {run.lost_pct:.1f} %, left {run.left_pct:.1f} %"
        t, y = thinned(run.time_s, run.torque, 1500)
        axes.plot(t, y, color=colour, linestyle=line, linewidth=0.9, label=label.replace("-", "−"))
    axes.set(xlabel="Time since the step (s)", ylabel=quantity(data.output_unit), xlim=(0, float(top.time_s[-1])))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.12 * (high - low))  # the words stand above every curve
    for text, at in (("input on", top.release_s / 2), ("off", (top.release_s + top.time_s[-1]) / 2)):
        axes.annotate(text, (float(at), 0.985), xycoords=("data", "axes fraction"), ha="center", va="top")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return Ready(figure, caption("held", top=top, unit=unit))


def pwm_period(results: Results) -> Ready | None:
    """Fig. 2: one PWM period of a clutch like the paper's: (a) voltage, (b) the ideal torque as a share of full duty's.

    Eq. (2): duty = 2 P_a / P; P_a is the time at +V and the time at −V, the rest of the period is 0.
    """
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not of_the_paper(fit.data if fit is not None else data, results.paper):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    if rig is None:
        return None
    duty_pct = 60.0
    figure, (voltage, torque) = style.sheet(style.COLUMN_IN, 2.5, 2, 1, sharex=True, height_ratios=(1.7, 1))
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
    return Ready(figure, caption("pwm"))


def shear_per_field(fit: Fit, results: Results) -> Ready | None:
    """Fig. 9, Eq. (1): shear stress over the electric field of this clutch at its highest level, of the paper's kind.

    A hollow square, as the paper marks adjustable rotary actuators, and lines of equal merit.
    """
    if fit.nonlinear is None or not of_the_paper(fit.data, results.paper):
        return None
    rig, model, top = apparatus_of(fit.data), fit.nonlinear.parameters, fit.nonlinear.u_range[1]
    field, shear = rig.field_v_per_um, rig.shear_kpa(float(nonlinear.steady_torque(model, top)))
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.5)
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
    return Ready(figure, caption("shear", field=field, stress=shear, level=top, unit=fit.data.input_unit))


def friction_steps(results: Results) -> Ready | None:
    """Fig. 3: steps of the force dataset, else of the speed dataset, and the fitted Eq. (3) where there is any."""
    kind = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None:
        return None
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    worst = max(((row.rmse / row.Ts, row.level) for row in rows if row.rmse is not None and row.Ts > 0), default=None)
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.9)
    draw_steps(axes, data, single_curves(fit), said="Eq. (3)")
    text = caption("friction_steps", worst=worst, unit=data.input_unit)
    return Ready(figure, text, (live(data, single_curves(fit)),))


def trends(fit: Fit, results: Results) -> Ready | None:
    """Figs. 4 and 5: the levels with their intervals, their trend and the published one, a panel a value.

    Over force: T_s, τ1, C_f and τ2 over the normal stress [kPa], where it is known; over speed: τ1, T_s and τ2 [RPM].
    """
    part = fit.friction
    if part is None or len(part.levels) < 2:
        return None
    names: tuple[str, ...] = ("Ts", "tau1", "tau2")
    paper = rig.OVER_STRESS
    if fit.data.kind == "friction-speed":
        # Table II's tau2 is two equal rates of opposite weight: at the printed digits no curve is left to draw.
        names, paper = ("tau1", "Ts", "tau2"), {name: rig.OVER_SPEED[name] for name in ("Ts", "tau1")}
    elif part.over_stress and fit.data.output_unit == "N·m":  # Eq. (1) takes a torque
        names = ("Ts", "tau1", "C_f", "tau2")
    x = np.array(part.x if part.over_stress else [row.level for row in part.levels])
    fine = np.linspace(x.min(), x.max(), 200)
    four = len(names) == 4
    figure, axes = style.sheet(style.PAGE_IN, 4.2 if four else 2.4, 1 + four, 2 if four else 3, sharex=four)
    for mark, name, panel in zip("abcd", names, axes, strict=False):
        values, ends = np.array([getattr(row, name) for row in part.levels]), intervals_of(part.levels, name)
        if name == "C_f":
            per = np.array([apparatus_of(fit.data).friction_coefficient(1.0, one) for one in x])
            values = per * np.array([row.Ts for row in part.levels])
            ends = [
                end and (k * end[0], k * end[1]) for k, end in zip(per, intervals_of(part.levels, "Ts"), strict=True)
            ]
        top = points(panel, x.tolist(), values, ends, color=style.BLACK, label="each level, 95 %")
        trend = part.trends.get(name)
        if trend is not None and trend.coefficients:
            panel.plot(fine, trend.predict(fine), color=style.BLUE, label="trend")
            top = max(top, float(np.max(trend.predict(fine))))
        if name in paper and overlaid(fit.data, results.paper):
            panel.plot(fine, paper[name](fine), color=style.VERMILLION, linestyle=":", label="published")
        panel.set_ylabel(axis_label(name, fit.data.output_unit))
        if top > 0:
            panel.set_ylim(0, 1.12 * top)
        style.letter(panel, mark)
    for panel in axes[-2:] if four else axes:
        panel.set_xlabel("Normal stress (kPa)" if part.over_stress else over(fit.data.input_unit))
    style.legend_over(figure, axes[0])
    text = caption("trends", rows=part.levels, unit=fit.data.input_unit, out=fit.data.output_unit)
    title = "" if of_the_paper(fit.data, results.paper) else "Fitted values over the level"
    return Ready(figure, text, title=title)
