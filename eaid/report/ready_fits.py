"""Figures of data and fits: how each is drawn from what its row of the catalogue needs, and its caption."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.models import linear
from eaid.report.edge_logs import EdgeLog
from eaid.report.figures import apparatus, checks, clutch, edges, hold, level_steps, recorded, values
from eaid.report.figures import friction as frictions
from eaid.report.figures.steps import Model, end_of
from eaid.report.page import live_fits, live_replays
from eaid.report.ready import Ready, caption
from eaid.report.results import Given, Results
from eaid.report.rig import apparatus_of, level_text, level_values, of_the_paper
from eaid.report.tables.table import SYMBOLS
from eaid.results.common import Interval
from eaid.results.fit import Fit
from eaid.steps.stepset import StepSet


def models_for(fit: Fit | None, data: StepSet | None) -> dict[float, Model]:
    """Level → model curve of a fit: the nonlinear model, else the single levels' curves."""
    return (clutch.models_of(fit, data) or frictions.curves_of(fit)) if data is not None and fit is not None else {}


def pwm(results: Results) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not of_the_paper(fit.data if fit is not None else data, results.paper):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    return Ready(lambda: apparatus.pwm_period(rig), caption("pwm")) if rig is not None else None


def held(data: StepSet) -> Ready | None:
    """Fig. 6, where the dataset holds releases."""
    levels, unit = hold.held_levels(data), data.input_unit
    if not levels:
        return None
    said = caption("held", top=levels[0], unit=unit)
    return Ready(lambda: hold.hold_and_release(levels, unit, data.output_unit), said)


def friction_steps(results: Results) -> Ready | None:
    """Fig. 3, from the force dataset, else the speed dataset; the fitted curves where there are any."""
    kind = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None:
        return None
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    worst = max(((row.rmse / row.Ts, row.level) for row in rows if row.rmse is not None and row.Ts > 0), default=None)
    said = caption("friction_steps", worst=worst, unit=data.input_unit)
    live = lambda: (live_fits.steps(data, frictions.curves_of(fit)),)  # noqa: E731
    return Ready(lambda: frictions.friction_steps(data, fit), said, live)


def steps_between(results: Results) -> Ready | None:
    """Steps from level to level, where some were recorded and fitted."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is not None and (pairs := level_steps.paired(data, fit.steps)):
            shares = [(shape.fit_pct, level_steps.step_text(shape)) for _, shape in pairs if shape.fit_pct is not None]
            said = caption("level_steps", count=len(pairs), worst=min(shares))
            return Ready(partial(level_steps.level_steps, data, fit.steps), said)
    return None


def steps_over_level(results: Results) -> Ready | None:
    """Gain and time constants of steps from level to level over the level."""
    fit = next((one.result for one in results.fits if len(one.result.steps) > 1), None)
    if fit is None:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    gains = {edge: [s.gain for s in fit.steps if s.edge == edge and s.gain is not None] for edge in ("up", "down")}
    return Ready(
        lambda: level_steps.over_level(fit.steps, units), caption("steps_over_level", edges=gains, units=units)
    )


def trends(draw: Callable[[Fit, bool | None], Figure], fit: Fit, results: Results) -> Ready | None:
    """Figs. 4 and 5: what was fitted over stress or speed."""
    if fit.friction is None or len(fit.friction.levels) < 2:
        return None
    said = caption("trends", rows=fit.friction.levels, unit=fit.data.input_unit, out=fit.data.output_unit)
    title = "" if of_the_paper(fit.data, results.paper) else "Fitted values over the level"
    return Ready(lambda: draw(fit, results.paper), said, title=title)


def nonlinear(data: StepSet, results: Results) -> Ready:
    """Fig. 7, from the clutch dataset; the model where it was fitted."""
    fit = results.fit("clutch")
    models = clutch.models_of(fit, data)
    notes = clutch.rmse_notes(fit.nonlinear.per_level) if fit is not None and fit.nonlinear is not None else {}
    several = [row for row in data.levels if len(row.runs) > 1 and models]
    inside = [np.abs(row.mean - models[row.level](row.time_s)) <= row.sd for row in several]
    share = 100 * float(np.mean(np.concatenate(inside))) if inside else None
    said = caption("nonlinear", fitted=bool(models), inside_pct=share, out=data.output_unit)
    return Ready(lambda: clutch.nonlinear_model(data, fit), said, lambda: (live_fits.steps(data, models, notes),))


def over_level(fit: Fit, results: Results) -> Ready | None:
    """Parameters over the level, with the estimates beside the one that is used."""
    rows = level_values(fit)
    if fit.nonlinear is None or len(rows) == 1:
        return None
    counts = []
    for name in values.NAMES:
        known = [(row.level, ends) for row in rows if row.ci95 and (ends := getattr(row.ci95, name)) is not None]
        if known:
            curve = values.values_over(fit.nonlinear, np.array([level for level, _ in known]))[name]
            met = sum(ends[0] <= value <= ends[1] for (_, ends), value in zip(known, curve, strict=True))
            counts.append(f"{SYMBOLS[name]} through {met} of {len(known)}")
    said = caption("over_duty", recorded=fit.recorded is not None, met=counts)
    return Ready(lambda: clutch.polynomials(fit, results.paper), said, lambda: live_fits.parameters(fit))


def linear_model(data: StepSet, fit: Fit) -> Ready | None:
    """Fig. 8, from the clutch dataset and its linear model."""
    if fit.linear is None:
        return None
    model = clutch.linear_of(fit.linear)
    goals = {row.level: linear.steady_torque(model, row.level) for row in data.levels}
    missed = [(abs(goals[row.level] - end_of(row.mean)), row.level) for row in data.levels]
    below = [level_text(level, data.input_unit) for level, goal in goals.items() if goal <= 0]
    units = {"unit": data.input_unit, "out": data.output_unit}
    said = caption("linear", near=min(missed), far=max(missed), below=below, **units)
    return Ready(lambda: clutch.linear_model(data, fit), said)


def residuals(model: str, with_live: bool, data: StepSet, fit: Fit) -> Ready | None:
    """Residual map of one model on the dataset of its kind."""
    rows = checks.residuals_of(data, fit, model) if getattr(fit, model) is not None else []
    if not rows:
        return None
    shown = checks.residual_map(rows)
    i, k = np.unravel_index(np.nanargmax(np.abs(shown.mean)), shown.mean.shape)
    times = shown.edges_s[k : k + 2].tolist()
    units = data.input_unit, data.output_unit
    said = caption(
        "residuals", value=float(shown.mean[i, k]), level=shown.levels[i], times=times, unit=units[0], out=units[1]
    )
    live = (lambda: (live_fits.residuals(shown, *units),)) if with_live else None
    return Ready(lambda: checks.residuals(data, fit, model), said, live)


def shear(fit: Fit, results: Results) -> Ready | None:
    """Fig. 9, of the paper's kind of clutch only."""
    if fit.nonlinear is None or not of_the_paper(fit.data, results.paper):
        return None
    field, stress = apparatus.shear_point(fit)
    top, unit = fit.nonlinear.u_range[1], fit.data.input_unit
    said = caption("shear", field=field, stress=stress, level=top, unit=unit)
    return Ready(lambda: apparatus.shear_per_field(fit), said)


