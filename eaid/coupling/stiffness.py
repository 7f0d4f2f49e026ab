"""The stiffest wall: passive against any passive limb, and stable with one limb.

**Passive.** The clutch's torque follows the limb's sampled angle, T(s) = −W(s) D(e^(sh)) θ*(s): D is the wall and the
closed torque loop at the samples, W = P(s)(1 − e^(−sh))/s the hold and the plant. Seen from the limb's speed v = sθ all
aliases ω_n = ω + 2πn/h of a frequency take part, and b |v|² + Re v*T ≥ 0 for every v asks at each ω for

    b ≥ ½ (√(‖p‖²‖q‖² − (Im p*q)²) − Re p*q),     p_n = 1/(jω_n)*,   q_n = D(e^(jωh)) W(jω_n)/h

(the least eigenvalue of a Hermitian matrix of rank two). With W the plain hold this is Colgate and Schenkel's
b ≥ h/2/(1 − cos ωh) · Re{(1 − e^(−jωh)) D}; for slow loops it is b ≥ K max(−Im G(jω)/ω).

**Stable.** The least K at which the spectral radius of the sampled loop with this limb reaches 1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.control.timing import Timing, hold_response, latch_response
from eaid.coupling.linearised import Complex
from eaid.coupling.sampled import Channel, Coupled, duty_response

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


def frequencies(timing: Timing, count: int = 1200) -> Array:
    """From slow to just below the Nyquist frequency [rad/s]."""
    return np.geomspace(1e-3, 0.999 * np.pi * timing.rate_hz, count)


def needed_damping(channels: Sequence[Channel], timing: Timing) -> Needed:
    """What a drive's walls ask of the limb."""
    omega = frequencies(timing)
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
