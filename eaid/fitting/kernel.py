"""Sums over samples of the friction curve, Eq. (3), for all levels at once: cost, gradient, curvature.

Every fit of the curve needs, per level, only the sum of squared residuals and its derivatives by θ = (T_s, τ1, τ2, C);
the chain rule carries them to whatever unknowns a fit has. θ has shape (4, L).
"""

from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points

TABLE = 128
"""Length of the tabulated stretch of a geometric sequence."""


def level_sums(theta: Array, points: Points) -> tuple[Array, Array]:
    """Σ w (f − y)² per level, shape (L,), and its gradient by θ, shape (4, L)."""
    Ts, tau1, tau2, share = theta[:, :, None]
    e1, e2 = np.exp(points.t_s / -tau1), np.exp(points.t_s / -tau2)
    shape = 1.0 - share * e1 - (1.0 - share) * e2
    residual = Ts * shape - points.y
    weighted = points.w * residual
    cost = np.einsum("lp,lp->l", weighted, residual)
    e1 *= weighted
    e2 *= weighted
    by_e1, by_e2 = e1.sum(axis=1), e2.sum(axis=1)
    t_e1 = np.einsum("lp,lp->l", e1, np.broadcast_to(points.t_s, e1.shape))
    t_e2 = np.einsum("lp,lp->l", e2, np.broadcast_to(points.t_s, e2.shape))
    along = np.einsum("lp,lp->l", weighted, shape)
    return cost, _gradient(theta, along, by_e1, by_e2, t_e1, t_e2)


def _gradient(theta: Array, along: Array, by_e1: Array, by_e2: Array, t_e1: Array, t_e2: Array) -> Array:
    Ts, tau1, tau2, share = theta
    return 2.0 * np.stack(
        [along, -Ts * share / tau1**2 * t_e1, -Ts * (1.0 - share) / tau2**2 * t_e2, Ts * (by_e2 - by_e1)]
    )


def level_curvature(theta: Array, points: Points, exact: bool = False) -> Array:
    """Second derivatives of `level_sums` by θ, (L, 4, 4): Gauss–Newton 2 J'WJ, or with the residuals' own part."""
    Ts, tau1, tau2, share = theta[:, :, None]
    t = np.broadcast_to(points.t_s, points.y.shape)
    e1, e2 = np.exp(-t / tau1), np.exp(-t / tau2)
    shape = 1.0 - share * e1 - (1.0 - share) * e2
    slopes = np.stack(
        [shape, -Ts * share * t * e1 / tau1**2, -Ts * (1.0 - share) * t * e2 / tau2**2, Ts * (e2 - e1)], axis=1
    )
    curvature = (slopes * points.w[:, None, :]) @ np.swapaxes(slopes, 1, 2)
    if exact:
        r = points.w * (Ts * shape - points.y)
        own = np.zeros_like(curvature)
        own[:, 0, 1] = (r * -share * t * e1 / tau1**2).sum(axis=1)
        own[:, 0, 2] = (r * -(1.0 - share) * t * e2 / tau2**2).sum(axis=1)
        own[:, 0, 3] = (r * (e2 - e1)).sum(axis=1)
        own[:, 1, 3] = (r * -Ts * t * e1 / tau1**2).sum(axis=1)
        own[:, 2, 3] = (r * Ts * t * e2 / tau2**2).sum(axis=1)
        own += np.swapaxes(own, 1, 2)
        own[:, 1, 1] = (r * -Ts * share * e1 * (t / tau1 - 2.0) * t / tau1**3).sum(axis=1)
        own[:, 2, 2] = (r * -Ts * (1.0 - share) * e2 * (t / tau2 - 2.0) * t / tau2**3).sum(axis=1)
        curvature = curvature + own
    return np.asarray(2.0 * curvature)


@dataclass(frozen=True, eq=False)
class Record:
    """Every sample of one level: the full data that an end point is confirmed on."""

    t_s: Array
    y: Array
    uniform: bool


def full_sums(theta: Array, records: tuple[Record, ...]) -> tuple[Array, Array, list[Array]]:
    """As `level_sums`, over every sample; and the residuals f − y of each level, shapes (n_l,)."""
    costs, gradients, residuals = [], [], []
    for record, (Ts, tau1, tau2, share) in zip(records, theta.T, strict=True):
        e1, e2 = decay(record, tau1), decay(record, tau2)
        shape = 1.0 - share * e1
        shape -= (1.0 - share) * e2
        r = Ts * shape - record.y
        costs.append(r @ r)
        by_e1, by_e2 = r @ e1, r @ e2
        e1 *= record.t_s
        e2 *= record.t_s
        one = np.array([Ts, tau1, tau2, share])
        gradients.append(_gradient(one, r @ shape, by_e1, by_e2, r @ e1, r @ e2))
        residuals.append(r)
    return np.array(costs), np.stack(gradients, axis=1), residuals


def decay(record: Record, tau: float) -> Array:
    """e^(−t/τ) at every sample, shape (n,).

    On a uniform grid it is a geometric sequence: one stretch of 128 is tabulated and multiplied by the first value of
    every stretch.
    """
    if not record.uniform or len(record.t_s) < 4 * TABLE:
        return np.exp(record.t_s / -tau)
    heads = np.exp(record.t_s[::TABLE] / -tau)
    stretch = np.exp((record.t_s[:TABLE] - record.t_s[0]) / -tau)
    return np.asarray(np.multiply.outer(heads, stretch).ravel()[: len(record.t_s)])
