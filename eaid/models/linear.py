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


def guess(t_s: Array, torque_nm: Array, duty_pct: Array) -> Linear:
    """First guess from data: the best a0 on a log grid, b0 and c0 by a linear solve.

    `t_s`: (n,), `torque_nm`: (L, n), `duty_pct`: (L,). With one level only c0 is 0.
    """
    positive = t_s[t_s > 0]
    best: tuple[float, Linear] | None = None
    design = np.stack([duty_pct, np.ones_like(duty_pct)], axis=1)
    if np.ptp(duty_pct) == 0:
        design[:, 1] = 0.0
    for a0 in np.geomspace(0.3 / positive.max(), 2.0 / positive.min(), 40):
        rise = -np.expm1(-a0 * t_s)
        square = float(rise @ rise)
        gains = torque_nm @ rise / square
        slope, offset = np.linalg.lstsq(design, gains, rcond=None)[0]
        left = float(np.sum((torque_nm - np.outer(design @ np.array([slope, offset]), rise)) ** 2))
        if best is None or left < best[0]:
            best = (left, Linear(float(a0), float(a0 * slope), float(a0 * offset)))
    assert best is not None
    return best[1]
