"""The friction curve of one level, Eq. (3): two exponentials that share one steady torque.

T(t) = (C (1 − e^(−t/τ1)) + (1 − C)(1 − e^(−t/τ2))) T_s
"""

import numpy as np

from eaid.arrays import Array
from eaid.models.parameters import Friction


def step_response(p: Friction, t_s: Array) -> Array:
    """Torque after a step from rest [N·m], Eq. (3), shape of `t_s`."""
    # expm1 keeps precision when t << tau, where 1 - exp(-x) cancels.
    return -(p.C * np.expm1(-t_s / p.tau1) + (1 - p.C) * np.expm1(-t_s / p.tau2)) * p.Ts


def gradient(p: Friction, t_s: Array) -> Array:
    """Derivatives of the torque by T_s, τ1, τ2 and C, shape (4, n), Eq. (3)."""
    e1, e2 = np.exp(-t_s / p.tau1), np.exp(-t_s / p.tau2)
    return np.stack(
        [
            -(p.C * np.expm1(-t_s / p.tau1) + (1 - p.C) * np.expm1(-t_s / p.tau2)),
            -p.Ts * p.C * e1 * t_s / p.tau1**2,
            -p.Ts * (1 - p.C) * e2 * t_s / p.tau2**2,
            p.Ts * (e2 - e1),
        ]
    )
