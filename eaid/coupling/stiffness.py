"""The stiffest wall: passive against any passive limb, and stable with one limb.

**Passive.** The clutch's torque follows the limb's sampled angle, T(s) = −W(s) D(e^(sh)) θ*(s): D is the wall and the
closed torque loop at the samples, W = P(s)(1 − e^(−sh))/s the hold and the plant. Seen from the limb's speed v = sθ all
aliases ω_n = ω + 2πn/h of a frequency take part, and b |v|² + Re v*T ≥ 0 for every v asks at each ω for

    b ≥ ½ (√(‖p‖²‖q‖² − (Im p*q)²) − Re p*q),     p_n = 1/(jω_n)*,   q_n = D(e^(jωh)) W(jω_n)/h

(the least eigenvalue of a Hermitian matrix of rank two). With W the plain hold this is Colgate and Schenkel's
b ≥ h/2/(1 − cos ωh) · Re{(1 − e^(−jωh)) D}; for slow loops it is b ≥ K max(−Im G(jω)/ω).

**Stable.** The least K at which the spectral radius of the sampled loop with this limb reaches 1.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from eaid.arrays import Array
from eaid.control.margins import Lag, Timing, hold_response, integral_at_rest, latch_response
from eaid.control.operating import lags_at
from eaid.control.pi import PIGains, PIState, pi_step
from eaid.control.rc import RCGains, RCState, rc_step
from eaid.errors import UsageError
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import Nonlinear
from eaid.replay.inverse import InverseState, inverse_gains, inverse_step

Complex = NDArray[np.complex128]


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


@dataclass(frozen=True)
class Limb:
    """What the clutch acts on: J θ'' + b θ' = T − T_0."""

    inertia_kgm2: float = 0.1
    damping_nms: float = 0.8
    """[N·m·s/rad]"""

    def __post_init__(self) -> None:
        for name, value in (("limb_inertia", self.inertia_kgm2), ("limb_damping", self.damping_nms)):
            if not (value > 0 and math.isfinite(value)):
                raise UsageError(f"«{name}» {value:g}: must be above 0; without it no wall is passive")


@dataclass(frozen=True, eq=False)
class Channel:
    """One clutch of the drive: its law and plant around its own torque, and its share of the wanted torque."""

    point: Point
    law: Law
    weight: float = 1.0
    """Share of T_d that this clutch is asked for, and the sign of its torque; 1 for a clutch alone."""


class Coupled:
    """The whole loop with a limb on it, over one common period of samples and latches.

    State: a clutch's lags, its law's state, filtered torque, duties on their way, latched duty; the limb's angle and
    speed, its angle at the last sample and the reference before (for differences). What lies between two events does
    not depend on the wall and is worked out once.
    """

    def __init__(self, channels: Sequence[Channel], limb: Limb, timing: Timing) -> None:
        self.channels, self.timing = channels, timing
        self.layout = _Layout(channels, timing)
        samples, latches = timing.pattern
        events = sorted(
            [(Fraction(k), 0) for k in range(samples)] + [(Fraction(j * samples, latches), 1) for j in range(latches)]
        )
        flows: dict[Fraction, Array] = {}
        self.moves: list[Array | None] = []
        """Matrices in the order of time; None where the control sample comes."""
        now = Fraction(0)
        for at, kind in [*events, (Fraction(samples), 2)]:
            if at > now:
                if at - now not in flows:
                    flows[at - now] = _flow(channels, limb, self.layout, float(at - now) * timing.step_s)
                self.moves.append(flows[at - now])
                now = at
            if kind < 2:
                self.moves.append(None if kind == 0 else _latch(self.layout))

    def period_map(self, stiffness: float, virtual_damping: float = 0.0) -> Array:
        """The linear map of the whole state; K [N·m/rad], B_v [N·m·s/rad]."""
        sample = _sample(self.channels, self.layout, self.timing, stiffness, virtual_damping)
        total = np.eye(self.layout.size)
        for move in self.moves:
            total = (sample if move is None else move) @ total
        return total

    def poles(self, stiffness: float, virtual_damping: float = 0.0) -> Complex:
        """Eigenvalues of that map."""
        return np.asarray(np.linalg.eigvals(self.period_map(stiffness, virtual_damping)), dtype=np.complex128)

    def is_stable(self, stiffness: float, virtual_damping: float = 0.0) -> bool:
        """Whether the motion dies out."""
        return bool(np.abs(self.poles(stiffness, virtual_damping)).max() < 1)


