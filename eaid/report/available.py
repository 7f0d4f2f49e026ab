"""Which figures the given results allow, and how each is drawn."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.models import friction, linear, nonlinear
from eaid.models.parameters import SHARE
from eaid.replay import references
from eaid.replay.metrics import tone
from eaid.replay.rehab import MODES
from eaid.report import live
from eaid.report.figures import checks, clutch, hold, pwm, rehab, replays
from eaid.report.figures import compare as compared
from eaid.report.figures import friction as frictions
from eaid.report.figures.steps import level_text, quantity
from eaid.report.results import Fit, Replay, Results
from eaid.report.rig import apparatus_of
from eaid.steps.stepset import StepSet

Draw = Callable[[], Figure]
Live = Callable[[], dict[str, Any]]


@dataclass(frozen=True)
class Ready:
    """A figure whose data are at hand."""

    draw: Draw
    live: Live | None = None
    note: str = ""
    """One more sentence, with this figure's own numbers."""


def _steps_live(
    data: StepSet,
    models: Mapping[float, Callable[[Array], Array]],
    spread: bool = False,
    notes: Mapping[float, str] | None = None,
) -> Live:
    names = [level_text(one.level, data.input_unit) for one in data.levels]
    levels = [(name, one.time_s, one.mean) for name, one in zip(names, data.levels, strict=True)]
    texts = [f", RMSE {notes[one.level]}" if notes and one.level in notes else "" for one in data.levels]
    fitted = [models.get(one.level) for one in data.levels]
    bands = [one.sd if spread and len(one.runs) > 1 else None for one in data.levels]
    return lambda: live.steps(levels, fitted, quantity(data.output_unit), data.output_unit, bands, texts)


def _friction_models(fit: Fit | None) -> dict[float, Callable[[Array], Array]]:
    part = (fit.content.get("friction") or {}) if fit else {}
    share = float(part.get("C") or SHARE)
    return {
        float(row["level"]): partial(friction.step_response, frictions.curve_of(row, share))
        for row in part.get("levels") or []
    }


def pwm_ready(results: Results) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit = results.fit("clutch")
    data = results.data_of("clutch")
    if fit is None and data is None:
        return None
    rig = (
        apparatus_of(fit.content["data"]) if fit and fit.content.get("data") else data.steps.apparatus if data else None
    )
    return Ready(lambda: pwm.pwm_period(rig)) if rig else None


def friction_steps_ready(results: Results) -> Ready | None:
    """Fig. 3, from the force dataset, else the speed dataset; the fitted curves where there are any."""
    for kind in ("friction-force", "friction-speed"):
        data, fit = results.data_of(kind), results.fit(kind)
        if data is not None:
            part = fit.content.get("friction") if fit else None
            return Ready(
                lambda data=data, part=part: frictions.friction_steps(data.steps, part),  # type: ignore[misc]
                _steps_live(data.steps, _friction_models(fit)),
            )
    return None


def over_stress_ready(results: Results) -> Ready | None:
    """Fig. 4, from a fit of the force set."""
    fit = results.fit("friction-force")
    if fit is None or not (fit.content.get("friction") or {}).get("levels"):
        return None
    return Ready(lambda: frictions.friction_over_stress(fit.content))


def over_speed_ready(results: Results) -> Ready | None:
    """Fig. 5, from a fit of the speed set."""
    fit = results.fit("friction-speed")
    if fit is None or not (fit.content.get("friction") or {}).get("levels"):
        return None
    return Ready(lambda: frictions.friction_over_speed(fit.content))


def hold_ready(results: Results) -> Ready | None:
    """Fig. 6, where the clutch dataset holds releases."""
    data = results.data_of("clutch")
    held = hold.held_levels(data.steps) if data else []
    if data is None or not held:
        return None
    top = held[0]
    note = (
        f"At {level_text(top.level, data.steps.input_unit)}, {top.lost_pct:.1f} % is lost while held and "
        f"{top.left_pct:.1f} % is left at the end."
    )
    return Ready(lambda: hold.hold_and_release(held, data.steps.input_unit, data.steps.output_unit), note=note)


