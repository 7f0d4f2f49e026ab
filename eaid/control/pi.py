"""The PI controller of §V-B, as one pure step on plain floats: u = K_P e + K_I ∫ e dt.

The controller reads the torque at t_k and its duty acts until t_{k+1}; that duty uses the integral of the
samples before k.
"""

import cmath
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from eaid.errors import GainsError
from eaid.plant.linear import LinearPlant
from eaid.results.gains import AskedPI, Robust, Timing


class PIGains(NamedTuple):
    """All that `pi_step` needs; floats only."""

    K_P: float  # [%/(N·m)]
    K_I: float  # [%/(N·m·s)]
    duty_min: float = 0.0  # Lowest duty of the actuator [%]
    duty_max: float = 100.0  # Highest duty of the actuator [%]


def pi_step(
    gains: PIGains, integral: float, reference: float, _reference_rate: float, torque: float, dt: float
) -> tuple[float, float]:
    """One sample of the PI controller: the next integral of the error [N·m·s], 0 at rest, and the duty [%] until then.

    Reference and torque in N·m, its rate in N·m/s (not used: a PI feeds nothing forward), dt in s.
    """
    K_P, K_I, low, high = gains
    error = reference - torque
    wanted = K_P * error + K_I * integral
    duty = min(max(wanted, low), high)
    if (wanted - duty) * error > 0.0:  # beyond a limit, and the error would drive it further
        return integral, duty
    return integral + dt * error, duty


PAPER_PI = (21.0, 360.0)  # K_P and K_I of §V-B
BAND = 0.02  # Settling band, share of the step
BEYOND_BAND = BAND * (1 + 1e-9)  # A lobe that touches the band is within it: rounding must not tell
MOST_OVERSHOOT_PCT = 95.0  # Beyond it a loop swings for hundreds of periods
NO_OVERSHOOT = 1e-9  # An overshoot below this share of the step is none
ROOT_CLOSE = 1e-15  # Share of itself to which a root is found
INWARD = 1e-12  # By what share of itself p is drawn inward: where the settling time jumps, rounding must not undo it


class PIErrorStep(NamedTuple):
    """The error after a unit step of the reference, (s + a0)/(s² + p s + q), by the roots of its denominator:
    e(t) = e^(s2 t) (1 + (s1 + a0) (e^(d t) − 1)/d), d = s1 − s2."""

    a0: float
    s1: complex  # The faster one, where both are real
    s2: complex

    @classmethod
    def of(cls, a0: float, p: float, q: float) -> "PIErrorStep":
        """p > 0 and q > 0."""
        s1 = -p / 2 - cmath.sqrt(p * p / 4 - q)
        return cls(a0, s1, q / s1)

    def error(self, t_s: float) -> float:
        """e(t) at one time [s]."""
        d = self.s1 - self.s2
        grown = complex(np.expm1(d * t_s)) / d if d else t_s
        return (cmath.exp(self.s2 * t_s) * (1 + (self.s1 + self.a0) * grown)).real

    def turns(self) -> list[float]:
        """Times [s] at which ė = 0, up to the first within the band: e^(d t) = 1 + d x."""
        d, below = self.s1 - self.s2, self.s1 * (self.s1 + self.a0)
        if below == 0:
            return []
        x = -(self.s1 + self.s2 + self.a0) / below
        if d.imag == 0:
            if not (x.real > 0 and (1 + d * x).real > 0):
                return []
            return [float((np.log1p(d * x) / d if d else x).real)]
        spacing = 2 * math.pi / abs(d)
        turns = [float((np.log1p(d * x) / d).real)]
        if turns[0] <= 0:
            turns[0] += spacing
        while abs(self.error(turns[-1])) > BEYOND_BAND:
            turns.append(turns[-1] + spacing)
        return turns

    def overshoot(self) -> float:
        """Share of the step."""
        return max([0.0, *(-self.error(t) for t in self.turns())])

    def settling_s(self) -> float:
        """The last time at which the torque leaves the band."""
        turns = self.turns()
        start = max((t for t in turns if abs(self.error(t)) > BEYOND_BAND), default=0.0)
        end = min((t for t in turns if t > start), default=math.inf)
        if math.isinf(end):
            end = start + 1 / -(self.s1 + self.s2).real
            while abs(self.error(end)) > BAND:
                end = start + 2 * (end - start)
        side = math.copysign(1.0, self.error(start))
        return float(brentq(lambda t: side * self.error(t) - BAND, start, end, xtol=ROOT_CLOSE * end))


