"""Figs. 11–13: steps, the multisine and the sweep, each controller in its own colour and line; logs; the guarantee."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.arrays import Array
from eaid.report import style
from eaid.report.figures import panels
from eaid.report.figures.panels import Line, Panel
from eaid.report.figures.recorded import titles
from eaid.report.figures.steps import some_levels
from eaid.report.results import Given
from eaid.report.rig import controller_name, over, quantity
from eaid.report.style import Ready, caption
from eaid.report.tables.replays import metric
from eaid.report.tables.table import number
from eaid.results.replay import Replay

Trace = Mapping[str, Array]
"""The columns of one controller."""
UNITS = ("%", "N·m")


def units_of(replay: Replay) -> tuple[str, str]:
    """Units of input and output."""
    return replay.head.input_unit, replay.head.output_unit


def traces_of(replay: Replay) -> dict[str, Trace]:
    """Controller → its columns."""
    return {name: one.columns for name, one in replay.records.items()}


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


def tracking_ready(replay: Replay) -> Ready:
    """Figs. 11, 12 and the like; of steps the overshoot counts, elsewhere the error over time."""
    traces, units, with_error = traces_of(replay), units_of(replay), replay.head.scenario != "steps"
    errors = sorted((value, name) for name in traces if (value := metric(replay, name, "max_abs_error_nm")))
    said = caption("errors", found=[(value, controller_name(name)) for value, name in errors], unit=units[1])
    draw = partial(tracking, traces, counted_from(replay), bands(replay), units)
    if not with_error:
        overshoots = []
        for name, one in replay.records.items():
            shares = [step.overshoot_pct for step in one.metrics.steps if step.overshoot_pct is not None]
            if shares:
                overshoots.append(f"{controller_name(name)} {number(max(shares), 2)} %")
        said = caption("steps", overshoots=overshoots, errors=said)
        draw = partial(tracking, traces, units=units, with_error=False)
    return Ready(draw, said, lambda: (panels.live(tracking_panels(traces, units, with_error)),))


def tracking_panels(traces: Mapping[str, Trace], units: tuple[str, str], with_error: bool) -> list[Panel]:
    """Output and reference, the error where wanted, and the input."""
    unit, out = units
    output, error, acting = [], [], []
    for i, (name, trace) in enumerate(traces.items()):
        t, said, look = trace["time_s"], controller_name(name), style.controller_look(name, i)
        output.append(Line(t, trace["torque_nm"], said, **look))
        error.append(Line(t, trace["reference_nm"] - trace["torque_nm"], said, **look))
        acting.append(Line(t, trace["duty_pct"], said, **look))
    first = next(iter(traces.values()))
    output.append(Line(first["time_s"], first["reference_nm"], "reference", style.BLACK, ":"))
    found = [Panel(quantity(out), out, 300, output, named=True), Panel(f"Error ({out})", out, 190, error)]
    return [*found[: 1 + with_error], Panel(over(unit), unit, 190, acting)]


def tracking(
    traces: Mapping[str, Trace],
    from_s: float = 0.0,
    bands: Mapping[str, tuple[Array, Array, Array]] | None = None,
    units: tuple[str, str] = UNITS,
    with_error: bool = True,
) -> Figure:
    """Output and reference, the error where wanted, and the input; the error counts from `from_s` on.

    `units` of input and output; `bands` holds time, lower and upper output of a controller over drawn plants, where
    there are any.
    """
    height, ratios = (4.4, (1.5, 1, 1)) if with_error else (3.4, (1.8, 1))
    figure, axes = style.page(height, len(ratios), 1, sharex=True, height_ratios=ratios)
    shown = tracking_panels(traces, units, with_error)
    panels.draw(axes, shown)
    for name, (t, low, high) in (bands or {}).items():
        colour = style.controller_look(name, list(traces).index(name))["color"]
        axes[0].fill_between(t, low, high, color=colour, alpha=0.25, linewidth=0)
    for panel in axes if from_s > 0 else ():
        panel.axvspan(0, from_s, color="#EEEEEE", lw=0)
    if with_error and from_s > 0:
        style.letter(axes[1], "b", "grey: not counted")
    if with_error and len(traces) > 1:
        counted = [line.y[line.t >= from_s] for line in shown[1].lines]
        top = max((float(np.max(np.abs(e))) for e in counted if len(e)), default=1.0)
        axes[1].set_ylim(-1.25 * top - 1e-9, 1.25 * top + 1e-9)
    style.legend_above(axes[0])
    return figure


def sweep_ready(replay: Replay) -> Ready | None:
    """Fig. 13, from the sweep's tones."""
    rows = frequencies(replay)
    each = []
    for name, row in rows.items():
        below = row["frequency_hz"][row["gain_db"] < -3].tolist()
        each.append((controller_name(name), below[0] if below else None, float(np.max(row["gain_db"]))))
    return Ready(lambda: sweep(rows, replay.head.output_unit), caption("sweep", rows=each)) if rows else None


