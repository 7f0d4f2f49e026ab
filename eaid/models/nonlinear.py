"""The nonlinear clutch model, Eqs. (4)–(7): the friction curve with τ1(u), τ2(u) and T_s(u) polynomials of the duty.

Outside the identified duties specification 4.2 rules: below the lowest τ1, τ2 keep their edge value, T_s goes linearly
to 0 at u = 0; above the highest all keep their edge value.
"""

import numpy as np
from numpy.polynomial.polynomial import polyval

from eaid.arrays import Array
from eaid.models import friction
from eaid.models.parameters import Friction, Nonlinear

CHECKED_DUTIES = 101  # Equally spaced duties, from the lowest to the highest identified, at which the constraints hold


def time_constants(p: Nonlinear, duty_pct: Array | float) -> tuple[Array, Array]:
    """τ1(u) and τ2(u) [s], Eqs. (5), (6), shape of `duty_pct`; edge values outside the identified duties."""
    inside = np.clip(duty_pct, *p.u_range)
    return polyval(inside, p.tau1), polyval(inside, p.tau2)


def steady_torque(p: Nonlinear, duty_pct: Array | float) -> Array:
    """T_s(u) [N·m], Eq. (7), shape of `duty_pct`; a line to 0 below the identified duties, constant above."""
    inside = np.clip(duty_pct, *p.u_range)
    edge = polyval(inside, p.Ts)
    below = np.clip(np.asarray(duty_pct) / p.u_range[0], 0.0, 1.0) if p.u_range[0] > 0 else 1.0
    return np.asarray(edge * below)


def terms(duty_pct: Array | float, count: int, u_range: tuple[float, float]) -> Array:
    """∂/∂coefficients of a polynomial of u/100 with so many, (n, count); edge values outside the identified duties."""
    return np.vander(np.atleast_1d(np.clip(duty_pct, *u_range)) / 100, count, increasing=True)


def scales(count: int) -> Array:
    """Coefficients of u/100 over those of u, (count,)."""
    return np.asarray(100.0 ** np.arange(count))


def at_duty(p: Nonlinear, duty_pct: float) -> Friction:
    """The friction curve that the model has at one duty."""
    tau1, tau2 = time_constants(p, duty_pct)
    return Friction(steady_torque(p, duty_pct).item(), tau1.item(), tau2.item(), p.C)


def step_response(p: Nonlinear, t_s: Array, duty_pct: float) -> Array:
    """Torque after a duty step from rest [N·m], Eq. (4), shape of `t_s`."""
    return friction.step_response(at_duty(p, duty_pct), t_s)