def nonlinear_ready(results: Results) -> Ready | None:
    """Fig. 7, from the clutch dataset; the model where it was fitted."""
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None:
        return None
    content = fit.content if fit and fit.content.get("nonlinear") else None
    models: dict[float, Callable[[Array], Array]] = {}
    note = ""
    errors: dict[float, str] = {}
    if content is not None:
        errors = clutch.rmse_notes(content["nonlinear"].get("per_level"))
        model = clutch.nonlinear_of(content)
        models = {one.level: partial(nonlinear.step_response, model, duty_pct=one.level) for one in data.steps.levels}
        error = content["nonlinear"].get("abs_error") or {}
        if error.get("mean") is not None and error.get("sd") is not None:
            note = f"Overall absolute error {error['mean']:.3f} ± {error['sd']:.3f} N·m; published 0.065 ± 0.059."
    return Ready(
        lambda: clutch.nonlinear_model(data.steps, content),
        _steps_live(data.steps, models, spread=True, notes=errors),
        note,
    )


def linear_ready(results: Results) -> Ready | None:
    """Fig. 8, from the clutch dataset and its linear model."""
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None or fit is None or not fit.content.get("linear"):
        return None
    model = clutch.linear_of(fit.content)
    models = {one.level: partial(linear.step_response, model, duty_pct=one.level) for one in data.steps.levels}
    return Ready(lambda: clutch.linear_model(data.steps, fit.content), _steps_live(data.steps, models))


def with_ready(results: Results, part: str, draw: Callable[[Mapping[str, Any]], Figure]) -> Ready | None:
    """A figure that needs one model of the clutch fit and no data."""
    fit = results.fit("clutch")
    return Ready(lambda: draw(fit.content)) if fit is not None and fit.content.get(part) else None


def residuals_ready(model: str, kind: str) -> Callable[[Results], Ready | None]:
    """Residuals of one model on the dataset of its kind."""

    def ready(results: Results) -> Ready | None:
        data, fit = results.data_of(kind), results.fit(kind)
        if data is None or fit is None or not fit.content.get(model):
            return None
        if not checks.residuals_of(data.steps, fit.content, model):
            return None
        return Ready(lambda: checks.residuals(data.steps, fit.content, model))

    return ready


def replay_ready(
    scenario: str, draw: Callable[[Replay], Figure], with_error: bool
) -> Callable[[Results], Ready | None]:
    """Time plots of one scenario, with or without a panel of the error."""

    def ready(results: Results) -> Ready | None:
        found = results.replay(scenario)
        return Ready(lambda: draw(found), lambda: live.tracking(found.traces, with_error)) if found else None

    return ready


def bands(replay: Replay) -> dict[str, tuple[Array, Array, Array]]:
    """Time [s] and the 2.5 % and 97.5 % torques [N·m] of each controller over drawn plants, where there are any."""
    quantiles = [float(q) for q in replay.options.get("band_quantiles") or []]
    if 0.025 not in quantiles or 0.975 not in quantiles:
        return {}
    low, high = quantiles.index(0.025), quantiles.index(0.975)
    return {
        name: (table["plants/band_time_s"], table["plants/band_nm"][low], table["plants/band_nm"][high])
        for name, table in replay.tables.items()
        if "plants/band_nm" in table
    }


def log_ready(results: Results) -> Ready | None:
    """Recorded duty through the model: at most six runs, spread over the torques."""
    found = results.replay("log")
    if found is None:
        return None
    compared = {
        name: trace
        for name, trace in found.traces.items()
        if (found.summary.get(name) or {}).get("reference_is") == "recorded torque"
    }
    by_torque = sorted(compared, key=lambda name: float(np.max(compared[name]["reference_nm"])))
    places = sorted({round(k * (len(by_torque) - 1) / 5) for k in range(6)}) if by_torque else []
    chosen = {by_torque[place]: compared[by_torque[place]] for place in places}
    return Ready(lambda: replays.recorded_duty(chosen)) if chosen else None


def guarantee_ready(results: Results) -> Ready | None:
    """The guarantee watched in a replay with the robust controller."""
    order = sorted(results.replays, key=lambda replay: replay.scenario != "multisine")
    for replay in order:
        trace = replay.traces.get("rc")
        if trace is not None and {"chi_nm_s", "rho_nm_s"} <= set(trace) and replay.scenario != "rehab":
            share = (replay.summary.get("rc") or {}).get("guarantee_holds_fraction")
            note = f"It covers the need {100 * share:.1f} % of the time in this replay." if share is not None else ""
            return Ready(partial(replays.guarantee, trace), note=note)
    return None


