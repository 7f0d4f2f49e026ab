"""Model, range of B and options → the robust controller's gains, with everything on the way to them."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.control import robust
from eaid.control.bounds import Bounds
from eaid.control.options import DesignOptions
from eaid.control.rc import RCGains
from eaid.errors import GainsError
from eaid.models.parameters import Linear


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


@dataclass(frozen=True, eq=False)
class Law:
    """A robust controller and what it was made of."""

    options: DesignOptions
    bounds: Bounds
    gains: RCGains
    alpha: float
    """By the formula."""
    alpha_reached: float
    phi: float
    """In the reading's own number."""
    phi_honest_pct: float
    phi_nm_s: float
    """Φ of Eq. (15), what b (η − η̂) is taken to stay below [N·m/s]."""
    rho: robust.Rho
    guaranteed: bool
    P: Array
    Q: Array
    equal_pi: tuple[float, float]
    """K_P [%/(N·m)], K_I [%/(N·m·s)] of the PI of equal slope inside the layer."""

    @property
    def norm_K(self) -> float:
        """‖K‖ = √(K_P² + K_D²)."""
        return math.hypot(self.options.K_P, self.options.K_D)

    def ultimate_bound_nm(self) -> float:
        """Largest torque error in the end [N·m] by the Lyapunov argument."""
        disturbance = Disturbance(
            alpha=self.alpha_reached,
            n0=self.alpha_reached * self.options.Q_M + self.phi_nm_s,
            n1=self.alpha_reached * self.norm_K,
            rho0=self.rho.constant,
            rho1=self.rho.slope,
            epsilon=self.options.epsilon,
        )
        return error_bound(ultimate_level(disturbance, self.P, self.Q), self.Q)


def law_of(model: Linear, bounds: Bounds, options: DesignOptions) -> Law:
    """The law that the options give on a model; GainsError where no ρ covers the α it is to be made with."""
    B_m, B_M = bounds.B_m, bounds.B_M
    choices = {"pooled": 1 / model.b0, "minimax": robust.minimax_B_hat(B_m, B_M)}
    B_hat = choices[options.B_hat] if isinstance(options.B_hat, str) else float(options.B_hat)
    formula, reached = robust.alpha_formula(B_m, B_M), robust.alpha_reached(B_hat, B_m, B_M)
    alpha = formula if options.alpha == "formula" else reached
    if alpha >= 1:
        raise GainsError(
            f"α is {alpha:.4g} with B̂ = {B_hat:.4g}: 1 or more, no ρ covers that; choose B̂ below {2 * B_m:.4g} "
            "(«b_hat» minimax)"
        )
    phi = options.phi
    if options.phi_honest_pct is not None:
        phi = robust.phi_of(options.reading, options.phi_honest_pct, B_m, B_M)
    term = robust.uncertainty_term(options.reading, phi, B_m, B_M)
    norm_K = math.hypot(options.K_P, options.K_D)
    rho = robust.rho(alpha, options.Q_M, norm_K, term)
    P = options.p_scale * np.eye(2)
    Q = solve_Q(options.K_P, options.K_D, P)
    Q12, Q22 = float(Q[0, 1]), float(Q[1, 1])
    equal = robust.equal_pi(options.K_P, options.K_D, B_hat, rho.constant, options.epsilon, Q12, Q22)
    low, high = options.duty_limits_pct
    gains = RCGains(
        K_P=options.K_P, K_D=options.K_D, B_hat=B_hat, a0=model.a0, b0=model.b0, c0=model.c0,
        rho_constant=rho.constant, rho_slope=rho.slope, epsilon=options.epsilon, gamma=options.gamma, Q12=Q12, Q22=Q22,
        duty_min=low, duty_max=high,
        back_calculation=1 / equal[0] if options.anti_windup == "back-calculation" else 0.0,
    )  # fmt: skip
    return Law(
        options, bounds, gains, formula, reached, phi, robust.honest_phi_pct(options.reading, phi, B_m, B_M), term, rho,
        robust.covers(rho, reached, options.Q_M, norm_K, term), P, Q, equal,
    )  # fmt: skip
