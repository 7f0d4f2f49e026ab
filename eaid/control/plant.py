"""The nonlinear model of a fit, held against what a plant can be."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.nonlinear import time_constants
from eaid.models.parameters import Nonlinear
from eaid.results.fit import Fit, FrictionLevel

DUTIES = 101
"""Inputs, evenly over the identified range, at which a model is looked at; the fit's own constraints hold there."""
SLOWEST_S = 1e9
LARGEST = 1e15


def plant_of(fit: Fit) -> Nonlinear | None:
    """The nonlinear model with the fitted release; None where the fit holds none.

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
    release = None if fit.release is None else (fit.release.tau1, fit.release.tau2)
    model = Nonlinear(part.tau1, part.tau2, part.Ts, (low, high), part.C, release)
    return replace(model, falls_as_release=falls_as_release(fit, model))


def why_not(fit: Fit, part: Literal["linear", "nonlinear"]) -> str:
    """Why a model of the fit is not identifiable; empty where it is."""
    model = fit.linear if part == "linear" else fit.nonlinear
    if model is None or model.identifiable is not False:
        return ""
    told = fit.not_identifiable_because(part)
    said = told or [one for one in fit.findings if one.subject == part and one.severity == "stop"]
    return "; ".join(sentences(said)) or "its data do not determine it"


def recorded_falls(fit: Fit) -> list[FrictionLevel]:
    """The fitted steps that fall from one level to another, not to rest."""
    levels = fit.friction.levels if fit.friction is not None else ()
    return [row for row in levels if row.from_ > row.level > 0]


def falls_as_release(fit: Fit, model: Nonlinear) -> bool:
    """Whether the recorded falls between levels are nearer to the release than to the rise, in log τ1 + log τ2."""
    falls = recorded_falls(fit)
    if model.release is None or not falls:
        return False
    nearer = 0.0
    for row in falls:
        rise = time_constants(model, row.level)
        for own, up, down in zip((row.tau1, row.tau2), rise, model.release, strict=True):
            nearer += abs(math.log(own / float(up))) - abs(math.log(own / down))
    return nearer > 0
