"""Many samples → a few weighted points with the same sum of squared residuals, for curves that are smooth on a block.

Each level is cut into blocks that double in length. On a block, y is projected on polynomials that are orthonormal over
the block's own instants (three-term recurrence, Stieltjes); the Jacobi matrix of the recurrence gives Gauss nodes t_j
and weights w_j (Golub–Welsch). With ŷ_j the projection at the nodes,
Σ_k (y_k − f_k)² = [Σ y² − Σ w_j ŷ_j²] + Σ w_j (ŷ_j − f(t_j))²,
exact where f is a polynomial of degree < m on the block.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

POINTS_PER_BLOCK = 8
HEAD = 16
"""First samples, kept as they are: the fast rise may be over within them. A block is never shorter."""
LONGEST_BLOCK = 16384
SMALL = 256
"""Records up to this length keep every sample: nothing would be gained."""


@dataclass(frozen=True, eq=False)
class Points:
    """Weighted points of L levels, padded to the longest with weight 0."""

    t_s: Array
    """Time since the step [s], shape (L, P), or (1, P) where all levels share it."""
    y: Array
    """Output, shape (L, P)."""
    w: Array
    """Weight: how many samples a point stands for, shape (L, P) or (1, P)."""

    def rows(self, which: "slice | NDArray[np.intp]") -> "Points":
        """The points of some levels."""
        t, w = self.t_s, self.w
        return Points(t if len(t) == 1 else t[which], self.y[which], w if len(w) == 1 else w[which])

    @cached_property
    def root_w(self) -> Array:
        """√w, shape of `w`: what residuals and slopes are multiplied by."""
        return np.sqrt(self.w)

    @cached_property
    def root_y(self) -> Array:
        """√w y, (L, P)."""
        return self.root_w * self.y


def blocks(n: int) -> Iterator[tuple[int, int]]:
    """Start and stop of each block of a record of n samples: 16, 16, 32, 64 … 16384, then equal ones."""
    start, length = 0, HEAD
    while start < n:
        stop = min(start + length, n)
        if n - stop < HEAD:
            stop = n
        yield start, stop
        if start > 0:
            length = min(2 * length, LONGEST_BLOCK)
        start = stop


def orthonormal(x: Array, m: int) -> tuple[Array, Array, Array]:
    """Gauss nodes (m,), weights (m,) and the whitened projection (n, m) for the instants `x`, shape (n,), n > m.

    The projection U maps samples to √w_j ŷ_j = Σ_k y_k U_kj.
    """
    centre, half = 0.5 * (x[0] + x[-1]), 0.5 * (x[-1] - x[0])
    s = (x - centre) / half
    basis = np.empty((m, len(x)))
    alpha, beta = np.zeros(m), np.zeros(m)
    basis[0] = 1 / np.sqrt(len(x))
    for k in range(m):
        alpha[k] = basis[k] @ (s * basis[k])
        if k + 1 == m:
            break
        following = (s - alpha[k]) * basis[k] - (beta[k] * basis[k - 1] if k else 0.0)
        following -= (basis[: k + 1] @ following) @ basis[: k + 1]  # rounding would pile up in the recurrence alone
        beta[k + 1] = np.sqrt(following @ following)
        basis[k + 1] = following / beta[k + 1]
    jacobi = np.diag(alpha) + np.diag(beta[1:], 1) + np.diag(beta[1:], -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    vectors = vectors * np.sign(vectors[0])
    return centre + half * nodes, len(x) * vectors[0] ** 2, np.ascontiguousarray(basis.T @ vectors)


@dataclass(frozen=True, eq=False)
class _Layout:
    """How a grid is compressed: nodes, their weights (P,), and the blocks with the projections that give ŷ."""

    nodes: Array
    weights: Array
    blocks: tuple[tuple[slice, Array], ...]

    def outputs(self, y: Array) -> Array:
        """ŷ at the nodes for L records, (L, P)."""
        return np.concatenate([y[:, :HEAD], *(y[:, where] @ projection for where, projection in self.blocks)], axis=1)


def _layout(t: Array, of_block: Callable[[Array], tuple[Array, Array, Array]]) -> _Layout:
    nodes, weights, parts = [t[:HEAD]], [np.ones(HEAD)], []
    for start, stop in list(blocks(len(t)))[1:]:
        at, w, projection = of_block(t[start:stop])
        nodes.append(at)
        weights.append(w)
        parts.append((slice(start, stop), projection))
    return _Layout(np.concatenate(nodes), np.concatenate(weights), tuple(parts))


def _of_block(t: Array) -> tuple[Array, Array, Array]:
    """Nodes and weights of a block, and the projection that gives ŷ at the nodes."""
    nodes, weights, projection = orthonormal(t, POINTS_PER_BLOCK)
    return nodes, weights, projection / np.sqrt(weights)


@lru_cache(maxsize=32)
def _steps(n: int) -> tuple[Array, Array, Array]:
    """The same for n equal steps from 0."""
    return _of_block(np.arange(n, dtype=np.float64))


@lru_cache(maxsize=32)
def _even(n: int) -> _Layout:
    """The layout of n equal steps from 0."""

    def of_block(t: Array) -> tuple[Array, Array, Array]:
        nodes, weights, projection = _steps(len(t))
        return t[0] + nodes, weights, projection

    return _layout(np.arange(n, dtype=np.float64), of_block)


def compress(
    times_s: Sequence[Array],
    outputs: Sequence[Array],
    together: Array | None = None,
    uniform: Sequence[bool] | None = None,
) -> Points:
    """Points of all levels; times and outputs of shape (n_l,) each, times rising, `uniform` where that is known.

    Levels on one grid share their nodes: `together` then holds the outputs as one array, (L, n).
    """
    known = [False] * len(times_s) if uniform is None else uniform
    if together is not None:
        t, y, w = _compress_grid(times_s[0], together, known[0])
        return Points(t[None], y, w[None])
    parts = [_compress_grid(t, y[None], k) for t, y, k in zip(times_s, outputs, known, strict=True)]
    longest = max(len(t) for t, _, _ in parts)

    def padded(values: Array) -> Array:
        return np.pad(values, (0, longest - len(values)), mode="edge")

    weights = [np.pad(w, (0, longest - len(w))) for _, _, w in parts]
    return Points(
        np.stack([padded(t) for t, _, _ in parts]), np.stack([padded(y[0]) for _, y, _ in parts]), np.stack(weights)
    )


def _compress_grid(t_s: Array, y: Array, uniform: bool) -> tuple[Array, Array, Array]:
    """Nodes (P,), outputs (L, P) and weights (P,) for L records on one grid."""
    n = len(t_s)
    if n <= SMALL:
        return t_s, y, np.ones(n)
    dt = (t_s[-1] - t_s[0]) / (n - 1)
    if uniform or np.abs(t_s - (t_s[0] + dt * np.arange(n))).max() <= 1e-6 * dt:
        layout = _even(n)
        return t_s[0] + dt * layout.nodes, layout.outputs(y), layout.weights
    layout = _layout(t_s, _of_block)
    return layout.nodes, layout.outputs(y), layout.weights
