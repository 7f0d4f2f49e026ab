"""Figures of data and fits that the given results allow: how each is drawn, and the numbers of its caption."""

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure

from eaid.models import linear
from eaid.report.figures import apparatus, checks, clutch, edges, hold, level_steps, recorded, values
from eaid.report.figures import friction as frictions
from eaid.report.figures.steps import Model
from eaid.report.page import live_fits, live_replays
from eaid.report.ready import Ready, caption
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, level_text, level_values, of_the_paper
from eaid.report.tables.table import SYMBOLS
from eaid.results.fit import Fit


def main_kind(results: Results) -> str | None:
    """The kind that the page is about: the clutch where there is one."""
    return next(iter(results.kinds), None)


def models_for(results: Results, kind: str) -> dict[float, Model]:
    """Level → model curve of a kind: the nonlinear model, else the single levels' curves."""
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None or fit is None:
        return {}
    return clutch.models_of(fit, data) or frictions.curves_of(fit)


def pwm_ready(results: Results, asked: bool | None) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not of_the_paper(fit.data if fit is not None else data, asked):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    return Ready(lambda: apparatus.pwm_period(rig), caption("pwm")) if rig is not None else None


def hold_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 6, where the dataset of the page's kind holds releases."""
    kind = main_kind(results)
    data = results.data_of(kind) if kind else None
    held = hold.held_levels(data) if data is not None else []
    if data is None or not held:
        return None
    unit, out = data.input_unit, data.output_unit
    return Ready(lambda: hold.hold_and_release(held, unit, out), caption("held", top=held[0], unit=unit))


def friction_steps_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 3, from the force dataset, else the speed dataset; the fitted curves where there are any."""
    kind = "friction-force" if results.data_of("friction-force") is not None else "friction-speed"
    data, fit = results.data_of(kind), results.fit(kind)
    if data is None:
        return None
    models = frictions.curves_of(fit)
    rows = fit.friction.levels if fit is not None and fit.friction is not None else ()
    worst = max(((row.rmse / row.Ts, row.level) for row in rows if row.rmse is not None and row.Ts > 0), default=None)
    return Ready(
        lambda: frictions.friction_steps(data, fit),
        caption("friction_steps", worst=worst, unit=data.input_unit),
        lambda: (live_fits.steps(data, models),),
    )


def level_steps_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Steps from level to level, where some were recorded and fitted."""
    for one in results.data:
        data, fit = one.result, results.fit(one.result.kind)
        if fit is None or not (pairs := level_steps.paired(data, fit.steps)):
            continue
        worst = min((shape.fit_pct, level_steps.step_text(shape)) for _, shape in pairs if shape.fit_pct is not None)
        said = caption("level_steps", count=len(pairs), worst=worst)
        return Ready(lambda data=data, fit=fit: level_steps.level_steps(data, fit.steps), said)  # type: ignore[misc]
    return None


