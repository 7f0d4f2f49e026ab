"""The robust controller, Eqs. (11)-(15), as one pure step on plain floats.

    e = T_d − T,   q̃ = ∫ e dt,   ξ = [q̃, e],   z = Q12 q̃ + Q22 e,   ρ = constant + slope ‖ξ‖
    S = (tanh(γ(|z| − ε)) + 1) / 2,   ω = S ρ sign(z) + (1 − S) ρ z/ε               Eqs. (13), (14)
    u = B̂ (Ṫ_d + K_D e + K_P q̃ + ω) + (a0 T − c0)/b0                               Eqs. (11), (12)

z is a scalar: |z| makes the law odd in z (docs/robust-control.md). As printed, ω still jumps by 2ρS(0) at z = 0; in
place of S stands (S − S(0))/(1 − S(0)), which is 0 there: S itself to the last bit once γε > 19.1 (paper: 25).

The controller reads the torque at t_k and its duty acts until t_{k+1}; that duty uses the integral of the samples
before k. Floats and `math` only: numba compiles `rc_step` as it stands, and plain Python runs it in about 1 µs.
"""

import math
from typing import NamedTuple

TANH_IS_ONE = 19.1  # Beyond it tanh(x) is exactly 1 in double precision


class RCGains(NamedTuple):
    """All that `rc_step` needs; floats only."""

    K_P: float  # [1/s²]
    K_D: float  # [1/s]
    B_hat: float  # B̂ [%·s/(N·m)]
    a0: float  # [1/s]
    b0: float  # [N·m/(s·%)]
    c0: float  # [N·m/s]
    rho_constant: float  # ρ at ξ = 0 [N·m/s]
    rho_slope: float  # dρ/d‖ξ‖ [N·m/s per N·m, as Table IV has it]
    epsilon: float  # Half width of the boundary layer, in units of z
    gamma: float  # Sharpness of the soft switch, per unit of z
    Q12: float  # z = Q12 q̃ + Q22 e
    Q22: float
    duty_min: float = 0.0  # Lowest duty of the actuator [%]
    duty_max: float = 100.0  # Highest duty of the actuator [%]


def robust_term(gains: RCGains, integral: float, error: float) -> float:
    """ω [N·m/s] for an integrated error [N·m·s] and an error [N·m], Eqs. (13)-(15)."""
    z = gains.Q12 * integral + gains.Q22 * error
    rho = gains.rho_constant + gains.rho_slope * math.sqrt(integral * integral + error * error)
    distance = gains.gamma * (abs(z) - gains.epsilon)
    if distance > TANH_IS_ONE:
        omega = math.copysign(rho, z)
    else:
        omega = rho * z / gains.epsilon
        if distance >= -TANH_IS_ONE:
            # (S − S(0))/(1 − S(0)) with S(0) = (1 − tanh γε)/2; exactly (14) where tanh γε is 1.
            at_zero = math.tanh(gains.gamma * gains.epsilon)
            share = (math.tanh(distance) + at_zero) / (1.0 + at_zero)
            omega = share * math.copysign(rho, z) + (1.0 - share) * omega
    return omega


def rc_step(
    gains: RCGains, integral: float, reference: float, reference_rate: float, torque: float, dt: float
) -> tuple[float, float]:
    """One sample of the robust controller: the next q̃ [N·m·s], 0 at rest, and the duty [%] until the next sample.

    Reference and torque in N·m, its rate in N·m/s, dt in s.
    """
    error = reference - torque
    y = reference_rate + gains.K_D * error + gains.K_P * integral + robust_term(gains, integral, error)
    wanted = gains.B_hat * y + (gains.a0 * torque - gains.c0) / gains.b0
    duty = min(max(wanted, gains.duty_min), gains.duty_max)
    if (wanted - duty) * error > 0.0:  # beyond a limit, and the error would drive it further
        return integral, duty
    return integral + dt * error, duty
