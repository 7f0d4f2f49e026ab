"""Figs. 11–13, 16 and 17: steps, multisine, sweep, each controller in its own colour and line; logs as recorded and
under the model; elbow rehabilitation."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from eaid.arrays import Array, median
from eaid.replay import rehab
from eaid.report import panels as ink
from eaid.report.figures.steps import some_of
from eaid.report.panels import Axis, Line, Panel, Sheet, Span, over, quantity
from eaid.report.rig import controller_name
from eaid.results.fit import Fit
from eaid.results.recorded import LogCurve, LogFit
from eaid.results.replay import COLUMNS, Replay

# Part of a log, and times the usual time between two drawn rows, from which one without rows is a gap
GAP_PART, GAP_TIMES = 2 / 150, 5.0


def bands(replay: Replay) -> list[ink.Band]:
    """The 2.5 % and 97.5 % outputs of each controller over drawn plants, where there are any."""
    quantiles, found = replay.head.band_quantiles, []
    for name, tables in ((name, one.tables) for name, one in replay.records.items()):
        if {0.025, 0.975} <= set(quantiles) and "plants/band_nm" in tables:
            low, high = (tables["plants/band_nm"][quantiles.index(share)] for share in (0.025, 0.975))
            found.append(ink.Band(tables["plants/band_time_s"], low, high, ink.controller_look(name)[0]))
    return found


def counted_from(replay: Replay) -> float:
    """Instant from which a replay's errors count [s]."""
    said = [one.metrics.counted_from_s for one in replay.records.values()] + [replay.head.counted_from_s]
    return next((value for value in said if value is not None), 0.0)


def tracked(replay: Replay) -> Sheet:
    """Figs. 11, 12 and the like: output and reference, the error but for steps, and the input of each controller."""
    output, error, acting = tracking_panels(replay)
    if replay.head.scenario == "steps":
        return Sheet([output, acting], 3.4, ratios=(1.8, 1), live=True)
    return Sheet([output, error, acting], 4.4, ratios=(1.5, 1, 1), live=True)


def tracking_panels(replay: Replay, until_s: float | None = None) -> list[Panel]:
    """Output and reference, error, and input of each controller; `until_s` leaves out what does not count, and more."""
    unit, out, from_s = replay.head.input_unit, replay.head.output_unit, counted_from(replay)
    output, error, acting, asked = list[Line](), list[Line](), list[Line](), list[Line]()
    for name, one in replay.records.items():
        t, said, (colour, dash, _marker) = one.columns["time_s"], controller_name(name), ink.controller_look(name)
        some = slice(None) if until_s is None else (t >= from_s) & (t <= until_s)
        t, reference, true, duty = (one.columns[key][some] for key in COLUMNS)
        for lines, values in ((output, true), (error, reference - true), (acting, duty)):
            lines.append(Line(t, values, said, colour, dash))
        asked.append(Line(t, reference, "reference", ink.BLACK, ":"))
    cut = until_s is not None
    shaded = [Span(0.0, from_s, ink.PALE)] if from_s > 0 and not cut and replay.head.scenario != "steps" else []
    counted = [np.abs(line.y[line.x >= from_s]) for line in error]
    top = max((float(np.max(e)) for e in counted if len(e)), default=1.0)
    size, plants = 1.25 * top + 1e-9, [] if cut else bands(replay)
    title = "grey: not counted" * bool(shaded)
    return [
        Panel(ink.TIME, quantity(out), [*output, asked[0]], plants, shaded, legend="above"),
        Panel(ink.TIME, Axis("Error", out, (-size, size)), error, spans=shaded, title=title),
        Panel(ink.TIME, over(unit), acting, spans=shaded),
    ]


