"""Live plots over time, panel above panel: tracking, the rehabilitation session, logs as recorded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.logs.run import Run
from eaid.report import style
from eaid.report.page.live import Plot
from eaid.report.rig import over, quantity
from eaid.results.recorded import LogCurve

INK, BLUE, RED = style.BLACK, style.BLUE, style.VERMILLION


@dataclass(frozen=True, eq=False)
class Line:
    """A curve of a panel."""

    t: Array
    y: Array
    name: str
    colour: str
    dash: str = "solid"


@dataclass(frozen=True, eq=False)
class Panel:
    """One of the panels: its label, its unit, and its curves; `named` puts them into a legend that hides by click."""

    label: str
    unit: str
    height: int
    lines: Sequence[Line]
    named: bool = False


def stack(panels: Sequence[Panel], time: str = "Time (s)") -> Mapping[str, Any]:
    """Panels that share their time, as plain data."""
    plot = Plot()
    for one in panels:
        drawn = plot.panel(time if one is panels[-1] else "", one.label, one.height, one.unit)
        for line in one.lines:
            legend = line.name if one.named else None
            plot.line(drawn, line.t, line.y, line.name, line.colour, line.dash, legend)
    return plot.finish()


def tracking(
    traces: Mapping[str, Mapping[str, Array]], units: tuple[str, str], with_error: bool = True
) -> Mapping[str, Any]:
    """Output, error and input of each controller over time."""
    unit, out = units
    output, error, acting = [], [], []
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        dash = {"-": "solid", "--": "dashed", "-.": "dashdot"}.get(look["linestyle"], "dotted")
        more = (style.controller_name(name), look["color"], dash)
        t = trace["time_s"]
        output.append(Line(t, trace["torque_nm"], *more))
        error.append(Line(t, trace["reference_nm"] - trace["torque_nm"], *more))
        acting.append(Line(t, trace["duty_pct"], *more))
    first = next(iter(traces.values()))
    output.append(Line(first["time_s"], first["reference_nm"], "reference", INK, "dotted"))
    panels = [Panel(quantity(out), out, 300, output, named=True), Panel(f"Error ({out})", out, 190, error)]
    return stack([*panels[: 1 + with_error], Panel(over(unit), unit, 190, acting)])


def training(trace: Mapping[str, Array], unit: str = "N·m") -> Mapping[str, Any]:
    """Angle, position error, output and its error of the rehabilitation replay over time."""
    t = trace["time_s"]
    angle = [Line(t, trace["target_deg"], "target", INK, "dashed"), Line(t, trace["angle_deg"], "angle", BLUE)]
    output = [Line(t, trace["desired_nm"], "desired", INK, "dashed"), Line(t, trace["rendered_nm"], "rendered", RED)]
    off = Line(t, trace["target_deg"] - trace["angle_deg"], "position error", BLUE)
    missed = Line(t, trace["desired_nm"] - trace["rendered_nm"], "error", RED)
    panels = [
        Panel("Angle (°)", "°", 210, angle, named=True),
        Panel("Position error (°)", "°", 150, [off]),
        Panel(quantity(unit), unit, 210, output, named=True),
        Panel(f"Error ({unit})", unit, 170, [missed]),
    ]
    return stack(panels)


def loop(run: Run) -> Mapping[str, Any]:
    """Output and reference of a closed loop over the time of its log, and its input where it was recorded."""
    output = [Line(run.time_s, run.output, "output", BLUE)]
    if run.reference_nm is not None:
        output.append(Line(run.time_s, run.reference_nm, "reference", INK, "dotted"))
    panels = [Panel(quantity(run.output_unit), run.output_unit, 280, output, named=True)]
    if run.has_input:
        panels.append(
            Panel(over(run.input_unit), run.input_unit, 150, [Line(run.time_s, run.input, "input", style.GREEN)])
        )
    return stack(panels, "Time of the log (s)")


def recorded(curve: LogCurve, units: tuple[str, str]) -> Mapping[str, Any]:
    """Input, measured and model, residual of one log over its own time."""
    t, (unit, out) = np.array(curve.time_s), units
    output = [
        Line(t, np.array(curve.measured), "measured", style.SKY),
        Line(t, np.array(curve.model), "model", INK, "dashed"),
    ]
    held = Line(np.repeat(t, 2)[1:], np.repeat(curve.input, 2)[:-1], "input", style.GREEN)
    panels = [
        Panel(over(unit), unit, 150, [held]),
        Panel(quantity(out), out, 280, output, named=True),
        Panel(f"Residual ({out})", out, 150, [Line(t, np.array(curve.residual), "residual", RED)]),
    ]
    return stack(panels, "Time of the log (s)")
