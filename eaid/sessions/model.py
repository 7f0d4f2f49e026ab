"""A number of a rig over its sessions, and what the next session may be.

With θ the number (T_s, a time constant, B) at a level of a session, x = ln(level/reference level) and W the variance
that the session's own fit leaves of ln θ,

    ln θ = X β + g + h x + d + ε,    g, h, d ~ N(0; σ_g², σ_h², σ_d²),    Var ε = W

g and h belong to the session, d to the session at that level. X is 1, x, x², or one term a level, between levels
straight in x. Variances by REML and the next value with its interval: `eaid.estimate.mixed`. Its degrees of freedom,
which Satterthwaite's formula overrates where S sessions are few, are S − 1 at most where nothing is known of a session,
and (S − 1)²/2.2 for each level of its reference steps where that is more; so the intervals hold
(`benchmarks/sessions.py`). Where levels and sessions are confounded, a step tells of no level that shares no session
with its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from eaid.arrays import Array, link
from eaid.estimate.mixed import Further, MixedLine, MixedValues, fit_restricted
from eaid.sessions.gather import EXACT, MANY

WIDEST_SAID = 50.0  # Half-width of ln θ beyond which nothing is said
TOLD = 1.92  # In log L: more than chance gives one parameter in 19 of 20 cases
NEW = -1  # The session that is still to come


def chance_beyond(t: float, dof: float) -> float:
    """Probability of a t at least so far from 0."""
    return float(2 * stdtr(dof, -abs(t)))


def between(knots: Array, level: Array) -> Array:
    """How a value at a level follows from those at rising knots, straight in ln level, (levels, knots)."""
    if len(knots) == 1:
        return np.ones((len(level), 1))
    x, at = np.log(level)[:, None], np.log(knots)
    k = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
    share, column = (x - at[k]) / (at[k + 1] - at[k]), np.arange(len(at))
    return np.where(column == k, 1 - share, np.where(column == k + 1, share, 0.0))


@dataclass(frozen=True, eq=False)
class KnownValues:
    """n values of ln θ with their own variance W: in which session, at which level."""

    session: Array
    level: Array
    y: Array
    W: Array


def as_known(rows: Iterable[tuple[float, float, float, float]]) -> KnownValues:
    """Rows of session, level, value and the standard deviation of its logarithm."""
    session, level, value, sd_log = np.array(list(rows), dtype=np.float64).reshape(-1, 4).T
    return KnownValues(session, level, np.log(value), np.maximum(sd_log, EXACT) ** 2)


def steps_known(steps: Iterable[tuple[float, float, float]]) -> KnownValues:
    """What the session to come has shown of itself: level, value, standard deviation of its logarithm."""
    return as_known((NEW, *step) for step in steps)


NO_STEPS = steps_known(())


@dataclass(frozen=True, eq=False)
class Next:
    """The next session at some levels: ln θ (q,), its covariance (q, q), degrees of freedom (q,)."""

    level: Array
    mean: Array
    covariance: Array
    dof: Array

    @property
    def value(self) -> Array:
        """θ, (q,)."""
        return np.asarray(np.exp(self.mean))

    @property
    def reach(self) -> Array:
        """Half-width of the 95 % intervals of ln θ, (q,)."""
        return np.minimum(stdtrit(self.dof, 0.975) * np.sqrt(np.diag(self.covariance)), WIDEST_SAID)

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
class SessionModel:
    """The model of one number; `terms` of X, 0: one a level."""

    known: KnownValues
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
    def parts(self) -> NDArray[np.intp]:
        """Which part each of the levels is of: levels of several parts share no session, be it by way of others."""
        of = self.known
        held = (self.knots[:, None] == of.level) @ (of.session[:, None] == np.unique(of.session)).astype(np.intp)
        return link(held @ held.T > 0)

    def part_at(self, level: Array) -> NDArray[np.intp]:
        """The part of some levels: that of the nearest."""
        return np.asarray(self.parts[np.abs(np.log(level)[:, None] - np.log(self.knots)).argmin(axis=1)])

    @cached_property
    def free(self) -> NDArray[np.intp]:
        """Which components the sessions can show: gain; with several levels in a session tilt and level too."""
        several = len(np.unique(self.known.session + 1j * self.known.level)) > self.count
        return np.arange(3 if several else 1)

    def rows(self, level: Array) -> Array:
        """X of some levels, (n, p)."""
        if self.terms:
            return np.asarray(np.log(level / self.reference)[:, None] ** np.arange(self.terms))
        return between(self.knots, level)

    def common(self, one: KnownValues, other: KnownValues) -> Array:
        """What two sets of values have in common, by component, (k, n, m)."""
        x, z = np.log(one.level / self.reference), np.log(other.level / self.reference)
        same = (one.session[:, None] == other.session) * 1.0
        parts = (same, same * np.outer(x, z), same * (one.level[:, None] == other.level))
        return np.stack([parts[k] for k in self.free])

    @cached_property
    def line(self) -> MixedLine:
        """The line through all sessions."""
        of = self.known
        values = MixedValues(of.y, self.rows(of.level), np.diag(of.W), tuple(self.common(of, of)))
        return values.at(self.variances[self.free])

    def likeliest(self) -> tuple["SessionModel", float]:
        """The same with the variances that its values make likeliest, looked for from its own; and −log L there."""
        near, variances = self.variances[self.free], np.zeros(3)
        found = fit_restricted(self.line.values, np.maximum(near, 1e-3) if near.any() else None)
        variances[self.free] = found.v
        return replace(self, variances=variances), found.cost

    def placed(self) -> "SessionModel":
        """The model with the likeliest of its levels as reference, from its own neighbour by neighbour, where that is
        no chance: where sessions that lie high rise more steeply too, gain and tilt are apart only where they meet."""
        best, least, levels = self, self.line.cost, self.knots.tolist()
        enough, at = least - TOLD, levels.index(self.reference)
        for way in (levels[at + 1 :], levels[:at][::-1]):
            for level in way:
                one, cost = replace(best, reference=level).likeliest()
                if cost >= least:
                    break
                best, least = one, cost
        return best if least < enough else self

    def next(self, level: Array, steps: KnownValues = NO_STEPS) -> Next:
        """The next session at some levels, given its reference steps: c being the share of what the steps show beyond
        their own means that goes on, its variance is that of (1, −c) times the session there and the steps."""
        return self._given(self._ahead(np.append(level, steps.level)), level, steps)

    def _ahead(self, level: Array) -> Further:
        """The next session at some levels, of which nothing is known."""
        new = KnownValues(np.full(len(level), NEW), level, 0 * level, 0 * level)
        return self.line.further(self.rows(level), self.common(self.known, new), self.common(new, new))

    def _given(self, both: Further, level: Array, steps: KnownValues) -> Next:
        """The same at the first of them, the others being the levels of its reference steps."""
        n, part = len(level), self.part_at(np.append(level, steps.level))
        V = both.covariance + np.diag(np.append(0 * level, steps.W))
        told = part[:, None] == part[n:]
        c = np.linalg.solve(V[n:, n:] * told[n:], (V[:n, n:] * told[:n]).T).T
        turn = np.hstack([np.eye(n), -c])
        once = np.unique(steps.level, return_index=True)[1]
        few = (self.count - 1.0) ** 2 / 2.2 * told[:n, once].sum(axis=1)
        dof = np.clip(replace(both, covariance=V).degrees(turn), 1.0, np.clip(few, self.count - 1.0, MANY))
        return Next(level, both.mean[:n] + c @ (steps.y - both.mean[n:]), turn @ V @ turn.T, dof)

    def worth_most(self, sd_log: float) -> tuple[float, Next]:
        """The level of the reference step that is worth most, and the session after it: the least interval at the
        worst level. What the step shows does not matter for that."""
        ahead, every = self._ahead(self.knots), np.arange(len(self.knots))
        rows = [(u, ahead.at(np.append(every, k)), steps_known([(u, 1.0, sd_log)])) for k, u in enumerate(self.knots)]
        tried = [(float(u), self._given(both, self.knots, step)) for u, both, step in rows]
        return min(tried, key=lambda one: float(one[1].reach.max()))

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
        return slope, chance_beyond(slope / error, self.count - 2) if error > EXACT else 1.0