def sweep_panels(replay: Replay) -> Sheet | None:
    """Fig. 13: (a) amplitude [dB] and (b) mean absolute error over the frequency [Hz], a row a controller."""
    gain, error = [], []
    for name, one in replay.records.items():
        tones = [row for row in one.metrics.frequencies if row.gain_db is not None]
        if tones:
            keys = ("frequency_hz", "gain_db", "mean_abs_error_nm")
            f, size_db, mean = (np.array([getattr(row, key) for row in tones]) for key in keys)
            said, (colour, dash, marker) = controller_name(name), ink.controller_look(name)
            gain.append(Line(f, size_db, said, colour, dash, 1.1, marker))
            error.append(Line(f, mean, said, colour, dash, 1.1, marker))
    if not gain:
        return None
    lowest = min(float(np.min(line.y)) for line in gain)
    hz = Axis("Frequency", "Hz", log=True)
    panels = [
        Panel(hz, Axis("Amplitude", "dB", (max(lowest - 2, -32), None)), gain,
              spans=[Span(-3, -3, ink.GREY, "y", 0.7, ":")], notes=[ink.Note("−3 dB", 1.01, -3, "x", ha="left")],
              legend="above", columns=2 if len(gain) > 3 else 3, tight=False),
        Panel(hz, Axis("Mean |error|", replay.head.output_unit, (0.0, None)), error, tight=False),
    ]  # fmt: skip
    return Sheet(panels, 3.3, ink.COLUMN_IN)


def recorded_input(replay: Replay) -> Sheet | None:
    """What a fit shows of its logs, of those whose recorded input was replayed."""
    logs = []
    for name, one in replay.records.items():
        if one.role == "recorded-input":
            t, recorded, model, duty = (one.columns[key] for key in COLUMNS)
            curve = LogCurve(*(tuple(column.tolist()) for column in (t, duty, recorded, model, recorded - model)))
            logs.append(LogFit(name, fit_pct=one.metrics.fit_pct, curve=curve))
    return logs_sheet(logs, (replay.head.input_unit, replay.head.output_unit))


def recorded_logs(fit: Fit) -> Sheet | None:
    """Measured output of logs and the model driven by their input alone."""
    return logs_sheet(fit.logs, (fit.data.input_unit, fit.data.output_unit))


def drawn_logs(logs: Sequence[LogFit]) -> list[LogFit]:
    """The logs that are drawn: all, or the best, the middle and the worst followed."""
    known = [log for log in logs if log.curve.time_s]
    return known if len(known) <= 3 else some_of(sorted(known, key=lambda log: -(log.fit_pct or 0.0)), 3)


def logs_sheet(logs: Sequence[LogFit], units: tuple[str, str]) -> Sheet | None:
    """A column a log of those drawn: (top) input, (middle) measured and model, (bottom) residual."""
    columns: list[list[Panel]] = []
    for log in (shown := drawn_logs(logs)):
        most = 44 // len(shown)  # letters of its name, by the end of which it differs from the others
        name = (log.name if len(log.name) <= most else f"…{log.name[1 - most :]}").replace("$", r"\$")
        percent = "" if log.fit_pct is None else f"fit {log.fit_pct:.3g} %"
        columns.append(log_panels(log.curve, units, (name, percent), first=not columns))
    panels = [column[row] for row in range(3) for column in columns]
    n = len(columns)
    return Sheet(panels, 4.2, columns=n, ratios=(1, 1.6, 1), live=n == 1) if n else None


def broken_at_gaps(time_s: Array, rows: Array) -> Array:
    """Time and rows of values, (1 + k, n), with a break where no row is compared for long: a line across is no data."""
    apart = np.diff(time_s)
    longest = max(GAP_PART * float(np.ptp(time_s)), GAP_TIMES * median(apart)) if len(apart) else 0.0
    return np.insert(np.vstack([time_s, rows]), np.flatnonzero(apart > longest) + 1, np.nan, axis=1)


def log_panels(
    curve: LogCurve, units: tuple[str, str], heads: tuple[str, str] = ("", ""), first: bool = True
) -> list[Panel]:
    """Input, measured and model, residual of one log over its own time; names and legend beside the `first` alone."""
    t, u, (unit, out) = np.array(curve.time_s), np.array(curve.input), units
    new = np.flatnonzero(np.diff(u)) + 1  # its corners alone, of which no thinner line loses one
    corners_s = np.concatenate([t[:1], np.repeat(t[new], 2), t[-1:]])
    held = Line(corners_s, np.repeat(u[np.append(0, new)], 2), "input", ink.GREEN, width=0.7)
    at, recorded, told, left = broken_at_gaps(t, np.array([curve.measured, curve.model, curve.residual]))
    measured = Line(at, recorded, "measured", ink.SKY, width=1.8)
    model = ink.model_line(at, told, "model")
    residual = Line(at, left, "residual", ink.VERMILLION, width=0.6)
    axes = (over(unit), quantity(out), Axis("Residual", out)) if first else (Axis(),) * 3
    return [
        Panel(ink.OF_LOG, axes[0], [held], title=heads[0]),
        Panel(ink.OF_LOG, axes[1], [measured, model], legend="over" if first else "", columns=6, title=heads[1]),
        Panel(ink.OF_LOG, axes[2], [residual], spans=[Span(0.0, 0.0, ink.BLACK, "y", 0.5)]),
    ]


