"""How sure the linear model is, Eq. (8): the pooled a0, b0, c0, and the B of each level.

The linear model is wrong by design (one time constant for two), so its truth is the fit to logs without noise or
scatter. With e = ȳ − f the influence of a run on the pooled fit is ψ = H⁻¹ (s_lr − s̄_l), s_lr = J'(y_lr − f)/R, where
H = Σ J'J − Σ e ∇²f is the full Hessian; V = Σ_l R/(R − 1) Σ_r ψψ', with Welch–Satterthwaite degrees of freedom.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.models.parameters import Linear
from eaid.steps.stepset import Level
from eaid.uncertainty.run_statistics import RunStatistics, run_statistics
from eaid.uncertainty.student_t import satterthwaite

TO_LOG_B = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
"""(log a0, log gain) → (log a0, log gain, log B) less log u."""


UNSEEN = 1e-10
"""Directions that the data do not see, b0 and c0 of a single level, have this part of the information at most."""


def _rise(a0: float, t_s: Array) -> tuple[Array, Array, Array]:
    """r = (1 − e^(−a0 t))/a0 and its first two derivatives by a0, shape (n,) each."""
    rise = -np.expm1(-a0 * t_s)
    decay, r = 1.0 - rise, rise / a0
    first = (t_s * decay - r) / a0
    return r, first, (-(t_s**2) * decay - 2 * first) / a0


Gain = tuple[Array, Array]
"""How a change of a level's mean moves m numbers, shape (m, n), as a product of (m, k) and (k, n)."""


def pooled_gain(levels: Sequence[Level], p: Linear) -> list[Gain]:
    """How a change of each level's mean moves the pooled (a0, b0, c0): H⁻¹ J' of each level, J' = (3, 2) of (r', r)."""
    hessian = np.zeros((3, 3))
    parts = []
    time_s, second, both, square = np.empty(0), np.empty(0), np.empty((2, 0)), np.empty((2, 2))
    for level in levels:
        if not np.array_equal(level.time_s, time_s):  # most levels have the same times
            time_s = level.time_s
            r, first, second = _rise(p.a0, time_s)
            both = np.stack([first, r])
            square = both @ both.T
        size = p.b0 * level.level + p.c0
        take = np.array([[size, 0.0], [0.0, level.level], [0.0, 1.0]])
        left = level.mean - size * both[1]
        curved = np.zeros((3, 3))
        curved[0, 0] = size * (left @ second)
        curved[0, 1] = curved[1, 0] = level.level * (left @ both[0])
        curved[0, 2] = curved[2, 0] = left @ both[0]
        hessian += take @ square @ take.T - curved
        parts.append((take, both))
    inverse = scaled_inverse(hessian, UNSEEN)
    return [(inverse @ take, both) for take, both in parts]


def level_gain(level: Level, a0: float, gain: float) -> Array:
    """How a change of a level's mean moves its own (log a0, log gain, log B), B = u/(a0 gain), shape (3, n)."""
    jacobian, hessian = level_terms(level, a0, gain)
    return np.asarray(TO_LOG_B @ scaled_inverse(hessian, UNSEEN) @ jacobian.T)


def level_terms(level: Level, a0: float, gain: float) -> tuple[Array, Array]:
    """∂f/∂(log a0, log gain) of gain · (1 − e^(−a0 t)), shape (n, 2), and the full Hessian of half the cost (2, 2)."""
    rise = -np.expm1(-a0 * level.time_s)
    decay = 1.0 - rise
    slope = gain * a0 * level.time_s * decay
    jacobian = np.stack([slope, gain * rise], axis=1)
    left = level.mean - gain * rise
    curved = np.array([[left @ (slope * (1 - a0 * level.time_s)), left @ slope], [left @ slope, left @ (gain * rise)]])
    return jacobian, np.asarray(jacobian.T @ jacobian - curved)


def combined_variance(influence: Sequence[Array]) -> tuple[float, float]:
    """Variance and Welch–Satterthwaite degrees of freedom of one number, from its influences (R,) of each level."""
    several = [psi for psi in influence if len(psi) > 1]
    spare = [float(len(psi) - 1) for psi in several]
    parts = [len(psi) / (len(psi) - 1) * float(((psi - psi.mean()) ** 2).sum()) for psi in several]
    variance = float(np.sum(parts))
    if variance == 0:
        return 0.0, float(np.sum(spare))
    return variance, max(float(satterthwaite(parts, spare)), min(spare))


def level_run_statistics(level: Level, a0: float, gain: float, noise_nm: Array) -> RunStatistics:
    """Statistics of the runs for (log a0, log gain, log B) of one level's own fit, gain [N·m] · (1 − e^(−a0 t))."""
    jacobian, hessian = level_terms(level, a0, gain)
    theta = np.log([a0, gain])
    one = run_statistics(
        level.level, level.time_s, level.runs, jacobian, theta,
        noise_nm=noise_nm, mean_nm=level.mean, hessian=hessian,
    )  # fmt: skip
    return replace(
        one,
        log_theta=np.append(theta, np.log(level.level) - theta.sum()),
        influence=one.influence @ TO_LOG_B.T,
        # both parts of B come from the same samples: their within-run errors are taken as additive, the wider reading
        within=np.append(one.within, np.sqrt(one.within).sum() ** 2),
    )
