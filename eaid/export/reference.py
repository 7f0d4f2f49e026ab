# SPDX-License-Identifier: MIT
"""The exported laws and the plant in plain Python: what the C, MATLAB and FMU texts are held against, bit by bit.

    1 − e^(−x) = x P(x) on 0…1; beyond, x is halved until it lies there, and E ← E (2 − E) undoes each halving
    tanh x     = E/(2 − E),  E = 1 − e^(−2x)
    x ← x + d  keeps what rounding leaves out of the sum in `carry` (Kahan), so that single precision holds too

The equations are those of the control law, Eqs. (11)-(14), the PI of §V-B, and the plant, Eqs. (4)-(7), in its dynamic
form. It is one file because it is exported as it stands, and needs nothing but Python; constants may be floats or
numpy.float32, and every operation keeps their type.
"""

import math
from typing import NamedTuple

NOT_READY, BAD_INPUT, AT_MIN, AT_MAX, WRONG_RATE = 1, 2, 4, 8, 32  # Bits of the status
HUGE = 1e9  # Inputs beyond it are as bad as NaN
TANH_IS_ONE = 19.1
SPANS, HALVINGS = 40, 60  # Doublings and halvings in which a bumpless start finds its integral


class PlantConstants(NamedTuple):
    """The nonlinear model at one sample time; polynomials of the duty, lowest power first."""

    C: float
    tau1_0: float
    tau1_1: float
    tau1_2: float
    tau2_0: float
    tau2_1: float
    tau2_2: float
    Ts_0: float
    Ts_1: float
    Ts_2: float
    Ts_3: float
    u_low: float
    u_high: float
    release1: float
    release2: float
    tau_floor: float
    dt: float
    series: tuple[float, ...]


class PIConstants(NamedTuple):
    """All that `pi_step` needs."""

    K_P: float
    K_I: float
    duty_min: float
    duty_max: float
    duty_on_fault: float
    dt: float


class RCConstants(NamedTuple):
    """All that `rc_step` needs; `at_zero` is tanh(γε)."""

    K_P: float
    K_D: float
    B_hat: float
    a0: float
    b0: float
    c0: float
    rho_constant: float
    rho_slope: float
    epsilon: float
    gamma: float
    Q12: float
    Q22: float
    at_zero: float
    duty_min: float
    duty_max: float
    duty_on_fault: float
    dt: float
    series: tuple[float, ...]


class InverseConstants(NamedTuple):
    """The model that is inverted, and the observer's two gains."""

    correction: float
    learning: float
    tolerance: float
    duty_min: float
    duty_max: float
    duty_on_fault: float
    dt: float
    searches: int
    plant: PlantConstants


class RateConstants(NamedTuple):
    """r ← memory r + gain (x − x before)."""

    memory: float
    gain: float


class Guard(NamedTuple):
    """What is watched in every state."""

    status: int
    ready: bool


class IntegralState(NamedTuple):
    """Between samples: the integral of the error, what rounding left out of it, the guard."""

    integral: float
    carry: float
    guard: Guard


class InverseState(NamedTuple):
    """The observer: the model's two states and what it lacks, and the duty played last."""

    x1: float
    x2: float
    lack: float
    duty: float
    carry1: float
    carry2: float
    guard: Guard


class PlantState(NamedTuple):
    """Fast and slow part of the torque, and what rounding left out of them."""

    x1: float
    x2: float
    carry1: float
    carry2: float
    status: int


class RateState(NamedTuple):
    """The reference of before, and its filtered slope."""

    before: float
    rate: float
    primed: bool


def loss(series: tuple[float, ...], x: float) -> float:
    """1 − e^(−x) for x ≥ 0."""
    if x > 64.0:
        return x / x
    halved = 0
    while x > 1.0:
        x = 0.5 * x
        halved += 1
    p = series[-1]
    for k in range(len(series) - 2, -1, -1):
        p = series[k] + x * p
    e = x * p
    for _ in range(halved):
        e = e * (2.0 - e)
    return e


def tanh(series: tuple[float, ...], x: float) -> float:
    """The hyperbolic tangent."""
    e = loss(series, 2.0 * abs(x))
    size = e / (2.0 - e)
    return -size if x < 0.0 else size


