"""The ten coefficients together: how the levels' scatter moves the joint fit of Eqs. (4)–(7).

Near the fit the coefficients answer to a shift of the levels' logarithms as δc = M⁻¹ Σ_l w_l D_l' A_l δθ_l, with
D_l = ∂log θ_l/∂c, A_l = J_l'J_l at the model's own curves, M = Σ_l w_l D_l' A_l D_l. With S_l the covariance of δθ_l
they have the covariance M⁻¹ (Σ_l w_l² D_l' A_l S_l A_l D_l) M⁻¹. Active constraints take their directions out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array, inverse
from eaid.fitting.basis import limits
from eaid.fitting.data import Data
from eaid.models import friction, nonlinear
from eaid.models.parameters import Nonlinear
from eaid.results.fit import Disagreement
from eaid.steps.stepset import Level
from eaid.uncertainty.curve import powers
from eaid.uncertainty.level_statistics import CURVES, log_jacobian
from eaid.uncertainty.runs import Degrees, t_quantile, textbook

ACTIVE = 1e-7
"""A constraint counts as active within this part of its own terms."""
BLOCKS = ("tau1", "tau2", "Ts")
"""Order of the coefficients in every covariance; C last where it was free."""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of (u/100)^k in the order of `BLOCKS`, C last where free, with their covariance."""

    values: Array
    covariance: Array
    counts: tuple[int, int, int]
    u_range: tuple[float, float]
    share: float
    share_free: bool
    constrained: tuple[str, ...]
    """Parameters that an active constraint holds at some duty: not estimable."""
    open: tuple[str, ...] = ()
    """Parameters whose curve too few levels support: no interval."""
    draws: Array | None = None
    """The coefficients of every refit of a bootstrap, shape (draws, P)."""

    def block(self, name: str) -> slice:
        """Where the coefficients of τ1, τ2 or T_s stand."""
        k = BLOCKS.index(name)
        start = sum(self.counts[:k])
        return slice(start, start + self.counts[k])

    def at(self, name: str, duty_pct: Array) -> Array:
        """τ1, τ2 [s] or T_s [N·m] at duties, shape (n,)."""
        own = self.block(name)
        return powers(duty_pct, self.counts[BLOCKS.index(name)]) @ self.values[own]

    def log_sd(self, name: str, duty_pct: Array) -> Array:
        """Standard deviation of the logarithm of τ1, τ2 or T_s at duties, of the refits where there are any; (n,)."""
        own = self.block(name)
        if self.draws is not None:
            curves = powers(duty_pct, self.counts[BLOCKS.index(name)]) @ self.draws[:, own].T
            return spread_of(np.log(np.maximum(curves, 1e-12)), axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            g = powers(duty_pct, self.counts[BLOCKS.index(name)]) / self.at(name, duty_pct)[:, None]
            return np.asarray(np.sqrt(np.maximum(((g @ self.covariance[own, own]) * g).sum(axis=1), 0)))

    def torque_sd(self, time_s: Array, duty_pct: float) -> Array:
        """Standard deviation of the torque curve at one duty [N·m], shape of `time_s`."""
        jacobian = log_jacobian(nonlinear.at_duty(self.plant(), duty_pct), time_s, self.share_free)
        g = jacobian @ chain(self, duty_pct)
        return np.asarray(np.sqrt(np.maximum(((g @ self.covariance) * g).sum(axis=1), 0)))

    def plant(self) -> Nonlinear:
        """The model in powers of the duty itself."""
        parts = [self.values[self.block(name)] / 100.0 ** np.arange(self.counts[k]) for k, name in enumerate(BLOCKS)]
        tau1, tau2, steady = (tuple(part.tolist()) for part in parts)
        return Nonlinear(tau1, tau2, steady, self.u_range, self.share)


def coefficients_of(p: Nonlinear, share_free: bool = False) -> Coefficients:
    """The coefficients of a model, with no covariance yet (zeros)."""
    counts = (len(p.tau1), len(p.tau2), len(p.Ts))
    values = np.concatenate([np.array(c) * 100.0 ** np.arange(len(c)) for c in (p.tau1, p.tau2, p.Ts)])
    if share_free:
        values = np.append(values, p.C)
    constrained = tuple(dict.fromkeys(_active(values, counts, p.u_range, share_free)[0]))
    return Coefficients(values, np.zeros((len(values),) * 2), counts, p.u_range, p.C, share_free, constrained)


def limits_of(
    counts: tuple[int, int, int], u_range: tuple[float, float], free_share: bool = False
) -> tuple[Array, Array]:
    """A and b of A c ≥ b for the coefficients of (u/100)^k, C last where free; 101 rows a parameter, then C's two."""
    duty, stops = np.linspace(*u_range, nonlinear.CHECKED_DUTIES), np.cumsum(counts)
    rows = np.zeros((3, len(duty), stops[-1] + free_share))
    for row, count, stop in zip(rows, counts, stops, strict=True):
        row[:, stop - count : stop] = powers(duty, count)
    tau1, tau2, Ts = rows
    return limits(Ts, tau1, tau2, free_share=free_share)


def _active(
    values: Array, counts: tuple[int, int, int], u_range: tuple[float, float], free_share: bool
) -> tuple[list[str], Array]:
    """The curves that active constraints hold, one a row, and their rows."""
    A, b = limits_of(counts, u_range, free_share)
    names = np.repeat(BLOCKS, nonlinear.CHECKED_DUTIES)
    A, b = A[: len(names)], b[: len(names)]
    held = A @ values - b <= ACTIVE * (np.abs(A) @ np.abs(values) + b)
    return names[held].tolist(), A[held]


def chain(c: Coefficients, duty_pct: float) -> Array:
    """D = ∂(log T_s, log τ1, log τ2[, logit C])/∂coefficients at one duty, shape (3 or 4, P)."""
    D = np.zeros((4 if c.share_free else 3, len(c.values)))
    duty = np.array([duty_pct])
    for row, name in enumerate(CURVES):
        own = c.block(name)
        D[row, own] = powers(duty, own.stop - own.start)[0] / max(float(c.at(name, duty)[0]), 1e-12)
    if c.share_free:
        D[3, -1] = 1 / max(c.share * (1 - c.share), 1e-12)
    return D


def with_joint_covariance(c: Coefficients, data: Data, shifts: Array) -> Coefficients:
    """The covariance of the joint fit, from S_l (`shifts`, shape (L, k, k)) of the levels' mean curves."""
    M = np.zeros((len(c.values),) * 2)
    middle = np.zeros_like(M)
    p = c.plant()
    points = data.points
    for i, (duty, shift) in enumerate(zip(data.u.tolist(), shifts, strict=True)):
        row = 0 if len(points.t_s) == 1 else i
        jacobian = log_jacobian(nonlinear.at_duty(p, duty), points.t_s[row], c.share_free)
        D = chain(c, duty)
        reach = D.T @ ((jacobian.T * points.w[row]) @ jacobian)
        M += reach @ D
        middle += reach @ shift @ reach.T
    bread = free_inverse(c, M, len(data.u))
    return with_covariance(c, bread @ middle @ bread)


def with_white_covariance(c: Coefficients, levels: Sequence[Level]) -> tuple[Coefficients, float]:
    """The textbook covariance s² (J'J)⁻¹ of the fit to the means, and its N − P degrees of freedom."""
    curves = [(nonlinear.at_duty(c.plant(), level.level), level) for level in levels]
    g = [log_jacobian(curve, level.time_s, c.share_free) @ chain(c, level.level) for curve, level in curves]
    left = [level.mean - friction.step_response(curve, level.time_s) for curve, level in curves]
    M, noise, spare = textbook(g, left, len(c.values))
    return with_covariance(c, free_inverse(c, M, len(levels)) * noise), spare


def with_covariance(c: Coefficients, covariance: Array) -> Coefficients:
    """The same coefficients with another covariance."""
    return replace(c, covariance=covariance, draws=None)


def with_draws(c: Coefficients, draws: Array) -> Coefficients:
    """The same coefficients with the spread of refits, shape (draws, P)."""
    size = spread_of(draws, axis=0)
    near = np.clip(draws, np.median(draws, axis=0) - 3 * size, np.median(draws, axis=0) + 3 * size)
    sd = near.std(axis=0)
    tame = np.cov(near, rowvar=False) * np.outer(size / np.where(sd > 0, sd, 1.0), size / np.where(sd > 0, sd, 1.0))
    return replace(with_covariance(c, tame), draws=draws)


def spread_of(values: Array, axis: int) -> Array:
    """Standard deviation from the middle 95 % of refits: some run away (a τ2 that a draw lost), and count by rank."""
    low, high = np.quantile(values, [0.025, 0.975], axis=axis)
    return np.asarray((high - low) / 3.92)


def free_inverse(c: Coefficients, M: Array, levels: int) -> Array:
    """Inverse of M in the directions that are free: no active constraint, no power beyond what the levels carry."""
    kept = np.concatenate([np.arange(count) < levels for count in c.counts] + [np.ones(int(c.share_free), dtype=bool)])
    scale = 1 / np.sqrt(np.maximum(np.diag(M), 1e-300))
    directions = np.diag(scale)[:, kept]
    rows = _active(c.values, c.counts, c.u_range, c.share_free)[1]
    if len(rows):
        _, size, right = np.linalg.svd(rows @ directions)
        rank = int((size > 1e-9 * size[0]).sum())
        directions = directions @ right[rank:].T
    inner = inverse(directions.T @ M @ directions, 1e-13)
    return np.asarray(directions @ inner @ directions.T)


def curves_apart(one: Coefficients, other: Coefficients, degrees: Degrees, duty_pct: Array) -> list[Disagreement]:
    """Parameters whose two curves part by more than the interval of the `other`; the worst level each."""
    found = []
    for name in CURVES:
        first, second = one.at(name, duty_pct), other.at(name, duty_pct)
        reach = t_quantile(np.asarray(degrees[name])) * other.log_sd(name, duty_pct)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(np.log(first / second)) / reach
        out = np.flatnonzero(~(ratio <= 1))
        if not len(out):
            continue
        i = int(out[np.nan_to_num(ratio[out], nan=np.inf).argmax()])
        held = name in other.constrained
        ends = None if held else (float(second[i] * np.exp(-reach[i])), float(second[i] * np.exp(min(reach[i], 138.0))))
        places = tuple(duty_pct[out].tolist())
        found.append(Disagreement(name, places, float(duty_pct[i]), float(first[i]), float(second[i]), ends))
    return found