class _Layout:
    """Where each part of the state stands."""

    def __init__(self, channels: Sequence[Channel], timing: Timing) -> None:
        at = 0
        self.lags, self.law, self.seen, self.queue, self.acting = [], [], [], [], []
        for channel in channels:
            self.lags.append(slice(at, at + 2))
            self.law.append(slice(at + 2, at + 2 + len(channel.law.A)))
            at += 2 + len(channel.law.A)
            self.seen.append(at)
            self.queue.append(slice(at + 1, at + 2 + timing.delay_samples))
            self.acting.append(at + 2 + timing.delay_samples)
            at += 3 + timing.delay_samples
        self.angle, self.speed, self.last_angle, self.last_reference = range(at, at + 4)
        self.size = at + 4


def _flow(channels: Sequence[Channel], limb: Limb, layout: _Layout, time_s: float) -> Array:
    """The plant and the limb between two events."""
    rate = np.zeros((layout.size, layout.size))
    for channel, lags, acting in zip(channels, layout.lags, layout.acting, strict=True):
        for i, (gain, tau) in enumerate(channel.point.lags):
            rate[lags.start + i, lags.start + i] = -1 / tau
            rate[lags.start + i, acting] = gain / tau
            rate[layout.speed, lags.start + i] = channel.weight / abs(channel.weight) / limb.inertia_kgm2
    rate[layout.angle, layout.speed] = 1.0
    rate[layout.speed, layout.speed] = -limb.damping_nms / limb.inertia_kgm2
    return np.asarray(expm(rate * time_s))


def _sample(
    channels: Sequence[Channel], layout: _Layout, timing: Timing, stiffness: float, virtual_damping: float
) -> Array:
    """One control sample: reference and its backward difference, the filtered torque, the laws, the queues."""
    h, memory = timing.step_s, timing.memory
    change = np.eye(layout.size)
    wanted = np.zeros(layout.size)
    wanted[layout.angle] = -stiffness - virtual_damping / h
    wanted[layout.last_angle] = virtual_damping / h
    before = np.zeros(layout.size)
    before[layout.last_reference] = 1.0
    for k, channel in enumerate(channels):
        seen = np.zeros(layout.size)
        seen[layout.lags[k]] = 1.0 - memory
        seen[layout.seen[k]] = memory
        inputs = np.array([channel.weight * wanted, channel.weight * (wanted - before) / h, seen])
        state = np.eye(layout.size)[layout.law[k]]
        change[layout.law[k]] = channel.law.A @ state + channel.law.B @ inputs
        duty = channel.law.c @ state + channel.law.d @ inputs
        queue = layout.queue[k]
        change[queue] = np.vstack(
            [np.eye(layout.size)[queue][1:], duty]
        )  # the first of the queue is next to be latched
        change[layout.seen[k]] = seen
    change[layout.last_angle] = np.eye(layout.size)[layout.angle]
    change[layout.last_reference] = wanted
    return change


def _latch(layout: _Layout) -> Array:
    change = np.eye(layout.size)
    for queue, acting in zip(layout.queue, layout.acting, strict=True):
        change[acting] = np.eye(layout.size)[queue.start]
    return change


def duty_response(channel: Channel, timing: Timing, omega: Array) -> Complex:
    """Duty per reference at sampled frequencies [rad/s], the torque loop closed, the PWM by its mean response."""
    h, memory = timing.step_s, timing.memory
    z = np.exp(1j * omega * h)
    plant = sum(g * -math.expm1(-h / tau) / (z - math.exp(-h / tau)) for g, tau in channel.point.lags)
    plant = plant * z**-timing.delay_samples * latch_response(timing, omega)
    seen = plant * (1 - memory) / (1 - memory / z)
    by_reference, by_rate, by_torque = channel.law.response(z).T
    return np.asarray((by_reference + by_rate * (1 - 1 / z) / h) / (1 - by_torque * seen))


ALIASES = 12
"""Aliases on either side: W falls with 1/ω², so the rest weighs less than 1e-5 of the sum."""
STIFFEST = 1e6
"""[N·m/rad]; a wall beyond it is called without limit."""


