"""The nonlinear model of a fit, held against what a plant can be."""

from typing import Literal

import numpy as np
from numpy.polynomial.polynomial import polyval

from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear
from eaid.results.fit import Fit

DUTIES = 101
"""Inputs, evenly over the identified range, at which a model is looked at; the fit's own constraints hold there."""
SLOWEST_S = 1e9
LARGEST = 1e15
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
    inputs = np.linspace(low, high, DUTIES)
    tau1, tau2, Ts = (polyval(inputs, coefficients) for coefficients in (part.tau1, part.tau2, part.Ts))
    _, slope, bend = part.tau1
    lowest = np.clip(-slope / (2 * bend), low, high) if bend > 0 else low
    for name, at, values, least, most, unit in (
        ("tau1", inputs, tau1, TAU_FLOOR_S / 2, SLOWEST_S, " s"),
        ("tau1", np.array([lowest]), polyval(np.array([lowest]), part.tau1), TAU_FLOOR_S / 2, SLOWEST_S, " s"),
        ("tau2", inputs, tau2, np.maximum(tau1 - NEARLY * np.max(tau2), TAU_FLOOR_S / 2), SLOWEST_S, " s"),
        ("Ts", inputs, Ts, -NEARLY * np.max(Ts) if np.max(Ts) > 1 / LARGEST else 1 / LARGEST, LARGEST, ""),
    ):
        wrong = ~((values >= least) & (values <= most))
        if wrong.any():
            k = int(wrong.argmax())
            below = ", below tau1" if name == "tau2" and 0 < values[k] < tau1[k] else ""
            raise DataError(
                f"the fit's nonlinear.{name} is {values[k]:.3g}{unit} at an input of {at[k]:.4g}{below}, which no "
                "plant has; fit again"
            )
    return fit.plant


def why_not(fit: Fit, part: Literal["linear", "nonlinear"]) -> str:
    """Why a model of the fit is not identifiable; empty where it is."""
    model = fit.linear if part == "linear" else fit.nonlinear
    if model is None or model.identifiable is not False:
        return ""
    stops = [each for each in fit.findings if each.subject == part and each.severity == "stop"]
    reasons = fit.not_identifiable_because(part) or stops
    return "; ".join(sentences(reasons)) or "most of its parameters have no interval"