# Mode → pale ground and name; the paper's blue, red and green
LOOKS = {
    "soft": ("#CFE6F5", "resistive, soft"),
    "hard": ("#F9DCCB", "resistive, hard"),
    "assisted": ("#D3EDE0", "assisted"),
}


def session(replay: Replay) -> tuple[Mapping[str, Array], list[tuple[str, float, float]]] | None:
    """The first trace that holds angle and target, RC's where it is there; its modes, each from when to when."""
    order = sorted(replay.records, key=lambda name: name != "rc")
    trace = next((one for name in order if "angle_deg" in (one := replay.records[name].columns)), None)
    if trace is None:
        return None
    modes, t = trace["mode"].astype(int), trace["time_s"]
    edges = [0, *(np.flatnonzero(np.diff(modes)) + 1).tolist(), len(modes)]
    names = dict(enumerate(rehab.MODES))
    return trace, [(names.get(int(modes[a]), str(modes[a])), float(t[a]), float(t[b - 1])) for a, b in pairwise(edges)]


def training(replay: Replay) -> Sheet | None:
    """Fig. 16: (a) target and angle, (b) position error [°], (c) desired and rendered output, (d) its error."""
    if (found := session(replay)) is None:
        return None
    (trace, stretches), unit = found, replay.head.output_unit
    t, target, angle, desired, rendered = (
        trace[key] for key in ("time_s", "target_deg", "angle_deg", "desired_nm", "rendered_nm")
    )
    spans = [Span(start, end, LOOKS.get(name, (ink.PALE, ""))[0]) for name, start, end in stretches]
    spans += [Span(start, start, ink.BLACK) for _name, start, _end in stretches]  # told apart in grey, too
    heads = [ink.Note(LOOKS.get(name, ("", name))[1], (a + b) / 2, 1.02, "y", va="bottom") for name, a, b in stretches]
    rows = (
        (Axis("Angle", "°"), [Line(t, target, "target", ink.BLACK, "--"), Line(t, angle, "angle", ink.BLUE)]),
        (Axis("Position\nerror", "°"), [Line(t, target - angle, "position error", ink.BLUE)]),
        (quantity(unit), [Line(t, desired, "desired", ink.BLACK, "--"), Line(t, rendered, "rendered", ink.VERMILLION)]),
        (Axis("Error\n" if unit else "Error", unit), [Line(t, desired - rendered, "error", ink.VERMILLION)]),
    )
    panels = [
        Panel(ink.TIME, y, lines, spans=spans, notes=() if k else heads, legend="beside" if len(lines) > 1 else "")
        for k, (y, lines) in enumerate(rows)
    ]
    return Sheet(panels, 5.0, live=True)


def error_boxes(replay: Replay) -> Sheet | None:
    """Fig. 17: box plot of the absolute position error [°] of each mode, without its first seconds."""
    if (found := session(replay)) is None:
        return None
    trace, stretches = found
    skip = replay.head.exercise.uncounted_s if replay.head.exercise is not None else 5.0
    t, error = trace["time_s"], np.abs(trace["target_deg"] - trace["angle_deg"])
    by_mode = {name: error[(t >= start + skip - 1e-9) & (t <= end)] for name, start, end in stretches}
    looks = [(*LOOKS.get(name, (ink.PALE, name)), values) for name, values in by_mode.items() if len(values)]
    if not looks:
        return None
    hatches = ("", "////", "....", "xxxx")
    boxes = [(name, values, colour, hatches[k % 4]) for k, (colour, name, values) in enumerate(looks)]
    return Sheet([Panel(Axis(), Axis("|position error|", "°", (0.0, None)), boxes=boxes)], 2.4, ink.COLUMN_IN)
