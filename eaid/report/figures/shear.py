"""Fig. 9: friction shear stress over the electric field, Eq. (1); our own point, computed."""

import numpy as np
from matplotlib.figure import Figure

from eaid.models import nonlinear
from eaid.report import style
from eaid.report.figures.values import nonlinear_of
from eaid.report.rig import apparatus_of
from eaid.results.fit import Fit


def shear_point(fit: Fit) -> tuple[float, float]:
    """Electric field [V/µm] and shear stress [kPa] of this clutch at its highest identified duty, Eq. (1)."""
    assert fit.nonlinear is not None
    rig, model = apparatus_of(fit.data), nonlinear_of(fit.nonlinear)
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
