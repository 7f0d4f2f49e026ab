"""A settled design → the robust controller, Eqs. (10)-(16), and how far η is from η̂ by the data.

    α = (B_M − B_m)/(B_M + B_m)                          by the formula; the same for B as for its inverse
    α_reached = max over b in [1/B_M, 1/B_m] of |1 − b B̂|   really: at one end, since 1 − b B̂ is linear in b
    ρ = (α Q_M + α ‖K‖ ‖ξ‖ + Φ)/(1 − α),                 ‖K‖ = √(K_P² + K_D²)

Two readings of Φ [N·m/s]: as printed, Φ = B_M φ; as the textbook derives it, Φ = φ/B_m, with φ in % duty. So the
printed φ means φ B_m B_M in % duty. B̂ of 2 B_m B_M/(B_m + B_M), minimax, makes α_reached least, α of the formula.

Q of AᵀQ + QA = −P, P = p·diag(π², 1) with π the rig's pace (1 on the paper's), so that no unit of time matters; its
entries one after another: 2 K_P Q12 = p π², 2 (Q12 − K_D Q22) = −p, Q11 = K_D Q12 + K_P Q22.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.control.gains import RangeOfB
from eaid.options import TuneOptions
from eaid.plant.dynamics import Plant
from eaid.plant.linear import LinearPlant
from eaid.plant.respond import unit_step
from eaid.results.gains import AskedPI, EqualPI, Rho, RhoLine, Robust, Timing

SAME_ALPHA = 1e-5  # Two fits of one level end no nearer to each other
RHO_ROUNDING = 1e-9  # By how much ρ may fall short [N·m/s]
DESIGN_INPUTS = 19
DESIGN_INSTANTS = 200
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
    P: tuple[float, float]  # Diagonal of P
    pi: AskedPI  # What the PI is designed for; nothing where its gains are given, or the paper's
    duty_limits_pct: tuple[float, float]
    timing: Timing


def robust_of(model: LinearPlant, bounds: RangeOfB, design: Design) -> Robust:
    """The robust controller that a design gives on a model, φ not yet held against anything."""
    options, B_m, B_M, K_P, K_D = design.options, bounds.B_m, bounds.B_M, design.K_P, design.K_D
    wanted, pooled, minimax = options.b_hat, 1 / model.b0, 2 * B_m * B_M / (B_m + B_M)
    if wanted is None:  # from 2 B_m on, α reaches 1 and no ρ is enough
        wanted = "pooled" if pooled < 2 * B_m else "minimax"
    B_hat = pooled if wanted == "pooled" else minimax if wanted == "minimax" else float(wanted)
    alpha, reached = (B_M - B_m) / (B_M + B_m), max(abs(1 - B_hat / B_M), abs(1 - B_hat / B_m))
    reached = alpha if abs(reached - alpha) <= SAME_ALPHA else reached
    norm_K, (p1, p2) = math.hypot(K_P, K_D), design.P

    def line(a: float, term: float) -> RhoLine:
        """Eq. (15) with equality."""
        return RhoLine(a * design.Q_M / (1 - a) + term / (1 - a), a * norm_K / (1 - a))

    as_printed, phi = options.rho == "paper", design.phi
    if design.phi_honest_pct is not None:
        phi = design.phi_honest_pct / (B_m * B_M) if as_printed else design.phi_honest_pct
    term = B_M * phi if as_printed else phi / B_m
    rho, needed = line(alpha, term), line(reached, term) if reached < 1 else None
    covers = needed is not None and (
        rho.constant >= needed.constant - RHO_ROUNDING and rho.slope >= needed.slope - RHO_ROUNDING
    )
    Q12 = p1 / (2 * K_P)
    Q22 = (p2 + 2 * Q12) / (2 * K_D)
    Q11 = K_D * Q12 + K_P * Q22
    # near ξ = 0 there is ω = ρ(0) z/ε, so u = B̂ ((K_D + ρ(0) Q22/ε) e + (K_P + ρ(0) Q12/ε) q̃) + feedforward
    steep = rho.constant / design.epsilon
    return Robust(
        K_P=K_P, K_D=K_D, B_hat=B_hat, B_m=B_m, B_M=B_M,
        alpha=alpha, alpha_reached=reached, rho_covers=covers, phi=phi, phi_honest_pct=term * B_m, Q_M=design.Q_M,
        rho=Rho(constant=rho.constant, slope=rho.slope, convention=options.rho, needed=needed),
        epsilon=design.epsilon, gamma=design.gamma, P=((p1, 0.0), (0.0, p2)), Q=((Q11, Q12), (Q12, Q22)),
        equal_pi=EqualPI(B_hat * (K_D + steep * Q22), B_hat * (K_P + steep * Q12)),
        ultimate_bound_nm=ultimate_bound_nm(
            reached, (reached * design.Q_M + term, reached * norm_K), rho, design.epsilon, design.P, (Q11, Q12, Q22)
        ),
    )  # fmt: skip


def ultimate_bound_nm(
    alpha: float, n: tuple[float, float], rho: RhoLine, epsilon: float, P: tuple[float, float], Q: tuple[float, ...]
) -> float | None:
    """Largest |e| [N·m] in the end; None where the bound on V̇ gives none.

    The disturbance is |χ| ≤ n0 + n1 ‖ξ‖ + α |ω|. Every trajectory ends below the largest V where V may still rise;
    along a direction (cos φ, sin φ) that is a quadratic in r inside the layer |z| ≤ ε and a line outside it.
    """
    (n0, n1), (Q11, Q12, Q22), keep = n, Q, 1 - alpha
    angle = np.linspace(0.0, math.pi, DIRECTIONS, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    p = P[0] * c * c + P[1] * s * s
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
    return math.sqrt(level * Q11 / (Q11 * Q22 - Q12**2)) if math.isfinite(level) else None


def phi_needed(model: LinearPlant, bounds: RangeOfB, plant: Plant | None) -> float | None:
    """The largest |η − η̂| [% duty] that the data show; None where the fit holds neither a nonlinear model nor levels.

    By the plant over its steps between identified duties and from rest: u − η̂(T), as far as it lies outside B Ṫ over B
    in [B_m, B_M].
    """
    if plant is None:
        # the levels' first-order models from 0 to the highest torque; linear in T, so one end is the worst
        ends = (0.0, max((row.gain for row in bounds.rows), default=0.0))
        levels = (
            torque * row.level / row.gain - (model.a0 * torque - model.c0) / model.b0
            for row, torque in itertools.product(bounds.rows, ends)
        )
        return max(map(abs, levels), default=None)
    duties = np.linspace(*plant.u_range, DESIGN_INPUTS)
    steady, starts = plant.steady(duties), np.append(0.0, plant.steady(duties))[:, None]
    most = 0.0
    for duty, end in zip(duties.tolist(), steady.tolist(), strict=True):
        longest = 5 * plant.slowest_s(duty)
        gone, rate = unit_step(
            plant, np.append(0.0, np.geomspace(min(1e-3, 1e-3 * longest), longest, DESIGN_INSTANTS)), duty
        )
        torque, slope = starts + (end - starts) * gone, (end - starts) * rate
        left: Array = duty - (model.a0 * torque - model.c0) / model.b0
        one, other = bounds.B_m * slope, bounds.B_M * slope
        apart = left - np.clip(left, np.minimum(one, other), np.maximum(one, other))
        most = max(most, float(np.abs(apart).max()))
    return most


def seen_top_nm(bounds: RangeOfB, plant: Plant | None) -> float | None:
    """The highest torque [N·m] of which `phi_needed` tells."""
    if plant is None:
        return max((row.gain for row in bounds.rows), default=None)
    return float(plant.steady(plant.u_range[1]))