def clamp(x: float, low: float, high: float) -> float:
    """`x` within low…high."""
    return low if x < low else high if x > high else x


def good(x: float) -> bool:
    """Neither NaN nor infinite nor absurd."""
    return bool(-HUGE <= x <= HUGE)


def added(value: float, carry: float, change: float) -> tuple[float, float]:
    """value + change, and what its rounding left out."""
    y = change - carry
    total = value + y
    return total, (total - value) - y


def rate_fits(baked: float, dt: float) -> bool:
    """Whether the caller's sample time is the one that the constants were made for, within 0.1 %."""
    return bool(abs(dt - baked) <= 0.001 * baked)


def watched(guard: Guard, reference: float, rate: float, torque: float) -> Guard:
    """The guard after one reading."""
    if not guard.ready:
        return Guard(guard.status | NOT_READY, False)
    return Guard(0 if good(reference) and good(rate) and good(torque) else BAD_INPUT, True)


def limited(guard: Guard, wanted: float, low: float, high: float) -> tuple[Guard, float]:
    """The duty within its limits, told in the status where it meets one."""
    duty = clamp(wanted, low, high)
    bits = (AT_MIN if wanted < low else 0) | (AT_MAX if wanted > high else 0)
    return guard._replace(status=guard.status | bits), duty


def wound(
    c: PIConstants | RCConstants, integral: float, carry: float, error: float, wanted: float, duty: float
) -> tuple[float, float]:
    """The integral after a sample; it stands still at a limit beyond which the error would drive the duty."""
    if (wanted - duty) * error > 0.0:
        return integral, carry
    return added(integral, carry, c.dt * error)


def integral_init(c: PIConstants | RCConstants, dt: float) -> IntegralState:
    """State at rest; not ready where `dt` is not the sample time of the constants."""
    fits = rate_fits(c.dt, dt)
    return IntegralState(0.0, 0.0, Guard(0 if fits else WRONG_RATE, fits))


def integral_reset(s: IntegralState) -> IntegralState:
    """At rest again, as ready as before."""
    return IntegralState(0.0, 0.0, Guard(s.guard.status & WRONG_RATE, s.guard.ready))


def pi_step(
    c: PIConstants, s: IntegralState, reference: float, _reference_rate: float, torque: float
) -> tuple[IntegralState, float]:
    """One sample of the PI; the rate is not used."""
    guard = watched(s.guard, reference, 0.0, torque)
    if guard.status & (NOT_READY | BAD_INPUT):
        return s._replace(guard=guard), c.duty_on_fault
    error = reference - torque
    wanted = c.K_P * error + c.K_I * s.integral
    guard, duty = limited(guard, wanted, c.duty_min, c.duty_max)
    integral, carry = wound(c, s.integral, s.carry, error, wanted, duty)
    return IntegralState(integral, carry, guard), duty


def pi_start(
    c: PIConstants, s: IntegralState, reference: float, _reference_rate: float, torque: float, duty: float
) -> IntegralState:
    """The integral with which the next step gives `duty`: a switch without a bump."""
    s = integral_reset(s)
    if not (good(reference) and good(torque) and good(duty)) or not c.K_I > 0.0:
        return s
    wanted = clamp(duty, c.duty_min, c.duty_max)
    return s._replace(integral=(wanted - c.K_P * (reference - torque)) / c.K_I)


def rc_wanted(c: RCConstants, integral: float, reference: float, reference_rate: float, torque: float) -> float:
    """The duty that Eqs. (11)-(14) ask for, before its limits."""
    error = reference - torque
    z = c.Q12 * integral + c.Q22 * error
    size = abs(z)
    squares = integral * integral + error * error
    rho = c.rho_constant + c.rho_slope * type(squares)(math.sqrt(squares))
    signed = -rho if z < 0.0 else rho
    distance = c.gamma * (size - c.epsilon)
    if distance > TANH_IS_ONE:
        omega = signed
    else:
        omega = rho * z / c.epsilon
        if distance >= -TANH_IS_ONE:
            share = (tanh(c.series, distance) + c.at_zero) / (1.0 + c.at_zero)
            omega = share * signed + (1.0 - share) * omega
    y = reference_rate + c.K_D * error + c.K_P * integral + omega
    return c.B_hat * y + (c.a0 * torque - c.c0) / c.b0


