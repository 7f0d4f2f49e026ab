"""Frequency response of a recorded log with its 95 % regions, those of the models on the same input, and coherence."""

import numpy as np
from matplotlib.figure import Figure

from eaid.report import style
from eaid.results.recorded import Response


def bode(response: Response, input_unit: str = "%", output_unit: str = "N·m") -> Figure:
    """Gain, phase and coherence over frequency."""
    figure, (gain, phase, coherence) = style.column(4.2, rows=3, sharex=True)
    f = np.array(response.frequency_hz)
    angle, half = np.array(response.phase_deg), np.array(response.phase_half_width_deg)
    gain.fill_between(f, response.gain_low, response.gain_high, alpha=0.25, color="0.4", linewidth=0)
    gain.plot(f, response.gain, color="0.2", label="recorded")
    known = half < 90  # beyond, the region holds the origin and says nothing of the phase
    phase.fill_between(f, angle - half, angle + half, where=known, alpha=0.25, color="0.4", linewidth=0)
    phase.plot(f, angle, color="0.2")
    for name, line, size, turned in (
        ("nonlinear model", "-", response.nonlinear_gain, response.nonlinear_phase_deg),
        ("linear model", "--", response.linear_gain, response.linear_phase_deg),
    ):
        if size:
            gain.plot(f, size, line, label=name)
            phase.plot(f, turned, line)
    coherence.plot(f, response.coherence, color="0.2")
    gain.set(xscale="log", yscale="log", ylabel=f"gain [{output_unit}/{input_unit}]")
    phase.set(ylabel="phase [°]")
    coherence.set(ylabel="coherence", xlabel="frequency [Hz]", ylim=(0, 1.05))
    style.legend_above(gain, columns=3)
    return figure
