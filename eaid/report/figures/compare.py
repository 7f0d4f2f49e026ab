"""Two fits over each other: what changed between two sets of discs, two days, two rigs."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eaid.models import nonlinear
from eaid.report import style
from eaid.report.figures.clutch import nonlinear_of
from eaid.report.figures.friction import LABELS, trend_x


def two_fits(first: Mapping[str, Any], second: Mapping[str, Any], names: tuple[str, str]) -> Figure:
    """T_s, τ1 and τ2 of both fits over the level: single levels with intervals, and the joint models."""
    figure, axes = style.sheet(style.PAGE_IN, 2.4, 1, 3)
    looks = ((style.BLUE, "-", "o"), (style.VERMILLION, "--", "s"))
    kind = (first.get("data") or {}).get("kind", "clutch")
    for fit, name, (colour, line, marker) in zip((first, second), names, looks, strict=True):
        rows = (fit.get("friction") or {}).get("levels") or []
        x = trend_x(fit.get("data") or {}, [float(row["level"]) for row in rows])
        for key, panel in zip(("Ts", "tau1", "tau2"), axes, strict=True):
            if rows:
                values = np.array([row[key] for row in rows], dtype=float)
                reach = np.zeros((2, len(rows)))
                for i, row in enumerate(rows):
                    interval = (row.get("ci95") or {}).get(key)
                    if interval and None not in interval:
                        reach[:, i] = [max(values[i] - interval[0], 0), max(interval[1] - values[i], 0)]
                panel.errorbar(x, values, yerr=reach, fmt=marker, color=colour, capsize=1.6, elinewidth=0.7, label=name)
            if kind == "clutch" and fit.get("nonlinear"):
                model = nonlinear_of(fit)
                u = np.linspace(*model.u_range, 150)
                tau1, tau2 = nonlinear.time_constants(model, u)
                curve = {"Ts": nonlinear.steady_torque(model, u), "tau1": tau1, "tau2": tau2}[key]
                panel.plot(u, curve, color=colour, linestyle=line, label=None if rows else name)
    label = {"clutch": "Duty (%)", "friction-force": "Normal stress (kPa)"}.get(kind, "Rotation speed (RPM)")
    for mark, key, panel in zip("abc", ("Ts", "tau1", "tau2"), axes, strict=True):
        panel.set(xlabel=label, ylabel=LABELS[key])
        panel.set_ylim(0, None)
        style.letter(panel, mark)
    axes[0].legend(loc="upper left")
    return figure
