"""Gains as the steps take them, from a `Gains`; and the paper's own, Table IV and §V-B."""

from typing import Literal

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polytrim, polyval
from numpy.typing import NDArray

from eaid.control.bounds import Bounds
from eaid.control.margins import RIG
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.control.robust import Design, law_of
from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.parameters import PAPER_LINEAR, TAU_FLOOR_S, Nonlinear
from eaid.options import TuneOptions
from eaid.results.fit import Fit
from eaid.results.gains import AntiWindup, AskedPI, Gains

LARGEST = 1e30
"""Of any gain, and of the inverse of one that has to be positive, whatever the rig's units."""


def paper_gains() -> tuple[RCGains, PIGains]:
    """Table IV (ρ with B_M φ as printed, P = 5·I, B̂ = 12.5) and the PI of 21 and 360."""
    papers = Design(TuneOptions(), 4.5, 3.0, 5.0, 0.05, None, 0.5, 50.0, AskedPI(), (0.0, 100.0), RIG)
    return law_of(PAPER_LINEAR, Bounds((), 12.4, 42.6, ()), papers)[0], PIGains(21.0, 360.0)


def rc_gains(gains: Gains | None) -> RCGains | None:
    """Gains of the robust controller; None where there are none. DataError where a loop cannot run with them."""
    if gains is None or gains.rc is None:
        return None
    rc = gains.rc
    low, high = gains.duty_limits_pct
    model, (Q12, Q22) = gains.model, rc.Q[1]
    positive = {"b0": model.b0, "Q[1][1]": Q22, "B_hat": rc.B_hat, "epsilon": rc.epsilon, "gamma": rc.gamma}
    _check(
        {**positive, "K_P": rc.K_P, "K_D": rc.K_D},
        {"a0": model.a0, "c0": model.c0, "Q[1][0]": Q12, "rho.constant": rc.rho.constant, "rho.slope": rc.rho.slope},
    )
    return RCGains(
        K_P=rc.K_P, K_D=rc.K_D, B_hat=rc.B_hat, a0=model.a0, b0=model.b0, c0=model.c0, rho_constant=rc.rho.constant,
        rho_slope=rc.rho.slope, epsilon=rc.epsilon, gamma=rc.gamma, Q12=Q12, Q22=Q22, duty_min=low, duty_max=high,
        back_calculation=_gain(rc.anti_windup),
    )  # fmt: skip


def pi_gains(gains: Gains | None) -> PIGains | None:
    """Gains of the PI controller; None where there are none. DataError where a loop cannot run with them."""
    if gains is None or gains.pi is None:
        return None
    pi = gains.pi
    _check({}, {"pi.K_P": pi.K_P, "pi.K_I": pi.K_I})
    low, high = gains.duty_limits_pct
    return PIGains(pi.K_P, pi.K_I, low, high, _gain(pi.anti_windup))


def _check(positive: dict[str, float], other: dict[str, float]) -> None:
    """Refuse numbers with which no loop of a rig runs."""
    for name, value in {**positive, **other}.items():
        if name in positive and not value > 0:
            raise DataError(f"gains.json: {name} is {value:g}, it has to be positive; run tune-rc again")
        if abs(value) > LARGEST or (name in positive and value < 1 / LARGEST):
            raise DataError(f"gains.json: {name} is {value:g}, which no loop of a rig has; run tune-rc again")


def _gain(wound: AntiWindup) -> float:
    return wound.gain if wound.method == "back-calculation" else 0.0


DUTIES = 101
"""Inputs, evenly over the identified range, at which a model is looked at, beside those where its curves turn."""
SLOWEST_S = 1e9
LARGEST_TORQUE = 1e15
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
        ("Ts", Ts, -NEARLY * np.max(Ts) if np.max(Ts) > 1 / LARGEST_TORQUE else 1 / LARGEST_TORQUE, LARGEST_TORQUE, ""),
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
