"""A line through values of known variance that scatter about it: variance components by REML, and what follows.

    y = X β + e,    Var e = K = W + Σ_k v_k G_k,    v_k ≥ 0

W is what the measurements themselves leave open, G_k what values have in common: the identity where each departs from
the line by itself, blocks of ones where those of a session depart together. The restricted likelihood

    −log L = ½ log|K| + ½ log|X' K⁻¹ X| + ½ r' K⁻¹ r,    r = y − X β,  β = (X' K⁻¹ X)⁻¹ X' K⁻¹ y

is smallest at the v_k. A further value of the same kind, with the rows x* and the covariances k = Cov(y, y*), is then
x* β + k' K⁻¹ r, with the variance k** − k' K⁻¹ k + a' (X' K⁻¹ X)⁻¹ a, a = x* − X' K⁻¹ k (Henderson), and as many
degrees of freedom as the v_k leave it by Satterthwaite: 2 V²/(∇V' H⁻¹ ∇V), H the curvature of −log L over the v_k
that are not 0. Where W is an estimate of ν degrees of freedom, its size is one more: + 2 (W ∂V/∂W)²/ν below.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from eaid.arrays import Array

NOTHING = 1e-6  # Part of the data's own variance below which a component is none
NUDGE = 1e-4  # Part of a variance by which it is changed to see what goes with it


@dataclass(frozen=True, eq=False)
class Values:
    """n values: y (n,), their rows X (n, p), their own variance W (n, n), what they have in common G, (n, n) each."""

    y: Array
    X: Array
    W: Array
    G: tuple[Array, ...]

    def at(self, v: Array) -> "Line":
        """The line through them where the variances are v, (k,)."""
        return Line(self, v)


@dataclass(frozen=True, eq=False)
class Line:
    """The line through values whose components have the variances v."""

    values: Values
    v: Array
    found_from: "Line | None" = None  # the line that the variances were found from, where it is another

    def among(self, values: Values) -> "Line":
        """The same variances for more values, which have no say in them: those of a new session."""
        return Line(values, self.v, self)

    @cached_property
    def K(self) -> Array:
        """Covariance of the values, (n, n)."""
        return np.asarray(self.values.W + sum(v * G for v, G in zip(self.v, self.values.G, strict=True)))

    @cached_property
    def inverse(self) -> Array:
        """K⁻¹."""
        return np.asarray(np.linalg.inv(self.K))

    @cached_property
    def information(self) -> Array:
        """X' K⁻¹ X, (p, p)."""
        return np.asarray(self.values.X.T @ self.inverse @ self.values.X)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of β, (p, p)."""
        return np.asarray(np.linalg.inv(self.information))

    @cached_property
    def beta(self) -> Array:
        """β by generalised least squares, (p,)."""
        return np.asarray(self.covariance @ (self.values.X.T @ (self.inverse @ self.values.y)))

    @cached_property
    def residuals(self) -> Array:
        """y − X β, (n,)."""
        return np.asarray(self.values.y - self.values.X @ self.beta)

    @cached_property
    def projected(self) -> Array:
        """P = K⁻¹ − K⁻¹ X (X' K⁻¹ X)⁻¹ X' K⁻¹, (n, n)."""
        across = self.inverse @ self.values.X
        return np.asarray(self.inverse - across @ self.covariance @ across.T)

    @property
    def cost(self) -> float:
        """−log L but for a constant."""
        half = np.linalg.slogdet(self.K)[1] + np.linalg.slogdet(self.information)[1]
        return 0.5 * float(half + self.residuals @ self.inverse @ self.residuals)

    @property
    def gained(self) -> float:
        """2 Δ log L over a line without components: χ² of half a degree or more where there are none."""
        return 2 * (self.values.at(0 * self.v).cost - self.cost)

    @property
    def slope(self) -> Array:
        """Its derivative by each v_k: ½ tr(P G_k) − ½ y'P G_k P y, (k,)."""
        pulled = self.projected @ self.values.y
        return np.array([0.5 * (np.vdot(self.projected, G) - pulled @ G @ pulled) for G in self.values.G])

    @cached_property
    def curvature(self) -> Array:
        """Its second derivatives: y'P G_j P G_k P y − ½ tr(P G_j P G_k), (k, k)."""
        pulled, across = self.projected @ self.values.y, [self.projected @ G for G in self.values.G]
        moved = [G @ pulled for G in self.values.G]
        second = [[a @ self.projected @ b for b in moved] for a in moved]
        return np.array(second) - 0.5 * np.array([[np.vdot(a.T, b) for b in across] for a in across])

    def predict(
        self, x: Array, k: Sequence[Array], own: Array, most: float = np.inf, known: float = np.inf
    ) -> tuple[float, float, float]:
        """A further value: its mean, variance and degrees of freedom, `most` at most; those of W are `known`.

        x (p,) is its row, k what it has in common with the values by component, (n,) each, and `own` (components,)
        its own variance by component.
        """

        def of(values: Values, v: Array) -> tuple[float, float]:
            line = values.at(v)
            common = sum((one * many for one, many in zip(v, k, strict=True)), np.zeros(len(values.y)))
            back = line.inverse @ common
            a = x - values.X.T @ back
            return float(x @ line.beta + back @ line.residuals), float(
                v @ own - common @ back + a @ line.covariance @ a
            )

        values, v, source = self.values, self.v, self.found_from or self
        (mean, variance), spread = of(values, v), 0.0
        free = np.flatnonzero(v > NOTHING * source.scale)
        if len(free):
            ways = NUDGE * np.diag(v)[free]
            slopes = [(of(values, v + way)[1] - of(values, v - way)[1]) / (2 * way.sum()) for way in ways]
            inner = np.linalg.pinv(source.curvature[np.ix_(free, free)], hermitian=True)
            spread = float(np.array(slopes) @ inner @ slopes)
        if np.isfinite(known):
            more, less = (of(replace(values, W=(1 + side * NUDGE) * values.W), v)[1] for side in (1, -1))
            spread += 2 * ((more - less) / (2 * NUDGE)) ** 2 / known
        return mean, variance, min(2 * variance**2 / spread, most) if spread > 0 else most

    @property
    def scale(self) -> float:
        """The size that variances are compared with: that of the values about the plain line."""
        left = self.values.y - self.values.X @ np.linalg.lstsq(self.values.X, self.values.y, rcond=None)[0]
        return float(left @ left / max(len(left) - self.values.X.shape[1], 1))


STARTS = (1.0, 0.1, 0.001)  # Parts of the values' scale about a plain line that each component starts from


def restricted(values: Values) -> Line:
    """The line whose variances maximise the restricted likelihood, the best of three starts."""
    scale = max(values.at(np.zeros(len(values.G))).scale, 1e-300)

    def cost(x: Array) -> tuple[float, Array]:
        line = values.at(scale * x)
        return line.cost, scale * line.slope

    ends = [
        minimize(
            cost,
            np.full(len(values.G), start),
            jac=True,
            method="L-BFGS-B",
            bounds=[(0, None)] * len(values.G),
            options={"ftol": 1e-14, "gtol": 1e-9},
        )
        for start in STARTS
    ]
    best = min(ends, key=lambda end: float(end.fun))
    return values.at(scale * best.x)
