"""One C for all levels, asked from the shape of the runs: does the C that was held, the paper's 0.85, fit this rig?

Every run keeps its own θ = (log T_s, log τ1, log τ2); C is common to all. With f the curve of a run at C and its best
θ, and z = ∂f/∂C less what ∂f/∂θ can follow, the score of a run is s = z'(y − f), its weight w = 1/(residual variance of
its level), and Σ w s = 0 gives C. A run's influence is u = w s/Σ w z'z, its leverage h = w z'z/Σ w z'z, and C has the
variance Σ u²/(1 − h) with (Σ u²)²/Σ u⁴ − 1 degrees of freedom: whole runs are compared, whatever the noise's colour.

The noise in a run's own θ bends that estimate, by one standard error on the reference rig. The score of a level's mean
curve has a part 1/R of that, so R² s_mean − Σ s over R − 1 has none to first order (the panel jackknife).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from eaid.arrays import Array
from eaid.estimate.level_statistics import LevelStatistics, usable
from eaid.estimate.points import Points, compress
from eaid.estimate.runs import t_quantile
from eaid.findings import Finding, finding
from eaid.results.fit import ShareEstimate
from eaid.steps.stepset import Level

Counts: TypeAlias = NDArray[np.int64]

STEPS, WARM = 25, 3
"""Steps at most, and those in which each run finds its own curve at the C that was held."""
SETTLED = 1e-6
"""The estimate has settled where a step moves C by less."""
LEAST, MOST = 0.02, 0.99
"""Where C cannot be told, it runs out of here."""
VAGUE = 0.1
"""Half-width of C beyond which the runs say hardly anything of it."""
MATTERS = 0.25
"""Part of a half-width: a shift by so much takes 4 of the 95 % from an interval."""
TRIFLE = 0.0025
"""A difference in C that is never worth a word: 3 % in τ2 and 0.3 % in T_s on the reference plant."""
CHANCE = 0.01
"""Probability at which runs that are independent would be taken for levels or sweeps that differ in C."""


@dataclass(frozen=True, eq=False)
class Share:
    """What the runs say of C."""

    held: float
    estimate: float | None
    """None where no level determines its own curve, or the estimate runs away."""
    sd: float
    degrees: float
    levels: tuple[float, ...]
    """Levels that speak: those whose records determine T_s, τ1 and τ2."""
    differ: bool
    """Whether the levels ask for different C, beyond what their runs scatter."""
    slope: Array
    """Derivative of (log T_s, log τ1, log τ2) of the speaking levels by C, shape (levels, 3)."""
    half_width: Array
    """Half-widths of their logarithms' intervals at the held C, shape (levels, 3)."""

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of C, within 0 and 1."""
        if self.estimate is None:
            return None
        reach = t_quantile(self.degrees) * self.sd
        return max(0.0, self.estimate - reach), min(1.0, self.estimate + reach)

    @property
    def rejected(self) -> bool:
        """Whether the held C lies outside of the interval."""
        ends = self.interval
        return ends is not None and not ends[0] <= self.held <= ends[1]

    @property
    def matters(self) -> bool:
        """Whether it is rejected and moves some level's parameter by a good part of its interval."""
        if not self.rejected or self.estimate is None or abs(self.estimate - self.held) < TRIFLE:
            return False
        return bool((np.abs(self.slope * (self.estimate - self.held)) > MATTERS * self.half_width).any())

    @property
    def vague(self) -> bool:
        """Whether the runs say hardly anything of C."""
        ends = self.interval
        return ends is None or ends[1] - ends[0] > 2 * VAGUE


def share_of(stats: LevelStatistics) -> Share | None:
    """C as the runs ask for it, from the levels whose C was held; None where C was free."""
    if stats.share_free:
        return None
    held = stats.estimates[0].curve.C
    speak = np.flatnonzero(usable(stats.estimates).all(axis=1))
    levels = [stats.levels[i] for i in speak]
    places = tuple(level.level for level in levels)
    nothing = Share(held, None, np.inf, 0.0, places, False, *np.zeros((2, 0, 3)))
    repeats = np.array([len(level.runs) for level in levels], dtype=np.int64)
    if repeats.sum() < 3:
        return nothing
    points = _runs_and_means(levels)
    theta = np.array([stats.estimates[i].runs.log_theta for i in speak])
    theta = np.concatenate([np.repeat(theta, repeats, axis=0), theta])
    which = np.repeat(np.arange(len(levels)), repeats)
    share, settled, runs = held, False, len(which)
    weight = np.ones(len(levels))
    for i in range(STEPS):
        now = _scores(theta, share, points)
        if i <= WARM:  # then no more: weights that follow the estimate would side with the levels that it comes nearest
            weight = repeats / np.maximum(np.bincount(which, now.cost[:runs]), 1e-300)
        score, information = _corrected(now, weight, which, repeats)
        step = float(np.clip(score / information, -0.1, 0.1)) if i >= WARM else 0.0
        settled = i >= WARM and abs(step) < SETTLED
        if settled or not LEAST < share + step < MOST:
            break
        share += step
        theta = theta + np.clip(now.move - step * now.slope, -0.5, 0.5)
    if not settled:
        return nothing
    leverage = weight[which] * now.information[:runs] / information
    u = weight[which] * now.score[:runs] / information
    u = (u - leverage * u.sum()) / np.sqrt(np.maximum(1 - leverage, 1e-3))
    variance, degrees, differ = _variance(u, repeats)
    sd = float(np.sqrt(variance))
    half_width = (t_quantile(stats.degrees) * np.sqrt(stats.variance))[speak]
    return Share(held, share, sd, degrees, places, differ, -now.slope[runs:], half_width)


