"""Model, range of B and settled numbers → the robust controller, with everything on the way to it: Eqs. (10)-(16).

    α = (B_M − B_m)/(B_M + B_m)                          by the formula; the same for B as for its inverse
    α_reached = max over b in [1/B_M, 1/B_m] of |1 − b B̂|   really: at one end, since 1 − b B̂ is linear in b
    ρ = (α Q_M + α ‖K‖ ‖ξ‖ + Φ)/(1 − α),                 ‖K‖ = √(K_P² + K_D²)

Two readings of Φ [N·m/s]: as printed, Φ = B_M φ; as the textbook derives it, Φ = φ/B_m, with φ in % duty. So the
printed φ means φ B_m B_M in % duty. B̂ of 2 B_m B_M/(B_m + B_M), minimax, makes α_reached least, α of the formula.

Q of AᵀQ + QA = −p·I, its entries one after another: 2 K_P Q12 = p, 2 (Q12 − K_D Q22) = −p, Q11 = K_D Q12 + K_P Q22.
"""

import math
from dataclasses import dataclass

import numpy as np

from eaid.control.gains import Bounds
from eaid.control.margins import Timing
from eaid.control.rc import RCGains
from eaid.models.parameters import Linear
from eaid.options import TuneOptions
from eaid.results.gains import AskedPI, BRange, EqualPI, Rho, RhoLine, Robust, UltimateBound

ROUNDING = 1e-9  # By how much ρ may fall short of what is needed [N·m/s]
DIRECTIONS = 7200  # Of the half plane of ξ; V and |z| are even


@dataclass(frozen=True)
class Design:
    """What was asked for, and the numbers that nothing was said about, settled; in the rig's units."""

    options: TuneOptions
    K_P: float
    K_D: float
    Q_M: float  # Largest slope of the torque reference [N·m/s]
    phi: float  # φ in the reading's own number
    phi_honest_pct: float | None  # Bound on |η − η̂|; where given, φ is worked out from it
    epsilon: float
    gamma: float
    pi: AskedPI  # What the PI is designed for; nothing where its gains are given, or the paper's
    duty_limits_pct: tuple[float, float]
    timing: Timing


def law_of(model: Linear, bounds: Bounds, design: Design) -> tuple[RCGains, Robust]:
    """The law that a design gives on a model, and its part of gains.json, φ and Q_M not yet held against anything."""
    options, B_m, B_M, K_P, K_D = design.options, bounds.B_m, bounds.B_M, design.K_P, design.K_D
    choices = {"pooled": 1 / model.b0, "minimax": 2 * B_m * B_M / (B_m + B_M)}
    B_hat = choices[options.b_hat] if isinstance(options.b_hat, str) else float(options.b_hat)
    alpha, reached = (B_M - B_m) / (B_M + B_m), max(abs(1 - B_hat / B_M), abs(1 - B_hat / B_m))
    norm_K, p = math.hypot(K_P, K_D), options.p_scale

    def line(a: float, term: float) -> RhoLine:
        """Eq. (15) with equality."""
        return RhoLine(a * design.Q_M / (1 - a) + term / (1 - a), a * norm_K / (1 - a))

    as_printed, phi = options.rho == "paper", design.phi
    if design.phi_honest_pct is not None:
        phi = design.phi_honest_pct / (B_m * B_M) if as_printed else design.phi_honest_pct
    term = B_M * phi if as_printed else phi / B_m
    rho, needed = line(alpha, term), line(reached, term) if reached < 1 else None
    covers = needed is not None and (
        rho.constant >= needed.constant - ROUNDING and rho.slope >= needed.slope - ROUNDING
    )
    Q12 = p / (2 * K_P)
    Q22 = (p + 2 * Q12) / (2 * K_D)
    Q11 = K_D * Q12 + K_P * Q22
    # near ξ = 0 there is ω = ρ(0) z/ε, so u = B̂ ((K_D + ρ(0) Q22/ε) e + (K_P + ρ(0) Q12/ε) q̃) + feedforward
    steep = rho.constant / design.epsilon
    equal = B_hat * (K_D + steep * Q22), B_hat * (K_P + steep * Q12)
    low, high = design.duty_limits_pct
    gains = RCGains(
        K_P=K_P, K_D=K_D, B_hat=B_hat, a0=model.a0, b0=model.b0, c0=model.c0, rho_constant=rho.constant,
        rho_slope=rho.slope, epsilon=design.epsilon, gamma=design.gamma, Q12=Q12, Q22=Q22, duty_min=low, duty_max=high,
    )  # fmt: skip
    bound = ultimate_bound_nm(
        reached, (reached * design.Q_M + term, reached * norm_K), rho, design.epsilon, p, (Q11, Q12, Q22)
    )
    return gains, Robust(
        K_P=K_P, K_D=K_D, natural_frequency_rad_s=math.sqrt(K_P), damping=K_D / (2 * math.sqrt(K_P)), B_hat=B_hat,
        B_hat_convention=options.b_hat if isinstance(options.b_hat, str) else "given", B_m=B_m, B_M=B_M,
        bounds=BRange(levels=bounds.levels), alpha=alpha, alpha_reached=reached,
        guaranteed=covers, phi=phi, phi_honest_pct=term * B_m, Q_M=design.Q_M,
        rho=Rho(
            constant=rho.constant, slope=rho.slope, convention=options.rho, alpha=alpha,
            needed=needed,
        ),
        epsilon=design.epsilon, gamma=design.gamma, P=((p, 0.0), (0.0, p)), Q=((Q11, Q12), (Q12, Q22)),
        equal_pi=EqualPI(*equal),
        ultimate_bound=UltimateBound(bound if math.isfinite(bound) else None),
    )  # fmt: skip


