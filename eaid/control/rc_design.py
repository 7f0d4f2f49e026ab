"""Model, range of B and options → the robust controller's gains, with everything on the way to them."""

import math
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.control import robust
from eaid.control.bounds import Bounds
from eaid.control.lyapunov import Disturbance, error_bound, solve_Q, ultimate_level
from eaid.control.options import DesignOptions
from eaid.control.rc import RCGains
from eaid.errors import GainsError
from eaid.models.parameters import Linear


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
