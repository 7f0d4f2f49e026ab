"""Figs. 2 and 9: one period of the bipolar PWM, Eq. (2), and the shear stress over the electric field, Eq. (1)."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from eaid.apparatus import Apparatus
from eaid.models import nonlinear
from eaid.report import style
from eaid.report.ready import Ready, caption
from eaid.report.results import Results
from eaid.report.rig import apparatus_of, of_the_paper
from eaid.results.fit import Fit


def pwm_ready(results: Results) -> Ready | None:
    """Fig. 2, from the rig that a clutch fit or dataset names."""
    fit, data = results.fit("clutch"), results.data_of("clutch")
    if not of_the_paper(fit.data if fit is not None else data, results.paper):
        return None
    rig = apparatus_of(fit.data) if fit is not None else data.apparatus if data is not None else None
    return Ready(partial(pwm_period, rig), caption("pwm")) if rig is not None else None


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


def shear_ready(fit: Fit, results: Results) -> Ready | None:
    """Fig. 9, of the paper's kind of clutch only."""
    if fit.nonlinear is None or not of_the_paper(fit.data, results.paper):
        return None
    field, stress = shear_point(fit)
    top, unit = fit.nonlinear.u_range[1], fit.data.input_unit
    return Ready(partial(shear_per_field, fit), caption("shear", field=field, stress=stress, level=top, unit=unit))


def shear_point(fit: Fit) -> tuple[float, float]:
    """Electric field [V/µm] and shear stress [kPa] of this clutch at its highest identified duty, Eq. (1)."""
    assert fit.nonlinear is not None
    rig, model = apparatus_of(fit.data), fit.nonlinear.parameters
    return rig.field_v_per_um, rig.shear_kpa(float(nonlinear.steady_torque(model, model.u_range[1])))


def shear_per_field(fit: Fit) -> Figure:
    """This clutch's point, a hollow square as the paper marks adjustable rotary actuators, and lines of equal merit."""
    figure, (axes,) = style.column(2.5)
    field, shear = shear_point(fit)
    x, merit = np.array([0.0, 2 * field]), shear / field
    for factor in (0.5, 1.0, 2.0):
        axes.plot(x, factor * merit * x, color=style.GREY, linestyle="--", linewidth=0.8)
        right = factor <= 1
        at = (1.01, factor / 1.0 if right else 1.0) if right else (0.5, 1.01)
        axes.annotate(
            f"{factor * merit:.2g}", at, xycoords="axes fraction", va="center" if right else "bottom",
            ha="left" if right else "center",
        )  # fmt: skip
    axes.plot([field], [shear], "s", color=style.BLUE, markerfacecolor="white", markeredgewidth=1.4, markersize=7)
    axes.annotate(
        f"this clutch,\n{shear:.2f} kPa", (field, shear), (12, -4), textcoords="offset points", va="top",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip
    axes.set(xlabel="Electric field (V/µm)", ylabel="Shear stress (kPa)", xlim=(0, 2 * field), ylim=(0, 2 * shear))
    axes.text(1.01, 0.86, "kPa/\n(V/µm)", transform=axes.transAxes, va="top")
    axes.grid(visible=False)
    return figure