def _runs_and_means(levels: Sequence[Level]) -> Points:
    """All runs, one row each, and after them the mean of each level."""
    rows = [(level.time_s, run) for level in levels for run in level.runs]
    times, values = zip(*rows, *((level.time_s, level.mean) for level in levels), strict=True)
    alike = all(time_s is times[0] or np.array_equal(time_s, times[0]) for time_s in times)
    return compress(times, values, np.array(values) if alike else None)


@dataclass(frozen=True, eq=False)
class _Now:
    """Where all rows stand at one C."""

    cost: Array
    score: Array
    information: Array
    move: Array
    """Gauss–Newton step of log θ at this C, shape (rows, 3)."""
    slope: Array
    """−∂ log θ/∂C along the best curves, shape (rows, 3)."""


def _scores(theta: Array, share: float, points: Points) -> _Now:
    Ts, tau1, tau2 = np.exp(theta).T[:, :, None]
    a, b = points.t_s / tau1, points.t_s / tau2
    e1, e2 = np.exp(-a), np.exp(-b)
    J = np.stack([1 - share * e1 - (1 - share) * e2, -share * a * e1, (share - 1) * b * e2, e2 - e1], axis=1)
    J *= Ts[:, None]
    left = points.y - J[:, 0]
    wr = points.w * left
    H = (J * np.broadcast_to(points.w, left.shape)[:, None]) @ np.swapaxes(J, 1, 2)
    g = (J @ wr[:, :, None])[:, :, 0]
    scale = 1 / np.sqrt(np.maximum(np.einsum("nii->ni", H), 1e-300))
    # the residuals' own part of the second derivatives: without it τ2 of a noisy run swings about its best value
    bent = np.zeros((len(g), 3, 3))
    bent[:, 0] = bent[:, :, 0] = g[:, :3]
    bent[:, 1, 1] = ((a - 1) * J[:, 1] * wr).sum(axis=1)
    bent[:, 2, 2] = ((b - 1) * J[:, 2] * wr).sum(axis=1)
    H, g = H * scale[:, :, None] * scale[:, None], g * scale
    inner = H[:, :3, :3] + 1e-10 * np.eye(3)  # what is singular has no say
    exact = inner - bent * scale[:, :3, None] * scale[:, None, :3]
    exact = np.where((np.linalg.eigvalsh(exact)[:, 0] > 1e-4)[:, None, None], exact, inner)
    move = np.linalg.solve(exact, g[:, :3, None])[:, :, 0]
    slope = np.linalg.solve(inner, H[:, :3, 3:])[:, :, 0]
    score = (g[:, 3] - (slope * g[:, :3]).sum(axis=1)) / scale[:, 3]
    information = np.maximum(H[:, 3, 3] - (slope * H[:, :3, 3]).sum(axis=1), 0.0) / scale[:, 3] ** 2
    return _Now((wr * left).sum(axis=1), score, information, move * scale[:, :3], slope * scale[:, :3] / scale[:, 3:])


def _corrected(now: _Now, weight: Array, which: Counts, repeats: Counts) -> tuple[float, float]:
    """Σ w s without what the noise in the runs' own θ adds to it, and Σ w z'z."""
    runs = len(which)
    alone = np.bincount(which, now.score[:runs])
    corrected = (repeats**2 * now.score[runs:] - alone) / np.maximum(repeats - 1, 1)
    score = np.where(repeats > 1, corrected, alone)
    return float(weight @ score), float(weight @ np.bincount(which, now.information[:runs]))


def _variance(u: Array, repeats: Counts) -> tuple[float, float, bool]:
    """Variance and degrees of freedom of C from the runs' influences, and whether the levels differ in it.

    Where levels, or sweeps (the first run of every level, and so on), differ beyond chance, they are what is counted.
    """

    def spread(parts: Array) -> tuple[float, float]:
        square = parts**2
        total = float(square.sum())
        return total, max(total**2 / max(float((square**2).sum()), 1e-300) - 1, 1.0)

    variance, degrees = spread(u)
    if len(set(repeats.tolist())) > 1 or repeats[0] == 1 or variance == 0:
        return variance, degrees, False
    grid = u.reshape(len(repeats), -1)
    count, ways = grid.shape
    sweeps = spread(grid.sum(axis=0))[0] * ways / (ways - 1)
    if fdtrc(ways - 1, degrees, sweeps / variance) < CHANCE:
        return sweeps, float(ways - 1), False
    if count > 2:
        within = float(((grid - grid.mean(axis=1, keepdims=True)) ** 2).sum()) * ways / (ways - 1)
        between, spare = spread(grid.sum(axis=1))
        between *= count / (count - 1)
        if within > 0 and fdtrc(spare + 1, degrees, between / within) < CHANCE:
            return between, spare, True
    return variance, degrees, False


def share_findings(share: Share) -> list[Finding]:
    """What the runs say of the C that was held, where that matters."""
    ends = share.interval
    if ends is None or share.estimate is None:
        return [finding("runs-give-no-share", "friction", held=share.held)]
    if not (share.matters or share.vague):
        return []
    code = "runs-reject-the-share" if share.matters else "runs-leave-the-share-open"
    values = {"estimate": share.estimate, "low": ends[0], "high": ends[1], "differ": share.differ}
    return [finding(code, "friction", (), held=share.held, **values)]


def share_part(share: Share | None, stats: LevelStatistics, sensitivity: dict[str, float]) -> ShareEstimate:
    """`uncertainty.share` of a fit."""
    if share is None:
        return ShareEstimate(stats.estimates[0].curve.C, sensitivity)
    verdict = (share.rejected, share.matters, share.differ)
    return ShareEstimate(share.held, sensitivity, share.estimate, share.interval, share.degrees, *verdict)
