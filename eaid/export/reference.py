# SPDX-License-Identifier: MIT
"""The exported laws and the plant in plain Python: what the C, MATLAB and FMU texts are held against, bit by bit.

    1 − e^(−x) = x P(x) on 0…1; beyond, x is halved until it lies there, and E ← E (2 − E) undoes each halving
    tanh x     = E/(2 − E),  E = 1 − e^(−2x)
    x ← x + d  keeps what rounding leaves out of the sum in `carry` (Kahan), so that single precision holds too

The equations are those of the control law, Eqs. (11)-(14), the PI of §V-B, and the plant, Eqs. (4)-(7), in its dynamic
form. Constants are those of `eaid.export.constants`, floats or numpy.float32, and every operation keeps their type.
"""

import math
from collections.abc import Callable
from itertools import count, takewhile
from typing import Any, TypeAlias

from eaid.plant.dynamics import PlantNumbers, plant_pull, plant_terms

Number: TypeAlias = Any  # float or numpy.float32

BAD_INPUT, AT_MIN, AT_MAX = 2, 4, 8  # Bits of the status; the sample time is here always the right one
HUGE = 1e9  # Inputs beyond it are as bad as NaN
TANH_ONE = 19.1
SPANS, HALVINGS = 40, 60  # Doublings and halvings in which a bumpless start finds its integral


def loss(series: tuple[Number, ...], x: Number) -> Number:
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


def tanh(series: tuple[Number, ...], x: Number) -> Number:
    """The hyperbolic tangent."""
    e = loss(series, 2.0 * abs(x))
    size = e / (2.0 - e)
    return -size if x < 0.0 else size


def clamp(x: float, low: float, high: float) -> float:
    """`x` within low…high."""
    return low if x < low else high if x > high else x


def good(*inputs: float) -> bool:
    """Neither NaN nor infinite nor absurd."""
    return all(-HUGE <= x <= HUGE for x in inputs)


def added(value: float, carry: float, change: float) -> tuple[float, float]:
    """value + change, and what its rounding left out."""
    y = change - carry
    total = value + y
    return total, (total - value) - y


class Sampled:
    """What all that goes from sample to sample shares: each reading is watched."""

    def __init__(self, c: Any) -> None:
        self.c = c
        self.reset()

    def reset(self) -> None:
        """At rest again."""
        self.status = 0

    def acts(self, *inputs: float) -> bool:
        """Whether the law may act on this reading; the status is begun."""
        self.status = 0 if good(*inputs) else BAD_INPUT
        return self.status == 0


class Integral(Sampled):
    """A law with the integral of the error, and what rounding left out of it."""

    integral: Number
    carry: Number

    wanted: Callable[..., Number]  # The duty that the law asks for, before its limits

    def reset(self) -> None:
        """At rest again."""
        super().reset()
        self.integral = self.carry = 0.0

    def step(self, reference: Number, reference_rate: Number, torque: Number) -> Number:
        """One sample; the integral stands still at a limit beyond which the error would drive the duty."""
        c = self.c
        if not self.acts(reference, reference_rate, torque):
            return c.duty_on_fault
        wanted = self.wanted(self.integral, reference, reference_rate, torque)
        duty = clamp(wanted, c.duty_min, c.duty_max)
        self.status |= (AT_MIN if wanted < c.duty_min else 0) | (AT_MAX if wanted > c.duty_max else 0)
        error = reference - torque
        if not (wanted - duty) * error > 0.0:
            self.integral, self.carry = added(self.integral, self.carry, c.dt * error)
        return duty


class PI(Integral):
    """The PI of §V-B; the rate is not used."""

    def wanted(self, integral: Number, reference: Number, _reference_rate: Number, torque: Number) -> Number:
        """The duty before its limits."""
        return self.c.K_P * (reference - torque) + self.c.K_I * integral

    def step(self, reference: Number, _reference_rate: Number, torque: Number) -> Number:
        """One sample."""
        return super().step(reference, 0.0, torque)

    def start(self, reference: Number, _reference_rate: Number, torque: Number, duty: Number) -> None:
        """The integral with which the next step gives `duty`: a switch without a bump."""
        self.reset()
        c = self.c
        if good(reference, torque, duty) and c.K_I > 0.0:
            self.integral = (clamp(duty, c.duty_min, c.duty_max) - c.K_P * (reference - torque)) / c.K_I