def counted_from(replay: Replay) -> float:
    """Instant from which a replay's errors count [s]."""
    for numbers in replay.summary.values():
        if isinstance(value := numbers.get("counted_from_s"), int | float):
            return float(value)
    return 5.0 if replay.scenario == "multisine" else 0.0


def frequencies(replay: Replay) -> dict[str, dict[str, Array]]:
    """Frequency [Hz], gain [dB] and mean absolute error [N·m] of each controller of a sweep, each of shape (F,)."""
    found = {}
    for name, trace in replay.traces.items():
        rows = (replay.summary.get(name) or {}).get("frequencies") or _tones(trace)
        rows = [row for row in rows if row.get("gain_db") is not None]
        if rows:
            found[name] = {
                key: np.array([row[key] for row in rows]) for key in ("frequency_hz", "gain_db", "mean_abs_error_nm")
            }
    return found


def _tones(trace: Mapping[str, Array]) -> list[dict[str, Any]]:
    """The sweep measured on its trace, where a file holds no numbers but the reference is the default one."""
    t = trace["time_s"]
    dt = float(t[1] - t[0])
    default = references.sweep(dt)
    if len(default.torque_nm) != len(t) or not np.allclose(default.torque_nm, trace["reference_nm"], atol=1e-6):
        return []
    return [
        tone(
            trace["reference_nm"][part.begin : part.end],
            trace["torque_nm"][part.begin : part.end],
            part.frequency_hz,
            dt,
        )
        for part in default.tones
    ]


def sweep_ready(results: Results) -> Ready | None:
    """Fig. 13, from the sweep's tones."""
    found = results.replay("sweep")
    rows = frequencies(found) if found else {}
    return Ready(lambda: replays.sweep(rows)) if rows else None


def rehab_trace(replay: Replay) -> Mapping[str, Array] | None:
    """The first controller's trace that holds angle and target; RC where it is there."""
    order = sorted(replay.traces, key=lambda name: name != "rc")
    return next((replay.traces[name] for name in order if "angle_deg" in replay.traces[name]), None)


def mode_names(trace: Mapping[str, Array]) -> list[str]:
    """Mode of each sample: soft, hard or assisted."""
    return [MODES[int(code)] if 0 <= int(code) < len(MODES) else str(int(code)) for code in trace["mode"]]


def training_ready(results: Results) -> Ready | None:
    """Fig. 16, from the rehabilitation replay."""
    found = results.replay("rehab")
    trace = rehab_trace(found) if found else None
    if trace is None:
        return None
    spans = rehab.mode_spans(trace["time_s"], mode_names(trace))
    return Ready(lambda: rehab.training(trace, spans), lambda: live.training(trace))


def position_errors(replay: Replay) -> dict[str, Array]:
    """Absolute position error [°] of each mode, without its first seconds."""
    trace = rehab_trace(replay)
    if trace is None:
        return {}
    skip = float(replay.options.get("uncounted_s", 5.0))
    found = {}
    t = trace["time_s"]
    for name, start, end in rehab.mode_spans(t, mode_names(trace)):
        counted = (t >= start + skip - 1e-9) & (t <= end)
        if counted.any():
            found[name] = np.abs(trace["target_deg"] - trace["angle_deg"])[counted]
    return found


def errors_ready(results: Results) -> Ready | None:
    """Fig. 17, from the rehabilitation replay."""
    found = results.replay("rehab")
    values = position_errors(found) if found else {}
    return Ready(lambda: rehab.errors(values)) if values else None


def compare_ready(results: Results) -> Ready | None:
    """Two fits of one kind over each other."""
    pair = two_alike(results)
    if pair is None:
        return None
    first, second = pair
    return Ready(lambda: compared.two_fits(first.content, second.content, (first.source.path, second.source.path)))


def two_alike(results: Results) -> tuple[Fit, Fit] | None:
    """The first two fits of one kind: those that are put side by side."""
    for i, first in enumerate(results.fits):
        for second in results.fits[i + 1 :]:
            if first.kind == second.kind:
                return first, second
    return None