def rc_step(
    c: RCConstants, s: IntegralState, reference: float, reference_rate: float, torque: float
) -> tuple[IntegralState, float]:
    """One sample of the robust controller."""
    guard = watched(s.guard, reference, reference_rate, torque)
    if guard.status & (NOT_READY | BAD_INPUT):
        return s._replace(guard=guard), c.duty_on_fault
    wanted = rc_wanted(c, s.integral, reference, reference_rate, torque)
    guard, duty = limited(guard, wanted, c.duty_min, c.duty_max)
    integral, carry = wound(c, s.integral, s.carry, reference - torque, wanted, duty)
    return IntegralState(integral, carry, guard), duty


def rc_start(
    c: RCConstants, s: IntegralState, reference: float, reference_rate: float, torque: float, duty: float
) -> IntegralState:
    """The integral with which the next step gives `duty`, by halving an interval: a switch without a bump."""
    s = integral_reset(s)
    if not (good(reference) and good(reference_rate) and good(torque) and good(duty)):
        return s
    wanted = clamp(duty, c.duty_min, c.duty_max)
    one = c.dt / c.dt
    low, high = -one, one
    for _ in range(SPANS):
        if rc_wanted(c, low, reference, reference_rate, torque) > wanted:
            low = 2.0 * low
        if rc_wanted(c, high, reference, reference_rate, torque) < wanted:
            high = 2.0 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if rc_wanted(c, middle, reference, reference_rate, torque) < wanted:
            low = middle
        else:
            high = middle
    return s._replace(integral=0.5 * (low + high))


def plant_change(c: PlantConstants, x1: float, x2: float, duty: float) -> tuple[float, float]:
    """By how much the fast and the slow part move in one sample of a held duty."""
    share = 1.0
    u = duty
    if u < c.u_low:
        share = u / c.u_low if u > 0.0 else 0.0
        u = c.u_low
    elif u > c.u_high:
        u = c.u_high
    tau1 = c.tau1_0 + u * (c.tau1_1 + u * c.tau1_2)
    tau2 = c.tau2_0 + u * (c.tau2_1 + u * c.tau2_2)
    steady = share * (c.Ts_0 + u * (c.Ts_1 + u * (c.Ts_2 + u * c.Ts_3)))
    if tau1 < c.tau_floor:
        tau1 = c.tau_floor
    if tau2 < tau1:
        tau2 = tau1
    if steady < 0.0:
        steady = 0.0
    target = c.C * steady
    fast = target - x1
    slow = steady - target - x2
    if duty < c.u_low:
        if fast < 0.0 and c.release1 > 0.0:
            tau1 = share * tau1 + (1.0 - share) * c.release1
        if slow < 0.0 and c.release2 > 0.0:
            tau2 = share * tau2 + (1.0 - share) * c.release2
    return loss(c.series, c.dt / tau1) * fast, loss(c.series, c.dt / tau2) * slow


def plant_init(c: PlantConstants, dt: float) -> PlantState:
    """The clutch at rest."""
    return PlantState(0.0, 0.0, 0.0, 0.0, 0 if rate_fits(c.dt, dt) else NOT_READY | WRONG_RATE)


def plant_step(c: PlantConstants, s: PlantState, duty: float) -> tuple[PlantState, float]:
    """The torque after one sample of a held duty; a duty that is no number counts as 0, and is told."""
    if s.status & NOT_READY:
        return s, s.x1 + s.x2
    known = good(duty)
    change1, change2 = plant_change(c, s.x1, s.x2, duty if known else 0.0)
    x1, carry1 = added(s.x1, s.carry1, change1)
    x2, carry2 = added(s.x2, s.carry2, change2)
    return PlantState(x1, x2, carry1, carry2, 0 if known else BAD_INPUT), x1 + x2


def inverse_init(c: InverseConstants, dt: float) -> InverseState:
    """At rest, with nothing learned."""
    fits = rate_fits(c.dt, dt)
    return InverseState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, Guard(0 if fits else WRONG_RATE, fits))


def inverse_reset(s: InverseState) -> InverseState:
    """At rest again, as ready as before."""
    guard = Guard(s.guard.status & WRONG_RATE, s.guard.ready)
    return InverseState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, guard)


