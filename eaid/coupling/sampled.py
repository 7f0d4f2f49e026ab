"""The loop as it runs on the rig, with a limb on it: sampled, delayed, latched by the PWM, its sensor filtered.

At t_k the controller reads limb and torque, asks T_d = T_0 − K θ − B_v (θ_k − θ_{k−1})/h, and its duty acts
`delay_samples` later, at the next latch of the PWM. Between two events all is linear and time-invariant,

    x_i' = (g_i u − x_i)/τ_i,   J θ'' + b θ' = Σ w x − T_0

so a matrix exponential carries the state exactly. Over one common period of samples and latches the whole is a linear
map: stable where its spectral radius is below 1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.linalg import expm

from eaid.arrays import Array
from eaid.control.timing import Timing, latch_response
from eaid.coupling.linearised import Complex, Law, Point
from eaid.errors import UsageError


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
