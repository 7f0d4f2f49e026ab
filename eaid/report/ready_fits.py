"""Figures of data and fits that the given results allow: how each is drawn, and what is to be seen in it, computed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.models import linear
from eaid.report.figures import checks, clutch, hold, level_steps, pwm, recorded, shear, values
from eaid.report.figures import friction as frictions
from eaid.report.figures.steps import Model
from eaid.report.page import live_fits, live_replays
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, level_text, level_values, of_the_paper
from eaid.report.tables.table import SYMBOLS, listed, number, with_unit
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet

Live = Callable[[], tuple[Mapping[str, Any], ...]]


@dataclass(frozen=True)
class Ready:
    """A figure whose data are at hand."""

    draw: Callable[[], Figure]
    sees: str
    """What is to be seen in it; every claim computed."""
    live: Live | None = None
    title: str = ""
    """What it is called on this rig; empty: as in the catalogue, without the paper's number on another rig."""
    """Its live plots, side by side."""


def main_kind(results: Results) -> str | None:
    """The kind that the page is about: the clutch where there is one."""
    return next(iter(results.kinds), None)


def models_for(results: Results, kind: str) -> dict[float, Model]:
    """Level → model curve of a kind: the nonlinear model, else the single levels' curves."""
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None or fit is None:
        return {}
    return clutch.any_models_of(fit, data)


def pwm_ready(results: Results, asked: bool | None) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not (of_the_paper(fit.data, asked) if fit is not None else of_the_paper(data, asked)):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    said = "The voltage alternates in sign, so that no charge builds up; the ideal torque does not depend on the sign."
    return Ready(lambda: pwm.pwm_period(rig), said) if rig is not None else None


def hold_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 6, where the dataset of the page's kind holds releases."""
    kind = main_kind(results)
    data = results.data_of(kind) if kind else None
    held = hold.held_levels(data) if data is not None else []
    if data is None or not held:
        return None
    top, unit, out = held[0], data.input_unit, data.output_unit
    said = f"At {level_text(top.level, unit)}, {top.lost_pct:.1f} % is lost while held and {top.left_pct:.1f} % is left"
    return Ready(lambda: hold.hold_and_release(held, unit, out), f"{said} at the end of the record.")


def friction_steps_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 3, from the force dataset, else the speed dataset; the fitted curves where there are any."""
    for kind in ("friction-force", "friction-speed"):
        data, fit = results.data_of(kind), results.fit(kind)
        if data is not None:
            models = frictions.curves_of(fit)
            return Ready(
                lambda data=data, fit=fit: frictions.friction_steps(data, fit),  # type: ignore[misc]
                _steps_say(data, fit, models),
                lambda data=data, models=models: (live_fits.steps(data, models),),  # type: ignore[misc]
            )
    return None


def _steps_say(data: StepSet, fit: Fit | None, models: Mapping[float, Model]) -> str:
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    known = [(row.rmse / row.Ts, row.level) for row in rows if row.rmse is not None and row.Ts > 0]
    if not models or not known:
        return "Mean of the repeats at each level."
    worst, at = max(known)
    said = f"Broad: mean of the repeats; dashed: Eq. (3). The curve misses most at {level_text(at, data.input_unit)}"
    return f"{said}, by {100 * worst:.2g} % of T_s (RMSE)."


def level_steps_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Steps from level to level, where some were recorded and fitted."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is None or not (pairs := level_steps.paired(data, fit.steps)):
            continue
        worst = min((shape.fit_pct, level_steps.step_text(shape)) for _, shape in pairs if shape.fit_pct is not None)
        said = f"{len(pairs)} steps, each from its own start. The fitted curve explains least of {worst[1]}: "
        said += f"{number(worst[0], 3)} %."
        return Ready(lambda data=data, fit=fit: level_steps.level_steps(data, fit.steps), said)  # type: ignore[misc]
    return None


def steps_over_level_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Gain and time constants of steps from level to level over the level."""
    fit = next((one.result for one in results.fits if one.result.steps), None)
    if fit is None:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    each = []
    for edge in ("up", "down"):
        rows = [one for one in fit.steps if one.edge == edge]
        gains = [one.gain for one in rows if one.gain is not None]
        if gains:
            each.append(f"{len(rows)} {edge}, gain {number(min(gains), 3)} to {number(max(gains), 3)}")
    said = f"Each change of input by itself, over the level that it goes to: {'; '.join(each)} "
    said += f"{units[1] or 'output'}/{units[0] or 'input'}."
    return Ready(lambda: level_steps.over_level(fit.steps, units), said)