def input_gain(fit: Fit, results: Results) -> Ready | None:
    """Input gain of each level."""
    bounds = fit.linear.bounds if fit.linear is not None else None
    known = [(row.B, row.level) for row in fit.linear.per_level if row.B is not None] if fit.linear is not None else []
    if not known and (bounds is None or bounds.B_m is None):
        return None
    return Ready(lambda: clutch.input_gain(fit, results.paper), caption("gain", known=known, unit=fit.data.input_unit))


def recorded_logs(fit: Fit) -> Ready | None:
    """Logs fitted as recorded: input, measured, model, residual."""
    every = fit.recorded.logs if fit.recorded is not None else ()
    logs = recorded.drawn_logs(every)
    if not logs:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    known = [one for one in logs if None not in (one.rmse, one.fit_pct, one.one_step_pct)]
    worst = min(known, key=lambda one: one.fit_pct or 0.0, default=None)
    said = caption("recorded", shown=len(logs), count=len(every), worst=worst, unit=units[1])
    live = (lambda: (live_replays.recorded(logs[0].curve, units),)) if len(logs) == 1 else None
    return Ready(lambda: recorded.recorded_logs(logs, units), said, live)


def edges_of_logs(logs: Sequence[EdgeLog]) -> Ready | None:
    """Logs of closed loops: reference and output, and the edges by themselves."""
    shown = [log for log in logs if log.edges]
    every = [one for log in shown for one in log.edges]
    if not every:
        return None
    worst = max(one.overshoot_pct for one in every)
    said = caption("edges", count=len(every), logs=len(logs), rise=[one.rise_s for one in every], worst=worst)
    live = (lambda: (live_replays.loop(shown[0].run),)) if len(shown) == 1 else None
    return Ready(lambda: edges.edges_of_logs(shown), said, live)


def bode(fit: Fit) -> Ready | None:
    """Frequency responses of recorded logs whose input moves."""
    known = [one for one in fit.recorded.responses if one.frequency_hz] if fit.recorded is not None else []
    if not known:
        return None
    shown = known[: recorded.MOST]
    first = next((one for one in shown if one.harmonics_pct is not None), shown[0])
    said = caption("bode", shown=len(shown), count=len(known), first=first)
    return Ready(lambda: recorded.bode(shown, (fit.data.input_unit, fit.data.output_unit)), said)


def compared(pair: tuple[Given[Fit], Given[Fit]]) -> Ready:
    """Two fits of one kind over each other."""
    rows: list[Mapping[float, object]] = [{row.level: row.ci95 for row in level_values(one.result)} for one in pair]
    parted: dict[str, list[str]] = {}
    for name in values.NAMES:
        for level in rows[0]:
            a, b = (getattr(one.get(level), name, None) for one in rows)
            if _apart(a, b):
                parted.setdefault(SYMBOLS[name], []).append(f"{level:.4g}")
    said = caption("compare", parted=parted, unit=pair[0].result.data.input_unit)
    return Ready(lambda: values.two_fits([(one.path, one.result) for one in pair]), said)


def _apart(a: Interval, b: Interval) -> bool:
    return a is not None and b is not None and (a[1] < b[0] or b[1] < a[0])
