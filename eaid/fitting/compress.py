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
from numpy.typing import NDArray

from eaid.arrays import Array

POINTS_PER_BLOCK = 8
HEAD = 16
"""First samples, kept as they are: the fast rise may be over within them. A block is never shorter."""
PIECE = 64
"""Samples of a piece, see `_Layout`; blocks begin at 0, 16, 32 and then at whole pieces."""
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


@lru_cache(maxsize=32)
def _uniform(n: int) -> tuple[Array, Array, Array]:
    """Nodes and weights of n equal steps, and the projection that gives ŷ at the nodes."""
    nodes, weights, projection = orthonormal(np.arange(n, dtype=np.float64), POINTS_PER_BLOCK)
    return nodes, weights, projection / np.sqrt(weights)


@dataclass(frozen=True, eq=False)
class _Layout:
    """How a uniform grid is compressed: the nodes, their weights, and the blocks with their projections.

    Blocks from `PIECE` on go in two stages: whole pieces of `PIECE` samples to polynomials of the same degree, and
    those to the block's. It is the same projection, for a polynomial on a block is one on each piece; and its matrices
    stay in the cache, which the long ones would not.
    """

    nodes: Array
    """In steps from the first sample, (P,)."""
    weights: Array
    short: tuple[tuple[slice, Array], ...]
    """Samples and projection of the blocks before the pieces."""
    long: tuple[tuple[slice, Array], ...]
    """Pieces and projection of the blocks made of them."""
    rest: Array
    """Projection of what the pieces leave over at the end, added to the last block."""

    def outputs(self, y: Array, pieces: Array | None) -> Array:
        """ŷ at the nodes for L records, (L, P)."""
        values = [y[:, :HEAD], *(y[:, where] @ projection for where, projection in self.short)]
        if self.long:
            pieces = to_pieces(y) if pieces is None else pieces
            values += [pieces[:, where].reshape(len(y), -1) @ projection for where, projection in self.long]
            values[-1] = values[-1] + y[:, y.shape[1] - len(self.rest) :] @ self.rest
        return np.concatenate(values, axis=1)


@lru_cache(maxsize=1)
def _piece() -> Array:
    """Orthonormal polynomials on a piece, shape (PIECE, m)."""
    return orthonormal(np.arange(PIECE, dtype=np.float64), POINTS_PER_BLOCK)[2]


def piece_count(n: int) -> int:
    """Whole pieces of a record of n samples, the first left out."""
    return n // PIECE - 1


def to_pieces(y: Array, out: Array | None = None) -> Array:
    """Every whole piece but the first of records on a uniform grid as a polynomial, (L, pieces, m); y is (L, n)."""
    count = piece_count(y.shape[1])
    return np.matmul(y[:, PIECE : PIECE * (1 + count)].reshape(len(y), count, PIECE), _piece(), out=out)


@lru_cache(maxsize=32)
def _layout(n: int) -> _Layout:
    """The layout for n samples."""
    nodes, weights, short, long = [np.arange(HEAD, dtype=np.float64)], [np.ones(HEAD)], [], []
    pieces, rest = piece_count(n), np.empty((0, POINTS_PER_BLOCK))
    for start, stop in list(blocks(n))[1:]:
        at, w, projection = _uniform(stop - start)
        nodes.append(start + at)
        weights.append(w)
        if start < PIECE:
            short.append((slice(start, stop), projection))
            continue
        first, last = start // PIECE - 1, min(stop // PIECE - 1, pieces)
        inside = PIECE * (last - first)
        local = _piece().T @ projection[:inside].reshape(-1, PIECE, POINTS_PER_BLOCK)
        long.append((slice(first, last), local.reshape(-1, POINTS_PER_BLOCK)))
        rest = projection[inside:]
    return _Layout(np.concatenate(nodes), np.concatenate(weights), tuple(short), tuple(long), rest)


def compress(
    times_s: Sequence[Array],
    outputs: Sequence[Array],
    together: Array | None = None,
    uniform: Sequence[bool] | None = None,
    pieces: Array | None = None,
) -> Points:
    """Points of all levels; times and outputs of shape (n_l,) each, times rising, `uniform` where that is known.

    Levels on one grid share their nodes: `together` then holds the outputs as one array, (L, n), and `pieces` what
    `to_pieces` makes of them, where that is known.
    """
    known = [False] * len(times_s) if uniform is None else uniform
    if together is not None:
        t, y, w = _compress_grid(times_s[0], together, known[0], pieces)
        return Points(t[None], y, w[None])
    parts = [_compress_grid(t, y[None], k) for t, y, k in zip(times_s, outputs, known, strict=True)]
    longest = max(len(t) for t, _, _ in parts)

    def padded(values: Array) -> Array:
        return np.pad(values, (0, longest - len(values)), mode="edge")

    weights = [np.pad(w, (0, longest - len(w))) for _, _, w in parts]
    return Points(
        np.stack([padded(t) for t, _, _ in parts]), np.stack([padded(y[0]) for _, y, _ in parts]), np.stack(weights)
    )


def _compress_grid(t_s: Array, y: Array, uniform: bool, pieces: Array | None = None) -> tuple[Array, Array, Array]:
    """Nodes (P,), outputs (L, P) and weights (P,) for L records on one grid."""
    n = len(t_s)
    if n <= SMALL:
        return t_s, y, np.ones(n)
    dt = (t_s[-1] - t_s[0]) / (n - 1)
    if uniform or np.abs(t_s - (t_s[0] + dt * np.arange(n))).max() <= 1e-6 * dt:
        layout = _layout(n)
        return t_s[0] + dt * layout.nodes, layout.outputs(y, pieces), layout.weights
    nodes, values, each = [t_s[:HEAD]], [y[:, :HEAD]], [np.ones(HEAD)]
    for start, stop in list(blocks(n))[1:]:
        at, w, projection = orthonormal(t_s[start:stop], POINTS_PER_BLOCK)
        nodes.append(at)
        values.append(y[:, start:stop] @ projection / np.sqrt(w))
        each.append(w)
    return np.concatenate(nodes), np.concatenate(values, axis=1), np.concatenate(each)
