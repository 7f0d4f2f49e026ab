"""Live plots of replays: tracking, and the rehabilitation session."""

from collections.abc import Mapping
from typing import Any

from eaid.arrays import Array
from eaid.report import style
from eaid.report.page.live import Plot, pair
from eaid.report.rig import over, quantity


def tracking(
    traces: Mapping[str, Mapping[str, Array]], units: tuple[str, str], with_error: bool = True
) -> Mapping[str, Any]:
    """Output, error and input of each controller over time; clicking a name in the legend hides it."""
    plot = Plot()
    unit, out = units
    output = plot.panel("", quantity(out), 300, out)
    error = plot.panel("", f"Error ({out})", 190, out) if with_error else None
    duty = plot.panel("Time (s)", over(unit), 190, unit)
    for i, (name, trace) in enumerate(traces.items()):
        look = style.controller_look(name, i)
        colours = pair(look["color"])
        dash = {"-": "solid", "--": "dashed", "-.": "dashdot"}.get(look["linestyle"], "dotted")
        said = style.controller_name(name)
        t = trace["time_s"]
        plot.line(output, t, trace["torque_nm"], said, colours, dash, legend=said)
        if error is not None:
            plot.line(error, t, trace["reference_nm"] - trace["torque_nm"], said, colours, dash)
        plot.line(duty, t, trace["duty_pct"], said, colours, dash)
    first = next(iter(traces.values()))
    plot.line(output, first["time_s"], first["reference_nm"], "reference", pair(style.BLACK), "dotted", "reference")
    return plot.finish()


def training(trace: Mapping[str, Array]) -> Mapping[str, Any]:
    """Angle, position error, torque and torque error of the rehabilitation replay over time."""
    plot = Plot()
    ink, blue, red = (pair(c) for c in (style.BLACK, style.BLUE, style.VERMILLION))
    t = trace["time_s"]
    angle = plot.panel("", "Angle (°)", 210, "°")
    plot.line(angle, t, trace["target_deg"], "target", ink, "dashed", legend="target")
    plot.line(angle, t, trace["angle_deg"], "angle", blue, legend="angle")
    position = plot.panel("", "Position error (°)", 150, "°")
    plot.line(position, t, trace["target_deg"] - trace["angle_deg"], "position error", blue)
    torque = plot.panel("", "Torque (N·m)", 210, "N·m")
    plot.line(torque, t, trace["desired_nm"], "desired", ink, "dashed", legend="desired")
    plot.line(torque, t, trace["rendered_nm"], "rendered", red, legend="rendered")
    error = plot.panel("Time (s)", "Torque error (N·m)", 170, "N·m")
    plot.line(error, t, trace["desired_nm"] - trace["rendered_nm"], "torque error", red)
    return plot.finish()
