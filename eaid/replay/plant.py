"""The plant of a replay: the nonlinear model in its dynamic form, advanced exactly from sample to sample.

    x1' = (C T_s(u) − x1)/τ1(u),   x2' = ((1 − C) T_s(u) − x2)/τ2(u),   T = x1 + x2       Eqs. (4)-(7)
    x ← x + (1 − e^(−dt/τ)) (target − x)                                                 exact while u is held

Outside the identified duties: below the lowest, u_low, τ1 and τ2 keep their edge value and T_s goes linearly to 0 at
u = 0; above the highest, all keep their edge value.

Release constants were fitted to falls from a level to rest, so they hold for falls to rest. A part that falls towards
a duty u below u_low has τ = s τ(u_low) + (1 − s) τ_release, s = u/u_low, the line that T_s follows there; a part that
falls towards an identified duty has that duty's own τ(u), as one that rises to it. Where falls between identified
duties were recorded and are as quick as the release, every fall has its constants (`falls_as_release`).

Floors, for plants drawn from an uncertain fit: τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0, as the fit's constraints have them.

A PWM latches the duty once a period; where that is no whole number of samples, the interval is cut where the new duty
takes over.

Floats and `math` only: numba compiles these functions as they stand, and plain Python runs them in about a microsecond.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear

INSTANT = 1e-9  # Two instants nearer than this share of a sample are one


class PlantParameters(NamedTuple):
    """`Nonlinear` as the loops take it, floats throughout; polynomials of the duty in %, lowest power first."""

    C: float
    tau1: tuple[float, float, float]
    tau2: tuple[float, float, float]
    Ts: tuple[float, float, float, float]
    u_low: float  # Lowest identified duty [%]
    u_high: float  # Highest identified duty [%]
    release: tuple[float, float]  # (τ1, τ2) of a fall to rest [s]; 0: no release was fitted
    release_below: float  # Duty [%] below which a fall goes over to them; infinite: every fall has them


def plant_parameters(p: Nonlinear) -> PlantParameters:
    """The form of a model that loops take, polynomials filled up with zeros; DataError where one has more coefficients
    than Eqs. (5)-(7)."""
    filled: list[Any] = []  # tuples of so many
    for name, polynomial, most in (("tau1", p.tau1, 3), ("tau2", p.tau2, 3), ("Ts", p.Ts, 4)):
        if not 1 <= len(polynomial) <= most:
            raise DataError(f"nonlinear.{name} has {len(polynomial)} coefficients; the replay takes 1 to {most}")
        filled.append((*map(float, polynomial), 0.0, 0.0, 0.0)[:most])
    tau1, tau2, Ts = filled
    low, high = map(float, p.u_range)
    fast, slow = map(float, p.release or (0.0, 0.0))
    return PlantParameters(float(p.C), tau1, tau2, Ts, low, high, (fast, slow), math.inf if p.falls_as_release else low)


def plant_terms(parameters: PlantParameters, duty: float) -> tuple[float, float, float]:
    """τ1 [s], τ2 [s] and T_s [N·m] at a duty [%], as a rising torque has them."""
    _, (a0, a1, a2), (b0, b1, b2), (c0, c1, c2, c3), low, high, _, _ = parameters
    share = 1.0
    u = duty
    if u < low:
        share = u / low if u > 0.0 else 0.0
        u = low
    elif u > high:
        u = high
    tau1 = a0 + u * (a1 + u * a2)
    tau2 = b0 + u * (b1 + u * b2)
    steady = share * (c0 + u * (c1 + u * (c2 + u * c3)))
    if tau1 < TAU_FLOOR_S:
        tau1 = TAU_FLOOR_S
    if tau2 < tau1:
        tau2 = tau1
    if steady < 0.0:
        steady = 0.0
    return tau1, tau2, steady


def plant_pull(parameters: PlantParameters, x1: float, x2: float, duty: float) -> tuple[float, float, float, float]:
    """Target minus state of the fast and the slow part [N·m], and the time constant of each [s]."""
    tau1, tau2, steady = plant_terms(parameters, duty)
    target = parameters.C * steady
    fast = target - x1
    slow = steady - target - x2
    if duty < parameters.release_below:
        share = duty / parameters.release_below if duty > 0.0 else 0.0
        release1, release2 = parameters.release
        if fast < 0.0 and release1 > 0.0:
            tau1 = share * tau1 + (1.0 - share) * release1
        if slow < 0.0 and release2 > 0.0:
            tau2 = share * tau2 + (1.0 - share) * release2
    return fast, slow, tau1, tau2


def plant_step(parameters: PlantParameters, x1: float, x2: float, duty: float, dt: float) -> tuple[float, float]:
    """Fast and slow part of the torque [N·m] after dt seconds of a held duty [%]; exact for any dt."""
    fast, slow, tau1, tau2 = plant_pull(parameters, x1, x2, duty)
    # expm1 keeps precision when dt << tau, where 1 - exp(-x) cancels.
    return x1 - math.expm1(-dt / tau1) * fast, x2 - math.expm1(-dt / tau2) * slow


# (fast part, slow part, input) → target minus state of both [N·m], and the time constant of each [s]
Pull = Callable[[float, float, float], tuple[float, float, float, float]]
FEW_ROWS = 8  # An input held for fewer rows is followed row by row, which then is faster


def driven(
    pull: Pull, changes_s: Array, values: Array, time_s: Array, start: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Torque [N·m] at the instants `time_s`, shape (n,), under an input that is `values[k]` from `changes_s[k]` on.

    The instants rise, from the first change on. While an input is held each part goes to its end exponentially, and
    from one side; the fast and the slow part begin at `start` [N·m].
    """
    torque = np.empty(len(time_s))
    first = np.append(0, np.flatnonzero(np.diff(values)) + 1)
    begins = changes_s[first]
    rows = np.append(np.searchsorted(time_s, begins), len(time_s)).tolist()
    ends = np.append(begins[1:], time_s[-1])
    x1, x2 = start
    for k, (begin, end, value) in enumerate(zip(begins.tolist(), ends.tolist(), values[first].tolist(), strict=True)):
        fast, slow, tau1, tau2 = pull(x1, x2, value)
        if rows[k + 1] - rows[k] < FEW_ROWS:
            for row in range(rows[k], rows[k + 1]):
                since = begin - float(time_s[row])
                torque[row] = x1 - math.expm1(since / tau1) * fast + x2 - math.expm1(since / tau2) * slow
        else:
            held = begin - time_s[rows[k] : rows[k + 1]]
            torque[rows[k] : rows[k + 1]] = x1 - np.expm1(held / tau1) * fast + x2 - np.expm1(held / tau2) * slow
        x1 -= math.expm1((begin - end) / tau1) * fast
        x2 -= math.expm1((begin - end) / tau2) * slow
    return torque


