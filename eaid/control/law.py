"""What a controller is to the loops around it: its linear part near a held input, and what its design is given."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.plant.linear import LinearPlant
from eaid.plant.operating import Complex
from eaid.results.gains import AskedPI, Robust, Timing


class LinearLaw(NamedTuple):
    """A controller around a point: δu = k_r δr + k_v δv − k_T δT + k_q δq, of reference r, its rate v, the torque T
    that is read, and the integral q of the error; without k_q nothing reads the integral."""

    k_r: float
    k_v: float
    k_T: float
    k_q: float

    def over(self, h: float) -> tuple[Array, Array, Array, float]:
        """A, B, C and D of s ← A s − B T, u = C s − D T, a sample being h; s is the integral."""
        kept = 1 if self.k_q else 0
        return np.eye(kept), np.full(kept, h), np.full(kept, self.k_q), self.k_T

    def response(self, z: Complex, h: float) -> Complex:
        """Duty per torque that is read, its sign turned, at z = e^(iωh)."""
        return np.asarray(self.k_T + self.k_q * h / (z - 1), dtype=np.complex128)


class Wanted(NamedTuple):
    """What a controller of the table is designed for, once the robust controller and the PI have their gains."""

    model: LinearPlant
    rc: Robust | None  # None: refused
    timing: Timing
    limits: tuple[float, float]
    # (K_P, K_I) → what a step takes, factors on the dead time → the quickest PI that has 6 dB and 45° around every held
    # input under each of them; None: there is none
    quickest: Callable[[Callable[[float, float], Any], tuple[float, ...]], AskedPI | None]
