"""The nonlinear model of a fit, held against what a plant can be."""

from typing import Literal

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polytrim, polyval
from numpy.typing import NDArray

from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear
from eaid.results.fit import Fit

DUTIES = 101
"""Inputs, evenly over the identified range, at which a model is looked at, beside those where its curves turn."""
SLOWEST_S = 1e9
LARGEST = 1e15
ROUNDING = 1e-12
NEARLY = 1e-3
"""Share of the largest value by which τ2 may lie below τ1, or T_s below 0."""


def plant_of(fit: Fit) -> Nonlinear | None:
    """The nonlinear model of a fit, `Fit.plant`; None where the fit holds none.

    Raises `DataError` where, within the identified inputs, a time constant or T_s is none that a plant has: the floors
    of the replay are for drawn plants and for rounding, not for a model that is wrong.
    """
    part = fit.nonlinear
    if part is None:
        return None
    low, high = part.u_range
    if low > high:
        raise DataError(f"the fit's nonlinear.u_range is [{low:g}, {high:g}]; it has to rise from 0 or above")
    curves = [np.array(each) for each in (part.tau1, part.tau2, part.Ts)]
    turns = np.concatenate([_turning_points(each, high) for each in (*curves, curves[1] - curves[0])])
    inputs = np.union1d(np.linspace(low, high, DUTIES), turns[(turns > low) & (turns < high)])
    tau1, tau2, Ts = (polyval(inputs, each) for each in curves)
    for name, values, least, most, unit in (
        ("tau1", tau1, TAU_FLOOR_S / 2, SLOWEST_S, " s"),
        ("tau2", tau2, np.maximum(tau1 - NEARLY * np.max(tau2), TAU_FLOOR_S / 2), SLOWEST_S, " s"),
        ("Ts", Ts, -NEARLY * np.max(Ts) if np.max(Ts) > 1 / LARGEST else 1 / LARGEST, LARGEST, ""),
    ):
        wrong = ~((values >= least) & (values <= most))
        if wrong.any():
            k = int(wrong.argmax())
            below = ", below tau1" if name == "tau2" and 0 < values[k] < tau1[k] else ""
            raise DataError(
                f"the fit's nonlinear.{name} is {values[k]:.3g}{unit} at an input of {inputs[k]:.4g}{below}, which no "
                "plant has; fit again"
            )
    return fit.plant


def _turning_points(coefficients: NDArray[np.float64], high: float) -> NDArray[np.float64]:
    """Where a curve's slope is zero; a bend that is lost in rounding within [0, high] is none."""
    slope = polyder(coefficients * high ** np.arange(len(coefficients)))
    roots = polyroots(polytrim(slope, ROUNDING * np.abs(slope).max())) * high
    return np.real(roots[np.isreal(roots)])


def why_not(fit: Fit, part: Literal["linear", "nonlinear"]) -> str:
    """Why a model of the fit is not identifiable; empty where it is."""
    model = fit.linear if part == "linear" else fit.nonlinear
    if model is None or model.identifiable is not False:
        return ""
    stops = [each for each in fit.findings if each.subject == part and each.severity == "stop"]
    reasons = fit.not_identifiable_because(part) or stops
    return "; ".join(sentences(reasons)) or "most of its parameters have no interval"