class PIFeedforward(Integral):
    """The PI with the robust controller's feedforward."""

    def wanted(self, integral: Number, reference: Number, reference_rate: Number, torque: Number) -> Number:
        """The duty before its limits."""
        c = self.c
        forward = c.B_hat * reference_rate + (c.a0 * torque - c.c0) / c.b0
        return c.K_P * (reference - torque) + c.K_I * integral + forward

    def start(self, reference: Number, reference_rate: Number, torque: Number, duty: Number) -> None:
        """The integral with which the next step gives `duty`."""
        self.reset()
        c = self.c
        if good(reference, reference_rate, torque, duty) and c.K_I > 0.0:
            rest = self.wanted(self.integral, reference, reference_rate, torque)
            self.integral = (clamp(duty, c.duty_min, c.duty_max) - rest) / c.K_I


class RC(Integral):
    """The robust controller; `at_zero` is tanh(γε)."""

    def wanted(self, integral: Number, reference: Number, reference_rate: Number, torque: Number) -> Number:
        """The duty that Eqs. (11)-(14) ask for, before its limits."""
        c = self.c
        error = reference - torque
        z = c.Q12 * integral + c.Q22 * error
        squares = integral * integral + error * error
        rho = c.rho_constant + c.rho_slope * type(squares)(math.sqrt(squares))
        signed = -rho if z < 0.0 else rho
        distance = c.gamma * (abs(z) - c.epsilon)
        if distance > TANH_ONE:
            omega = signed
        else:
            omega = rho * z / c.epsilon
            if distance >= -TANH_ONE:
                share = (tanh(c.series, distance) + c.at_zero) / (1.0 + c.at_zero)
                omega = share * signed + (1.0 - share) * omega
        y = reference_rate + c.K_D * error + c.K_P * integral + omega
        return c.B_hat * y + (c.a0 * torque - c.c0) / c.b0

    def start(self, reference: Number, reference_rate: Number, torque: Number, duty: Number) -> None:
        """The integral with which the next step gives `duty`, by halving an interval: a switch without a bump."""
        self.reset()
        if not good(reference, reference_rate, torque, duty):
            return
        inputs = reference, reference_rate, torque
        wanted = clamp(duty, self.c.duty_min, self.c.duty_max)
        high = self.c.dt / self.c.dt  # 1, in the type of the constants
        low = -high
        for _ in range(SPANS):
            if self.wanted(low, *inputs) > wanted:
                low = 2.0 * low
            if self.wanted(high, *inputs) < wanted:
                high = 2.0 * high
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self.wanted(middle, *inputs) < wanted:
                low = middle
            else:
                high = middle
        self.integral = 0.5 * (low + high)


def numbers(c: Any) -> PlantNumbers:
    """The plant as the replay takes it; time constants of 0 where `c` has Φ in their place."""

    def curve(name: str, count: int) -> Any:
        return tuple(getattr(c, f"{name}_{k}", 0.0) for k in range(count))

    names = ["Ts", *takewhile(lambda name: hasattr(c, f"{name}_0"), (f"Ts{k}" for k in count(1)))]
    pieces = tuple((getattr(c, f"{name}_from", 0.0), *curve(name, 4)) for name in names)
    return PlantNumbers(
        getattr(c, "C", 1.0), curve("tau1", 3), curve("tau2", 3), curve("Ts", 4), c.u_low, c.u_high,
        (getattr(c, "release1", 0.0), getattr(c, "release2", 0.0)), getattr(c, "release_below", c.u_low),
        curve("Ts_below", 4), (getattr(c, "falls1", 1.0), getattr(c, "falls2", 1.0)), -1.0, 1.0,
        getattr(c, "tau_floor", 0.0), hasattr(c, "Ts_below_0"), through=hasattr(c, "Ts_from"), pieces=pieces,
    )  # fmt: skip


def plant_change(c: Any, x1: Number, x2: Number, duty: Number, dt: Number) -> tuple[Number, Number]:
    """By how much the fast and the slow part move in a time of a held duty."""
    fast, slow, tau1, tau2 = plant_pull(numbers(c), x1, x2, duty)
    return loss(c.series, dt / tau1) * fast, loss(c.series, dt / tau2) * slow


def swing_change(c: Any, part: str, x1: Number, x2: Number, duty: Number) -> tuple[Number, Number]:
    """The same of two lags in series or ringing, in a part of a sample, by its Φ − 1."""
    away = x1 - plant_terms(numbers(c), duty)[2]
    m11, m12, m21, m22 = (getattr(c, f"{part}_{k}") for k in ("11", "12", "21", "22"))
    return m11 * away + m12 * x2, m21 * away + m22 * x2


