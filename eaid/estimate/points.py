"""Many samples → a few weighted points with the same sum of squared residuals, for curves that are smooth on a block.

Each level is cut into blocks that double in length. On a block, y is projected on polynomials that are orthonormal over
the block's own instants (QR); how they go with the instant, a Jacobi matrix, gives Gauss nodes t_j and weights w_j
(Golub–Welsch). With ŷ_j the projection at the nodes,
Σ_k (y_k − f_k)² = [Σ y² − Σ w_j ŷ_j²] + Σ w_j (ŷ_j − f(t_j))²,
exact where f is a polynomial of degree < m on the block.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.plant.dynamics import Step
from eaid.plant.steps import decay, slope_shapes, slope_sizes, step_response

POINTS_PER_BLOCK = 8
SINGLE_ROWS = 16  # First samples, kept as they are: the fast rise may be over within them. A block is never shorter.
LONGEST_BLOCK = 16384
MANY_HOLDS = 64  # Holds of a record from which their last blocks have few different sizes: each has nodes of its own
FEW_SAMPLES = 256  # Records up to this length keep every sample: nothing would be gained


@dataclass(frozen=True, eq=False)
class Points:
    """Weighted points of L levels, padded to the longest with weight 0."""

    t_s: Array  # Time since the step [s], shape (L, P)
    y: Array  # Output, shape (L, P)
    w: Array  # Weight: how many samples a point stands for, shape (L, P)
    # Whether curves are compared about their means: an unknown constant is then taken out of each level
    centred: bool = False
    states: Array | None = None  # What the steps before have left of each state when these begin, shape (2, L)
    off: Array | None = None  # By how much independent errors move these, one standard deviation each, (parts, 2, L)

    def rows(self, which: slice | list[int]) -> "Points":
        """The points of some levels."""
        states = None if self.states is None else self.states[:, which]
        off = None if self.off is None else self.off[:, :, which]
        return Points(self.t_s[which], self.y[which], self.w[which], self.centred, states, off)

    def about_mean(self, values: Array) -> Array:
        """Values at the points, (L, …, P), less their weighted mean."""
        w = self.w if values.ndim == 2 else self.w[:, None]
        return np.asarray(values - (values * w).sum(axis=-1, keepdims=True) / w.sum(axis=-1, keepdims=True))

    def slopes(self, theta: Array) -> Array:
        """`slope_shapes` of curves at the points, and room for the residual, (L, 5, P)."""
        s = slope_shapes(theta, self.t_s)
        if self.centred:
            s[:, :4] = self.about_mean(s[:, :4])
        return s

    def sizes(self, theta: Array) -> Array:
        """`slope_sizes` of curves, behind what the steps before have left of each state, whose fall tells τ, too."""
        sizes = slope_sizes(theta)
        if self.states is not None:
            sizes[:, 1:3] += (self.states / theta[1:3] ** 2).T
        return sizes

    def step_slopes(self, theta: Array, i: int, t_s: Array) -> Array:
        """∂f/∂(T_s, τ1, τ2, C) of a level's curve, behind its tails, at instants, (4, n)."""
        return np.asarray(slope_shapes(theta[:, [i]], t_s[None])[0, :4] * self.sizes(theta)[i, :4, None])

    @property
    def of_falls(self) -> "Points":
        """The same turned over and about their means: a fall to an unknown rest goes as a rise from it."""
        return Points(self.t_s, -self.about_mean(self.y), self.w, True)


def gauss_nodes(x: Array) -> tuple[Array, Array, Array]:
    """Gauss nodes (m,), weights (m,), the projection (n, m) to ŷ_j, for the instants `x`, shape (n,), n > m."""
    centre, half = 0.5 * (x[0] + x[-1]), 0.5 * (x[-1] - x[0])
    s = (x - centre) / half
    basis = np.linalg.qr(legvander(s, POINTS_PER_BLOCK - 1))[0]
    nodes, vectors = np.linalg.eigh(basis.T @ (s[:, None] * basis))
    root = np.sqrt(len(x)) * vectors[0] * np.sign(basis[0, 0])  # √w but for its sign, which the projection has, too
    return centre + half * nodes, root**2, np.ascontiguousarray(basis @ vectors / root)


