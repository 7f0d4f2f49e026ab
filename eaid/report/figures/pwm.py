"""Fig. 2: one period of the bipolar PWM, Eq. (2), and the torque it would ideally give."""

import numpy as np
from matplotlib.figure import Figure

from eaid.apparatus import Apparatus
from eaid.report import style


def pwm_period(rig: Apparatus, duty_pct: float = 60.0) -> Figure:
    """One PWM period at a duty [%]: voltage [V], and the ideal torque as a share of the torque at full duty.

    Eq. (2): duty = 2 P_a / P; P_a is the time at +V and the time at −V, the rest of the period is 0.
    """
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.1)
    period_ms = 1e3 / rig.pwm_hz
    active_ms = period_ms * duty_pct / 200
    half = period_ms / 2
    edges = [0, 0, active_ms, active_ms, half, half, half + active_ms, half + active_ms, period_ms]
    v = rig.voltage_v
    axes.plot(edges, [0, v, v, 0, 0, -v, -v, 0, 0], color=style.BLACK, label="voltage")
    axes.plot(
        edges, [0, v, v, 0, 0, v, v, 0, 0], color=style.VERMILLION, linestyle="--", label="ideal torque (1 = full)"
    )
    axes.annotate("", (0, -0.42 * v), (active_ms, -0.42 * v), arrowprops={"arrowstyle": "<->", "lw": 0.6})
    axes.text(active_ms / 2, -0.39 * v, r"$P_a$", ha="center", va="bottom")
    axes.annotate("", (0, -1.25 * v), (period_ms, -1.25 * v), arrowprops={"arrowstyle": "<->", "lw": 0.6})
    axes.text(half, -1.23 * v, rf"$P$ = {period_ms:.2f} ms", ha="center", va="bottom")
    axes.set(xlabel="Time (ms)", ylabel="Voltage (V)", ylim=(-1.35 * v, 1.55 * v), xlim=(0, period_ms))
    axes.legend(loc="upper center", ncols=2)
    scale = axes.secondary_yaxis("right", functions=(lambda volts: np.asarray(volts) / v, lambda y: np.asarray(y) * v))
    scale.set_yticks([0, 1])
    scale.set_ylabel("Ideal torque (1)", y=0.6)
    return figure
