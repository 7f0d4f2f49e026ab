"""The curves of single steps: change · s(t) of p = (change, ln τ1, ln(τ2/τ1), C, θ), with their slopes.

With t' = max(t − θ, 0): s = 1 − C e^(−t'/τ1) − (1 − C) e^(−t'/τ2); C = 1 is one exponential, C > 1 overshoots.
"""

from typing import Literal

import numpy as np

from eaid.arrays import Array

Shape = Literal["one", "two", "free", "overshoot"]
SHAPES: tuple[Shape, ...] = ("one", "two", "free", "overshoot")
MOST = 3.0
"""Largest C of an overshoot: beyond, two nearly equal parts of opposite sign imitate other shapes."""
APART = 2.0
"""Least τ2/τ1 of an overshoot."""
SEEN = 0.02
"""Share of its peak by which an overshoot has to come down within the record."""


def curve(p: Array, time_s: Array) -> Array:
    """change · s(t) of p = (change, ln τ1, ln(τ2/τ1), C, θ), shape (n,)."""
    after = np.maximum(time_s - p[4], 0.0)
    fast = np.exp(-after / np.exp(p[1]))
    slow = np.exp(-after / np.exp(p[1] + p[2])) if p[3] != 1.0 else 0.0
    return np.asarray(p[0] * (1.0 - p[3] * fast - (1.0 - p[3]) * slow))


def slopes(p: Array, time_s: Array) -> Array:
    """∂ curve / ∂p, shape (n, 5); where p is complex, its real part decides which samples lie behind the dead time."""
    behind = np.real(time_s - p[4]) > 0
    after = np.where(behind, time_s - p[4], 0.0)
    tau1, tau2 = np.exp(p[1]), np.exp(p[1] + p[2])
    fast, slow = np.exp(-after / tau1), np.exp(-after / tau2)
    by_fast, by_slow = p[3] * fast * after / tau1, (1 - p[3]) * slow * after / tau2
    by_time = np.where(behind, p[3] * fast / tau1 + (1 - p[3]) * slow / tau2, 0.0)
    return np.stack(
        (
            1.0 - p[3] * fast - (1 - p[3]) * slow,
            -p[0] * (by_fast + by_slow),
            -p[0] * by_slow,
            p[0] * (slow - fast),
            -p[0] * by_time,
        ),
        axis=1,
    )


def overshoots(p: Array, window: float) -> bool:
    """True where a curve passes its peak within the window, and is `SEEN` of its peak below it at the end."""
    at = np.linspace(p[4], window, 400)
    s = curve(np.array([1.0, *p[1:]]), at)
    return bool(s.max() - s[-1] > SEEN * s.max())
