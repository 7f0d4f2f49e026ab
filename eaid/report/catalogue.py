"""Every figure of the page: its name, what the eye should see, what it needs, who makes that, and who draws it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
from eaid.report.figures import checks, clutch, hold, pwm, rehab, replays, shear
from eaid.report.figures import compare as compared
from eaid.report.figures import friction as frictions
from eaid.report.figures.steps import level_text, quantity
from eaid.report.results import Data, Fit, Replay, Results
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


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str
    """File name without ending."""
    title: str
    sees: str
    """What the eye should see, in one sentence."""
    section: str
    """data, models, gains, replays, rehab or compare: where on the page it stands."""
    ready: Callable[[Results], Ready | None]
    """The figure, or None where its data were not given."""
    made_by: str
    """The command that makes what is missing."""


def _steps_live(data: StepSet, models: Mapping[float, Callable[[Array], Array]]) -> Live:
    levels = [(level_text(one.level, data.input_unit), one.time_s, one.mean_nm) for one in data.levels]
    fitted = [models.get(one.level) for one in data.levels]
    return lambda: live.steps(levels, fitted, quantity(data.output_unit), data.output_unit)


def _friction_models(fit: Fit | None) -> dict[float, Callable[[Array], Array]]:
    part = (fit.content.get("friction") or {}) if fit else {}
    share = float(part.get("C") or SHARE)
    return {
        float(row["level"]): (lambda t, p=frictions.curve_of(row, share): friction.step_response(p, t))
        for row in part.get("levels") or []
    }


def _pwm(results: Results) -> Ready | None:
    fit = results.fit("clutch")
    data = results.data_of("clutch")
    if fit is None and data is None:
        return None
    rig = apparatus_of(fit.content["data"]) if fit and fit.content.get("data") else data.steps.apparatus if data else None
    return Ready(lambda: pwm.pwm_period(rig)) if rig else None


def _friction_steps(results: Results) -> Ready | None:
    for kind in ("friction-force", "friction-speed"):
        data, fit = results.data_of(kind), results.fit(kind)
        if data is not None:
            part = fit.content.get("friction") if fit else None
            return Ready(
                lambda data=data, part=part: frictions.friction_steps(data.steps, part),  # type: ignore[misc]
                _steps_live(data.steps, _friction_models(fit)),
            )
    return None


def _over_stress(results: Results) -> Ready | None:
    fit = results.fit("friction-force")
    if fit is None or not (fit.content.get("friction") or {}).get("levels"):
        return None
    return Ready(lambda: frictions.friction_over_stress(fit.content))


def _over_speed(results: Results) -> Ready | None:
    fit = results.fit("friction-speed")
    if fit is None or not (fit.content.get("friction") or {}).get("levels"):
        return None
    return Ready(lambda: frictions.friction_over_speed(fit.content))


def _hold(results: Results) -> Ready | None:
    data = results.data_of("clutch")
    held = hold.held_levels(data.steps) if data else []
    if data is None or not held:
        return None
    note = f"At {level_text(held[0].level, data.steps.input_unit)}, {held[0].lost_pct:.1f} % is lost while held and {held[0].left_pct:.1f} % is left at the end."
    return Ready(lambda: hold.hold_and_release(held, data.steps.input_unit, data.steps.output_unit), note=note)


def _nonlinear(results: Results) -> Ready | None:
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None:
        return None
    content = fit.content if fit and fit.content.get("nonlinear") else None
    models: dict[float, Callable[[Array], Array]] = {}
    note = ""
    if content is not None:
        model = clutch.nonlinear_of(content)
        models = {one.level: (lambda t, u=one.level: nonlinear.step_response(model, t, u)) for one in data.steps.levels}
        error = content["nonlinear"].get("abs_error") or {}
        if error.get("mean") is not None and error.get("sd") is not None:
            note = f"Overall absolute error {error['mean']:.3f} ± {error['sd']:.3f} N·m; published 0.065 ± 0.059."
    return Ready(lambda: clutch.nonlinear_model(data.steps, content), _steps_live(data.steps, models), note)


def _linear(results: Results) -> Ready | None:
    data, fit = results.data_of("clutch"), results.fit("clutch")
    if data is None or fit is None or not fit.content.get("linear"):
        return None
    model = clutch.linear_of(fit.content)
    models = {one.level: (lambda t, u=one.level: linear.step_response(model, t, u)) for one in data.steps.levels}
    return Ready(lambda: clutch.linear_model(data.steps, fit.content), _steps_live(data.steps, models))


def _with(results: Results, part: str, draw: Callable[[Mapping[str, Any]], Figure]) -> Ready | None:
    fit = results.fit("clutch")
    return Ready(lambda: draw(fit.content)) if fit is not None and fit.content.get(part) else None


def _residuals(model: str, kind: str) -> Callable[[Results], Ready | None]:
    def ready(results: Results) -> Ready | None:
        data, fit = results.data_of(kind), results.fit(kind)
        if data is None or fit is None or not fit.content.get(model):
            return None
        if not checks.residuals_of(data.steps, fit.content, model):
            return None
        return Ready(lambda: checks.residuals(data.steps, fit.content, model))

    return ready


def _replay(scenario: str, draw: Callable[[Replay], Figure], with_error: bool) -> Callable[[Results], Ready | None]:
    def ready(results: Results) -> Ready | None:
        found = results.replay(scenario)
        return Ready(lambda: draw(found), lambda: live.tracking(found.traces, with_error)) if found else None

    return ready


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
            found[name] = {key: np.array([row[key] for row in rows]) for key in ("frequency_hz", "gain_db", "mean_abs_error_nm")}
    return found


def _tones(trace: Mapping[str, Array]) -> list[dict[str, Any]]:
    """The sweep measured on its trace, where a file holds no numbers but the reference is the default one."""
    t = trace["time_s"]
    dt = float(t[1] - t[0])
    default = references.sweep(dt)
    if len(default.torque_nm) != len(t) or not np.allclose(default.torque_nm, trace["reference_nm"], atol=1e-6):
        return []
    return [
        tone(trace["reference_nm"][part.begin : part.end], trace["torque_nm"][part.begin : part.end], part.frequency_hz, dt)
        for part in default.tones
    ]


def _sweep(results: Results) -> Ready | None:
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


def _training(results: Results) -> Ready | None:
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


def _errors(results: Results) -> Ready | None:
    found = results.replay("rehab")
    values = position_errors(found) if found else {}
    return Ready(lambda: rehab.errors(values)) if values else None


def _compare(results: Results) -> Ready | None:
    pair = two_alike(results)
    if pair is None:
        return None
    first, second = pair
    return Ready(
        lambda: compared.two_fits(first.content, second.content, (first.source.path, second.source.path))
    )


def two_alike(results: Results) -> tuple[Fit, Fit] | None:
    """The first two fits of one kind: those that are put side by side."""
    for i, first in enumerate(results.fits):
        for second in results.fits[i + 1 :]:
            if first.kind == second.kind:
                return first, second
    return None


FIGURES: tuple[Row, ...] = (
    Row("fig02_pwm", "Fig. 2 · One PWM period", "Voltage alternates in sign, so no charge builds up, while the ideal torque does not care about the sign.", "data", _pwm, "eaid fit clutch.h5"),
    Row("fig06_hold_and_release", "Fig. 6 · Torque while held and after release", "A good drive holds its torque while the input is on and leaves nothing behind afterwards.", "data", _hold, "eaid ingest LOGS (with the release recorded) -o data.h5"),
    Row("fig03_friction_steps", "Fig. 3 · Friction steps", "Torque rises fast to most of its final value, then creeps; each dashed curve should lie on its solid one.", "models", _friction_steps, "eaid ingest FRICTION-LOGS -o friction-force.h5"),
    Row("fig04_friction_over_stress", "Fig. 4 · Friction over the normal stress", "Steady torque grows along a line, while both time constants are long at low stress and short at high stress.", "models", _over_stress, "eaid fit friction-force.h5 -o friction-force.json"),
    Row("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed", "Steady torque dips and then rises slowly with speed; the time constants change little beyond the slowest speeds.", "models", _over_speed, "eaid fit friction-speed.h5 -o friction-speed.json"),
    Row("fig07_nonlinear_model", "Fig. 7 · Nonlinear model", "Each dashed model curve should stay inside the shaded band of its level; the number after the duty is the root-mean-square error in N·m.", "models", _nonlinear, "eaid ingest CLUTCH-LOGS -o clutch.h5"),
    Row("model_over_duty", "Model parameters over the duty", "The joint curve should pass through the intervals of the single levels; where it does not, the polynomial is too stiff or the runs scatter.", "models", lambda r: _with(r, "nonlinear", clutch.polynomials), "eaid fit clutch.h5 -o fit.json"),
    Row("fig08_linear_model", "Fig. 8 · Linear model", "One straight-line model for all duties meets the data at two duties only and misses everywhere else, which is what the robust controller has to make up for.", "models", _linear, "eaid fit clutch.h5 -o fit.json"),
    Row("residuals_nonlinear", "What the nonlinear model leaves", "Residuals should scatter around zero without a trend, and their autocorrelation should fall to zero within a short lag.", "models", _residuals("nonlinear", "clutch"), "eaid fit clutch.h5 -o fit.json"),
    Row("residuals_linear", "What the linear model leaves", "The residuals are large and all of one sign within a level: the linear model is a tool for control design, not a description.", "models", _residuals("linear", "clutch"), "eaid fit clutch.h5 -o fit.json"),
    Row("residuals_friction_force", "What the friction curves leave, over force", "Each level has a curve of its own, so only noise and the rotor's ripple should be left.", "models", _residuals("friction", "friction-force"), "eaid fit friction-force.h5 -o friction-force.json"),
    Row("residuals_friction_speed", "What the friction curves leave, over speed", "Each level has a curve of its own, so only noise and the rotor's ripple should be left.", "models", _residuals("friction", "friction-speed"), "eaid fit friction-speed.h5 -o friction-speed.json"),
    Row("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field", "The square is this clutch at its highest duty; the further above a line, the more friction per field.", "models", lambda r: _with(r, "nonlinear", shear.shear_per_field), "eaid fit clutch.h5 -o fit.json"),
    Row("input_gain", "Input gain of each level", "B is far from constant over the duty; its least and largest value are what the robust gains are made for.", "gains", lambda r: _with(r, "linear", clutch.input_gain), "eaid fit clutch.h5 -o fit.json"),
    Row("fig11_steps", "Fig. 11 · Steps", "The robust controller (RC) should reach each step with less overshoot than the PI; the last fall is slow for both, as the duty cannot go below zero.", "replays", _replay("steps", lambda r: replays.steps(r.traces), with_error=False), "eaid simulate fit.json --gains gains.json --scenario steps -o steps.h5"),
    Row("fig12_multisine", "Fig. 12 · Sum of sines", "The RC's error band is several times narrower than the PI's.", "replays", _replay("multisine", lambda r: replays.tracking(r.traces, counted_from(r)), with_error=True), "eaid simulate fit.json --gains gains.json --scenario multisine -o multisine.h5"),
    Row("fig13_sweep", "Fig. 13 · Sines of rising frequency", "A good controller stays at 0 dB as far to the right as the duty allows; the PI overshoots near 0.6 Hz.", "replays", _sweep, "eaid simulate fit.json --gains gains.json --scenario sweep -o sweep.h5"),
    Row("fig16_rehab", "Fig. 16 · Elbow rehabilitation", "Rendered torque lies on the desired torque in all three modes, while the position error grows with the stiffness.", "rehab", _training, "eaid simulate fit.json --gains gains.json --scenario rehab -o rehab.h5"),
    Row("fig17_rehab_errors", "Fig. 17 · Position error by mode", "The hard mode has the largest position error; whether soft and assisted differ is for the tests below to say.", "rehab", _errors, "eaid simulate fit.json --gains gains.json --scenario rehab -o rehab.h5"),
    Row("compare", "Two fits over each other", "Points whose intervals do not touch differ by more than repeats explain.", "compare", _compare, "eaid report A/fit.json B/fit.json"),
)  # fmt: skip
"""In the order of the page."""