def trends_ready(kind: str, draw: Callable[[Fit, bool | None], Figure]) -> Callable[..., Ready | None]:
    """Figs. 4 and 5, from a fit of their kind."""

    def ready(results: Results, asked: bool | None) -> Ready | None:
        fit = results.fit(kind)
        if fit is None or fit.friction is None or len(fit.friction.levels) < 2:
            return None
        rows, unit, out = fit.friction.levels, fit.data.input_unit, fit.data.output_unit
        ends = [
            f"{SYMBOLS[name]} from {number(getattr(rows[0], name), 3)} to {number(getattr(rows[-1], name), 3)} {per}"
            for name, per in (("Ts", out), ("tau1", "s"), ("tau2", "s"))
        ]
        said = f"From {level_text(rows[0].level, unit)} to {level_text(rows[-1].level, unit)}, {listed(ends)} each."
        title = "" if of_the_paper(fit.data, asked) else "Fitted values over the level"
        return Ready(lambda: draw(fit, asked), said, title=title)

    return ready


def nonlinear_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 7, from the clutch dataset; the model where it was fitted."""
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None:
        return None
    models = clutch.models_of(fit, data)
    notes = clutch.rmse_notes(fit.nonlinear.per_level) if fit is not None and fit.nonlinear is not None else {}
    said = "Mean of the repeats and ± one standard deviation (sd) at each level."
    if models:
        inside = [
            np.abs(row.mean - models[row.level](row.time_s)) <= row.sd for row in data.levels if len(row.runs) > 1
        ]
        said = f"Broad: mean of the repeats, shaded ± sd; dashed: Eq. (4), with its RMSE in {data.output_unit} behind "
        said += "each level."
        if inside:
            said += f" The model stays within ± sd {100 * np.mean(np.concatenate(inside)):.0f} % of the time."
    return Ready(lambda: clutch.nonlinear_model(data, fit), said, lambda: (live_fits.steps(data, models, notes),))


def over_duty_ready(results: Results, asked: bool | None) -> Ready | None:
    """Parameters over the level, with the estimates beside the one that is used."""
    fit = results.fit("clutch")
    if fit is None or fit.nonlinear is None or len(level_values(fit)) == 1:
        return None
    counts = []
    for name in ("Ts", "tau1", "tau2") if fit.recorded is None else ():
        rows = [(row.level, getattr(row.ci95, name)) for row in level_values(fit) if row.ci95]
        known = [(level, ends) for level, ends in rows if ends is not None]
        if known:
            curve = values.values_over(fit.nonlinear, np.array([level for level, _ in known]))[name]
            met = sum(ends[0] <= value <= ends[1] for (_, ends), value in zip(known, curve, strict=True))
            counts.append(f"{SYMBOLS[name]} through {met} of {len(known)}")
    said = "Points: each level by itself; line: the model over the level."
    if fit.recorded is not None:
        said = "The model over the level, with its 95 % intervals at some levels."
    said += f" It passes inside the 95 % intervals: {listed(counts)}." if counts else ""
    return Ready(lambda: clutch.polynomials(fit, asked), said, lambda: live_fits.parameters(fit))


def linear_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 8, from the clutch dataset and its linear model."""
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None or fit is None or fit.linear is None:
        return None
    model = clutch.linear_of(fit.linear)
    ends = {row.level: float(np.mean(row.mean[-max(1, len(row.mean) // 50) :])) for row in data.levels}
    miss = {level: linear.steady_torque(model, level) - end for level, end in ends.items()}
    near, far = (pick(miss, key=lambda level: abs(miss[level])) for pick in (min, max))
    unit, out = data.input_unit, data.output_unit
    said = (
        f"In the end the one linear model is nearest at {level_text(near, unit)} ({number(abs(miss[near]), 2)} {out} "
    )
    said += f"off) and furthest at {level_text(far, unit)} ({number(abs(miss[far]), 2)} {out})."
    below = [level for level in ends if linear.steady_torque(model, level) <= 0]
    if below:
        said += f" At {listed([level_text(level, unit) for level in below])} it ends below zero and is not drawn."
    return Ready(lambda: clutch.linear_model(data, fit), said)


def residuals_ready(model: str, kind: str, with_live: bool = False) -> Callable[..., Ready | None]:
    """Residual map of one model on the dataset of its kind."""

    def ready(results: Results, _asked: bool | None) -> Ready | None:
        data, fit = results.data_of(kind), results.fit(kind)
        if data is None or fit is None or getattr(fit, model) is None:
            return None
        rows = checks.residuals_of(data, fit, model)
        if not rows:
            return None
        found = checks.residual_map(rows)
        i, k = np.unravel_index(np.nanargmax(np.abs(found.mean)), found.mean.shape)
        said = "Mean of measured − model in stretches of time, a row a level. Furthest: "
        said += f"{number(float(found.mean[i, k]), 2)} {data.output_unit} at "
        said += f"{level_text(found.levels[i], data.input_unit)}, {number(float(found.edges_s[k]), 2)} to "
        said += f"{number(float(found.edges_s[k + 1]), 2)} s after the step."
        return Ready(
            lambda: checks.residuals(data, fit, model),
            said,
            (lambda: (live_fits.residuals(found, data.input_unit, data.output_unit),)) if with_live else None,
        )

    return ready


def shear_ready(results: Results, asked: bool | None) -> Ready | None:
    """Fig. 9, of the paper's kind of clutch only."""
    fit = results.fit("clutch")
    if fit is None or fit.nonlinear is None or not of_the_paper(fit.data, asked):
        return None
    field, stress = shear.shear_point(fit)
    said = f"The square is this clutch at {level_text(fit.nonlinear.u_range[1], fit.data.input_unit)}: "
    said += (
        f"{stress:.2f} kPa at {field:.2f} V/µm, {stress / field:.2f} kPa per V/µm; lines of half, equal and twice that."
    )
    return Ready(lambda: shear.shear_per_field(fit), said)


def gain_ready(results: Results, asked: bool | None) -> Ready | None:
    """Input gain of each level."""
    fit = results.fit("clutch")
    if fit is None or fit.linear is None:
        return None
    known = [(row.B, row.level) for row in fit.linear.per_level if row.B is not None]
    bounds = fit.linear.bounds
    if not known and (bounds is None or bounds.B_m is None):
        return None
    said = "Bounds of the input gain B (input per rate of output, 1/b0) that the robust gains are made for."
    if known:
        (low, at_low), (high, at_high) = min(known), max(known)
        unit = fit.data.input_unit
        said = f"The input gain B (1/b0: input per rate of output) lies between {number(low, 3)} at "
        said += f"{level_text(at_low, unit)} and {number(high, 3)} at {level_text(at_high, unit)}, a factor of "
        said += f"{number(high / low, 2)}." if low > 0 else "any size."
        if len(known) == 1:
            said = (
                f"The input gain B (1/b0: input per rate of output) is {number(low, 3)} at {level_text(at_low, unit)}."
            )
    return Ready(lambda: clutch.input_gain(fit, asked), said)


def _recorded_fit(results: Results) -> Fit | None:
    return next((one.result for one in results.fits if one.result.recorded is not None), None)


def recorded_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Logs fitted as recorded: input, measured, model, residual."""
    fit = _recorded_fit(results)
    logs = recorded.drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if fit is None or fit.recorded is None or not logs:
        return None
    units, count = (fit.data.input_unit, fit.data.output_unit), len(fit.recorded.logs)
    said = "The model is driven by the recorded input alone (free run)."
    if count > len(logs):
        said = f"{len(logs)} of {count} logs: the best, the middle and the worst followed. {said}"
    worst = max((one for one in logs if one.rmse is not None), key=lambda one: one.rmse or 0.0, default=None)
    if worst is not None and worst.fit_pct is not None and worst.one_step_pct is not None:
        said += f" {'Worst followed: ' + worst.name + ', ' if count > 1 else 'It is off by '}"
        said += f"{number(worst.rmse, 2)} {units[1]} (RMS); free-run fit {number(worst.fit_pct, 3)} %, from sample to "
        said += f"sample {number(worst.one_step_pct, 3)} %."
    return Ready(
        lambda: recorded.recorded_logs(logs, units), said,
        lambda: (live_replays.recorded(logs[-1].curve, units),) if len(logs) == 1 else (),
    )  # fmt: skip


def bode_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Frequency responses of recorded logs whose input moves."""
    fit = _recorded_fit(results)
    known = [one for one in fit.recorded.responses if one.frequency_hz] if fit and fit.recorded else []
    if fit is None or not known:
        return None
    shown = known[: recorded.MOST]
    first = shown[0]
    said = f"{len(shown)} of {len(known)} logs. " if len(known) > len(shown) else ""
    said += "Dots: output over input as recorded, grey: 95 %; lines: the models on the same input."
    if first.harmonics_pct is not None and first.model_harmonics_pct is not None:
        which = "" if len(known) == 1 else f" ({first.name})"
        said += f" Beyond any linear answer{which}: {number(first.harmonics_pct, 2)} % of the output, "
        said += f"{number(first.model_harmonics_pct, 2)} % of the nonlinear model's."
    return Ready(lambda: recorded.bode(shown, (fit.data.input_unit, fit.data.output_unit)), said)


def compare_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Two fits of one kind over each other."""
    if results.pair is None:
        return None
    first, second = results.pair
    rows = [
        {row.level: row for row in (one.result.friction.levels if one.result.friction else ())} for one in results.pair
    ]
    parted = []
    for name in ("Ts", "tau1", "tau2"):
        pairs = [(rows[0][u].ci95, rows[1][u].ci95, u) for u in rows[0] if u in rows[1]]
        ends = [(getattr(a, name), getattr(b, name), u) for a, b, u in pairs if a is not None and b is not None]
        apart = [u for a, b, u in ends if a is not None and b is not None and (a[1] < b[0] or b[1] < a[0])]
        if apart:
            unit = first.result.data.input_unit
            parted.append(f"{SYMBOLS[name]} at {with_unit(listed([f'{u:.4g}' for u in apart]), unit)}")
    said = "Their 95 % intervals part at no level."
    if parted:
        said = f"Their 95 % intervals part for {'; '.join(parted)}: more than repeats explain."
    return Ready(lambda: values.two_fits([(one.path, one.result) for one in (first, second)]), said)