def step_metrics(model: LinearPlant, K_P: float, K_I: float) -> tuple[float, float]:
    """Overshoot [%] and 2 % settling time [s] of the closed loop on the linear model without c0; infinite where it does
    not settle."""
    p, q = model.a0 + model.b0 * K_P, model.b0 * K_I
    if q == 0:
        # No integral: the error ends at a0/p and stays there.
        rest = model.a0 / p
        return 0.0, math.log((1 - rest) / (BAND - rest)) / p if rest < BAND else math.inf
    loop = PIErrorStep.of(model.a0, p, q)
    return 100 * loop.overshoot(), loop.settling_s()


def _q_of_overshoot(a0: float, p: float, overshoot: float) -> float:
    """q that gives an overshoot (share of the step) at a given p; overshoot rises with q from q = a0 (p − a0)."""
    low = a0 * (p - a0)  # there zero and pole cancel: first order, no overshoot
    if overshoot <= NO_OVERSHOOT and low > 0:
        return low

    def above(q: float) -> float:
        return PIErrorStep.of(a0, p, q).overshoot() - overshoot if q > low else -overshoot

    high = max(low, p * p, a0 * a0)
    while above(high) < 0:
        high *= 2
    return float(brentq(above, low, high, xtol=ROOT_CLOSE * high))


def pi_gains(model: LinearPlant, overshoot_pct: float, settling_s: float) -> tuple[float, float]:
    """The least PI gains (K_P, K_I) with this overshoot [%] that settle within this time [s] (2 % band).

    Refused (GainsError) where no non-negative K_P does it: overshoot outside 0…95 %, or a settling time longer than
    pure integral control has.
    """
    if not 0 <= overshoot_pct <= MOST_OVERSHOOT_PCT:
        raise GainsError(
            f"an overshoot of {overshoot_pct:g} % is out of reach; give one from 0 to {MOST_OVERSHOOT_PCT:g} %"
        )
    if not settling_s > 0:
        raise GainsError(f"a settling time of {settling_s:g} s is out of reach; give one above 0 s")
    a0, share = model.a0, overshoot_pct / 100

    def settles(p: float) -> float:
        return PIErrorStep.of(a0, p, _q_of_overshoot(a0, p, share)).settling_s()

    # A loop with overshoot settles in about 4/σ or less; p from the open loop's up to far above what the time asks.
    low = a0 * (1 + 1e-9)
    if settles(low) < settling_s:
        raise GainsError(
            f"a settling time of {settling_s:g} s with {overshoot_pct:g} % overshoot is out of reach: integral control "
            f"alone settles in {settles(low):.3g} s; ask for less"
        )
    high = low
    while settles(high) > settling_s:
        low, high = high, high * 1.05
    high = float(brentq(lambda p: settles(p) - settling_s, low, high, xtol=ROOT_CLOSE * high))
    high *= 1 + INWARD
    return (high - a0) / model.b0, _q_of_overshoot(a0, high, share) / model.b0


class Wanted(NamedTuple):
    """What a controller of the table is designed for, once the robust controller and the PI have their gains."""

    model: LinearPlant
    rc: Robust | None  # None: refused
    timing: Timing
    limits: tuple[float, float]
    # (K_P, K_I) → what a step takes, factors on the dead time → the quickest PI that has 6 dB and 45° around every held
    # input under each of them; None: there is none
    quickest: Callable[[Callable[[float, float], Any], tuple[float, ...]], AskedPI | None]
