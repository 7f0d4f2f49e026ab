"""Tables of replays, for page and terminal: errors, guarantee, steps, tones, drawn plants, logs, modes."""

from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from eaid.arrays import median
from eaid.report.rig import SCENARIO_NAMES, controller_name
from eaid.report.tables import OUTSIDE, Name, Table, level, outside, table_of
from eaid.results.fit import Fit
from eaid.results.replay import COLUMNS, Replay
from eaid.results.residuals import Correlation, correlation_of
from eaid.shown import number

METRICS = {
    "max_abs_error_nm": ("largest |error|", "out"),
    "rms_error_nm": ("RMS error", "out"),
    "mean_abs_error_nm": ("mean |error|", "out"),
    "mean_abs_duty_step_pct": ("mean input step", "in"),
    "saturated_fraction": ("share at a limit", ""),
}


def _units(replay: Replay) -> dict[str, str]:
    return {"out": replay.head.output_unit, "in": replay.head.input_unit, "": ""}


def metric(replay: Replay, name: str, key: str) -> float | None:
    """One number of one controller; errors of the whole trace where the file says none."""
    one = replay.records[name]
    known: float | None = getattr(one.metrics, key)
    if known is not None or key not in ("max_abs_error_nm", "mean_abs_error_nm"):
        return known
    error = abs(one.columns["reference_nm"] - one.columns["torque_nm"])
    return float(error.max() if key == "max_abs_error_nm" else error.mean())


def tables_of(replay: Replay) -> list[Table]:
    """Every table of one replay."""
    return [log_table(replay), errors_table([replay]), *further_tables(replay)]


def further_tables(replay: Replay) -> list[Table]:
    """What a replay has beside its errors: each step, each tone of a sweep, modes, drawn plants."""
    out, units = replay.head.output_unit, _units(replay)

    def called(name: str, key: str) -> str:
        said, kind = METRICS.get(key, (key, None))
        return f"{controller_name(name)}: {said}{f' ({units[kind] or 1})' if kind is not None else ''}"

    steps = table_of(
        "Each step",
        "Rise from 10 to 90 %; settling to within 2 % of the step; a dash where the next step comes first.",
        [(controller_name(name), step) for name, one in replay.records.items() for step in one.metrics.steps],
        ("controller", lambda of: of[0]),
        (("step", out), lambda of: f"{level(of[1].from_nm)} → {level(of[1].to_nm)}"),
        (("rise time", "s", 3), lambda of: of[1].rise_time_s), (("overshoot", "%", 3), lambda of: of[1].overshoot_pct),
        (("settling, 2 %", "s", 3), lambda of: of[1].settling_s),
    )  # fmt: skip
    tones = table_of(
        "Each frequency", "Amplitude and phase of the output against the reference, at the sine's own frequency.",
        [(controller_name(name), tone) for name, one in replay.records.items() for tone in one.metrics.frequencies],
        ("controller", lambda of: of[0]), (("frequency", "Hz", 3), lambda of: of[1].frequency_hz),
        (("amplitude", "dB", 3), lambda of: of[1].gain_db), (("phase", "°", 3), lambda of: of[1].phase_deg),
        (("mean |error|", out, 3), lambda of: of[1].mean_abs_error_nm),
    )  # fmt: skip
    plants = table_of(
        f"Over drawn plants: {replay.head.scenario}",
        f"{replay.head.plants} plants drawn from the fit's uncertainty; the figure's shaded band holds 95 % of them.",
        [(called(name, key), one) for name, m in replay.metrics().items() if m.plants
         for key, one in m.plants.metrics.items()],
        ("number", lambda of: of[0]), (("2.5 %", "", 3), lambda of: of[1].low),
        (("median", "", 3), lambda of: of[1].median), (("97.5 %", "", 3), lambda of: of[1].high),
        (("worst", "", 3), lambda of: of[1].worst.value), ("its plant", lambda of: of[1].worst.plant),
    )  # fmt: skip
    return [steps, tones, modes_table(replay), plants]


def errors_table(replays: Sequence[Replay]) -> Table:
    """Errors and input of each controller, all scenarios in one table."""
    units = _units(replays[0])
    return table_of(
        "Errors of each controller",
        "Errors are reference minus true output; the settling time at the start is left out where there is one.",
        [(one, name) for one in replays for name in one.metrics()],
        ("replay", lambda of: SCENARIO_NAMES.get(of[0].head.scenario, of[0].head.scenario or "own reference")),
        ("controller", lambda of: controller_name(of[1])),
        *(((said, units[u], 3), lambda of, key=key: metric(of[0], of[1], key)) for key, (said, u) in METRICS.items()),
    )  # fmt: skip


def log_table(replay: Replay, fits: Sequence[Fit] = ()) -> Table:
    """How far the model is from each recorded run when it gets the recorded input; logs that share no fingerprint with
    those of the fits, or, where only names tell logs of datasets and folders, no name, are told as such."""
    out = replay.head.output_unit

    def left(name: str) -> Correlation:
        t, recorded, model, u = (replay.records[name].columns[key] for key in COLUMNS)
        return correlation_of([recorded - model], median(np.diff(t)), u)

    given = replay.head.inputs.get("log", ())
    files = given if isinstance(given, tuple) else (given,)
    logs = {one.sha256 for one in files}
    logs |= set(replay.records) if not files or any(one.path.endswith((".h5", ".hdf5")) for one in files) else set()
    fitted = {one.sha256 for fit in fits for one in fit.data.inputs}
    fitted |= {known for fit in fits for one in fit.data.sources for known in (one.sha256, one.run)}
    return table_of(
        "Another log, which the model has not seen" if fits and logs.isdisjoint(fitted)
        else "Recorded input through the model",
        f"Each log's own input drives the model: free run, and from each measured sample to the next. {OUTSIDE}",
        [(name, one, left(name)) for name, one in replay.metrics("recorded-input").items()],
        ("run", lambda of: Name(of[0])), (("RMSE", out, 3), lambda of: of[1].rms_difference_nm),
        (("largest", out, 3), lambda of: of[1].max_abs_difference_nm),
        (("mean, recorded − model", out, 3), lambda of: of[1].mean_difference_nm), ("R²", lambda of: of[1].R2),
        (("free-run fit", "%", 3), lambda of: of[1].fit_pct), (("one-step fit", "%", 3), lambda of: of[1].one_step_pct),
        *outside(itemgetter(2)),
    )  # fmt: skip


def modes_table(replay: Replay) -> Table:
    """Errors of each controller by mode, the robust one first."""
    order = sorted(replay.metrics().items(), key=lambda item: item[0] != "rc")
    return table_of(
        "Errors by mode", "Absolute position error.",
        [(controller_name(name), mode, part.abs_position_error_deg, part)
         for name, metrics in order for mode, part in metrics.modes.items()],
        ("controller", lambda of: of[0]), ("mode", lambda of: of[1]), (("median", "°", 3), lambda of: of[2].median),
        ("middle half (°)", lambda of: f"{number(of[2].q1, 3)} … {number(of[2].q3, 3)}"),
        (("mean", "°", 3), lambda of: of[2].mean),
        (("mean error of the output", replay.head.output_unit, 2), lambda of: of[3].mean_abs_torque_error_nm),
    )  # fmt: skip