@lru_cache(maxsize=4096)
def block_sizes(n: int, longest: int = LONGEST_BLOCK, few: bool = False) -> NDArray[np.int64]:
    """How a record of n samples is cut: 16 single ones, then blocks of 16, 32, 64 … the longest, then equal ones; of
    `few` different sizes, the last are an eighth of a power of two so many times, and single ones."""
    sizes, length = [1] * min(n, SINGLE_ROWS), SINGLE_ROWS
    if n - SINGLE_ROWS < SINGLE_ROWS:
        sizes = [1] * n
    while (left := n - sum(sizes)) > 0:
        last = left - length < SINGLE_ROWS
        part = max(2 ** (left.bit_length() - 4), 1) if few and last else 1
        sizes += [left // part * part] if left >= SINGLE_ROWS else [1] * left
        sizes[-1] = sizes[-1] if last else length
        length = min(2 * length, longest)
    return np.array(sizes, dtype=np.int64)


@lru_cache(maxsize=256)  # the projections of long blocks take a megabyte each
def gauss(n: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of n equal steps, and the projection to ŷ."""
    return gauss_nodes(np.arange(float(n)))


def nodes_of(
    t_s: Array, y: Array, holds: NDArray[np.int64], even_s: float | None, known: NDArray[np.bool_] | None = None,
    longest: int = LONGEST_BLOCK,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Nodes, outputs and weights, (P,) each, for a record of n rows.

    `holds` are the rows at which an input begins to act, and n; `even_s` is the time from row to row where it is always
    the same. Rows that are not `known` have no weight, and blocks of which some are not stay as they are; the `longest`
    has so many rows.
    """
    sizes = [block_sizes(n, longest, len(holds) > MANY_HOLDS) for n in np.diff(holds).tolist()]
    size = np.concatenate(sizes)
    first, counted = np.cumsum(size) - size, np.ones(len(y))
    if known is not None and not known.all():
        alike = np.logical_and.reduceat(known, first) | ~np.logical_or.reduceat(known, first)
        size = np.concatenate([[n] if each else [1] * n for n, each in zip(size, alike, strict=True)])
        first, counted = np.cumsum(size) - size, known.astype(np.float64)
    raw = first[size == 1]
    at, outputs, weights = [t_s[raw]], [y[raw]], [counted[raw]]
    for n in np.unique(size[size > 1]).tolist():
        starts = first[size == n]
        if even_s is not None:
            nodes, w, projection = gauss(n)
            at.append((t_s[starts][:, None] + even_s * nodes).ravel())
            outputs.append((sliding_window_view(y, n)[starts] @ projection).ravel())
            weights.append(np.outer(counted[starts], w).ravel())
            continue
        for k in starts.tolist():
            nodes, w, projection = gauss_nodes(t_s[k : k + n])
            at.append(nodes)
            outputs.append(y[k : k + n] @ projection)
            weights.append(counted[k] * w)
    when = np.concatenate(at)
    order = np.argsort(when, kind="stable")
    return when[order], np.concatenate(outputs)[order], np.concatenate(weights)[order]


def compress(times_s: Sequence[Array], outputs: Sequence[Array]) -> Points:
    """Points of all levels; times and outputs of shape (n_l,) each, times rising."""
    parts = []
    for t_s, out in zip(times_s, outputs, strict=True):
        n = len(t_s)
        if n <= FEW_SAMPLES:
            parts.append((t_s, out, np.ones(n)))
            continue
        dt = (t_s[-1] - t_s[0]) / (n - 1)
        even = np.abs(t_s - (t_s[0] + dt * np.arange(n))).max() <= 1e-6 * dt
        parts.append(nodes_of(t_s, out, np.array([0, n]), dt if even else None))
    longest = max(len(t) for t, _, _ in parts)
    t, y = (np.stack([np.pad(one[k], (0, longest - len(one[k])), mode="edge") for one in parts]) for k in (0, 1))
    return Points(t, y, np.stack([np.pad(w, (0, longest - len(w))) for _, _, w in parts]))


class Normal(NamedTuple):
    """What L levels cost at θ = (T_s, τ1, τ2, C), and how that changes; residuals are f − y."""

    theta: Array  # (4, L)
    cost: Array  # Σ w r², (L,)
    score: Array  # Σ w r ∂f/∂θ, (L, 4)
    information: Array  # Σ w ∂f/∂θ ∂f/∂θ', (L, 4, 4)


def level_normal(theta: Array, points: Points, torques: Callable[[Array, Array], Array] | None = None) -> Normal:
    """Sums of the curves T_s φ of Eq. (3), behind Σ x e^(−t/τ) of steps that do not begin at rest; `torques` gives T_s
    from Σ w φ² and Σ w φ y where it is to be solved for."""
    s, y = points.slopes(theta), points.y
    if points.states is not None:
        y = y - (points.states[:, :, None] * decay(points.t_s, theta[1:3, :, None])).sum(axis=0)
    if torques is not None:
        weighed = s[:, 0] * points.w
        theta = np.array([torques((weighed * s[:, 0]).sum(axis=1), (weighed * y).sum(axis=1)), *theta[1:]])
    np.subtract(theta[0, :, None] * s[:, 0], y, out=s[:, 4])
    product = (s * points.w[:, None, :]) @ s.transpose(0, 2, 1)
    scale = points.sizes(theta)
    product *= scale[:, :, None] * scale[:, None, :]
    return Normal(theta, product[:, 4, 4], product[:, :4, 4], product[:, :4, :4])


def log_crossed(theta: Array, other: Array, points: Points, share_free: bool) -> Array:
    """Σ w s s' of each level, s the slopes of its curve θ by ln T_s, ln τ1, ln τ2, and a free logit C, and those of
    another curve by T_s, τ1, τ2, C, (L, k, 4)."""
    one, two = points.slopes(theta)[:, :4], points.slopes(other)[:, :4]
    product = (one * points.w[:, None, :]) @ two.transpose(0, 2, 1) * points.sizes(other)[:, None, :4]
    by_log = np.array([*theta[:3], theta[3] * (1 - theta[3])]).T * slope_sizes(theta)[:, :4]
    return np.asarray(by_log[:, :, None] * product)[:, : 4 if share_free else 3]


def crossed_with_tails(theta: Array, points: Points) -> Array:
    """Σ w ∂f/∂θ e^(−t/τ_i) of each level, by what the steps before have left of each state, (L, 4, 2)."""
    left = decay(points.t_s, theta[1:3, :, None]).transpose(1, 2, 0)
    return np.asarray((points.slopes(theta)[:, :4] * points.w[:, None, :]) @ left * points.sizes(theta)[:, :4, None])


@dataclass(frozen=True, eq=False)
class LevelRecord:
    """Every sample of one level."""

    t_s: Array
    y: Array


def level_residuals(theta: Array, records: Sequence[LevelRecord]) -> list[Array]:
    """f − y at every sample of each level, shapes (n_l,)."""
    curves = (Step(*one) for one in theta.T.tolist())
    return [step_response(curve, record.t_s) - record.y for curve, record in zip(curves, records, strict=True)]