class Held(NamedTuple):
    """Where plant and latch are; at rest, before the first pulse, all is 0."""

    x1: float  # Fast part of the torque [N·m]
    x2: float  # Slow part [N·m]
    latched: float  # Duty that acts [%]
    pulse: int  # The next PWM period to begin, at pulse·period samples


def hold_step(plant: PlantParameters, period: float, dt: float, k: int, duty: float, held: Held) -> tuple[Held, float]:
    """From sample k to the next with a duty [%], latched once a PWM period [samples; 0: at once]; and the mean duty."""
    x1, x2, latched, pulse = held
    if period == 0.0:
        x1, x2 = plant_step(plant, x1, x2, duty, dt)
        return Held(x1, x2, duty, pulse), duty
    wait = pulse * period - k
    if wait >= 1.0 - INSTANT:
        x1, x2 = plant_step(plant, x1, x2, latched, dt)
        return Held(x1, x2, latched, pulse), latched
    wait = max(wait, 0.0)
    x1, x2 = plant_step(plant, x1, x2, latched, wait * dt)
    x1, x2 = plant_step(plant, x1, x2, duty, (1.0 - wait) * dt)
    return Held(x1, x2, duty, math.ceil((k + 1 - INSTANT) / period)), wait * latched + (1.0 - wait) * duty