def ultimate_bound_nm(
    alpha: float, n: tuple[float, float], rho: RhoLine, epsilon: float, p: float, Q: tuple[float, float, float]
) -> float:
    """Largest |e| [N·m] in the end; infinite where the bound on V̇ gives none.

    The disturbance is |χ| ≤ n0 + n1 ‖ξ‖ + α |ω|. Every trajectory ends below the largest V where V may still rise;
    along a direction (cos φ, sin φ) that is a quadratic in r inside the layer |z| ≤ ε and a line outside it.
    """
    (n0, n1), (Q11, Q12, Q22), keep = n, Q, 1 - alpha
    angle = np.linspace(0.0, math.pi, DIRECTIONS, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    zd = np.abs(Q12 * c + Q22 * s)
    with np.errstate(divide="ignore", invalid="ignore"):
        edge = np.where(zd > 0, epsilon / zd, np.inf)
        # Outside: r (p − 2 zd (n1 − keep ρ1)) = 2 zd (n0 − keep ρ0) is the last r where V may rise.
        slope = p - 2 * zd * (n1 - keep * rho.slope)
        excess = 2 * zd * (n0 - keep * rho.constant)
        outside = np.where(slope > 0, excess / slope, np.where((slope < 0) | (excess > 0), np.inf, 0.0))
        # Inside: a r² + b r + d = 0; −2d/(b + √) holds for a = 0 too and cancels nothing where b > 0.
        a = 2 * zd**2 * keep * rho.slope / epsilon
        b = p - 2 * zd * n1 + 2 * zd**2 * keep * rho.constant / epsilon
        d = -2 * zd * n0
        root = np.sqrt(np.maximum(b * b - 4 * a * d, 0.0))
        inside = np.where(b >= 0, -2 * d / (b + root), np.where(a > 0, (root - b) / (2 * a), np.inf))
    last = np.where(outside > edge, outside, np.minimum(np.nan_to_num(inside, nan=0.0, posinf=np.inf), edge))
    level = float((last**2 * (Q11 * c * c + 2 * Q12 * c * s + Q22 * s * s)).max())
    # on V = level: |e| ≤ √(level (Q⁻¹)₂₂)
    return math.sqrt(level * Q11 / (Q11 * Q22 - Q12**2))
