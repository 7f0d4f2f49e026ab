"""The nonlinear model of a fit, held against what a plant can be."""

from typing import Literal

import numpy as np

from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.parameters import Nonlinear
from eaid.results.fit import Fit

DUTIES = 101
"""Inputs, evenly over the identified range, at which a model is looked at; the fit's own constraints hold there."""
SLOWEST_S = 1e9
LARGEST = 1e15


def plant_of(fit: Fit) -> Nonlinear | None:
    """The nonlinear model of a fit, `Fit.plant`; None where the fit holds none.

    Raises `DataError` where a time constant is not positive within the identified inputs, or no number of a rig.
    """
    part = fit.nonlinear
    if part is None:
        return None
    low, high = part.u_range
    if low > high:
        raise DataError(f"the fit's nonlinear.u_range is [{low:g}, {high:g}]; it has to rise from 0 or above")
    inputs = np.linspace(low, high, DUTIES)
    for name, most in (("tau1", SLOWEST_S), ("tau2", SLOWEST_S), ("Ts", LARGEST)):
        values = np.polynomial.polynomial.polyval(inputs, getattr(part, name))
        wrong = ~(np.abs(values) <= most) if name == "Ts" else ~((values > 0) & (values <= most))
        if wrong.any():
            k = int(wrong.argmax())
            unit = "" if name == "Ts" else " s"
            raise DataError(
                f"the fit's nonlinear.{name} is {values[k]:.3g}{unit} at an input of {inputs[k]:.4g}, which no plant "
                "has; fit again"
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
