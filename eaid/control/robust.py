"""From the range of B to ρ, and whether ρ covers the uncertainty: Eqs. (15), (16).

    α = (B_M − B_m)/(B_M + B_m)                          by the formula
    α_reached = max over b in [1/B_M, 1/B_m] of |1 − b B̂|   really: at one end, since 1 − b B̂ is linear in b
    ρ ≥ (α Q_M + α ‖K‖ ‖ξ‖ + Φ)/(1 − α)

Two readings of Φ: as printed, Φ = B_M φ; as the textbook derives it, Φ = φ/B_m, with φ in % duty. Both need Φ in N·m/s,
so the printed φ means φ B_m B_M in % duty.
"""

import math
from dataclasses import dataclass
from typing import Literal

Reading = Literal["paper", "textbook"]


@dataclass(frozen=True)
class Rho:
    """ρ(ξ) = constant + slope ‖ξ‖ [N·m/s], and the shares of its terms."""

    alpha: float
    """The α it was made with."""
    reference_term: float
    """α Q_M/(1 − α) [N·m/s]"""
    phi_term: float
    """Φ/(1 − α) [N·m/s]"""
    slope: float
    """α ‖K‖/(1 − α) [N·m/s per unit of ‖ξ‖]"""

    @property
    def constant(self) -> float:
        """ρ at ξ = 0 [N·m/s]."""
        return self.reference_term + self.phi_term


def alpha_formula(B_m: float, B_M: float) -> float:
    """α = (B_M − B_m)/(B_M + B_m), Eq. (16); the same for B as for its inverse."""
    return (B_M - B_m) / (B_M + B_m)


def alpha_reached(B_hat: float, B_m: float, B_M: float) -> float:
    """max |1 − b B̂| over b in [1/B_M, 1/B_m]."""
    return max(abs(1 - B_hat / B_M), abs(1 - B_hat / B_m))


def minimax_B_hat(B_m: float, B_M: float) -> float:
    """B̂ [%·s/(N·m)] that makes α_reached least, 2 B_m B_M/(B_m + B_M): both ends then give α of the formula."""
    return 2 * B_m * B_M / (B_m + B_M)


def uncertainty_term(convention: Reading, phi: float, B_m: float, B_M: float) -> float:
    """Φ of Eq. (15) [N·m/s]: B_M φ as printed, φ/B_m in the textbook."""
    return B_M * phi if convention == "paper" else phi / B_m


def honest_phi_pct(convention: Reading, phi: float, B_m: float, B_M: float) -> float:
    """The bound on |η − η̂| that a φ of either reading stands for [% duty]: Φ B_m."""
    return uncertainty_term(convention, phi, B_m, B_M) * B_m


def phi_of(convention: Reading, honest_pct: float, B_m: float, B_M: float) -> float:
    """φ in a reading's own number for a bound on |η − η̂| in % duty; the inverse of `honest_phi_pct`."""
    return honest_pct / (B_m * B_M) if convention == "paper" else honest_pct


def rho(alpha: float, Q_M: float, norm_K: float, phi_nm_s: float) -> Rho:
    """Eq. (15) with equality; `phi_nm_s` is Φ [N·m/s], Q_M in N·m/s, ‖K‖ = √(K_P² + K_D²)."""
    return Rho(
        alpha=alpha,
        reference_term=alpha * Q_M / (1 - alpha),
        phi_term=phi_nm_s / (1 - alpha),
        slope=alpha * norm_K / (1 - alpha),
    )


def covers(have: Rho, alpha: float, Q_M: float, norm_K: float, phi_nm_s: float) -> bool:
    """Whether ρ is at least Eq. (15) with another α, for every ξ, within 1e-9."""
    if alpha >= 1:
        return False
    need = rho(alpha, Q_M, norm_K, phi_nm_s)
    return have.constant >= need.constant - 1e-9 and have.slope >= need.slope - 1e-9


def equal_pi(
    K_P: float, K_D: float, B_hat: float, rho_constant: float, epsilon: float, Q12: float, Q22: float
) -> tuple[float, float]:
    """The PI of equal slope inside the layer near ξ = 0: (K_P [%/(N·m)], K_I [%/(N·m·s)]).

    There ω = ρ(0) z/ε, so u = B̂ ((K_D + ρ(0) Q22/ε) e + (K_P + ρ(0) Q12/ε) q̃) + feedforward.
    """
    return (
        B_hat * (K_D + rho_constant * Q22 / epsilon),
        B_hat * (K_P + rho_constant * Q12 / epsilon),
    )


def damping_gains(natural_frequency: float, damping: float) -> tuple[float, float]:
    """K_P [1/s²] and K_D [1/s] of s² + K_D s + K_P with a natural frequency [rad/s] and a damping ratio [1]."""
    return natural_frequency**2, 2 * damping * natural_frequency


def frequency_and_damping(K_P: float, K_D: float) -> tuple[float, float]:
    """Natural frequency [rad/s] and damping ratio [1] of s² + K_D s + K_P."""
    natural = math.sqrt(K_P)
    return natural, K_D / (2 * natural)
