"""Figs. 11–13: steps, the multisine and the sweep, each controller in its own colour and line; logs; the guarantee;
how stiff a wall."""

from collections.abc import Mapping, Sequence

import numpy as np

from eaid.arrays import Array
from eaid.report import style
from eaid.report.figures.recorded import titles
from eaid.report.figures.steps import some_levels
from eaid.report.live import Line, Panel, draw_line, draw_panels, live_panels
from eaid.report.results import Given
from eaid.report.rig import controller_name, over, quantity
from eaid.report.style import Ready, caption
from eaid.report.tables.replays import metric
from eaid.report.tables.table import number
from eaid.results.coupling import Coupling
from eaid.results.replay import Replay

Trace = Mapping[str, Array]
"""The columns of one controller."""


def units_of(replay: Replay) -> tuple[str, str]:
    """Units of input and output."""
    return replay.head.input_unit, replay.head.output_unit


def traces_of(replay: Replay) -> dict[str, Trace]:
    """Controller → its columns."""
    return {name: one.columns for name, one in replay.records.items()}


def bands(replay: Replay) -> dict[str, tuple[Array, Array, Array]]:
    """Time [s] and the 2.5 % and 97.5 % outputs of each controller over drawn plants, where there are any."""
    quantiles = replay.head.band_quantiles
    drawn = {name: one.tables for name, one in replay.records.items() if "plants/band_nm" in one.tables}
    if not {0.025, 0.975} <= set(quantiles):
        return {}
    low, high = quantiles.index(0.025), quantiles.index(0.975)
    return {
        name: (tables["plants/band_time_s"], tables["plants/band_nm"][low], tables["plants/band_nm"][high])
        for name, tables in drawn.items()
    }


def counted_from(replay: Replay) -> float:
    """Instant from which a replay's errors count [s]."""
    said = [one.metrics.counted_from_s for one in replay.records.values()] + [replay.head.counted_from_s]
    usual = 5.0 if replay.head.scenario == "multisine" else 0.0
    return next((value for value in said if value is not None), usual)


def tracking(replay: Replay) -> Ready:
    """Figs. 11, 12 and the like: output and reference, the error but for steps, and the input of each controller.

    Grey: where the error does not count yet; shaded: 95 % of drawn plants, where there are any. Of steps the overshoot
    is told, elsewhere the error alone.
    """
    traces, units, with_error = traces_of(replay), units_of(replay), replay.head.scenario != "steps"
    from_s = counted_from(replay) if with_error else 0.0
    height, ratios = (4.4, (1.5, 1, 1)) if with_error else (3.4, (1.8, 1))
    figure, axes = style.sheet(style.PAGE_IN, height, len(ratios), 1, sharex=True, height_ratios=ratios)
    shown = tracking_panels(traces, units, with_error)
    draw_panels(axes, shown)
    for name, (t, low, high) in bands(replay).items() if with_error else ():
        colour = style.controller_look(name, list(traces).index(name))["color"]
        axes[0].fill_between(t, low, high, color=colour, alpha=0.25, linewidth=0)
    for panel in axes if from_s > 0 else ():
        panel.axvspan(0, from_s, color="#EEEEEE", lw=0)
    if from_s > 0:
        style.letter(axes[1], "b", "grey: not counted")
    if with_error and len(traces) > 1:
        counted = [line.y[line.t >= from_s] for line in shown[1].lines]
        top = max((float(np.max(np.abs(e))) for e in counted if len(e)), default=1.0)
        axes[1].set_ylim(-1.25 * top - 1e-9, 1.25 * top + 1e-9)
    style.legend_above(axes[0])
    errors = sorted((value, name) for name in traces if (value := metric(replay, name, "max_abs_error_nm")))
    text = caption("errors", found=[(value, controller_name(name)) for value, name in errors], unit=units[1])
    if not with_error:
        overshoots = []
        for name, one in replay.records.items():
            shares = [step.overshoot_pct for step in one.metrics.steps if step.overshoot_pct is not None]
            if shares:
                overshoots.append(f"{controller_name(name)} {number(max(shares), 2)} %")
        text = caption("steps", overshoots=overshoots, errors=text)
    return Ready(figure, text, (live_panels(shown),))


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


def sweep(replay: Replay) -> Ready | None:
    """Fig. 13: (a) amplitude [dB] and (b) mean absolute error over the frequency [Hz], a row a controller."""
    rows: dict[str, Trace] = {}
    for name, one in replay.records.items():
        tones = [row for row in one.metrics.frequencies if row.gain_db is not None]
        if tones:
            keys = ("frequency_hz", "gain_db", "mean_abs_error_nm")
            rows[name] = {key: np.array([getattr(row, key) for row in tones]) for key in keys}
    if not rows:
        return None
    figure, (gain, error) = style.sheet(style.COLUMN_IN, 3.3, 2, 1, sharex=True)
    for i, (name, row) in enumerate(rows.items()):
        look = {**style.controller_look(name, i), "marker": style.controller_marker(name, i)}
        gain.semilogx(row["frequency_hz"], row["gain_db"], label=controller_name(name), **look)
        error.semilogx(row["frequency_hz"], row["mean_abs_error_nm"], **look)
    gain.axhline(-3, color=style.GREY, linewidth=0.7, linestyle=":")
    gain.annotate("−3 dB", (1.01, -3), xycoords=("axes fraction", "data"), va="center")
    lowest = min(float(np.min(row["gain_db"])) for row in rows.values())
    gain.set(ylabel="Amplitude (dB)", ylim=(max(lowest - 2, -32), None))
    error.set(ylabel=f"Mean |error| ({replay.head.output_unit})", xlabel="Frequency (Hz)")
    error.set_ylim(0, None)
    f = np.concatenate([row["frequency_hz"] for row in rows.values()])
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1, 2, 3, 5, 10) if 0.95 * f.min() <= tick <= 1.05 * f.max()]
    for mark, axes in zip("ab", (gain, error), strict=True):
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        style.letter(axes, mark)
    style.legend_above(gain, 2 if len(rows) > 3 else 3)
    each = []
    for name, row in rows.items():
        below = row["frequency_hz"][row["gain_db"] < -3].tolist()
        each.append((controller_name(name), below[0] if below else None, float(np.max(row["gain_db"]))))
    return Ready(figure, caption("sweep", rows=each))


