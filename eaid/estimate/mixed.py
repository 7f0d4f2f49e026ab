"""A line through values of known variance that scatter about it: variance components by REML, and what follows.

    y = X β + e,    Var e = K = W + Σ_k v_k G_k,    v_k ≥ 0

W is what the measurements themselves leave open, G_k what values have in common: the identity where each departs from
the line by itself, blocks of ones where those of a session depart together. The restricted likelihood

    −log L = ½ log|K| + ½ log|X' K⁻¹ X| + ½ r' K⁻¹ r,    r = y − X β,  β = (X' K⁻¹ X)⁻¹ X' K⁻¹ y

is smallest at the v_k. A further value of the same kind, with the rows x* and the covariances k = Cov(y, y*), is then
x* β + k' K⁻¹ r, with the variance k** − k' K⁻¹ k + a' (X' K⁻¹ X)⁻¹ a, a = x* − X' K⁻¹ k (Henderson), and as many
degrees of freedom as the v_k leave it by Satterthwaite: 2 V²/(∇V' H⁻¹ ∇V), H the curvature of −log L over the v_k
that are not 0. Where W is an estimate of ν degrees of freedom, its size is one more: + 2 (w' W w)²/ν below, w the
weights of the values in the further one.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array, link
from eaid.estimate.solver import Problem, approach

NO_VARIANCE = 1e-6  # Part of the data's own variance below which a component is none


@dataclass(frozen=True, eq=False)
class MixedValues:
    """n values: y (n,), their rows X (n, p), their own variance W (n, n), what they have in common G, (n, n) each."""

    y: Array
    X: Array
    W: Array
    G: tuple[Array, ...]

    def at(self, v: Array) -> "MixedLine":
        """The line through them where the variances are v, (k,)."""
        return MixedLine(self, v)

    @cached_property
    def place(self) -> NDArray[np.intp]:
        """The values that have something in common, block by block, (b, m); n for each that is missing in shorter
        blocks."""
        tied = np.any([self.W != 0, *(G != 0 for G in self.G)], axis=0)
        label = link(tied)
        sizes = np.bincount(label)
        place = np.full((len(sizes), sizes.max()), len(self.y))
        place[np.arange(sizes.max()) < sizes[:, None]] = np.argsort(label, kind="stable")
        return place

    @cached_property
    def blocks(self) -> tuple[Array, Array, Array, Array]:
        """y (b, m), X (b, m, p), W (b, m, m), G (k, b, m, m), block by block; a value of nothing, with the variance 1,
        stands for each that is missing."""
        n, place, every = len(self.y), self.place, np.zeros((1 + len(self.G), len(self.y) + 1, len(self.y) + 1))
        every[:, :n, :n] = self.W, *self.G
        squares = every[:, place[:, :, None], place[:, None, :]]
        squares[0] += (place == n)[:, :, None] * np.eye(place.shape[1])
        return np.append(self.y, 0)[place], np.vstack([self.X, 0 * self.X[:1]])[place], squares[0], squares[1:]

    def likelihood(self, v: Array) -> tuple[float, Array, Array]:
        """−log L but for a constant, its derivative by each v_k, ½ tr(P G_k) − ½ y'P G_k P y, (k,), and what its second
        is expected to be, ½ tr(P G_j P G_k), (k, k)."""
        y, X, W, G = self.blocks
        K = W + np.tensordot(v, G, 1)
        inverse = np.linalg.inv(K)
        across = inverse @ X
        information = np.einsum("bmp,bmq->pq", X, across)
        covariance = np.linalg.inv(information)
        r = y - X @ (covariance @ np.einsum("bmp,bm->p", across, y))
        pulled = np.einsum("bmn,bn->bm", inverse, r)
        logs = np.linalg.slogdet(K)[1].sum() + np.linalg.slogdet(information)[1]
        own, line = inverse @ G, G @ across  # by component
        within = np.tensordot(line, across, ((1, 2), (0, 1))) @ covariance
        slope = np.einsum("kbmm->k", own) - np.einsum("kpp->k", within) - np.einsum("kbmn,bm,bn->k", G, pulled, pulled)
        tied = np.tensordot(inverse @ line, line, ((1, 2), (1, 2)))  # (k, p, k, p)
        expected = np.tensordot(own, own.swapaxes(2, 3), ((1, 2, 3),) * 2)
        expected += np.tensordot(within, within.swapaxes(1, 2), ((1, 2),) * 2)
        expected -= 2 * np.tensordot(tied, covariance, ((1, 3), (0, 1)))
        return 0.5 * float(logs + np.vdot(pulled, r)), 0.5 * slope, 0.5 * expected


@dataclass(frozen=True, eq=False)
class MixedLine:
    """The line through values whose components have the variances v."""

    values: MixedValues
    v: Array

    @cached_property
    def inverse(self) -> Array:
        """K⁻¹ of the covariance of the values, (n, n)."""
        n, place, (_, _, W, G) = len(self.values.y), self.values.place, self.values.blocks
        whole = np.zeros((n + 1, n + 1))
        whole[place[:, :, None], place[:, None, :]] = np.linalg.inv(W + np.tensordot(self.v, G, 1))
        return whole[:n, :n]

    @cached_property
    def covariance(self) -> Array:
        """Covariance of β, (X' K⁻¹ X)⁻¹, (p, p)."""
        return np.asarray(np.linalg.inv(self.values.X.T @ self.inverse @ self.values.X))

    @cached_property
    def beta(self) -> Array:
        """β by generalised least squares, (p,)."""
        return np.asarray(self.covariance @ (self.values.X.T @ (self.inverse @ self.values.y)))

    @cached_property
    def residuals(self) -> Array:
        """y − X β, (n,)."""
        return np.asarray(self.values.y - self.values.X @ self.beta)

    @property
    def cost(self) -> float:
        """−log L but for a constant."""
        return self.values.likelihood(self.v)[0]

    @property
    def gained(self) -> float:
        """2 Δ log L over a line without components: χ² of half a degree or more where there are none."""
        return 2 * (self.values.at(0 * self.v).cost - self.cost)

    @cached_property
    def curvature(self) -> Array:
        """Its second derivatives: y'P G_j P G_k P y − ½ tr(P G_j P G_k), (k, k), where P y is K⁻¹ r."""
        moved = np.stack([G @ (self.inverse @ self.residuals) for G in self.values.G])
        along = moved @ self.inverse @ self.values.X
        free = moved @ self.inverse @ moved.T - along @ self.covariance @ along.T  # with P = K⁻¹ − K⁻¹ X (…)⁻¹ X' K⁻¹
        return np.asarray(free - self.values.likelihood(self.v)[2])

    def further(self, x: Array, k: Array, own: Array) -> "Further":
        """q further values: x (q, p) are their rows, k (components, n, q) what they have in common with the values,
        `own` (components, q, q) among themselves.

        As the weights w = K⁻¹ (k + X (X' K⁻¹ X)⁻¹ a) of the values make the variance least, it goes with v_j as
        own_j − k_j' w − w' k_j + w' G_j w.
        """
        free = np.flatnonzero(self.v > NO_VARIANCE * self.scale)
        common = np.tensordot(self.v, k, 1)
        back = self.inverse @ common
        w = back + self.inverse @ self.values.X @ self.covariance @ (x.T - self.values.X.T @ back)
        across = w.T @ k
        slopes = own - across - across.transpose(0, 2, 1) + np.stack([w.T @ (G @ w) for G in self.values.G])
        measured = w.T @ self.values.W @ w
        covariance = np.tensordot(self.v, slopes, 1) + measured
        of_variances = np.linalg.pinv(self.curvature[np.ix_(free, free)], hermitian=True)
        return Further(w.T @ self.values.y, covariance, slopes[free], np.asarray(of_variances), measured)

    @property
    def scale(self) -> float:
        """The size that variances are compared with: that of the values about the plain line."""
        left = self.values.y - self.values.X @ np.linalg.lstsq(self.values.X, self.values.y, rcond=None)[0]
        return float(left @ left / max(len(left) - self.values.X.shape[1], 1))


@dataclass(frozen=True, eq=False)
class Further:
    """Further values: their means (q,), covariance (q, q), its derivatives by the variances that are not 0, (k, q, q),
    and the covariance of those, (k, k)."""

    mean: Array
    covariance: Array
    slopes: Array
    variances_covariance: Array
    measured: Array  # The part of the covariance that W makes, (q, q)

    def at(self, places: Array) -> "Further":
        """Some of them, one more than once where it is to be measured."""
        pair = np.ix_(places, places)
        slopes, measured = self.slopes[:, pair[0], pair[1]], self.measured[pair]
        return Further(self.mean[places], self.covariance[pair], slopes, self.variances_covariance, measured)

    def degrees(self, turn: Array, known: float = np.inf) -> Array:
        """Degrees of freedom of the variances of `turn` (m, q) times the values, those of W being `known`: infinite
        where nothing is estimated."""
        variance = np.einsum("mq,qr,mr->m", turn, self.covariance, turn)
        slopes = np.einsum("mq,kqr,mr->km", turn, self.slopes, turn)
        spread = np.einsum("km,kl,lm->m", slopes, self.variances_covariance, slopes)
        spread = spread + 2 * np.einsum("mq,qr,mr->m", turn, self.measured, turn) ** 2 / known
        return np.where(spread > 0, 2 * variance**2 / np.where(spread > 0, spread, 1.0), np.inf)


REML_STARTS = (1.0, 0.1, 0.001)  # Parts of the values' scale about a plain line that each component starts from
MOST_STEPS, NO_GAIN, NO_COMPONENT = 60, 1e-12, 1e-12  # Fisher's scoring: steps; gain of log L, part of the scale: none


def fit_restricted(values: MixedValues, near: Array | None = None) -> MixedLine:
    """The line whose variances maximise the restricted likelihood: the best of three starts, or the one `near` some."""
    scale = max(values.at(np.zeros(len(values.G))).scale, 1e-300)
    if not np.diag(values.W).all():  # values known for certain have no K⁻¹ where their components are 0
        values = replace(values, W=values.W + NO_VARIANCE**2 * scale * np.eye(len(values.y)))
    starts = [np.full(len(values.G), one * scale) for one in REML_STARTS] if near is None else [near]
    problem = Problem(values.likelihood, np.eye(len(values.G)), np.zeros(len(values.G)), str, floor=1.0)
    best = min((approach(problem, one, MOST_STEPS, NO_GAIN) for one in starts), key=lambda end: end.cost)
    return values.at(np.where(best.x > NO_COMPONENT * scale, best.x, 0.0))
