"""Figures of replays: how each is drawn from what its row of the catalogue needs, and the numbers of its caption."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from eaid.arrays import Array
from eaid.replay import references
from eaid.replay.metrics import tone
from eaid.replay.rehab import MODES
from eaid.report.figures import coupling, rehab, replays
from eaid.report.figures.steps import some_levels
from eaid.report.page import live_replays
from eaid.report.ready import Ready, caption
from eaid.report.results import Given
from eaid.report.style import controller_name
from eaid.report.tables.replays import metric
from eaid.report.tables.table import number
from eaid.results.coupling import Coupling
from eaid.results.metrics import ToneMetrics
from eaid.results.replay import Replay


def units_of(replay: Replay) -> tuple[str, str]:
    """Units of input and output."""
    return replay.head.input_unit, replay.head.output_unit


def traces_of(replay: Replay) -> dict[str, Mapping[str, Array]]:
    """Controller → its columns."""
    return {name: one.columns for name, one in replay.records.items()}


def errors_say(replay: Replay) -> str:
    """The largest error of each controller, and by how much the best of them is better."""
    errors = sorted((value, name) for name in replay.records if (value := metric(replay, name, "max_abs_error_nm")))
    named = [(value, controller_name(name)) for value, name in errors]
    return caption("errors", found=named, unit=replay.head.output_unit)


def walls(couplings: Sequence[Given[Coupling]]) -> Ready | None:
    """How stiff a virtual wall each loop may render."""
    if not couplings or not couplings[0].result.walls:
        return None
    first = couplings[0].result
    at = coupling.middle_torque(first)
    passive = [
        f"{controller_name(wall.loop)} {number(wall.K_passive, 3)}"
        for wall in first.walls
        if wall.torque_nm == at and wall.loop in coupling.SHOWN
    ]
    return Ready(lambda: coupling.walls(first), caption("walls", at=at, unit=first.output_unit, walls=passive))


def steps(replay: Replay) -> Ready:
    """Fig. 11: steps."""
    each = []
    for name, one in replay.records.items():
        shares = [step.overshoot_pct for step in one.metrics.steps if step.overshoot_pct is not None]
        if shares:
            each.append(f"{controller_name(name)} {number(max(shares), 2)} %")
    traces, units = traces_of(replay), units_of(replay)
    said = caption("steps", overshoots=each, errors=errors_say(replay))
    live = lambda: (live_replays.tracking(traces, units, with_error=False),)  # noqa: E731
    return Ready(partial(replays.tracking, traces, units=units, with_error=False), said, live)


def tracking(replay: Replay) -> Ready:
    """Figs. 12 and the like: output, error and input over time."""
    traces, units = traces_of(replay), units_of(replay)
    draw = partial(replays.tracking, traces, counted_from(replay), bands(replay), units)
    return Ready(draw, errors_say(replay), lambda: (live_replays.tracking(traces, units),))


def bands(replay: Replay) -> dict[str, tuple[Array, Array, Array]]:
    """Time [s] and the 2.5 % and 97.5 % outputs of each controller over drawn plants, where there are any."""
    quantiles = replay.head.band_quantiles
    if 0.025 not in quantiles or 0.975 not in quantiles:
        return {}
    low, high = quantiles.index(0.025), quantiles.index(0.975)
    return {
        name: (one.tables["plants/band_time_s"], one.tables["plants/band_nm"][low], one.tables["plants/band_nm"][high])
        for name, one in replay.records.items()
        if "plants/band_nm" in one.tables
    }


def counted_from(replay: Replay) -> float:
    """Instant from which a replay's errors count [s]."""
    said = [one.metrics.counted_from_s for one in replay.records.values()] + [replay.head.counted_from_s]
    usual = 5.0 if replay.head.scenario == "multisine" else 0.0
    return next((value for value in said if value is not None), usual)


def log(replay: Replay) -> Ready | None:
    """Recorded input through the model: at most six runs, spread over the outputs."""
    compared = {name: one.columns for name, one in replay.records.items() if one.role == "recorded-input"}
    if not compared:
        return None
    by_output = sorted(compared, key=lambda name: float(np.max(compared[name]["reference_nm"])))
    chosen = {name: compared[name] for name in some_levels(by_output, 6)}
    rms = sorted((float(np.sqrt(np.mean((t["reference_nm"] - t["torque_nm"]) ** 2))), n) for n, t in compared.items())
    said = caption("log", shown=len(chosen), rms=rms, unit=replay.head.output_unit)
    return Ready(lambda: replays.recorded_duty(chosen, units_of(replay)), said)