@dataclass(frozen=True, eq=False)
class Needed:
    """What a wall needs of the limb, over frequency; arrays of shape (n,)."""

    omega: Array
    """Angular frequency [rad/s]."""
    step_s: float
    size: Array
    """‖p‖‖q‖ for K = 1 [s]"""
    inner: Complex
    """p*q for K = 1 [s]"""
    response: Complex
    """G(jω): torque per reference."""

    def damping(self, stiffness: float, virtual_damping: float = 0.0) -> Array:
        """Damping that the wall K, B_v asks of the limb at each frequency [N·m·s/rad]; per K about −Im G(jω)/ω."""
        wall = stiffness + virtual_damping * (1 - np.exp(-1j * self.omega * self.step_s)) / self.step_s
        inner = wall * self.inner
        across = np.sqrt(np.maximum((np.abs(wall) * self.size) ** 2 - inner.imag**2, inner.real**2))
        return np.asarray(0.5 * (across - inner.real))


def needed_damping(channels: Sequence[Channel], timing: Timing) -> Needed:
    """What a drive's walls ask of the limb."""
    omega = np.geomspace(1e-3, 0.999 * np.pi * timing.rate_hz, 1200)  # to just below the Nyquist frequency
    h = timing.step_s
    p, q = [], []
    duties = [duty_response(channel, timing, omega) for channel in channels]
    for n in range(-ALIASES, ALIASES + 1):
        alias = omega + 2 * np.pi * n / h
        p.append(np.conj(1 / (1j * alias)))
        q.append(sum(_torque(one, duty, timing, omega, alias) for one, duty in zip(channels, duties, strict=True)))
    first, second = np.array(p), np.array(q)
    # ‖p‖ in closed form: Σ 1/ω_n² = (h/2)²/sin²(ωh/2)
    size = 0.5 * h / np.sin(0.5 * omega * h) * np.linalg.norm(second, axis=0)
    return Needed(omega, h, size, np.sum(np.conj(first) * second, axis=0), np.asarray(second[ALIASES]))


def _torque(channel: Channel, duty: Complex, timing: Timing, omega: Array, alias: Array) -> Complex:
    """D W/h of one clutch at an alias of ω, for K = 1."""
    lags = sum(g / (1 + 1j * alias * tau) for g, tau in channel.point.lags)
    hold = hold_response(alias, timing.step_s) * latch_response(timing, omega)
    late = np.exp(-1j * omega * timing.step_s * timing.delay_samples)
    share = abs(channel.weight)
    return np.asarray(share * duty * lags * hold * late)


def passive_stiffness(needed: Needed, damping_nms: float, virtual_damping: float = 0.0) -> tuple[float, float]:
    """The stiffest passive wall [N·m/rad] on a limb of a damping b, and the frequency that limits it [rad/s].

    0 where B_v alone is too much, inf where there is no limit below `STIFFEST`.
    """
    if virtual_damping > 0:
        stiffness = edge(lambda k: bool(needed.damping(k, virtual_damping).max() <= damping_nms), 1e-3)
        limit = needed.damping(min(max(stiffness, 1e-3), STIFFEST), virtual_damping)
    else:
        limit = needed.damping(1.0)
        stiffness = damping_nms / max(float(limit.max()), 1e-300)
    return (stiffness if stiffness < STIFFEST else float("inf")), float(needed.omega[int(np.argmax(limit))])


def stable_stiffness(coupled: Coupled, virtual_damping: float = 0.0) -> float:
    """The least K at which the sampled loop with its limb stops being stable [N·m/rad]; inf beyond `STIFFEST`."""
    return edge(lambda k: coupled.is_stable(k, virtual_damping), 1e-2)


def edge(holds: Callable[[float], bool], low: float, high: float = STIFFEST, factor: float = 1.4) -> float:
    """First stiffness at which something stops to hold; 0 where it does not hold at `low`, inf for never."""
    if not holds(low):
        return 0.0
    above = low * factor
    while above < high and holds(above):
        low, above = above, above * factor
    if above >= high:
        return float("inf")
    for _ in range(22):
        middle = (low * above) ** 0.5
        low, above = (middle, above) if holds(middle) else (low, middle)
    return low
