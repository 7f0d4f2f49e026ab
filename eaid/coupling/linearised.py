"""A torque loop around a held torque, linearised: the law and the plant's lags.

    law      s' = A s + b_r r + b_v ṙ + b_T T,   u = c s + d_r r + d_v ṙ + d_T T    by central differences
    plant    T = Σ x_i,   x_i' = (g_i u − x_i)/τ_i,   g_1 = C T_s'(u_0),  g_2 = (1 − C) T_s'(u_0)

around the duty u_0 with T_s(u_0) = T_0. There target − state is 0, so the changes of τ play no part.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.control.margins import Lag, integral_at_rest
from eaid.control.operating import lags_at
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.errors import UsageError
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.replay.inverse import InverseState, inverse_gains, inverse_step

Complex = NDArray[np.complex128]
LOOPS = ("open-loop", "pi", "rc-no-rate", "rc", "inverse")
"""rc-no-rate is the robust controller whose reference rate is left at 0."""


@dataclass(frozen=True)
class Point:
    """Where a loop is linearised."""

    torque_nm: float
    duty_pct: float
    lags: tuple[Lag, ...]
    """Of the plant there, in parallel."""


def operating_point(plant: Nonlinear, torque_nm: float) -> Point:
    """The duty that holds a torque, and the plant around it; UsageError for a torque outside the identified duties."""
    least, most = (float(steady_torque(plant, u)) for u in plant.u_range)
    if not least <= torque_nm <= most:
        raise UsageError(
            f"«torque» {torque_nm:g}: the fitted plant holds {least:.3g} to {most:.3g} within its identified inputs; "
            "choose a torque in between"
        )
    duty = float(brentq(lambda u: float(steady_torque(plant, u)) - torque_nm, *plant.u_range, xtol=1e-12))
    lags = lags_at(plant, duty)
    if not lags[0][0] > 0:
        raise UsageError(f"«torque» {torque_nm:g}: T_s does not rise with the input there; choose another torque")
    return Point(torque_nm, duty, lags)


@dataclass(frozen=True, eq=False)
class Law:
    """A controller around a point, per control sample: state s of shape (n,), inputs reference, its rate, torque."""

    A: Array
    B: Array
    """Shape (n, 3)."""
    c: Array
    d: Array
    """Shape (3,)."""

    def response(self, z: Complex) -> Complex:
        """Duty per reference, rate and torque, shape (len(z), 3)."""
        if not len(self.A):
            return np.broadcast_to(self.d.astype(complex), (len(z), 3)).copy()
        resolvent = np.linalg.inv(z[:, None, None] * np.eye(len(self.A)) - self.A)
        return np.asarray(self.c @ resolvent @ self.B + self.d)


Step = Callable[[tuple[float, ...], float, float, float], tuple[Any, float]]
"""step(state, reference, its rate, torque) → (next state, duty)"""


def step_of(
    loop: str, plant: Nonlinear, point: Point, rc: RCGains | None, pi: PIGains | None, dt_s: float
) -> tuple[Step, tuple[float, ...]]:
    """One control sample of a loop without limits, and its state at rest; UsageError where its gains are not given."""
    if loop == "open-loop":
        duties = np.linspace(*plant.u_range, 20_001)  # so fine a table is good to 1e-8 of the range
        steady = steady_torque(plant, duties)
        return lambda s, r, _v, _t: (s, float(np.interp(r, steady, duties))), ()
    if loop == "inverse":
        gains = inverse_gains(plant, limits=(0.0, plant.u_range[1]))
        start = (plant.C * point.torque_nm, (1 - plant.C) * point.torque_nm, 0.0, point.duty_pct)
        return lambda s, r, v, t: inverse_step(gains, InverseState(*s), r, v, t, dt_s), start
    if loop == "pi":
        if pi is None:
            raise UsageError("the loop pi needs gains with a PI; give «gains» that tune-rc wrote")
        free = pi._replace(duty_min=-math.inf, duty_max=math.inf, back_calculation=0.0)
        return lambda s, r, v, t: pi_step(free, PIState(*s), r, v, t, dt_s), (
            point.duty_pct / pi.K_I if pi.K_I else 0.0,
        )
    if loop not in LOOPS:
        raise UsageError(f"no loop {loop!r}; there are {', '.join(LOOPS)}")
    if rc is None:
        raise UsageError(f"the loop {loop} needs gains with a robust controller; give «gains» that tune-rc wrote")
    open_ended = rc._replace(duty_min=-math.inf, duty_max=math.inf, back_calculation=0.0)
    share = 1.0 if loop == "rc" else 0.0

    def step(s: tuple[float, ...], r: float, v: float, t: float) -> tuple[Any, float]:
        return rc_step(open_ended, RCState(*s), r, share * v, t, dt_s)

    return step, (integral_at_rest(rc, point.torque_nm, point.duty_pct),)


def linearised(step: Step, start: tuple[float, ...], point: Point) -> Law:
    """Central differences of a law's step around its rest."""
    n = len(start)
    at = np.array([*start, point.torque_nm, 0.0, point.torque_nm])

    def value(x: Array) -> Array:
        state, duty = step(tuple(x[:n].tolist()), *x[n:].tolist())
        return np.array([*state, duty])

    steps = 1e-5 * np.maximum(1.0, np.abs(at))
    slopes = np.column_stack([(value(at + e) - value(at - e)) / (2 * e.max()) for e in np.diag(steps)])
    return Law(slopes[:n, :n], slopes[:n, n:], slopes[n, :n], slopes[n, n:])