def steps_over_level_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Gain and time constants of steps from level to level over the level."""
    fit = next((one.result for one in results.fits if len(one.result.steps) > 1), None)
    if fit is None:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    edges = {edge: [s.gain for s in fit.steps if s.edge == edge and s.gain is not None] for edge in ("up", "down")}
    said = caption("steps_over_level", edges=edges, units=units)
    return Ready(lambda: level_steps.over_level(fit.steps, units), said)


def trends_ready(kind: str, draw: Callable[[Fit, bool | None], Figure]) -> Callable[..., Ready | None]:
    """Figs. 4 and 5, from a fit of their kind."""

    def ready(results: Results, asked: bool | None) -> Ready | None:
        fit = results.fit(kind)
        if fit is None or fit.friction is None or len(fit.friction.levels) < 2:
            return None
        said = caption("trends", rows=fit.friction.levels, unit=fit.data.input_unit, out=fit.data.output_unit)
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
    several = [row for row in data.levels if len(row.runs) > 1 and models]
    inside = [np.abs(row.mean - models[row.level](row.time_s)) <= row.sd for row in several]
    share = 100 * float(np.mean(np.concatenate(inside))) if inside else None
    said = caption("nonlinear", fitted=bool(models), inside_pct=share, out=data.output_unit)
    return Ready(lambda: clutch.nonlinear_model(data, fit), said, lambda: (live_fits.steps(data, models, notes),))


def over_duty_ready(results: Results, asked: bool | None) -> Ready | None:
    """Parameters over the level, with the estimates beside the one that is used."""
    fit = results.fit("clutch")
    if fit is None or fit.nonlinear is None or len(level_values(fit)) == 1:
        return None
    counts = []
    for name in ("Ts", "tau1", "tau2"):
        rows = [(row.level, getattr(row.ci95, name)) for row in level_values(fit) if row.ci95]
        known = [(level, ends) for level, ends in rows if ends is not None]
        if known:
            curve = values.values_over(fit.nonlinear, np.array([level for level, _ in known]))[name]
            met = sum(ends[0] <= value <= ends[1] for (_, ends), value in zip(known, curve, strict=True))
            counts.append(f"{SYMBOLS[name]} through {met} of {len(known)}")
    said = caption("over_duty", recorded=fit.recorded is not None, met=counts)
    return Ready(lambda: clutch.polynomials(fit, asked), said, lambda: live_fits.parameters(fit))


def linear_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Fig. 8, from the clutch dataset and its linear model."""
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None or fit is None or fit.linear is None:
        return None
    model = clutch.linear_of(fit.linear)
    goals = {row.level: linear.steady_torque(model, row.level) for row in data.levels}
    ends = {row.level: float(np.mean(row.mean[-max(1, len(row.mean) // 50) :])) for row in data.levels}
    missed = [(abs(goals[level] - end), level) for level, end in ends.items()]
    below = [level_text(level, data.input_unit) for level, goal in goals.items() if goal <= 0]
    units = {"unit": data.input_unit, "out": data.output_unit}
    said = caption("linear", near=min(missed), far=max(missed), below=below, **units)
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
        times = found.edges_s[k : k + 2].tolist()
        units = {"unit": data.input_unit, "out": data.output_unit}
        said = caption("residuals", value=float(found.mean[i, k]), level=found.levels[i], times=times, **units)
        live = lambda: (live_fits.residuals(found, data.input_unit, data.output_unit),)  # noqa: E731
        return Ready(lambda: checks.residuals(data, fit, model), said, live if with_live else None)

    return ready


def shear_ready(results: Results, asked: bool | None) -> Ready | None:
    """Fig. 9, of the paper's kind of clutch only."""
    fit = results.fit("clutch")
    if fit is None or fit.nonlinear is None or not of_the_paper(fit.data, asked):
        return None
    field, stress = apparatus.shear_point(fit)
    top, unit = fit.nonlinear.u_range[1], fit.data.input_unit
    return Ready(
        lambda: apparatus.shear_per_field(fit), caption("shear", field=field, stress=stress, level=top, unit=unit)
    )


def gain_ready(results: Results, asked: bool | None) -> Ready | None:
    """Input gain of each level."""
    fit = results.fit("clutch")
    if fit is None or fit.linear is None:
        return None
    known = [(row.B, row.level) for row in fit.linear.per_level if row.B is not None]
    bounds = fit.linear.bounds
    if not known and (bounds is None or bounds.B_m is None):
        return None
    return Ready(lambda: clutch.input_gain(fit, asked), caption("gain", known=known, unit=fit.data.input_unit))


def _recorded_fit(results: Results) -> Fit | None:
    return next((one.result for one in results.fits if one.result.recorded is not None), None)


def recorded_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Logs fitted as recorded: input, measured, model, residual."""
    fit = _recorded_fit(results)
    logs = recorded.drawn_logs(fit.recorded.logs) if fit is not None and fit.recorded is not None else []
    if fit is None or fit.recorded is None or not logs:
        return None
    units = fit.data.input_unit, fit.data.output_unit
    known = [one for one in logs if None not in (one.rmse, one.fit_pct, one.one_step_pct)]
    worst = min(known, key=lambda one: one.fit_pct or 0.0, default=None)
    said = caption("recorded", shown=len(logs), count=len(fit.recorded.logs), worst=worst, unit=units[1])
    live = lambda: (live_replays.recorded(logs[0].curve, units),)  # noqa: E731
    return Ready(lambda: recorded.recorded_logs(logs, units), said, live if len(logs) == 1 else None)


def edges_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Logs of closed loops: reference and output, and the edges by themselves."""
    logs = [log for log in results.edge_logs if log.edges]
    if not logs:
        return None
    every = [one for log in logs for one in log.edges]
    worst = max(one.overshoot_pct for one in every)
    said = caption(
        "edges", count=len(every), logs=len(results.edge_logs), rise=[one.rise_s for one in every], worst=worst
    )
    live = lambda: (live_replays.loop(logs[0].run),)  # noqa: E731
    return Ready(lambda: edges.edges_of_logs(logs), said, live if len(logs) == 1 else None)


def bode_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Frequency responses of recorded logs whose input moves."""
    fit = _recorded_fit(results)
    known = [one for one in fit.recorded.responses if one.frequency_hz] if fit and fit.recorded else []
    if fit is None or not known:
        return None
    shown = known[: recorded.MOST]
    told = next((one for one in shown if one.harmonics_pct is not None), shown[0])
    said = caption("bode", shown=len(shown), count=len(known), first=told)
    return Ready(lambda: recorded.bode(shown, (fit.data.input_unit, fit.data.output_unit)), said)


def compare_ready(results: Results, _asked: bool | None) -> Ready | None:
    """Two fits of one kind over each other."""
    if results.pair is None:
        return None
    first, second = results.pair
    rows: list[Mapping[float, object]] = [
        {row.level: row.ci95 for row in level_values(one.result)} for one in results.pair
    ]
    parted: dict[str, list[str]] = {}
    for name in ("Ts", "tau1", "tau2"):
        for level in rows[0]:
            a, b = (getattr(one.get(level), name, None) for one in rows)
            if a is not None and b is not None and (a[1] < b[0] or b[1] < a[0]):
                parted.setdefault(SYMBOLS[name], []).append(f"{level:.4g}")
    said = caption("compare", parted=parted, unit=first.result.data.input_unit)
    return Ready(lambda: values.two_fits([(one.path, one.result) for one in (first, second)]), said)
