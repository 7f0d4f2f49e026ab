"""The plant around a held input, as every other tool takes it: x' = A x + b u, y = c x, u so much later.

Target − state is 0 there, so changes of τ with the input play no part; what falls have of their own is left out.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.plant.dynamics import Plant, plant_numbers, plant_terms, swing

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Operating:
    """A linear plant of two states; of one lag the second has no part in the output."""

    gain: float  # Output per input at rest, dT_s/du
    tau1: float  # [s]; of series and ringing 1/ω
    tau2: float  # [s]; of one lag that of the first
    C: float = 1.0  # Share of the first state
    zeta: float | None = None
    z: float = 0.0
    dead_time_s: float = 0.0

    @cached_property
    def A(self) -> Array:
        """(2, 2) [1/s]."""
        if self.zeta is not None:
            return np.array([[0.0, 1.0], [-1.0, -2 * self.zeta]]) / self.tau1
        return np.diag([-1 / self.tau1, -1 / self.tau2])

    @cached_property
    def b(self) -> Array:
        """(2,)"""
        if self.zeta is not None:
            return np.array([0.0, self.gain / self.tau1])
        return self.gain * np.array([self.C / self.tau1, (1 - self.C) / self.tau2])

    @cached_property
    def c(self) -> Array:
        """(2,)"""
        return np.array([1.0, 1.0 if self.zeta is None else self.z])

    @property
    def slowest_s(self) -> float:
        """Time in which the slowest part falls to 1/e [s]."""
        if self.zeta is None:
            return max(self.tau1, self.tau2)
        return self.tau1 * (self.zeta + math.sqrt(self.zeta**2 - 1) if self.zeta > 1 else 1 / max(self.zeta, 1e-3))

    def over(self, dt_s: float) -> tuple[Array, Array]:
        """Φ = e^(A dt), (2, 2), and what a held input of 1 adds, (2,)."""
        if self.zeta is None:
            decays = np.array([-dt_s / self.tau1, -dt_s / self.tau2])
            return np.diag(np.exp(decays)), -np.expm1(decays) * self.gain * np.array([self.C, 1 - self.C])
        c, n = swing(self.zeta, dt_s / self.tau1)
        flow = np.array([[c + self.zeta * n, n], [-n, c - self.zeta * n]])
        return flow, self.gain * np.array([1 - flow[0, 0], -flow[1, 0]])

    def response(self, s: Complex) -> Complex:
        """c (sI − A)⁻¹ b, without the dead time, shape of `s`."""
        if self.zeta is None:
            return np.asarray(self.gain * (self.C / (1 + s * self.tau1) + (1 - self.C) / (1 + s * self.tau2)))
        p = s * self.tau1
        return np.asarray(self.gain * (1 + self.z * p) / (1 + 2 * self.zeta * p + p * p))

    def sampled(self, z: Complex, dt_s: float) -> Complex:
        """Output at the samples per input held between them, c (zI − Φ)⁻¹ Γ, without the dead time, shape of `z`."""
        flow, pushed = self.over(dt_s)
        if self.zeta is None:
            return np.asarray(sum(g / (z - f) for g, f in zip(pushed, np.diag(flow), strict=True)))
        (f11, f12), (f21, f22) = flow
        one = (z - f22) * pushed[0] + f12 * pushed[1]
        two = f21 * pushed[0] + (z - f11) * pushed[1]
        return np.asarray((one + self.z * two) / ((z - f11) * (z - f22) - f12 * f21))

    def to_control(self, pade: int = 0) -> Any:
        """The plant as python-control's `StateSpace`, where that is installed; its dead time by Padé of that order."""
        import control

        lags = control.ss(self.A, self.b[:, None], self.c[None], [[0.0]])
        if pade and self.dead_time_s:
            return control.series(control.tf(*control.pade(self.dead_time_s, pade)), lags)
        return lags


def lag(gain: float, tau: float) -> Operating:
    """One lag: τ y' = gain u − y."""
    return Operating(gain, tau, tau, 1.0)


def around(plant: Plant, u: float) -> Operating:
    """The plant around an input that has been held for long."""
    slope = plant.slope(u)
    if plant.zeta is not None:
        tau = plant_terms(plant_numbers(plant), u)[0]
        return Operating(slope, tau, tau, 1.0, plant.zeta, plant.zero, plant.dead_time_s)
    tau1, tau2 = map(float, plant.time_constants(u))
    return Operating(slope, tau1, tau2 if plant.C != 1 else tau1, plant.C, dead_time_s=plant.dead_time_s)