def recorded_input(replay: Replay) -> Ready | None:
    """Recorded output and the model's under the recorded input, a panel a run, at most six, spread over the outputs."""
    compared = {name: one.columns for name, one in replay.records.items() if one.role == "recorded-input"}
    if not compared:
        return None
    rms = {name: float(np.sqrt(np.mean((t["reference_nm"] - t["torque_nm"]) ** 2))) for name, t in compared.items()}
    by_output = sorted(compared, key=lambda name: float(np.max(compared[name]["reference_nm"])))
    chosen, out = some_levels(by_output, 6), replay.head.output_unit
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // columns)
    figure, every = style.sheet(style.PAGE_IN, 0.5 + 1.35 * rows, rows, columns)
    for panel in every[len(chosen) :]:
        panel.set_visible(False)
    heads = titles(chosen, 16 * len(chosen))
    for mark, head, name, panel in zip("abcdef", heads, chosen, every, strict=False):
        trace = compared[name]
        t = trace["time_s"]
        draw_line(panel, Line(t, trace["reference_nm"], "recorded", style.SKY, linewidth=2.2))
        draw_line(panel, Line(t, trace["torque_nm"], "model, same input", style.BLACK, (0, (4, 2))))
        style.letter(panel, mark, f"{head}: RMS {rms[name]:.2g}")
    for i, panel in enumerate(every):
        if i % columns == 0:
            panel.set_ylabel(quantity(out))
        if i + columns >= len(chosen):
            panel.set_xlabel("Time of the log (s)")
    style.legend_over(figure, every[0])
    found = sorted((value, name) for name, value in rms.items())
    return Ready(figure, caption("log", shown=len(chosen), rms=found, unit=out))


def guarantee(every: Sequence[Given[Replay]]) -> Ready | None:
    """What the robust term has to cover, |χ|, and its size ρ over time, in a replay with the robust controller."""
    for replay in sorted((one.result for one in every), key=lambda one: one.head.scenario != "multisine"):
        one = replay.records.get("rc")
        if one is None or not {"chi_nm_s", "rho_nm_s"} <= set(one.columns) or replay.head.scenario == "rehab":
            continue
        figure, (axes,) = style.sheet(style.COLUMN_IN, 2.3)
        t, rho = one.columns["time_s"], one.columns["rho_nm_s"]
        draw_line(axes, Line(t, rho, r"available, $\rho$", style.BLUE))
        draw_line(axes, Line(t, np.abs(one.columns["chi_nm_s"]), r"needed, $|\chi|$", style.VERMILLION, "--"))
        axes.set(xlabel="Time (s)", ylabel=f"Robust term ({replay.head.output_unit}/s)", xlim=(t[0], t[-1]))
        axes.set_ylim(0, 2.5 * float(np.median(rho)))
        style.legend_above(axes)
        return Ready(figure, caption("guarantee", share=one.metrics.guarantee_holds_fraction))
    return None


LOOPS = ("open-loop", "pi", "rc-no-rate", "rc")


def walls(couplings: Sequence[Given[Coupling]]) -> Ready | None:
    """−Im G/ω with its maximum, and the region of K and B_v, both around the middle torque of those held."""
    if not couplings or not couplings[0].result.walls:
        return None
    coupling = couplings[0].result
    torques = sorted({wall.torque_nm for wall in coupling.walls})
    at = torques[len(torques) // 2]
    figure, (needed, region) = style.sheet(style.PAGE_IN, 3.0, columns=2)
    for k, name in enumerate(LOOPS):
        colour = f"C{k}"
        for curve in coupling.curves:
            if (curve.loop, curve.torque_nm) == (name, at):
                f, asked = np.array(curve.frequency_hz), np.array(curve.needed_s)
                up = asked > 0
                needed.plot(f[up], asked[up], color=colour, label=controller_name(name))
                if up.any():
                    most = int(np.argmax(asked))
                    needed.plot(f[most], asked[most], "o", color=colour, markersize=4)
        for one in coupling.regions:
            if (one.loop, one.torque_nm) == (name, at):
                damping = [point.virtual_damping for point in one.points]
                for key, line in (("K_passive", "-"), ("K_stable", "--")):
                    held = [getattr(point, key) or np.nan for point in one.points]
                    region.plot(damping, held, line, color=colour)
    needed.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="damping asked for per stiffness (s)")
    region.set(yscale="log", xlabel="virtual damping (N·m·s/rad)", ylabel="stiffness (N·m/rad)")
    region.plot([], [], "-", color="0.3", label="passive")
    region.plot([], [], "--", color="0.3", label="stable on this limb")
    for mark, panel in zip("ab", (needed, region), strict=True):
        style.letter(panel, mark)
    style.legend_above(needed, columns=2)
    style.legend_above(region, columns=2)
    shown = [wall for wall in coupling.walls if wall.torque_nm == at and wall.loop in LOOPS]
    passive = [f"{controller_name(wall.loop)} {number(wall.K_passive, 3)}" for wall in shown]
    return Ready(figure, caption("walls", at=at, unit=coupling.output_unit, walls=passive))
