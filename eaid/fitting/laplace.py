"""The sums of `kernel` without the points: every one is a Laplace transform of the weights or of the weighted data.

With G_k(λ) = Σ w t^k e^(−λt) and B_k(λ) = Σ w y t^k e^(−λt) tabulated once, cost, gradient and curvature of a level
take a handful of look-ups, however many points it has. Between the nodes, equally spaced in ln λ, a cubic takes on
values and slopes, dG_k/d ln λ = −λ G_{k+1}: 1e-8 of the sum of squared data. For searches, not for end points.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points

SPACING = 0.06
"""Between nodes, in ln λ."""
SLOWEST = 1e-5
"""Least λ times the record: slower parts are missing from it altogether, and taken as this slow."""
FASTEST_S = 1e-4
"""Least τ [s], a tenth of its floor."""


@dataclass(frozen=True, eq=False)
class Transforms:
    """G_0…G_3 of the time axes and B_0…B_2 of the levels, at nodes of λ."""

    rates: Array
    """λ [1/s], shape (K,)."""
    weights: Array
    """G, shape (1 or L, K, 4)."""
    data: Array
    """B, shape (L, K, 3)."""
    count: Array
    """Σ w, shape (1 or L,)."""
    total: Array
    """Σ w y, shape (L,)."""
    squares: Array
    """Σ w y², shape (L,)."""

    def normal(self, theta: Array) -> tuple[Array, Array, Array]:
        """Cost (N, L), gradient by θ (4, N, L) and Gauss–Newton curvature (N, L, 4, 4) for θ of shape (4, N, L)."""
        Ts, tau1, tau2, c = theta
        d = 1.0 - c
        slow, fast = self.rates[0], 0.5 * self.rates[-1]
        a, b = np.clip(1.0 / tau1, slow, fast), np.clip(1.0 / tau2, slow, fast)
        places = self._places(np.stack([a, b, 2 * a, a + b, 2 * b]))
        one, two, aa, ab, bb = places.values(self.weights, 3, 5).swapaxes(0, 1)
        y1, y2 = places.values(self.data, 2, 2).swapaxes(0, 1)
        # products of the slopes 1 − c e1 − d e2, t e1, t e2, e2 − e1 with one another, and with the data
        with1, with2 = one[:2] - c * aa[:2] - d * ab[:2], two[:2] - c * ab[:2] - d * bb[:2]  # φ with t^k e1, t^k e2
        product = np.empty((*Ts.shape, 4, 4))
        whole = self.count - c * one[0] - d * two[0]  # φ with 1
        product[..., 0, 0] = whole - c * with1[0] - d * with2[0]
        product[..., 0, 1], product[..., 0, 2], product[..., 0, 3] = with1[1], with2[1], with2[0] - with1[0]
        product[..., 1, 1], product[..., 1, 2], product[..., 1, 3] = aa[2], ab[2], ab[1] - aa[1]
        product[..., 2, 2], product[..., 2, 3] = bb[2], bb[1] - ab[1]
        product[..., 3, 3] = bb[0] - 2 * ab[0] + aa[0]
        for i, j in ((1, 0), (2, 0), (3, 0), (2, 1), (3, 1), (3, 2)):
            product[..., i, j] = product[..., j, i]
        along = np.stack([self.total - c * y1[0] - d * y2[0], y1[1], y2[1], y2[0] - y1[0]], axis=-1)
        scale = np.stack([np.ones_like(Ts), -Ts * c / tau1**2, -Ts * d / tau2**2, Ts], axis=-1)
        cost = self.squares + Ts * (Ts * product[..., 0, 0] - 2.0 * along[..., 0])
        gradient = 2.0 * scale * (Ts[..., None] * product[..., 0] - along)
        product *= 2.0 * scale[..., :, None] * scale[..., None, :]
        return cost, np.moveaxis(gradient, -1, 0), product

    def _places(self, rate: Array) -> "_Places":
        """Where some λ lie among the nodes; shape (R, N, L), as of all arrays of the result."""
        place = np.log(rate / self.rates[0]) / SPACING
        left = np.minimum(place.astype(np.intp), len(self.rates) - 2)
        s = place - left
        off = s - 1.0
        # Hermite: values, and slopes by ln λ times the spacing
        return _Places(
            left,
            s * s * (3.0 - 2.0 * s),
            s * off * off * -SPACING * self.rates[left],
            s * s * off * -SPACING * self.rates[left + 1],
        )


@dataclass(frozen=True, eq=False)
class _Places:
    """Some λ among the nodes of a table: the node before each, and the cubic's weights of what stands there."""

    left: NDArray[np.intp]
    rise: Array
    """Of the difference of the values."""
    before: Array
    """Of G_{k+1} at the node before, and after it."""
    after: Array

    def values(self, table: Array, most: int, count: int) -> Array:
        """The first `most` columns of a table, (1 or L, K, …), at the first `count` λ, shape (most, count, N, L)."""
        left = self.left[:count]
        rise, before, after = (part[:count] for part in (self.rise, self.before, self.after))
        nodes = table.shape[1]
        if len(table) > 1:
            left = left + nodes * np.arange(len(table))
        flat = table.reshape(len(table) * nodes, -1)
        low, high = flat.take(left, axis=0), flat.take(left + 1, axis=0)
        found = np.empty((most, *left.shape))
        for k in range(most):
            found[k] = (
                low[..., k] + rise * (high[..., k] - low[..., k]) + before * low[..., k + 1] + after * high[..., k + 1]
            )
        return found


def transforms(points: Points) -> Transforms:
    """Tables for the points of L levels."""
    longest = float(points.t_s.max())
    low = np.log(SLOWEST / longest)
    rates = np.exp(np.arange(low, np.log(2.0 / FASTEST_S) + SPACING, SPACING))
    shared = len(points.t_s) == 1
    powers = np.arange(4)
    weights, data = [], []
    for t, w, y in zip(points.t_s, points.w, [points.y] if shared else points.y[:, None], strict=True):
        decay = np.exp(-rates[:, None] * t)
        moments = t[:, None] ** powers * w[:, None]  # (P, 4)
        weights.append(decay @ moments)
        data.append(np.stack([decay @ (y * moments[:, k]).T for k in range(3)], axis=-1))  # (K, levels, 3)
    whole = np.broadcast_to(points.w, points.y.shape)
    return Transforms(
        rates,
        np.stack(weights),
        np.concatenate(data, axis=1).transpose(1, 0, 2).copy(),
        points.w.sum(axis=1),
        (whole * points.y).sum(axis=1),
        (whole * points.y**2).sum(axis=1),
    )
