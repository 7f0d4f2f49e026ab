"""Two fits over each other: what changed between two sets of discs, two days, two rigs."""

import numpy as np
from matplotlib.figure import Figure

from eaid.report import style
from eaid.report.figures.clutch import values_over
from eaid.report.figures.friction import axis_label, intervals_of, reach, trend_x
from eaid.results.fit import Fit

LOOKS = ((style.BLUE, "-", "o"), (style.VERMILLION, "--", "s"))


def two_fits(first: Fit, second: Fit, names: tuple[str, str]) -> Figure:
    """T_s, τ1 and τ2 of both fits over the level: single levels with intervals, and the models."""
    figure, axes = style.page(2.5, 1, 3)
    for fit, name, (colour, line, marker) in zip((first, second), map(_short, names), LOOKS, strict=True):
        rows = fit.friction.levels if fit.friction is not None else ()
        x, _label = trend_x(fit)
        low, high = fit.nonlinear.u_range if fit.nonlinear is not None else (0.0, 1.0)
        u = np.linspace(low, high, 150)
        curves = values_over(fit.nonlinear, u) if fit.nonlinear is not None else {}
        for key, panel in zip(("Ts", "tau1", "tau2"), axes, strict=True):
            if rows:
                values = np.array([getattr(row, key) for row in rows])
                far = reach(values, intervals_of(rows, key))
                panel.errorbar(x, values, yerr=far, fmt=marker, color=colour, capsize=1.6, elinewidth=0.7, label=name)
            if curves:
                panel.plot(u, curves[key], color=colour, linestyle=line, label=None if rows else name)
    for mark, key, panel in zip("abc", ("Ts", "tau1", "tau2"), axes, strict=True):
        panel.set(xlabel=trend_x(first)[1], ylabel=axis_label(key, first.data.output_unit))
        panel.set_ylim(0, None)
        style.letter(panel, mark)
    style.legend_over(figure, axes[0])
    return figure


def _short(name: str) -> str:
    """A file's name that fits above a figure."""
    return name if len(name) <= 48 else f"…{name[-47:]}"
