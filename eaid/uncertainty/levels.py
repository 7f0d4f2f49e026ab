"""The friction curve of each level, Eq. (3), in (log T_s, log τ1, log τ2), and what its runs say about it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, inverse, median
from eaid.fitting.levels import RECORDS_FREE
from eaid.fitting.starts import RECORDS
from eaid.models import friction
from eaid.models.parameters import TAU_FLOOR_S, Friction
from eaid.results.friction import FrictionLevel
from eaid.steps.stepset import Level
from eaid.uncertainty.run_statistics import RunStatistics, run_residuals, run_statistics
from eaid.uncertainty.scatter import Mask

NAMES = ("Ts", "tau1", "tau2", "C")
"""Parameters of one level, in the order of every array here; C only where it was free."""
CURVES = NAMES[:3]
"""Those that are curves over the duty."""
MEETING = 1e-4
"""A limit this close holds a parameter; τ1 and τ2 this close are one."""
UNDETERMINED = 3.0
"""Factor up or down beyond which a parameter counts as not determined."""


@dataclass(frozen=True, eq=False)
class LevelEstimate:
    """One level's friction curve with what its runs say about it."""

    curve: Friction
    runs: RunStatistics
    noise_nm: Array
    """Residuals of each run about its own best curve [output], shape (R, n)."""
    constrained: tuple[str, ...]
    """Parameters that a constraint holds: not estimable."""

    @property
    def level(self) -> float:
        """Input of the level."""
        return self.runs.level

    @property
    def share_free(self) -> bool:
        """Whether C is a parameter too."""
        return len(self.runs.log_theta) == 4

    @property
    def memory(self) -> float:
        """How many times larger than under white noise the within-run variance is, at most over the parameters."""
        white = np.diag(self.runs.inverse) * float(np.mean(self.noise_nm**2))
        return float(max(1.0, np.max(self.runs.within / np.maximum(white, 1e-300))))


def log_jacobian(curve: Friction, time_s: Array, share_free: bool = False) -> Array:
    """∂f/∂(log T_s, log τ1, log τ2[, logit C]), shape (n, 3 or 4), Eq. (3)."""
    scale = np.array([curve.Ts, curve.tau1, curve.tau2, curve.C * (1 - curve.C)])
    count = 4 if share_free else 3
    return np.asarray((friction.gradient(curve, time_s) * scale[:, None])[:count].T)


def log_theta(curve: Friction, share_free: bool = False) -> Array:
    """(log T_s, log τ1, log τ2[, logit C]); what is zero or at its edge is kept finite."""
    share = min(max(curve.C, 1e-12), 1 - 1e-12)
    values = np.log(np.maximum([curve.Ts, curve.tau1, curve.tau2, share / (1 - share)], 1e-300))
    return np.asarray(values[: 4 if share_free else 3])


def level_estimate(
    level: Level, curve: Friction, constrained: Sequence[str] = (), share_free: bool = False
) -> LevelEstimate:
    """What the runs of one level say about its friction curve."""
    jacobian = log_jacobian(curve, level.time_s, share_free)
    noise = run_residuals(level.runs, jacobian[:, 0], jacobian)  # ∂f/∂log T_s is f itself
    theta = log_theta(curve, share_free)
    found = run_statistics(level.level, level.time_s, level.runs, jacobian, theta, noise_nm=noise, mean_nm=level.mean)
    return LevelEstimate(curve, found, noise, tuple(constrained))


def constrained_parameters(fit: FrictionLevel, record_s: float, share_free: bool) -> tuple[str, ...]:
    """Which of T_s, τ1, τ2, C a constraint holds in this level's fit."""
    found: list[str] = []
    if fit.tau1 <= TAU_FLOOR_S * (1 + MEETING):
        found.append("tau1")
    if fit.tau2 >= (RECORDS_FREE if share_free else RECORDS) * record_s * (1 - MEETING):
        found.append("tau2")
    if fit.tau2 <= fit.tau1 * (1 + MEETING):
        found += ["tau1", "tau2"]
    if fit.Ts <= 0:
        found += ["Ts", "tau1", "tau2"]
    return tuple(dict.fromkeys(found))


def usable(levels: Sequence[LevelEstimate]) -> Mask:
    """Which parameters of which levels show the scatter: held by no constraint, and determined by their record."""
    rows = []
    for level in levels:
        names = NAMES[: len(level.runs.log_theta)]
        known = np.sqrt(level.runs.within / level.runs.repeats) < np.log(UNDETERMINED)
        rows.append(known & np.array([name not in level.constrained for name in names]))
    return np.array(rows)


def share_sensitivity(levels: Sequence[Level], found: Sequence[LevelEstimate]) -> dict[str, float]:
    """How far T_s, τ1, τ2 would move [%] if the held C were larger by 0.01; median over the levels, linear."""
    moves = []
    for level, one in zip(levels, found, strict=True):
        slopes = friction.gradient(one.curve, level.time_s)
        along = np.array([one.curve.Ts, one.curve.tau1, one.curve.tau2]) * (slopes[:3] @ slopes[3])
        moves.append(-inverse(one.runs.information[:3, :3]) @ along)
    return dict(zip(NAMES[:3], map(median, np.transpose(moves)), strict=True))
