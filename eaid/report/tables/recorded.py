"""Tables of logs fitted as they were recorded: how each is followed, its frequency response, loops, what was asked."""

from collections.abc import Sequence

from eaid.report.edge_logs import EdgeLog
from eaid.report.tables.table import Cell, Name, Table, columns, level
from eaid.results.fit import Fit


def recorded_tables(fit: Fit) -> list[Table]:
    """Every table of the recorded part, how well each log is followed first."""
    if fit.recorded is None:
        return []
    return [logs_table(fit), responses_table(fit), loops_table(fit), asked_table(fit), falls_table(fit)]


def logs_table(fit: Fit) -> Table:
    """One row a log."""
    out = fit.data.output_unit
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (Name(one.name), one.input_kind, one.duration_s, one.rate_hz, one.idle, one.rmse, one.fit_pct, one.one_step_pct)
        for one in (fit.recorded.logs if fit.recorded else ())
    )
    heads = columns(
        "log", "input", ("length", "s", 3), ("rate", "Hz", 3), ("idle", out, 3), ("RMSE", out, 3),
        ("free-run fit", "%", 3), ("one-step fit", "%", 3),
    )  # fmt: skip
    said = "Free run: the model driven by the input alone. One step: from each measured sample to the next."
    return Table("Logs fitted as recorded", said, heads, rows)


def responses_table(fit: Fit) -> Table:
    """Where the frequency response of each log is known, and how far the clutch is from any linear system."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            Name(one.name), one.frequency_hz[0], one.frequency_hz[-1], one.averages, min(one.coherence),
            one.harmonics_pct, one.model_harmonics_pct,
        )
        for one in (fit.recorded.responses if fit.recorded else ())
        if one.frequency_hz
    )  # fmt: skip
    heads = columns(
        "log", ("from", "Hz", 3), ("to", "Hz", 3), ("averages", "", 2), ("least coherence", "", 3),
        ("harmonics", "%", 3), ("of the model", "%", 3),
    )  # fmt: skip
    said = "Harmonics: what the output holds beyond any linear answer to the input, noise taken off, as a share of the "
    return Table("Frequency response", f"{said}linear part; the same of the nonlinear model.", heads, rows)


def loops_table(fit: Fit) -> Table:
    """Recorded closed loops: the law that explains the input, errors, margins, limits."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            Name(one.name), one.K_P, one.K_I, one.law_fit_pct, 100 * one.saturated_fraction, one.rms_error,
            one.predicted_rms_error, one.rms_from_predicted, one.gain_margin_db, one.phase_margin_deg,
        )
        for one in (fit.recorded.loops if fit.recorded else ())
    )  # fmt: skip
    heads = columns(
        "loop", ("K_P", f"{unit}/({out})", 3), ("K_I", f"{unit}/({out}·s)", 3), ("PI law explains", "%", 3),
        ("at a limit", "%", 2), ("RMS error", out, 3), ("as replayed", out, 3), ("apart", out, 3),
        ("gain margin", "dB", 3), ("phase margin", "°", 3),
    )  # fmt: skip
    said = (
        "Error: reference minus output, as recorded and as the same law gives it on the fitted model; margins of that "
    )
    return Table("Closed loops as recorded", f"{said}law around the inputs used.", heads, rows)


def asked_table(fit: Fit) -> Table:
    """What the inputs asked about at each level."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (level(one.level), one.time_s, one.Ts, one.tau1, one.tau2)
        for one in (fit.recorded.asked if fit.recorded else ())
    )
    heads = columns(
        ("level", fit.data.input_unit), ("time near it", "s", 3), ("T_s", "± %", 2), ("τ1", "± %", 2), ("τ2", "± %", 2)
    )
    said = "Half-widths of the 95 % intervals there, as a share of the value; a dash: never asked."
    return Table("What the input asked about", said, heads, rows)


def falls_table(fit: Fit) -> Table:
    """Whether falls differ from rises; no rows where nothing was tested."""
    one = fit.recorded.falls if fit.recorded else None
    rows: list[tuple[Cell, ...]] = []
    if one is not None:
        slip = (one.hysteresis_pct, one.hysteresis_ci95, one.hysteresis_chance, one.hysteresis_fitted)
        rows = [
            ("τ1 of falls to rest (s)", one.release_tau1, None, one.release_chance, one.release_fitted),
            ("τ2 of falls to rest (s)", one.release_tau2, None, one.release_chance, one.release_fitted),
            ("τ1 of partial falls, times", one.fall_tau1, one.fall_tau1_ci95, one.fall_chance, one.fall_fitted),
            ("τ2 of partial falls, times", one.fall_tau2, one.fall_tau2_ci95, one.fall_chance, one.fall_fitted),
            ("T_s after a fall, more by (%)", *slip),
        ]
    heads = columns("value", ("found", "", 3), ("95 % interval", "", 3), ("p", "", 2), "fitted apart")
    said = "A small p, the probability of such a difference by chance, says that falls go otherwise than rises."
    return Table("Falls against rises", said, heads, tuple(row for row in rows if row[1] is not None))


def edges_table(logs: Sequence[EdgeLog]) -> Table:
    """One row an edge of an output: where it goes, and how it gets there."""
    out = logs[0].run.output_unit if logs else ""
    asked = any(log.run.reference_nm is not None for log in logs)
    rows: list[tuple[Cell, ...]] = []
    for log in logs:
        for k, (one, goal) in enumerate(zip(log.edges, log.goals, strict=True)):
            name: tuple[Cell, ...] = (Name(log.run.name),) if len(logs) > 1 else ()
            left = (goal, None if goal is None else goal - one.after) if asked else ()
            at = log.run.start_s + one.at_s
            rows.append((*name, k + 1, at, one.before, one.after, *left, one.rise_s, one.overshoot_pct, one.settling_s))
    heads = (
        *columns(*["log"] * (len(logs) > 1), ("edge", "", 1), ("at", "s"), ("from", out), ("to", out)),
        *(columns(("asked for", out), ("left over", out, 2)) if asked else ()),
        *columns(("rise", "s", 3), ("overshoot", "%", 3), ("settled in", "s", 3)),
    )
    said = (
        "Rise from 10 to 90 % of the change, overshoot beyond the end value, time until it stays within 5 % about it; "
    )
    return Table("Edges of the output", f"{said}a dash: it does not settle.", heads, tuple(rows))
