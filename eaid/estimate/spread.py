"""Intervals from whole runs (cluster sandwich): how far each run moves an estimate, and how sure any number of it is.

Near its minimum an estimate answers to run r of level l by ψ_lr = H⁻¹ s_lr, with H the curvature of half the cost and
s_lr the run's score, centred within the level. A number with the gradient g then has the variance
V = Σ_l R/(R − 1) Σ_r (g'ψ_lr)², and by Satterthwaite V²/Σ_l(V_l²/(R − 1)) degrees of freedom. Where repeats were
recorded as sweeps, the excess of the variance between sweeps, R/(R − 1) Σ_r (Σ_l g'ψ_lr)², is added, with R − 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.estimate.points import compress
from eaid.steps.stepset import Level

Counts: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Influence:
    """How n numbers answer to the runs that they were estimated from."""

    runs: Array
    """ψ of the N runs of levels with repeats, level after level, (N, n); those of a level sum to 0."""
    repeats: Counts
    """Runs of each such level."""
    singles: Array
    """Independent parts of what levels of a single run contribute, (parts, n)."""
    single_degrees: float
    """Degrees of freedom of those."""
    swept: bool = False
    """Whether run r of every level was one sweep."""

    def of(self, rows: Array) -> "Influence":
        """The same for other numbers, whose gradients are `rows`, shape (m, n)."""
        return replace(self, runs=self.runs @ rows.T, singles=self.singles @ rows.T)

    def variance(self) -> tuple[Array, Array]:
        """Variance of each number and its degrees of freedom, (n,) each."""
        parts, degrees = [self._by_level()], [self.repeats[:, None] - 1.0]
        if len(self.singles):
            parts.append((self.singles**2).sum(axis=0, keepdims=True))
            degrees.append(np.array([[self.single_degrees]]))
        if self.swept:
            excess = (self._sweeps() ** 2).sum(axis=0) - np.concatenate(parts).sum(axis=0)
            parts.append(np.maximum(excess, 0.0)[None])
            degrees.append(np.array([[self.repeats[0] - 1.0]]))
        part, nu = np.concatenate(parts), np.concatenate(degrees)
        total = part.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = total**2 / (part**2 / nu).sum(axis=0)
        return total, np.where(total > 0, found, nu.sum())

    def covariance(self) -> Array:
        """Covariance of the numbers, (n, n)."""
        root = self.runs * np.sqrt(self._factor())[:, None]
        V = root.T @ root + self.singles.T @ self.singles
        if self.swept:
            sweeps = self._sweeps()
            scale = np.sqrt(np.maximum(np.diag(V), 1e-300))
            size, ways = np.linalg.eigh((sweeps.T @ sweeps - V) / np.outer(scale, scale))
            V = V + (ways * np.maximum(size, 0.0)) @ ways.T * np.outer(scale, scale)
        return np.asarray(V)

    def _factor(self) -> Array:
        """R/(R − 1) of each run, (N,)."""
        return np.repeat(self.repeats / (self.repeats - 1.0), self.repeats)

    def _by_level(self) -> Array:
        """R/(R − 1) Σ_r ψ² of each level, (L, n)."""
        first = np.cumsum(self.repeats) - self.repeats
        squares = self.runs**2 * self._factor()[:, None]
        return np.add.reduceat(squares, first, axis=0) if len(first) else np.zeros((0, squares.shape[1]))

    def _sweeps(self) -> Array:
        """√(R/(R − 1)) Σ_l ψ_lr of each sweep, (R, n)."""
        together = self.runs.reshape(len(self.repeats), -1, self.runs.shape[1]).sum(axis=0)
        return np.asarray(np.sqrt(len(together) / (len(together) - 1)) * together)


def influence_of(
    weighed: Array,
    ways: Array,
    take: Array,
    runs: "Runs",
    held: Array,
    singles: Array,
    single_degrees: float,
    swept: bool,
) -> tuple[Influence, Array]:
    """How n unknowns answer to the runs of L levels, and the inverse of half the cost's curvature, (n, n).

    `ways` are the slopes of each level's curve by k numbers at its points, (L, k, P), `weighed` the same times the
    points' weights, `take` how these go with the unknowns, (L, k, n). `held` are rows of active constraints, (m, n);
    `singles` scores of the independent parts of levels of a single run, (parts, n).
    """
    curvature = np.einsum("lin,lij,ljm->nm", take, weighed @ ways.transpose(0, 2, 1), take, optimize=True)
    unseen = np.flatnonzero(np.diag(curvature) == 0)
    curvature[unseen, unseen] = 1.0
    back = free_inverse(curvature, held)
    along = (weighed[runs.level] @ runs.off[:, :, None])[:, :, 0] / np.repeat(runs.repeats, runs.repeats)[:, None]
    scores = np.einsum("nk,nkm->nm", along, take[runs.level])
    return Influence(scores @ back, runs.repeats, singles @ back, single_degrees, swept), back


@dataclass(frozen=True, eq=False)
class Runs:
    """The compressed runs of levels with repeats, less the mean of their level."""

    off: Array
    """(N, P)."""
    level: Counts
    """Index of the level of each, (N,)."""
    repeats: Counts
    """Runs of each level with repeats."""

    @classmethod
    def of(cls, levels: Sequence[Level], width: int) -> "Runs":
        """The runs of some levels, on points padded to `width`."""
        rows, index, repeats = [np.zeros((0, width))], [], []
        for i, level in enumerate(levels):
            if len(level.runs) > 1:
                y = compress([level.time_s] * len(level.runs), list(level.runs)).y
                rows.append(np.pad(y - np.sort(y, axis=0).mean(axis=0), ((0, 0), (0, width - y.shape[1]))))
                index += [i] * len(y)
                repeats.append(len(y))
        return cls(np.concatenate(rows), np.array(index, dtype=np.int64), np.array(repeats, dtype=np.int64))


def corrected(own: Array, back: Array, score: Array) -> Array:
    """The score of a cluster without its own say in the estimate, (I − own back)⁻¹ score (CR3), (n,)."""
    return np.asarray(np.linalg.lstsq(np.eye(len(own)) - own @ back, score, rcond=1e-9)[0])


def free_inverse(curvature: Array, held: Array) -> Array:
    """Inverse of a curvature in the directions that no row of `held` blocks, in scaled form, (n, n)."""
    scale = 1 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    ways = np.diag(scale)
    if len(held):
        _, size, right = np.linalg.svd(held * scale)
        ways = ways @ right[int((size > 1e-9 * size[0]).sum()) :].T
    inner = ways.T @ curvature @ ways
    return np.asarray(ways @ np.linalg.pinv(inner, rcond=1e-13, hermitian=True) @ ways.T)