def guarantee(every: Sequence[Given[Replay]]) -> Ready | None:
    """The guarantee watched in a replay with the robust controller."""
    for replay in sorted((one.result for one in every), key=lambda one: one.head.scenario != "multisine"):
        one = replay.records.get("rc")
        if one is not None and {"chi_nm_s", "rho_nm_s"} <= set(one.columns) and replay.head.scenario != "rehab":
            said = caption("guarantee", share=one.metrics.guarantee_holds_fraction)
            return Ready(partial(replays.guarantee, one.columns, replay.head.output_unit), said)
    return None


def frequencies(replay: Replay) -> dict[str, dict[str, Array]]:
    """Frequency [Hz], gain [dB] and mean absolute error of each controller of a sweep, each of shape (F,)."""
    by_controller = {}
    for name, one in replay.records.items():
        rows = [row for row in one.metrics.frequencies or _tones(one.columns) if row.gain_db is not None]
        if rows:
            keys = ("frequency_hz", "gain_db", "mean_abs_error_nm")
            by_controller[name] = {key: np.array([getattr(row, key) for row in rows]) for key in keys}
    return by_controller


def _tones(trace: Mapping[str, Array]) -> Sequence[ToneMetrics]:
    """The sweep measured on its trace, where a file holds no numbers but the reference is the default one."""
    t = trace["time_s"]
    dt = float(t[1] - t[0])
    default = references.sweep(dt)
    if len(default.torque_nm) != len(t) or not np.allclose(default.torque_nm, trace["reference_nm"], atol=1e-6):
        return []
    wanted, y = trace["reference_nm"], trace["torque_nm"]
    return [tone(wanted[p.begin : p.end], y[p.begin : p.end], p.frequency_hz, dt) for p in default.tones]


def sweep(replay: Replay) -> Ready | None:
    """Fig. 13, from the sweep's tones."""
    rows = frequencies(replay)
    each = []
    for name, row in rows.items():
        below = row["frequency_hz"][row["gain_db"] < -3].tolist()
        each.append((controller_name(name), below[0] if below else None, float(np.max(row["gain_db"]))))
    return Ready(lambda: replays.sweep(rows, replay.head.output_unit), caption("sweep", rows=each)) if rows else None


def rehab_trace(replay: Replay) -> Mapping[str, Array] | None:
    """The first controller's trace that holds angle and target; RC where it is there."""
    traces = traces_of(replay)
    order = sorted(traces, key=lambda name: name != "rc")
    return next((traces[name] for name in order if "angle_deg" in traces[name]), None)


def mode_spans(trace: Mapping[str, Array]) -> list[tuple[str, float, float]]:
    """Stretches of one mode (soft, hard, assisted) as (name, from [s], to [s])."""
    names = [MODES[int(code)] if 0 <= int(code) < len(MODES) else str(int(code)) for code in trace["mode"]]
    return rehab.mode_spans(trace["time_s"], names)


def training(replay: Replay) -> Ready | None:
    """Fig. 16, from the rehabilitation replay."""
    trace, unit = rehab_trace(replay), replay.head.output_unit
    if trace is None:
        return None
    gap = float(np.mean(np.abs(trace["desired_nm"] - trace["rendered_nm"])))
    said = caption("training", gap=gap, top=float(np.max(np.abs(trace["desired_nm"]))), unit=unit)
    spans = mode_spans(trace)
    return Ready(lambda: rehab.training(trace, spans, unit), said, lambda: (live_replays.training(trace, unit),))


def position_errors(replay: Replay) -> dict[str, Array]:
    """Absolute position error [°] of each mode, without its first seconds."""
    trace = rehab_trace(replay)
    if trace is None:
        return {}
    skip = replay.head.exercise.uncounted_s if replay.head.exercise is not None else 5.0
    t, error = trace["time_s"], np.abs(trace["target_deg"] - trace["angle_deg"])
    by_mode = {name: error[(t >= start + skip - 1e-9) & (t <= end)] for name, start, end in mode_spans(trace)}
    return {name: values for name, values in by_mode.items() if len(values)}


def position(replay: Replay) -> Ready | None:
    """Fig. 17, from the rehabilitation replay."""
    values = position_errors(replay)
    each = [f"{name} {number(float(np.median(of)), 2)}°" for name, of in values.items()]
    return Ready(lambda: rehab.errors(values), caption("position", medians=each)) if values else None
