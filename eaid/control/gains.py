"""Gains as the steps take them, from a `Gains`."""

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import DataError
from eaid.findings import sentences
from eaid.models.parameters import Nonlinear
from eaid.results.fit import Fit
from eaid.results.gains import AntiWindup, Gains
from eaid.results.verdict import unphysical

LARGEST = 1e30
"""Of any gain, and of the inverse of one that has to be positive, whatever the rig's units."""


def refuse_other_units(fit: Fit, gains: Gains | None) -> None:
    """DataError where gains are for another input or output than the fit's."""
    if gains is not None and (gains.input_unit, gains.output_unit) != (fit.data.input_unit, fit.data.output_unit):
        raise DataError(
            f"the gains are for an input in {gains.input_unit} and an output in {gains.output_unit}, the fit has "
            f"{fit.data.input_unit} and {fit.data.output_unit}; run tune-rc on this fit"
        )


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
    if wrong := unphysical(part):
        raise DataError(*sentences(wrong[:1]))
    return fit.plant
