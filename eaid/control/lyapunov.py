"""Error dynamics, its Lyapunov equation, and the ultimate bound on the torque error.

    ξ˙ = A ξ + D (χ − ω),   A = [[0, 1], [−K_P, −K_D]],   D = [0, 1]ᵀ,   ξ = [q̃, e]
    AᵀQ + QA = −P,          V = ξᵀQξ,   V̇ = −ξᵀPξ + 2 z (χ − ω),   z = DᵀQξ

with the disturbance |χ| ≤ n0 + n1 ‖ξ‖ + α |ω| (docs/robust-control.md). Since |ω| ≥ ρ min(1, |z|/ε), V falls wherever

    ξᵀPξ > 2 |z| (n0 + n1 ‖ξ‖ − (1 − α) ρ(ξ) min(1, |z|/ε)).

The largest V where that fails is a level that every trajectory ends below: c; then |e| ≤ √(c (Q⁻¹)₂₂).
"""

import math
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array


def solve_Q(K_P: float, K_D: float, P: Array) -> Array:
    """Q of AᵀQ + QA = −P for the 2 × 2 symmetric P, shape (2, 2), in closed form.

    The three entries one after another: 2 K_P Q12 = P11, 2 (Q12 − K_D Q22) = −P22, Q11 = K_D Q12 + K_P Q22 − P12.
    """
    Q12 = P[0, 0] / (2 * K_P)
    Q22 = (P[1, 1] + 2 * Q12) / (2 * K_D)
    Q11 = K_D * Q12 + K_P * Q22 - P[0, 1]
    return np.array([[Q11, Q12], [Q12, Q22]])


class Disturbance(NamedTuple):
    """What the robust term has to cover, |χ| ≤ n0 + n1 ‖ξ‖ + α |ω|, and what it has, ρ = rho0 + rho1 ‖ξ‖."""

    alpha: float
    """The α really reached, max |1 − b B̂|."""
    n0: float
    """[N·m/s]"""
    n1: float
    """[N·m/s per unit of ‖ξ‖]"""
    rho0: float
    """[N·m/s]"""
    rho1: float
    """[N·m/s per unit of ‖ξ‖]"""
    epsilon: float
    """Boundary layer, |z| ≤ ε."""


def ultimate_level(d: Disturbance, P: Array, Q: Array, directions: int = 7200) -> float:
    """The level c of V that every trajectory ends below; infinite where the bound on V̇ gives none.

    Along a direction (cos φ, sin φ) the condition is a quadratic in r inside the layer and a line outside it.
    """
    angle = np.linspace(0.0, math.pi, directions, endpoint=False)  # V and |z| are even in ξ
    unit = np.stack([np.cos(angle), np.sin(angle)])
    pd = np.einsum("id,ij,jd->d", unit, P, unit)
    qd = np.einsum("id,ij,jd->d", unit, Q, unit)
    zd = np.abs(Q[1] @ unit)
    keep = 1 - d.alpha
    with np.errstate(divide="ignore", invalid="ignore"):
        edge = np.where(zd > 0, d.epsilon / zd, np.inf)
        # Outside: r (pd − 2 zd (n1 − keep rho1)) = 2 zd (n0 − keep rho0) is the last r where V may rise.
        slope = pd - 2 * zd * (d.n1 - keep * d.rho1)
        excess = 2 * zd * (d.n0 - keep * d.rho0)
        outside = np.where(slope > 0, excess / slope, np.where((slope < 0) | (excess > 0), np.inf, 0.0))
        # Inside: a r² + b r + c = 0.
        a = 2 * zd**2 * keep * d.rho1 / d.epsilon
        b = pd - 2 * zd * d.n1 + 2 * zd**2 * keep * d.rho0 / d.epsilon
        c = -2 * zd * d.n0
        root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
        # 2c/(−b − √) holds for a = 0 too and cancels nothing where b > 0.
        inside = np.where(b >= 0, -2 * c / (b + root), np.where(a > 0, (root - b) / (2 * a), np.inf))
    last = np.where(outside > edge, outside, np.minimum(np.nan_to_num(inside, nan=0.0, posinf=np.inf), edge))
    level = last**2 * qd
    return float(level.max())


def error_bound(level: float, Q: Array) -> float:
    """Largest |e| [N·m] on the level set V = level: √(level (Q⁻¹)₂₂), (Q⁻¹)₂₂ = Q11 / det Q."""
    determinant = Q[0, 0] * Q[1, 1] - Q[0, 1] ** 2
    return math.sqrt(level * float(Q[0, 0] / determinant)) if math.isfinite(level) else math.inf
