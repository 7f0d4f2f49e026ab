"""Fig. 9: friction shear stress over the electric field, Eq. (1); our own point, computed."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.models import nonlinear
from eaid.report import style
from eaid.report.figures.clutch import nonlinear_of
from eaid.report.rig import apparatus_of


def shear_point(fit: Mapping[str, Any]) -> tuple[float, float]:
    """Electric field [V/µm] and shear stress [kPa] of this clutch at its highest identified duty, Eq. (1)."""
    rig = apparatus_of(fit["data"])
    model = nonlinear_of(fit)
    return rig.field_v_per_um, rig.shear_kpa(float(nonlinear.steady_torque(model, model.u_range[1])))


def shear_per_field(fit: Mapping[str, Any]) -> Figure:
    """This clutch's point, a hollow square as the paper marks adjustable rotary actuators, and lines of equal merit."""
    figure, (axes,) = style.sheet(style.COLUMN_IN, 2.3)
    field, shear = shear_point(fit)
    x = np.array([0.0, 2 * field])
    merit = shear / field
    for factor, line in ((0.5, ":"), (1.0, "--"), (2.0, "-.")):
        axes.plot(x, factor * merit * x, color=style.GREY, linestyle=line, linewidth=0.8)
        at = min(1.9 * field, 1.9 * shear / (factor * merit))
        axes.annotate(
            f"{factor * merit:.2g} kPa/(V/µm)", (at, factor * merit * at), fontsize=6, ha="right", va="bottom",
            xytext=(-2, 1), textcoords="offset points",
        )  # fmt: skip
    axes.plot([field], [shear], "s", color=style.BLUE, markerfacecolor="white", markeredgewidth=1.2, markersize=6)
    axes.annotate(
        f"this clutch\n{shear:.2f} kPa at {field:.2f} V/µm", (field, shear), (8, -14), textcoords="offset points",
        fontsize=6.8, va="top", bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip
    axes.set(xlabel="Electric field (V/µm)", ylabel="Shear stress (kPa)", xlim=(0, 2 * field), ylim=(0, 2 * shear))
    return figure
