"""Tables of logs fitted as they were recorded: how each is followed, its frequency response, loops, what was asked."""

from collections.abc import Sequence

from eaid.report.results import EdgeLog
from eaid.report.tables.table import Cell, Name, Table, columns, level, table_of
from eaid.results.fit import Fit
from eaid.results.recorded import Asked, Falls, LogFit, Loop, Response


def recorded_tables(fit: Fit) -> list[Table]:
    """Every table of the recorded part, how well each log is followed first."""
    if (part := fit.recorded) is None:
        return []
    units = fit.data.input_unit, fit.data.output_unit
    every = (logs_table(part.logs, units[1]), responses_table(part.responses), loops_table(part.loops, units))
    return [*every, asked_table(part.asked, units[0]), falls_table(part.falls)]


def logs_table(logs: Sequence[LogFit], out: str) -> Table:
    """One row a log."""
    return table_of(
        "Logs fitted as recorded",
        "Free run: the model driven by the input alone. One step: from each measured sample to the next.",
        logs,
        ("log", lambda log: Name(log.name)), ("input", "input_kind"), (("length", "s", 3), "duration_s"),
        (("rate", "Hz", 3), "rate_hz"), (("idle", out, 3), "idle"), (("RMSE", out, 3), "rmse"),
        (("free-run fit", "%", 3), "fit_pct"), (("one-step fit", "%", 3), "one_step_pct"),
    )  # fmt: skip


def responses_table(responses: Sequence[Response]) -> Table:
    """Where the frequency response of each log is known, and how far the clutch is from any linear system."""
    return table_of(
        "Frequency response",
        "Harmonics: what the output holds beyond any linear answer to the input, noise taken off, as a share of the "
        "linear part; the same of the nonlinear model.",
        [response for response in responses if response.frequency_hz],
        ("log", lambda response: Name(response.name)), (("from", "Hz", 3), lambda response: response.frequency_hz[0]),
        (("to", "Hz", 3), lambda response: response.frequency_hz[-1]), (("averages", "", 2), "averages"),
        (("least coherence", "", 3), lambda response: min(response.coherence)),
        (("harmonics", "%", 3), "harmonics_pct"), (("of the model", "%", 3), "model_harmonics_pct"),
    )  # fmt: skip


def loops_table(loops: Sequence[Loop], units: tuple[str, str]) -> Table:
    """Recorded closed loops: the law that explains the input, errors, margins, limits."""
    unit, out = units
    return table_of(
        "Closed loops as recorded",
        "Error: reference minus output, as recorded and as the same law gives it on the fitted model; margins of that "
        "law around the inputs used.",
        loops,
        ("loop", lambda loop: Name(loop.name)), (("K_P", f"{unit}/({out})", 3), "K_P"),
        (("K_I", f"{unit}/({out}·s)", 3), "K_I"), (("PI law explains", "%", 3), "law_fit_pct"),
        (("at a limit", "%", 2), lambda loop: 100 * loop.saturated_fraction), (("RMS error", out, 3), "rms_error"),
        (("as replayed", out, 3), "predicted_rms_error"), (("apart", out, 3), "rms_from_predicted"),
        (("gain margin", "dB", 3), "gain_margin_db"), (("phase margin", "°", 3), "phase_margin_deg"),
    )  # fmt: skip


def asked_table(asked: Sequence[Asked], unit: str) -> Table:
    """What the inputs asked about at each level."""
    return table_of(
        "What the input asked about",
        "Half-widths of the 95 % intervals there, as a share of the value; a dash: never asked.",
        asked,
        (("level", unit), lambda row: level(row.level)), (("time near it", "s", 3), "time_s"),
        (("T_s", "± %", 2), "Ts"), (("τ1", "± %", 2), "tau1"), (("τ2", "± %", 2), "tau2"),
    )  # fmt: skip


def falls_table(falls: Falls | None) -> Table:
    """Whether falls differ from rises; no rows where nothing was tested."""
    rows: list[tuple[Cell, ...]] = []
    if falls is not None:
        slip = (falls.hysteresis_pct, falls.hysteresis_ci95, falls.hysteresis_chance, falls.hysteresis_fitted)
        rows = [
            ("τ1 of falls to rest (s)", falls.release_tau1, None, falls.release_chance, falls.release_fitted),
            ("τ2 of falls to rest (s)", falls.release_tau2, None, falls.release_chance, falls.release_fitted),
            ("τ1 of partial falls, times", falls.fall_tau1, falls.fall_tau1_ci95, falls.fall_chance, falls.fall_fitted),
            ("τ2 of partial falls, times", falls.fall_tau2, falls.fall_tau2_ci95, falls.fall_chance, falls.fall_fitted),
            ("T_s after a fall, more by (%)", *slip),
        ]
    heads = columns("value", ("found", "", 3), ("95 % interval", "", 3), ("p", "", 2), "fitted apart")
    caption = "A small p, the probability of such a difference by chance, says that falls go otherwise than rises."
    return Table("Falls against rises", caption, heads, tuple(row for row in rows if row[1] is not None))


def edges_table(logs: Sequence[EdgeLog]) -> Table:
    """One row an edge of an output: where it goes, and how it gets there."""
    out = logs[0].run.output_unit if logs else ""
    asked = any(log.run.reference_nm is not None for log in logs)
    rows: list[tuple[Cell, ...]] = []
    for log in logs:
        for k, (edge, goal) in enumerate(zip(log.edges, log.goals, strict=True)):
            name: tuple[Cell, ...] = (Name(log.run.name),) if len(logs) > 1 else ()
            of_goal = (goal, None if goal is None else goal - edge.after) if asked else ()
            at_s = log.run.start_s + edge.at_s
            course = (edge.rise_s, edge.overshoot_pct, edge.settling_s)
            rows.append((*name, k + 1, at_s, edge.before, edge.after, *of_goal, *course))
    heads = (
        *columns(*["log"] * (len(logs) > 1), ("edge", "", 1), ("at", "s"), ("from", out), ("to", out)),
        *(columns(("asked for", out), ("left over", out, 2)) if asked else ()),
        *columns(("rise", "s", 3), ("overshoot", "%", 3), ("settled in", "s", 3)),
    )
    caption = (
        "Rise from 10 to 90 % of the change, overshoot beyond the end value, time until it stays within 5 % about it; "
        "a dash: it does not settle."
    )
    return Table("Edges of the output", caption, heads, tuple(rows))
