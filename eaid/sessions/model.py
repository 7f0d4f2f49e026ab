"""A number of a rig over its sessions, and what the next session may be.

With θ the number (T_s, a time constant, B) at a level of a session, x = ln(level/reference level) and W the variance
that the session's own fit leaves of ln θ,

    ln θ = X β + g + h x + d + ε,    g, h, d ~ N(0; σ_g², σ_h², σ_d²),    Var ε = W

g and h belong to the session, d to the session at that level. X is 1, x, x², or one term a level, between levels
straight in x. Variances by REML and the next value with its interval: `eaid.estimate.mixed`. Its degrees of freedom,
which Satterthwaite's formula overrates where S sessions are few, are S − 1 at most where nothing is known of a session,
and (S − 1)²/2.2 for each level of its reference steps where that is more; so the intervals hold
(`benchmarks/sessions.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from eaid.arrays import Array
from eaid.estimate.mixed import Further, MixedLine, MixedValues, restricted
from eaid.sessions.gather import MANY

EXACT = 1e-6  # Standard deviation of ln θ below which a value is known for certain
FARTHEST = 50.0  # Half-width of ln θ beyond which nothing is said
TOLD = 1.92  # In log L: more than chance gives one parameter in 19 of 20 cases
NEW = -1  # The session that is still to come


def between(knots: Array, level: Array) -> Array:
    """How a value at a level follows from those at rising knots, straight in ln level, (levels, knots)."""
    if len(knots) == 1:
        return np.ones((len(level), 1))
    x, at = np.log(level), np.log(knots)
    k = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
    share, rows = (x - at[k]) / (at[k + 1] - at[k]), np.zeros((len(x), len(at)))
    rows[np.arange(len(x)), k], rows[np.arange(len(x)), k + 1] = 1 - share, share
    return rows


@dataclass(frozen=True, eq=False)
class Known:
    """n values of ln θ with their own variance W: in which session, at which level."""

    session: Array
    level: Array
    y: Array
    W: Array


def steps_known(steps: Sequence[tuple[float, float, float]]) -> Known:
    """What the session to come has shown of itself: level, value, standard deviation of its logarithm."""
    level, value, sd_log = np.array(steps, dtype=np.float64).reshape(-1, 3).T
    return Known(np.full(len(level), NEW), level, np.log(value), np.maximum(sd_log, EXACT) ** 2)


NO_STEPS = steps_known([])


@dataclass(frozen=True, eq=False)
class Next:
    """The next session at some levels: ln θ (q,), its covariance (q, q), degrees of freedom (q,)."""

    level: Array
    mean: Array
    covariance: Array
    dof: Array

    @property
    def reach(self) -> Array:
        """Half-width of the 95 % intervals of ln θ, (q,)."""
        return np.minimum(stdtrit(self.dof, 0.975) * np.sqrt(np.diag(self.covariance)), FARTHEST)

    @property
    def value(self) -> Array:
        """θ, (q,)."""
        return np.asarray(np.exp(self.mean))

    @property
    def ends(self) -> Array:
        """Low and high ends of its 95 % intervals, (2, q)."""
        return np.exp([self.mean - self.reach, self.mean + self.reach])

    def of_a_run(self, W: float) -> tuple[float, float]:
        """Ends of the interval of a single run at the first level, whose ln θ scatters with the variance W."""
        reach = float(self.reach[0] * np.sqrt(1 + W / self.covariance[0, 0]))
        low, high = np.exp(self.mean[0] + reach * np.array([-1.0, 1.0])).tolist()
        return low, high


@dataclass(frozen=True, eq=False)
class Model:
    """The model of one number; `terms` of X, 0: one a level."""

    known: Known
    reference: float
    terms: int
    variances: Array  # Of gain, tilt and level; 0 of what the sessions cannot show

    @cached_property
    def knots(self) -> Array:
        """The levels, rising."""
        return np.unique(self.known.level)

    @cached_property
    def count(self) -> int:
        """Sessions."""
        return len(np.unique(self.known.session))

    @cached_property
    def free(self) -> NDArray[np.intp]:
        """Which components the sessions can show: gain; with several levels in a session tilt and level too."""
        several = len(np.unique(self.known.session + 1j * self.known.level)) > self.count
        return np.flatnonzero([True, several, several])

    def x(self, level: Array) -> Array:
        """ln(level/reference)."""
        return np.asarray(np.log(level / self.reference))

    def rows(self, level: Array) -> Array:
        """X of some levels, (n, p)."""
        if self.terms:
            return np.asarray(self.x(level)[:, None] ** np.arange(self.terms))
        return between(self.knots, level)

    def common(self, one: Known, other: Known) -> list[Array]:
        """What two sets of values have in common, by component, (n, m) each."""
        same = (one.session[:, None] == other.session).astype(float)
        tilt, level = np.outer(self.x(one.level), self.x(other.level)), one.level[:, None] == other.level
        return [same * (1.0, tilt, level)[k] for k in self.free]

    @cached_property
    def values(self) -> MixedValues:
        """Its values as the line through them takes them."""
        known = self.known
        return MixedValues(known.y, self.rows(known.level), np.diag(known.W), tuple(self.common(known, known)))

    @cached_property
    def line(self) -> MixedLine:
        """The line through all sessions."""
        return self.values.at(self.variances[self.free])

    @property
    def likeliest(self) -> MixedLine:
        """The same with the variances that its values make likeliest, looked for from its own."""
        near = self.variances[self.free]
        return restricted(self.values, np.maximum(near, 1e-3) if near.any() else None)

    def having(self, v: Array) -> "Model":
        """The model with these variances of what its sessions can show."""
        variances = np.zeros_like(self.variances)
        variances[self.free] = v
        return replace(self, variances=variances)

    def placed(self) -> "Model":
        """The model with the likeliest of its levels as reference, from its own neighbour by neighbour, where that is
        no chance: where sessions that lie high rise more steeply too, gain and tilt are apart only where they meet."""
        best, least, levels = self, self.line.cost, self.knots.tolist()
        at = levels.index(self.reference)
        for way in (levels[at + 1 :], levels[:at][::-1]):
            for level in way:
                one = replace(best, reference=level)
                line = one.likeliest
                if line.cost >= least:
                    break
                best, least = one.having(line.v), line.cost
        return best if self.line.cost - least > TOLD else self

    def further(self, level: Array) -> Further:
        """The next session at some levels, nothing known of it."""
        new = Known(np.full(len(level), NEW), level, np.zeros(len(level)), np.zeros(len(level)))
        of_line, own = np.stack(self.common(self.known, new)), np.stack(self.common(new, new))
        return self.line.further(self.rows(level), of_line, own)

    def next(self, level: Array, steps: Known = NO_STEPS) -> Next:
        """The next session at some levels, given its reference steps."""
        return self.given(level, steps, self.further(np.concatenate([level, steps.level])))

    def given(self, level: Array, steps: Known, both: Further) -> Next:
        """The same from `both`, the session at the levels and at those of the steps, nothing known: c being the share
        of what the steps show beyond their own means that goes on, its variance is that of (1, −c) and of the steps."""
        n, V = len(level), both.covariance
        c = np.linalg.solve(V[n:, n:] + np.diag(steps.W), V[n:, :n]).T if len(steps.y) else np.zeros((n, 0))
        turn = np.hstack([np.eye(n), -c])
        mean = both.mean[:n] + c @ (steps.y - both.mean[n:])
        whole = replace(both, covariance=V + np.diag(np.append(np.zeros(n), steps.W)))
        few = (self.count - 1.0) ** 2 / 2.2 * len(np.unique(steps.level))
        most = np.clip(few, self.count - 1.0, MANY)
        return Next(level, mean, turn @ whole.covariance @ turn.T, np.clip(whole.degrees(turn), 1.0, most))

    def narrowest(self, sd_log: float) -> tuple[Next, float, Next]:
        """The next session; the level of the reference step that is worth most, and the session after one: the least
        interval at the worst level. What the step shows does not matter for that."""
        n, every, tried = len(self.knots), self.further(self.knots), []
        for k, level in enumerate(self.knots.tolist()):
            at = np.append(np.arange(n), k)
            square = np.ix_(at, at)
            pair = replace(every, mean=every.mean[at], covariance=every.covariance[square],
                           slopes=every.slopes[:, at][:, :, at], measured=every.measured[square])  # fmt: skip
            tried.append((level, self.given(self.knots, steps_known([(level, 1.0, sd_log)]), pair)))
        return self.given(self.knots, NO_STEPS, every), *min(tried, key=lambda one: float(one[1].reach.max()))

    def gains(self) -> tuple[Array, Array, Array]:
        """By how much each session lies above the common line in the mean of its levels, ln θ, with the standard
        error of that: sessions, values, errors."""
        sessions, own = np.unique(self.known.session), np.maximum(self.known.W + self.variances[2], 1e-300)
        inside = (self.known.session == sessions[:, None]) / own
        whole = inside.sum(axis=1)
        return sessions, inside @ self.line.residuals / whole, 1 / np.sqrt(whole)

    def trend(self) -> tuple[float, float]:
        """Change of ln θ from one session to the next in their order, and the probability of such a one by chance."""
        sessions, gain, _ = self.gains()
        order = sessions - sessions.mean()
        slope = float(order @ gain / (order @ order))
        error = float(np.linalg.norm(gain - gain.mean() - slope * order) / np.sqrt((self.count - 2) * (order @ order)))
        return slope, two_sided(slope / error, self.count - 2) if error > EXACT else 1.0


def two_sided(t: float, dof: float) -> float:
    """Probability of a t at least so far from 0."""
    return float(2 * stdtr(dof, -abs(t)))