def inverse_start(
    c: InverseConstants, s: InverseState, _reference: float, _reference_rate: float, torque: float, duty: float
) -> InverseState:
    """The observer at the measured torque, as after a long hold, and its search at the duty played until now."""
    s = inverse_reset(s)
    if not (good(torque) and good(duty)):
        return s
    x1 = c.plant.C * torque
    return s._replace(x1=x1, x2=torque - x1, duty=clamp(duty, c.duty_min, c.duty_max))


def miss_of(c: InverseConstants, x1: float, x2: float, need: float, duty: float) -> float:
    """By how much a duty moves the torque too far in one sample."""
    change1, change2 = plant_change(c.plant, x1, x2, duty)
    return (change1 + change2) - need


def duty_for(c: InverseConstants, x1: float, x2: float, need: float, guess: float) -> float:
    """Duty after which the torque has moved by `need`, by false position after Anderson and Björck.

    It brackets the duty by the guess and 1 beside it, else the limit on that side; `searches` tries at most.
    """
    a = clamp(guess, c.duty_min, c.duty_max)
    miss_a = miss_of(c, x1, x2, need, a)
    limit = c.duty_max if miss_a < 0.0 else c.duty_min
    b = clamp(a + 1.0 if miss_a < 0.0 else a - 1.0, c.duty_min, c.duty_max)
    miss_b = miss_of(c, x1, x2, need, b)
    if miss_a != 0.0 and miss_b != 0.0 and (miss_a < 0.0) == (miss_b < 0.0):
        a, miss_a, b = b, miss_b, limit
        miss_b = miss_of(c, x1, x2, need, b)
        if (miss_a < 0.0) == (miss_b < 0.0):
            return limit
    if miss_a == 0.0:
        b, miss_b = a, miss_a
    tries, rise = 0, miss_b - miss_a
    while tries < c.searches and miss_b != 0.0 and rise != 0.0:
        duty = b - miss_b * (b - a) / rise
        miss = miss_of(c, x1, x2, need, duty)
        moved = abs(duty - b)
        if (miss < 0.0) != (miss_b < 0.0):
            a, miss_a = b, miss_b
        else:
            kept = 1.0 - miss / miss_b
            miss_a = miss_a * (kept if kept > 0.0 else 0.5)
        b, miss_b = duty, miss
        tries = c.searches if moved <= c.tolerance else tries + 1
        rise = miss_b - miss_a
    return b


def inverse_step(
    c: InverseConstants, s: InverseState, reference: float, reference_rate: float, torque: float
) -> tuple[InverseState, float]:
    """One sample of the inverse: reference + rate·dt is where the torque is to be at the next one."""
    guard = watched(s.guard, reference, reference_rate, torque)
    if guard.status & (NOT_READY | BAD_INPUT):
        return s._replace(guard=guard), c.duty_on_fault
    innovation = (torque - s.x1) - s.x2
    correction = c.correction * innovation
    x1, carry1 = added(s.x1, s.carry1, c.plant.C * correction)
    x2, carry2 = added(s.x2, s.carry2, (1.0 - c.plant.C) * correction)
    lack = s.lack + c.learning * innovation
    need = ((reference - x1) - x2) + (reference_rate - lack) * c.dt
    duty = duty_for(c, x1, x2, need, s.duty)
    change1, change2 = plant_change(c.plant, x1, x2, duty)
    x1, carry1 = added(x1, carry1, change1 + lack * c.dt)
    x2, carry2 = added(x2, carry2, change2)
    bits = (AT_MIN if duty <= c.duty_min else 0) | (AT_MAX if duty >= c.duty_max else 0)
    return InverseState(x1, x2, lack, duty, carry1, carry2, guard._replace(status=guard.status | bits)), duty


def rate_init() -> RateState:
    """Nothing seen yet: the first reference has no slope."""
    return RateState(0.0, 0.0, False)


def rate_step(c: RateConstants, s: RateState, reference: float) -> tuple[RateState, float]:
    """The slope of the reference by a filtered difference; a reference that is no number begins anew."""
    if not good(reference):
        return rate_init(), 0.0
    if not s.primed:
        return RateState(reference, 0.0, True), 0.0
    rate = c.memory * s.rate + c.gain * (reference - s.before)
    return RateState(reference, rate, True), rate
