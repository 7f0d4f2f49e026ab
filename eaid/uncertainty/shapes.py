"""Other shapes for the step response of one level, fitted to its mean.

stretched           T_s (1 − e^(−(t/τ)^β))
logarithm           A ln(1 + t/τ)
power               A t^β
three exponentials  Σ A_k (1 − e^(−t/τ_k)), A_k > 0

Their parameters in logarithms, by damped Gauss–Newton from starts about the level's two exponentials of Eq. (3).
"""

from collections.abc import Callable

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.descent import descend
from eaid.models.parameters import Friction

Shape = Callable[[Array, Array], tuple[Array, Array]]
"""θ (N, k) and t, (n,) or (N, n) → the curves (N, n) and their slopes by θ (N, n, k)."""
STEPS, ENOUGH = 40, 1e-7
BETAS = (0.5, 0.8)


def stretched(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """T_s (1 − e^(−a)), a = (t/τ)^β, by (log T_s, log τ, log β)."""
    steady, tau, beta = np.exp(theta).T[:, :, None]
    with np.errstate(divide="ignore"):
        log_a = beta * np.log(time_s / tau)
    a = np.exp(np.minimum(log_a, 50.0))
    bent = steady * a * np.exp(-a)
    f = -steady * np.expm1(-a)
    return f, np.stack([f, -beta * bent, bent * np.where(a > 0, log_a, 0.0)], axis=-1)


def logarithm(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """A ln(1 + t/τ), by (log A, log τ): it grows for ever, as a contact that ages may."""
    size, tau = np.exp(theta).T[:, :, None]
    f = size * np.log1p(time_s / tau)
    return f, np.stack([f, -size * time_s / (tau + time_s)], axis=-1)


def power(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """A t^β, by (log A, log β): the creep of Andrade, β about 1/3, without an end."""
    size, beta = np.exp(theta).T[:, :, None]
    log_t = np.log(np.maximum(time_s, 1e-12))
    f = size * np.where(time_s > 0, np.exp(beta * log_t), 0.0)
    return f, np.stack([f, f * beta * log_t], axis=-1)


def three_exponentials(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """Σ A_k (1 − e^(−t/τ_k)), by (log A_1..3, log τ_1..3)."""
    size, tau = np.exp(theta[:, None, :3]), np.exp(theta[:, None, 3:])
    a = np.atleast_2d(time_s)[:, :, None] / tau
    parts = -size * np.expm1(-a)
    return parts.sum(axis=-1), np.concatenate([parts, -size * a * np.exp(-a)], axis=-1)


def stretched_starts(curve: Friction) -> Array:
    """About the level's two exponentials, shape (2, 3)."""
    middle = curve.tau1 ** (curve.C) * curve.tau2 ** (1 - curve.C)
    return np.log([[curve.Ts, middle, beta] for beta in BETAS])


def logarithm_starts(curve: Friction) -> Array:
    """Through T_s at the level's τ2, shape (2, 2)."""
    return np.log([[curve.Ts / np.log1p(curve.tau2 / tau), tau] for tau in (curve.tau1, curve.tau1 / 5)])


def power_starts(curve: Friction) -> Array:
    """Through T_s at the level's τ2, shape (2, 2)."""
    return np.log([[curve.Ts / curve.tau2**beta, beta] for beta in (0.1, 1 / 3)])


def three_starts(curve: Friction) -> Array:
    """The two exponentials with a third one below, between and above them, shape (3, 6)."""
    fast, slow = curve.C * curve.Ts, (1 - curve.C) * curve.Ts
    between = np.sqrt(curve.tau1 * curve.tau2)
    return np.log(
        [
            [fast / 2, fast / 2, slow, curve.tau1 / 2, curve.tau1 * 1.5, curve.tau2],
            [fast * 0.8, fast * 0.2, slow, curve.tau1, between, curve.tau2],
            [fast, slow / 2, slow / 2, curve.tau1, between, curve.tau2 * 2],
        ]
    )


THREE = "three exponentials"
OTHERS: tuple[tuple[str, int, Shape, Callable[[Friction], Array]], ...] = (
    ("a stretched exponential", 3, stretched, stretched_starts),
    ("a logarithm of time", 2, logarithm, logarithm_starts),
    ("a power of time", 2, power, power_starts),
    (THREE, 6, three_exponentials, three_starts),
)
"""Shapes that are tried where two exponentials fail: name, parameters, curve, starts."""


def best_fits(shape: Shape, starts: Array, points: Points) -> Array:
    """Where a shape is nearest to each level of `points`, from starts of shape (L, S, k); shape (L, k)."""
    levels, several, count = starts.shape
    each = points.rows(np.repeat(np.arange(levels), several))

    def look(x: Array) -> tuple[Array, Array, Array]:
        f, slopes = shape(x, each.t_s)
        left, J = each.root_w * (f - each.y), each.root_w[:, :, None] * slopes
        cost = np.nan_to_num(np.einsum("nj,nj->n", left, left), nan=np.inf)
        sound = np.isfinite(cost)[:, None, None]
        J = np.where(sound, J, 0.0)
        return cost, 2 * np.einsum("njk,nj->nk", J, np.where(sound[:, :, 0], left, 0.0)), 2 * J.transpose(0, 2, 1) @ J

    found = descend(look, starts.reshape(-1, count), STEPS, ENOUGH, lambda x, move: x - np.clip(move, -1.0, 1.0))
    best = found.cost.reshape(levels, several).argmin(axis=1)
    return np.asarray(found.x.reshape(starts.shape)[np.arange(levels), best])
