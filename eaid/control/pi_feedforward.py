"""A PI with the feedforward of the robust controller, as one pure step on plain floats:

    u = K_P e + K_I ∫ e dt + B̂ Ṫ_d + (a0 T − c0)/b0

With the slopes that the robust controller has inside its layer it is that controller without its robust term, and so
tells what the term itself is worth. Timing and anti-windup are those of `pi_step`.
"""

from collections.abc import Mapping
from typing import NamedTuple

from eaid.control.pi import Wanted
from eaid.plant.linear import LinearPlant


class PIFeedforwardGains(NamedTuple):
    """All that `pi_feedforward_step` needs; floats only."""

    K_P: float  # [%/(N·m)]
    K_I: float  # [%/(N·m·s)]
    B_hat: float  # B̂ [%·s/(N·m)]
    a0: float  # [1/s]
    b0: float  # [N·m/(s·%)]
    c0: float  # [N·m/s]
    duty_min: float = 0.0  # Lowest duty of the actuator [%]
    duty_max: float = 100.0  # Highest duty of the actuator [%]


def pi_feedforward_step(
    gains: PIFeedforwardGains, integral: float, reference: float, reference_rate: float, torque: float, dt: float
) -> tuple[float, float]:
    """One sample: the next integral of the error [N·m·s], 0 at rest, and the duty [%] until the next sample.

    Reference and torque in N·m, its rate in N·m/s, dt in s.
    """
    error = reference - torque
    forward = gains.B_hat * reference_rate + (gains.a0 * torque - gains.c0) / gains.b0
    wanted = gains.K_P * error + gains.K_I * integral + forward
    duty = min(max(wanted, gains.duty_min), gains.duty_max)
    if (wanted - duty) * error > 0.0:  # beyond a limit, and the error would drive it further
        return integral, duty
    return integral + dt * error, duty


def law(model: LinearPlant, held: Mapping[str, float], limits_pct: tuple[float, float]) -> PIFeedforwardGains:
    """The gains of a file on a model as the step takes them."""
    return PIFeedforwardGains(held["K_P"], held["K_I"], held["B_hat"], model.a0, model.b0, model.c0, *limits_pct)


def design(wanted: Wanted) -> dict[str, float] | None:
    """The slopes of the robust controller inside its layer; None where they are not known."""
    alike = None if wanted.rc is None else wanted.rc.equal_pi
    if wanted.rc is None or alike is None or alike.K_P is None or alike.K_I is None:
        return None
    return {"K_P": alike.K_P, "K_I": alike.K_I, "B_hat": wanted.rc.B_hat}
