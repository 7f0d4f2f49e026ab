"""The linear model, Eq. (8): Ṫ = −a0 T + b0 u + c0, and its step response from rest."""

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Linear


def step_response(p: Linear, t_s: Array, duty_pct: float) -> Array:
    """Torque after a duty step from rest [N·m], Eq. (8): T(t) = (b0 u + c0)/a0 · (1 − e^(−a0 t))."""
    return (p.b0 * duty_pct + p.c0) / p.a0 * -np.expm1(-p.a0 * t_s)


def gradient(p: Linear, t_s: Array, duty_pct: float) -> Array:
    """Derivatives of the torque by a0, b0 and c0, shape (3, n), Eq. (8)."""
    rise = -np.expm1(-p.a0 * t_s)
    drive = p.b0 * duty_pct + p.c0
    return np.stack(
        [
            drive * (t_s * np.exp(-p.a0 * t_s) / p.a0 - rise / p.a0**2),
            duty_pct * rise / p.a0,
            rise / p.a0,
        ]
    )


def steady_torque(p: Linear, duty_pct: float) -> float:
    """Torque after a long time at a duty [N·m], (b0 u + c0)/a0."""
    return (p.b0 * duty_pct + p.c0) / p.a0
