"""Fig. 2: one period of the bipolar PWM, Eq. (2), and the torque it would ideally give."""

import numpy as np
from matplotlib.figure import Figure

from eaid.apparatus import Apparatus
from eaid.report import style


def pwm_period(rig: Apparatus, duty_pct: float = 60.0) -> Figure:
    """One PWM period at a duty [%]: (a) voltage [V], (b) the ideal torque as a share of the torque at full duty.

    Eq. (2): duty = 2 P_a / P; P_a is the time at +V and the time at −V, the rest of the period is 0.
    """
    figure, (voltage, torque) = style.column(2.5, 2, 1, sharex=True, height_ratios=(1.7, 1))
    period_ms = 1e3 / rig.pwm_hz
    active_ms = period_ms * duty_pct / 200
    half, v = period_ms / 2, rig.voltage_v
    edges = [0, 0, active_ms, active_ms, half, half, half + active_ms, half + active_ms, period_ms]
    voltage.plot(edges, [0, v, v, 0, 0, -v, -v, 0, 0], color=style.BLACK)
    torque.plot(edges, [0, 1, 1, 0, 0, 1, 1, 0, 0], color=style.BLUE)
    torque.fill_between(edges, [0, 1, 1, 0, 0, 1, 1, 0, 0], color=style.BLUE, alpha=0.15, linewidth=0)
    for text, end, height in ((r"$P_a$", active_ms, -0.45 * v), (rf"$P$ = {period_ms:.2f} ms", period_ms, -1.5 * v)):
        voltage.annotate("", (0, height), (end, height), arrowprops={"arrowstyle": "<->", "lw": 0.6, "shrinkA": 0})
        voltage.text(end / 2, height, text, ha="center", va="bottom")
    voltage.set(ylabel="Voltage (V)", ylim=(-1.75 * v, 1.25 * v), yticks=[-v, 0, v])
    torque.set(ylabel="Ideal\ntorque (1)", xlabel="Time (ms)", xlim=(0, period_ms), ylim=(0, 1.2), yticks=np.arange(2))
    style.letter(voltage, "a", f"duty 2 $P_a$/$P$ = {duty_pct:.0f} %")
    style.letter(torque, "b")
    return figure
