"""The PI controller of §V-B, as one pure step on plain floats: u = K_P e + K_I ∫ e dt.

The controller reads the torque at t_k and its duty acts until t_{k+1}; that duty uses the integral of the
samples before k.
"""

import math
from typing import NamedTuple

from scipy.optimize import brentq

from eaid.errors import GainsError
from eaid.models.parameters import Linear


class PIGains(NamedTuple):
    """All that `pi_step` needs; floats only."""

    K_P: float  # [%/(N·m)]
    K_I: float  # [%/(N·m·s)]
    duty_min: float = 0.0  # Lowest duty of the actuator [%]
    duty_max: float = 100.0  # Highest duty of the actuator [%]


class PIState(NamedTuple):
    """What the controller remembers between samples; at rest, nothing."""

    integral: float = 0.0  # Integral of the torque error [N·m·s]


def pi_step(
    gains: PIGains, state: PIState, reference: float, _reference_rate: float, torque: float, dt: float
) -> tuple[PIState, float]:
    """One sample of the PI controller: the next state, and the duty [%] that acts until the next sample.

    Reference and torque in N·m, its rate in N·m/s (not used: a PI feeds nothing forward), dt in s.
    """
    K_P, K_I, low, high = gains
    integral = state.integral
    error = reference - torque
    wanted = K_P * error + K_I * integral
    duty = min(max(wanted, low), high)
    if (wanted - duty) * error > 0.0:  # beyond a limit, and the error would drive it further
        return state, duty
    return PIState(integral + dt * error), duty


PAPER_PI = (21.0, 360.0)  # K_P and K_I of §V-B
BAND = 0.02  # Settling band, share of the step
MOST_OVERSHOOT_PCT = 95.0  # Beyond it a loop swings for hundreds of periods
NONE = 1e-9  # An overshoot below this share of the step is none
CLOSE = 1e-15  # Share of itself to which a root is found
INWARD = 1e-12  # By what share of itself p is drawn inward: where the settling time jumps, rounding must not undo it


def error(a0: float, p: float, q: float, t_s: float) -> float:
    """Error e(t) after a unit step of the reference, at one time [s]."""
    sigma = p / 2
    square = q - sigma * sigma
    if square > 0:
        omega = math.sqrt(square)
        return math.exp(-sigma * t_s) * (math.cos(omega * t_s) + (a0 - sigma) * t_s * _sinc(omega * t_s))
    kappa = math.sqrt(-square)
    # e^(−σt) cosh κt overflows nowhere when written as two decaying exponentials; q > 0 keeps κ < σ.
    slow, fast = math.exp(-(sigma - kappa) * t_s), math.exp(-(sigma + kappa) * t_s)
    x = kappa * t_s
    ratio = slow * -math.expm1(-2 * x) / (2 * x) if x > 1e-8 else slow
    return (slow + fast) / 2 + (a0 - sigma) * t_s * ratio


def _sinc(x: float) -> float:
    return math.sin(x) / x if x > 1e-8 else 1.0


def _extrema(a0: float, p: float, q: float) -> tuple[float, float]:
    """First time [s] at which ė = 0, and the time between extrema; infinite where there is none.

    ė = e^(−σt) ((a0 − p) c − (q − σ² + σ (a0 − σ)) s), zero where (a0 − p) c = m s.
    """
    sigma = p / 2
    square = q - sigma * sigma
    m = square + sigma * (a0 - sigma)
    if square > 0:
        omega = math.sqrt(square)
        first = math.atan2((a0 - p) * omega, m) / omega
        while first <= 0:
            first += math.pi / omega
        return first, math.pi / omega
    kappa = math.sqrt(-square)
    # tanh(κt)/κ = (a0 − p)/m
    if m == 0:
        return math.inf, math.inf
    ratio = (a0 - p) / m
    if ratio <= 0 or kappa * ratio >= 1:
        return math.inf, math.inf
    return (math.atanh(kappa * ratio) / kappa if kappa * ratio > 1e-8 else ratio), math.inf


def step_metrics(model: Linear, K_P: float, K_I: float) -> tuple[float, float]:
    """Overshoot [%] and 2 % settling time [s] of the closed loop on the linear model without c0.

    The time is the last at which the torque leaves the band; infinite where the loop does not settle.
    """
    p, q = model.a0 + model.b0 * K_P, model.b0 * K_I
    if p <= 0 or q < 0:
        return math.inf, math.inf
    if q == 0:
        # No integral: the error ends at a0/p and stays there.
        rest = model.a0 / p
        return 0.0, math.log((1 - rest) / (BAND - rest)) / p if rest < BAND else math.inf
    return _metrics(model.a0, p, q)


def _metrics(a0: float, p: float, q: float) -> tuple[float, float]:
    first, spacing = _extrema(a0, p, q)
    turns = [first]
    while math.isfinite(turns[-1]) and math.isfinite(spacing) and abs(error(a0, p, q, turns[-1])) > BAND:
        turns.append(turns[-1] + spacing)
    peaks = [error(a0, p, q, t) for t in turns if math.isfinite(t)]
    overshoot = max([0.0, *(-peak for peak in peaks)])
    outside = [t for t, peak in zip(turns, peaks, strict=False) if abs(peak) > BAND]
    start = outside[-1] if outside else 0.0
    later = [t for t in turns if t > start and math.isfinite(t)]
    end = later[0] if later else start + 1 / p
    while not later and abs(error(a0, p, q, end)) > BAND:
        end = start + 2 * (end - start)
    settling = brentq(lambda t: abs(error(a0, p, q, t)) - BAND, start, end, xtol=CLOSE * end)
    return 100 * overshoot, float(settling)


def _q_of_overshoot(a0: float, p: float, overshoot: float) -> float:
    """q that gives an overshoot (share of the step) at a given p; overshoot rises with q from q = a0 (p − a0)."""
    low = a0 * (p - a0)  # there zero and pole cancel: first order, no overshoot
    if overshoot <= NONE and low > 0:
        return low

    def above(q: float) -> float:
        return _metrics(a0, p, q)[0] / 100 - overshoot if q > low else -overshoot

    high = max(low, p * p, a0 * a0)
    while above(high) < 0:
        high *= 2
    return float(brentq(above, low, high, xtol=CLOSE * high))


def pi_gains(model: Linear, overshoot_pct: float, settling_s: float) -> tuple[float, float]:
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
        return _metrics(a0, p, _q_of_overshoot(a0, p, share))[1]

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
    high = float(brentq(lambda p: settles(p) - settling_s, low, high, xtol=CLOSE * high))
    high *= 1 + INWARD
    return (high - a0) / model.b0, _q_of_overshoot(a0, high, share) / model.b0