def frequencies(replay: Replay) -> dict[str, dict[str, Array]]:
    """Frequency [Hz], gain [dB] and mean absolute error of each controller of a sweep, each of shape (F,)."""
    by_controller = {}
    for name, one in replay.records.items():
        rows = [row for row in one.metrics.frequencies if row.gain_db is not None]
        if rows:
            keys = ("frequency_hz", "gain_db", "mean_abs_error_nm")
            by_controller[name] = {key: np.array([getattr(row, key) for row in rows]) for key in keys}
    return by_controller


def sweep(rows: Mapping[str, Trace], output_unit: str = "N·m") -> Figure:
    """Fig. 13: (a) amplitude [dB] and (b) mean absolute error over the frequency [Hz], a row a controller."""
    figure, (gain, error) = style.column(3.3, 2, 1, sharex=True)
    for i, (name, row) in enumerate(rows.items()):
        look = {**style.controller_look(name, i), "marker": style.controller_marker(name, i)}
        gain.semilogx(row["frequency_hz"], row["gain_db"], label=controller_name(name), **look)
        error.semilogx(row["frequency_hz"], row["mean_abs_error_nm"], **look)
    gain.axhline(-3, color=style.GREY, linewidth=0.7, linestyle=":")
    gain.annotate("−3 dB", (1.01, -3), xycoords=("axes fraction", "data"), va="center")
    lowest = min(float(np.min(row["gain_db"])) for row in rows.values())
    gain.set(ylabel="Amplitude (dB)", ylim=(max(lowest - 2, -32), None))
    error.set(ylabel=f"Mean |error| ({output_unit})", xlabel="Frequency (Hz)")
    error.set_ylim(0, None)
    f = np.concatenate([row["frequency_hz"] for row in rows.values()])
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1, 2, 3, 5, 10) if 0.95 * f.min() <= tick <= 1.05 * f.max()]
    for mark, axes in zip("ab", (gain, error), strict=True):
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        style.letter(axes, mark)
    style.legend_above(gain, 2 if len(rows) > 3 else 3)
    return figure


def log_ready(replay: Replay) -> Ready | None:
    """Recorded input through the model: at most six runs, spread over the outputs."""
    compared = {name: one.columns for name, one in replay.records.items() if one.role == "recorded-input"}
    if not compared:
        return None
    by_output = sorted(compared, key=lambda name: float(np.max(compared[name]["reference_nm"])))
    chosen = {name: compared[name] for name in some_levels(by_output, 6)}
    rms = sorted((_rms(trace), name) for name, trace in compared.items())
    said = caption("log", shown=len(chosen), rms=rms, unit=replay.head.output_unit)
    return Ready(lambda: recorded_duty(chosen, units_of(replay)), said)


def _rms(trace: Trace) -> float:
    return float(np.sqrt(np.mean((trace["reference_nm"] - trace["torque_nm"]) ** 2)))


def recorded_duty(traces: Mapping[str, Trace], units: tuple[str, str] = UNITS) -> Figure:
    """Recorded output and the model's under the recorded input, a panel a run, with the RMS of their difference."""
    columns = min(3, len(traces))
    rows = -(-len(traces) // columns)
    figure, every = style.page(0.5 + 1.35 * rows, rows, columns)
    for panel in every[len(traces) :]:
        panel.set_visible(False)
    heads = titles(list(traces), 16 * len(traces))
    for mark, head, trace, panel in zip("abcdef", heads, traces.values(), every, strict=False):
        t = trace["time_s"]
        panels.draw_line(panel, Line(t, trace["reference_nm"], "recorded", style.SKY, linewidth=2.2))
        panels.draw_line(panel, Line(t, trace["torque_nm"], "model, same input", style.BLACK, (0, (4, 2))))
        style.letter(panel, mark, f"{head}: RMS {_rms(trace):.2g}")
    for i, panel in enumerate(every):
        if i % columns == 0:
            panel.set_ylabel(quantity(units[1]))
        if i + columns >= len(traces):
            panel.set_xlabel("Time of the log (s)")
    style.legend_over(figure, every[0])
    return figure


def guarantee_ready(every: Sequence[Given[Replay]]) -> Ready | None:
    """The guarantee watched in a replay with the robust controller."""
    for replay in sorted((one.result for one in every), key=lambda one: one.head.scenario != "multisine"):
        one = replay.records.get("rc")
        if one is not None and {"chi_nm_s", "rho_nm_s"} <= set(one.columns) and replay.head.scenario != "rehab":
            said = caption("guarantee", share=one.metrics.guarantee_holds_fraction)
            return Ready(partial(guarantee, one.columns, replay.head.output_unit), said)
    return None


def guarantee(trace: Trace, output_unit: str = "N·m") -> Figure:
    """What the robust term has to cover, |χ|, and its size ρ over time."""
    figure, (axes,) = style.column(2.3)
    t = trace["time_s"]
    panels.draw_line(axes, Line(t, trace["rho_nm_s"], r"available, $\rho$", style.BLUE))
    panels.draw_line(axes, Line(t, np.abs(trace["chi_nm_s"]), r"needed, $|\chi|$", style.VERMILLION, "--"))
    axes.set(xlabel="Time (s)", ylabel=f"Robust term ({output_unit}/s)", xlim=(t[0], t[-1]))
    axes.set_ylim(0, 2.5 * float(np.median(trace["rho_nm_s"])))
    style.legend_above(axes)
    return figure