class Plant(Sampled):
    """The plant: its two states, what rounding left out of them, and the duties that are on their way."""

    def reset(self) -> None:
        """At rest again."""
        super().reset()
        self.x1 = self.x2 = self.carry1 = self.carry2 = 0.0
        self.held = [0.0] * (getattr(self.c, "delay", 0) + 1)

    def step(self, duty: Number) -> Number:
        """The torque after one sample of a held duty; a duty that is no number counts as 0, and is told."""
        before = self.held[0]
        self.held = [*self.held[1:], duty if self.acts(duty) else 0.0]
        if getattr(self.c, "dt_before", 0.0) > 0.0:
            self.move("before", before)
        self.move("after", self.held[0])
        return self.x1 + self.c.z * self.x2 if hasattr(self.c, "z") else self.x1 + self.x2

    def move(self, part: str, duty: Number) -> None:
        """Both states over a part of a sample."""
        if hasattr(self.c, "z"):
            change1, change2 = swing_change(self.c, part, self.x1, self.x2, duty)
        else:
            change1, change2 = plant_change(self.c, self.x1, self.x2, duty, getattr(self.c, f"dt_{part}", self.c.dt))
        self.x1, self.carry1 = added(self.x1, self.carry1, change1)
        self.x2, self.carry2 = added(self.x2, self.carry2, change2)


class Inverse(Sampled):
    """The model inverted: an observer of its two states and of what it lacks, and the duty played last."""

    def reset(self) -> None:
        """At rest again, with nothing learned."""
        super().reset()
        self.x1 = self.x2 = self.lack = self.duty = self.carry1 = self.carry2 = 0.0

    def start(self, _reference: Number, _reference_rate: Number, torque: Number, duty: Number) -> None:
        """The observer at the measured torque, as after a long hold, and its search at the duty played until now."""
        self.reset()
        if good(torque, duty):
            self.x1 = self.c.plant.C * torque
            self.x2 = torque - self.x1
            self.duty = clamp(duty, self.c.duty_min, self.c.duty_max)

    def step(self, reference: Number, reference_rate: Number, torque: Number) -> Number:
        """One sample: reference + rate·dt is where the torque is to be at the next one."""
        c = self.c
        if not self.acts(reference, reference_rate, torque):
            return c.duty_on_fault
        innovation = (torque - self.x1) - self.x2
        correction = c.correction * innovation
        self.x1, self.carry1 = added(self.x1, self.carry1, c.plant.C * correction)
        self.x2, self.carry2 = added(self.x2, self.carry2, (1.0 - c.plant.C) * correction)
        self.lack = self.lack + c.learning * innovation
        need = ((reference - self.x1) - self.x2) + (reference_rate - self.lack) * c.dt
        self.duty = self.duty_for(need)
        change1, change2 = plant_change(c.plant, self.x1, self.x2, self.duty, c.dt)
        self.x1, self.carry1 = added(self.x1, self.carry1, change1 + self.lack * c.dt)
        self.x2, self.carry2 = added(self.x2, self.carry2, change2)
        self.status |= (AT_MIN if self.duty <= c.duty_min else 0) | (AT_MAX if self.duty >= c.duty_max else 0)
        return self.duty

    def duty_for(self, need: Number) -> Number:
        """Duty after which the torque has moved by `need`, by false position after Anderson and Björck between the last
        duty and 1 beside it, else the limit on that side; `searches` tries at most."""
        c = self.c

        def miss_of(duty: Number) -> Number:
            change1, change2 = plant_change(c.plant, self.x1, self.x2, duty, c.dt)
            return (change1 + change2) - need

        a = clamp(self.duty, c.duty_min, c.duty_max)
        miss_a = miss_of(a)
        limit = c.duty_max if miss_a < 0.0 else c.duty_min
        b = clamp(a + 1.0 if miss_a < 0.0 else a - 1.0, c.duty_min, c.duty_max)
        miss_b = miss_of(b)
        if miss_a != 0.0 and miss_b != 0.0 and (miss_a < 0.0) == (miss_b < 0.0):
            a, miss_a, b = b, miss_b, limit
            miss_b = miss_of(b)
            if (miss_a < 0.0) == (miss_b < 0.0):
                return limit
        if miss_a == 0.0:
            b, miss_b = a, miss_a
        tries, rise = 0, miss_b - miss_a
        while tries < c.searches and miss_b != 0.0 and rise != 0.0:
            duty = b - miss_b * (b - a) / rise
            miss = miss_of(duty)
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


class Rate(Sampled):
    """The slope of the reference by a filtered difference, r ← memory r + gain (x − x before)."""

    def reset(self) -> None:
        """Nothing seen yet: the first reference has no slope."""
        super().reset()
        self.before: Number = None
        self.rate = 0.0

    def step(self, reference: Number) -> Number:
        """One sample; a reference that is no number begins anew."""
        primed = self.before is not None and good(reference)
        self.rate = self.c.memory * self.rate + self.c.gain * (reference - self.before) if primed else 0.0
        self.before = reference if good(reference) else None
        return self.rate
