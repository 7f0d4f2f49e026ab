"""The PI controller of §V-B, as one pure step on plain floats: u = K_P e + K_I ∫ e dt.

The controller reads the torque at t_k and its duty acts until t_{k+1}; that duty uses the integral of the
samples before k.
"""

from typing import NamedTuple


class PIGains(NamedTuple):
    """All that `pi_step` needs; floats only."""

    K_P: float
    """[%/(N·m)]"""
    K_I: float
    """[%/(N·m·s)]"""
    duty_min: float = 0.0
    """Lowest duty of the actuator [%]"""
    duty_max: float = 100.0
    """Highest duty of the actuator [%]"""
    back_calculation: float = 0.0
    """Anti-windup: 0 holds the integral while it would wind up (conditional integration); > 0 is the back-calculation
    gain k [N·m/%], q̃˙ = e + k (u − u_unlimited)."""


class PIState(NamedTuple):
    """What the controller remembers between samples; at rest, nothing."""

    integral: float = 0.0
    """Integral of the torque error [N·m·s]"""


def pi_step(
    gains: PIGains, state: PIState, reference: float, _reference_rate: float, torque: float, dt: float
) -> tuple[PIState, float]:
    """One sample of the PI controller: the next state, and the duty [%] that acts until the next sample.

    Reference and torque in N·m, its rate in N·m/s (not used: a PI feeds nothing forward), dt in s.
    """
    K_P, K_I, low, high, back_calculation = gains
    integral = state.integral
    error = reference - torque
    wanted = K_P * error + K_I * integral
    duty = min(max(wanted, low), high)
    if back_calculation > 0.0:
        return PIState(integral + dt * (error + back_calculation * (duty - wanted))), duty
    if (wanted - duty) * error > 0.0:  # beyond a limit, and the error would drive it further
        return state, duty
    return PIState(integral + dt * error), duty
