"""Gains as the steps take them, from a `Gains`; and the paper's own, Table IV and §V-B."""

from eaid.control.bounds import Bounds
from eaid.control.options import DesignOptions
from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.control.rc_design import law_of
from eaid.errors import DataError
from eaid.models.parameters import PAPER_LINEAR
from eaid.results.gains import AntiWindup, Gains


def paper_gains() -> tuple[RCGains, PIGains]:
    """Table IV (ρ with B_M φ as printed, P = 5·I, B̂ = 12.5) and the PI of 21 and 360."""
    return law_of(PAPER_LINEAR, Bounds("zero-offset", (), 12.4, 42.6, ()), DesignOptions()).gains, PIGains(21.0, 360.0)


def rc_gains(gains: Gains) -> RCGains | None:
    """Gains of the robust controller; None where none were designed. DataError where a loop cannot run with them."""
    rc = gains.rc
    if rc is None:
        return None
    if not gains.model.b0 > 0:
        raise DataError(f"gains.json: b0 is {gains.model.b0:g}, it has to be positive; run tune-rc again")
    if not rc.Q[1][1] > 0:
        raise DataError(f"gains.json: Q[1][1] is {rc.Q[1][1]:g}, it has to be positive; run tune-rc again")
    low, high = gains.duty_limits_pct
    return RCGains(
        K_P=rc.K_P,
        K_D=rc.K_D,
        B_hat=rc.B_hat,
        a0=gains.model.a0,
        b0=gains.model.b0,
        c0=gains.model.c0,
        rho_constant=rc.rho.constant,
        rho_slope=rc.rho.slope,
        epsilon=rc.epsilon,
        gamma=rc.gamma,
        Q12=rc.Q[1][0],
        Q22=rc.Q[1][1],
        duty_min=low,
        duty_max=high,
        back_calculation=_gain(rc.anti_windup),
    )


def pi_gains(gains: Gains) -> PIGains | None:
    """Gains of the PI controller; None where none were designed."""
    pi = gains.pi
    if pi is None:
        return None
    low, high = gains.duty_limits_pct
    return PIGains(pi.K_P, pi.K_I, low, high, _gain(pi.anti_windup))


def _gain(wound: AntiWindup) -> float:
    return wound.gain if wound.method == "back-calculation" else 0.0
