"""What a plant of one lag, or two in parallel, answers to a step from rest, in closed form, and how that changes.

    rise      s(t, τ) = 1 − e^(−t/τ)                              one lag
    step      y(t) = (C s(t, τ1) + (1 − C) s(t, τ2)) T_s          Eq. (3)

Fits of steps evaluate this for many levels at once; `eaid.plant.respond` goes through any input.
"""

import numpy as np

from eaid.arrays import Array
from eaid.plant.dynamics import Step


def decay(t_s: Array, tau: Array | float) -> Array:
    """What a lag still has of its start, e^(−t/τ), shapes broadcast."""
    return np.exp(t_s * (-1.0 / tau))


def rise(t_s: Array, tau: Array | float) -> Array:
    """How far a lag has gone, 1 − e^(−t/τ); with its digits where t is small beside τ, too."""
    return -np.expm1(t_s * (-1.0 / tau))


def step_response(at: Step, t_s: Array) -> Array:
    """Output after a step from rest, Eq. (3), shape of `t_s`."""
    return (at.C * rise(t_s, at.tau1) + (1 - at.C) * rise(t_s, at.tau2)) * at.Ts


def step_rate(at: Step, t_s: Array) -> Array:
    """How fast that output goes, per second, shape of `t_s`."""
    return (at.C / at.tau1 * decay(t_s, at.tau1) + (1 - at.C) / at.tau2 * decay(t_s, at.tau2)) * at.Ts


def step_way(at: Step, t_s: Array) -> Array:
    """How far a step from rest has gone, 1 in the end, shape of `t_s`: for fits, whose noise hides the digits that are
    lost where t is small beside τ."""
    return 1 - at.C * decay(t_s, at.tau1) - (1 - at.C) * decay(t_s, at.tau2)


def step_ways(at: Step, t_s: Array) -> tuple[Array, Array, Array, Array, Array]:
    """The same, the derivatives of the output by ln τ1, ln τ2 and C, and its rate, from two exponentials."""
    fast, slow = decay(t_s, at.tau1), decay(t_s, at.tau2)
    fast_rate, slow_rate = at.Ts * at.C / at.tau1 * fast, at.Ts * (1 - at.C) / at.tau2 * slow
    way = 1 - at.C * fast - (1 - at.C) * slow
    return way, -t_s * fast_rate, -t_s * slow_rate, at.Ts * (slow - fast), fast_rate + slow_rate


def step_slopes(at: Step, t_s: Array) -> Array:
    """Derivatives of that output by T_s, τ1, τ2 and C, shape (4, n)."""
    theta = np.array([[at.Ts], [at.tau1], [at.tau2], [at.C]])
    return np.asarray(slope_shapes(theta, np.asarray(t_s)[None])[0, :4] * slope_sizes(theta)[0, :4, None])


def slope_shapes(theta: Array, t_s: Array) -> Array:
    """The derivatives of L steps of T_s, τ1, τ2, C, (4, L), at times (L, P), yet to be multiplied by `slope_sizes`:
    (L, 5, P), the last row left to the caller."""
    share, gone = theta[3][:, None], decay(t_s, theta[1:3, :, None])
    s = np.empty((theta.shape[1], 5, t_s.shape[1]), dtype=gone.dtype)
    s[:, 0] = 1.0 - share * gone[0] - (1.0 - share) * gone[1]
    np.multiply(t_s, gone[0], out=s[:, 1])
    np.multiply(t_s, gone[1], out=s[:, 2])
    np.subtract(gone[1], gone[0], out=s[:, 3])
    return s


def slope_sizes(theta: Array) -> Array:
    """Factors of those derivatives, and 1 for the last row, (L, 5)."""
    sizes = np.ones((theta.shape[1], 5), dtype=theta.dtype)
    sizes[:, 1] = -theta[0] * theta[3] / theta[1] ** 2
    sizes[:, 2] = theta[0] * (theta[3] - 1.0) / theta[2] ** 2
    sizes[:, 3] = theta[0]
    return sizes


def step_bends(theta: Array, t_s: Array) -> Array:
    """Second derivatives of L steps of T_s, τ1, τ2, C, (4, L), by ln τ1 and ln τ2, at times (L, P): (2, L, P)."""
    x = t_s / theta[1:3, :, None]
    return np.asarray((theta[0] * [theta[3], 1 - theta[3]])[:, :, None] * x * (1 - x) * np.exp(-x))


def peak_of(at: Step) -> tuple[float, float]:
    """When a step that overshoots (C > 1) is at its top [s], and its output there.

    Its rate is 0 where C/τ1 e^(−t/τ1) = (C − 1)/τ2 e^(−t/τ2).
    """
    time_s = float(np.log(at.C * at.tau2 / ((at.C - 1) * at.tau1)) / (1 / at.tau1 - 1 / at.tau2))
    return time_s, float(step_response(at, np.array(time_s)))
