"""What the runs of one level say about its parameters: information, influence of each run, within-run variance.

With J = ∂f/∂log θ on the n samples of a level and A = J'J:

- influence of a run, how far it alone would move the fit:  d_r = A⁻¹ J' (y_r − ȳ);
- within-run variance of a single run:  h = mean over runs of diag(A⁻¹ Ω A⁻¹), Ω the Bartlett sum over J e_r, where
  e_r is the residual about the run's own fit; the largest over windows of 0.1, 0.3, 1 and 2 s.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, inverse

WINDOWS_S = (0.1, 0.3, 1.0, 2.0)
"""Bartlett windows [s]: from the friction ripple's memory to a third of a rotor turn."""

BINS_PER_WINDOW = 10
"""Scores are summed over a tenth of the shortest window before the Bartlett sum; no memory is that short."""


@dataclass(frozen=True, eq=False)
class RunStatistics:
    """One level's parameters in logs (k of them), and what its R runs say about them."""

    level: float
    log_theta: Array
    """Logarithms of the fitted parameters, shape (k,)."""
    information: Array
    """A = J'J of one run, shape (k, k) [output²]."""
    influence: Array
    """Shift that each run alone would give, shape (R, k); the rows sum to zero."""
    within: Array
    """Within-run variance h of a single run's parameters, shape (k,)."""
    duration_s: float
    """Length of the record after the step [s]."""

    @property
    def repeats(self) -> int:
        """R, the number of runs."""
        return len(self.influence)

    @property
    def inverse(self) -> Array:
        """A⁻¹, the covariance of the parameters under noise of variance 1 without memory, shape (k, k)."""
        return inverse(self.information)

    @property
    def scatter(self) -> Array:
        """v = Σ d²/(R − 1): variance between runs, shape (k,); NaN for a single run."""
        if self.repeats < 2:
            return np.full(len(self.log_theta), np.nan)
        return np.asarray(np.sort(self.influence**2, axis=0).sum(axis=0) / (self.repeats - 1))


def bartlett_variance(time_s: Array, scores: Array, windows_s: Sequence[float] = WINDOWS_S) -> Array:
    """Variance of the sum of correlated scores, by Bartlett windows; shape (windows, k) for scores (n, k).

    Σ_|j|<m (1 − |j|/m) Γ_j equals the mean square of all sums over m neighbours (zeros beyond the ends), so running
    sums give it in O(n). Windows longer than half the record are cut to it.
    """
    duration_s = float(time_s[-1] - time_s[0])
    bin_s = min(windows_s) / BINS_PER_WINDOW
    if duration_s > 4 * len(time_s) * bin_s:  # a slow clock, or one in another unit: no more bins than data
        bin_s = duration_s / len(time_s)
    bins = np.floor((time_s - time_s[0]) / bin_s + 1e-6).astype(np.int64)
    sums = np.zeros((scores.shape[1], int(bins[-1]) + 1))
    starts = np.flatnonzero(np.r_[True, bins[1:] != bins[:-1]])
    sums[:, bins[starts]] = np.add.reduceat(scores.T, starts, axis=1)
    running = np.cumsum(sums, axis=1)
    variances = []
    for window_s in windows_s:
        m = max(1, min(round(window_s / bin_s), round(duration_s / 2 / bin_s)))
        before = np.zeros((len(sums), m))
        padded = np.concatenate([before, running, np.repeat(running[:, -1:], m - 1, axis=1)], axis=1)
        moving = padded[:, m:] - padded[:, :-m]
        variances.append(np.einsum("ij,ij->i", moving, moving) / m)
    return np.array(variances)


def run_statistics(
    level: float,
    time_s: Array,
    runs_nm: Array,
    jacobian: Array,
    log_theta: Array,
    *,
    noise_nm: Array,
    mean_nm: Array,
    hessian: Array | None = None,
) -> RunStatistics:
    """The statistics of one level from its runs (R, n) and ∂f/∂log θ (n, k).

    `noise_nm`, shape (R, n), are the residuals of each run about its own best curve (`run_residuals`); `mean_nm` is the
    mean of the runs. A model that is wrong by design gives its full `hessian` Σ (J'J − e ∇²f), shape (k, k), in place
    of J'J.
    """
    information = jacobian.T @ jacobian if hessian is None else hessian
    directions = jacobian @ inverse(information)
    return RunStatistics(
        level=level,
        log_theta=log_theta,
        information=information,
        influence=(runs_nm - mean_nm) @ directions,
        within=within_variance(time_s, noise_nm, directions),
        duration_s=float(time_s[-1] - time_s[0]),
    )


def within_variance(time_s: Array, noise_nm: Array, directions: Array) -> Array:
    """h, shape (k,), from residuals (R, n) and how the parameters answer to the samples, J A⁻¹, shape (n, k)."""
    scores = (noise_nm[:, None] * np.ascontiguousarray(directions.T)).reshape(-1, len(time_s)).T
    variances = bartlett_variance(time_s, scores).reshape(len(WINDOWS_S), len(noise_nm), -1)
    # sorted: the order of the runs changes no rounding
    return np.asarray(np.sort(variances, axis=1).mean(axis=1).max(axis=0))


def textbook(jacobians: Sequence[Array], residuals: Sequence[Array], parameters: int) -> tuple[Array, float, float]:
    """Σ J'J, the noise's variance s² = Σ r'r/(N − P) as if every sample's error were its own, and N − P."""
    information = sum(J.T @ J for J in jacobians)
    spare = sum(map(len, residuals)) - parameters
    cost = sum(float(r @ r) for r in residuals)
    return np.asarray(information), cost / max(spare, 1), float(spare)


def run_residuals(runs_nm: Array, fitted_nm: Array, jacobian: Array) -> Array:
    """Residuals of each run about its own fit [output], one linear step from the level's fit, shape (R, n)."""
    left = runs_nm - fitted_nm
    basis, triangle = np.linalg.qr(jacobian)
    turn, size, _ = np.linalg.svd(triangle)
    basis = basis @ turn[:, size > 1e-10 * size[0]]  # where τ1 meets τ2 two columns are one, and the third is rounding
    return np.asarray(left - (left @ basis) @ basis.T)
