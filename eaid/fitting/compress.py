"""Many samples → a few weighted points with the same sum of squared residuals, for curves that are smooth on a block.

Each level is cut into blocks that double in length. On a block, y is projected on polynomials that are orthonormal over
the block's own instants (three-term recurrence, Stieltjes); the Jacobi matrix of the recurrence gives Gauss nodes t_j
and weights w_j (Golub–Welsch). With ŷ_j the projection at the nodes,
Σ_k (y_k − f_k)² = [Σ y² − Σ w_j ŷ_j²] + Σ w_j (ŷ_j − f(t_j))²,
exact where f is a polynomial of degree < m on the block.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

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

    @cached_property
    def moments(self) -> Array:
        """1 and t at the points, (P, 2), where all levels share their times: sums with both are one product."""
        return np.stack([np.ones_like(self.t_s[0]), self.t_s[0]], axis=1)


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


@lru_cache(maxsize=32)
def _uniform(n: int, m: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of n equal steps, and the projection that gives ŷ at the nodes."""
    nodes, weights, projection = orthonormal(np.arange(n, dtype=np.float64), m)
    return nodes, weights, projection / np.sqrt(weights)


@lru_cache(maxsize=32)
def _layout(n: int, m: int) -> tuple[Array, Array, tuple[tuple[slice, Array], ...]]:
    """Nodes, in steps from the first sample, and weights of a uniform grid; each block's place and projection."""
    nodes, weights, parts = [np.arange(HEAD, dtype=np.float64)], [np.ones(HEAD)], []
    for start, stop in list(blocks(n))[1:]:
        at, w, projection = _uniform(stop - start, m)
        nodes.append(start + at)
        weights.append(w)
        parts.append((slice(start, stop), projection))
    return np.concatenate(nodes), np.concatenate(weights), tuple(parts)


def compress(
    times_s: Sequence[Array],
    outputs: Sequence[Array],
    together: Array | None = None,
    uniform: Sequence[bool] | None = None,
    m: int = POINTS_PER_BLOCK,
) -> Points:
    """Points of all levels; times and outputs of shape (n_l,) each, times rising, `uniform` where that is known.

    Levels on one grid share their nodes: `together` then holds the outputs as one array, (L, n).
    """
    known = [False] * len(times_s) if uniform is None else uniform
    if together is not None:
        t, y, w = _compress_grid(times_s[0], together, known[0], m)
        return Points(t[None], y, w[None])
    parts = [_compress_grid(t, y[None], k, m) for t, y, k in zip(times_s, outputs, known, strict=True)]
    longest = max(len(t) for t, _, _ in parts)

    def padded(values: Array) -> Array:
        return np.pad(values, (0, longest - len(values)), mode="edge")

    weights = [np.pad(w, (0, longest - len(w))) for _, _, w in parts]
    return Points(
        np.stack([padded(t) for t, _, _ in parts]), np.stack([padded(y[0]) for _, y, _ in parts]), np.stack(weights)
    )


def _compress_grid(t_s: Array, y: Array, uniform: bool, m: int) -> tuple[Array, Array, Array]:
    """Nodes (P,), outputs (L, P) and weights (P,) for L records on one grid."""
    n = len(t_s)
    if n <= SMALL:
        return t_s, y, np.ones(n)
    dt = (t_s[-1] - t_s[0]) / (n - 1)
    if uniform or np.abs(t_s - (t_s[0] + dt * np.arange(n))).max() <= 1e-6 * dt:
        at, weights, parts = _layout(n, m)
        values = [y[:, :HEAD], *(y[:, where] @ projection for where, projection in parts)]
        return t_s[0] + dt * at, np.concatenate(values, axis=1), weights
    nodes, values, each = [t_s[:HEAD]], [y[:, :HEAD]], [np.ones(HEAD)]
    for start, stop in list(blocks(n))[1:]:
        at, w, projection = orthonormal(t_s[start:stop], m)
        nodes.append(at)
        values.append(y[:, start:stop] @ projection / np.sqrt(w))
        each.append(w)
    return np.concatenate(nodes), np.concatenate(values, axis=1), np.concatenate(each)
