"""Engagements, stretches of a log under load between returns to rest: their gains, and fits beside these.

The runs of a clutch differ by some percent to ten, and so do the engagements of one log: with one T_s(u) for all, what
they differ by is fitted by falls, lags and polynomials. A gain g_e takes T_e G_e, G_e = (T_e'J)/(T_e'T_e), out of the
derivatives J of an engagement, T_e being the response there, and with that what tells T_s as a whole, or at its one
level: this is told by the gains themselves, Σ ω G_e'(g_e − 1) = 0, which count as rows do by ω, the variance of the
noise over theirs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from eaid.arrays import Array
from eaid.estimate.recorded_log import RecordedLog
from eaid.estimate.scatter import pace
from eaid.estimate.solver import draw_back_inside, newton_step
from eaid.estimate.spread import t_quantile
from eaid.findings import Finding, finding
from eaid.plant.drive import Drive
from eaid.recorded.from_logs import Setup, Solved, fit_setup, idle_found, setup_of


def engagement_starts(drive: Drive) -> NDArray[np.intp]:
    """At which of the rows that count each engagement begins, (M,): where the input leaves rest, the first at 0."""
    loaded, counted = (drive.duty != 0)[drive.which], drive.w > 0
    begins = np.flatnonzero(loaded[1:] & ~loaded[:-1]) + 1
    begins = begins if loaded[0] else begins[1:]  # a rest before the first is a part of it
    rows = np.cumsum(counted)[begins - 1] if not counted.all() else begins
    rows = np.unique(np.append(0, rows))
    return np.asarray(rows[rows < np.count_nonzero(counted)], dtype=np.intp)


def of_rows(values: NDArray[Any], starts: NDArray[np.intp], rows: int) -> NDArray[Any]:
    """At each of so many rows the value of its engagement, (N, …)."""
    return np.repeat(values, np.diff(np.append(starts, rows)), axis=0)


WINDOW_S = 2.0  # Stretch over which the density of the noise is taken [s] …
LOGS_S = (10.0, 600.0)  # … of logs of such lengths, of shorter and longer ones in proportion [s]
FEWEST_ENGAGEMENTS = 4  # Fewest engagements whose scatter counts
GAINS_CHANCE = 1e-3  # Gains that noise makes so different more rarely than this are told
# Part by which a log that is told lies off the others, by chance as rarely as this; how engagements scatter at least,
# and where too few tell it
LEAST_LOG_PART, LOG_CHANCE, LEAST_SCATTER, USUAL_GAIN_SD = 0.03, 0.01, 0.002, 0.02
# Scatter of gains from which it hides how the plant goes, and the least gain that an engagement is believed to have
HIDING_GAIN, SMALLEST_GAIN = 0.01, 0.2
GAIN_ROUNDS, GAINS_SETTLED = 30, 1e-7  # Newton steps beside gains, and the part of an unknown at which they end
GAIN_STEPS = (1.0, 0.5, 0.2, 0.05, 0.01)  # Lengths of one that are tried
GAIN_SEARCHES, NOT_LESS = 3, 0.98  # Searches for other starts, and the part of the squares that one has to go below
GAINS_SEEN, LAGS_SEEN = 2e-3, 0.1  # Gains, and τ1, that noise makes so different more rarely than this scatter
LEAST_LOAD = 0.02  # An engagement with less than this part of the mean ∫ T² tells no gain


@dataclass(frozen=True, eq=False)
class EngagementScatter:
    """Noise and scatter of a fit's residuals."""

    sensor_nm2_s: float
    ripple_s: float
    gain: float  # Standard deviation of the gain between engagements beyond what noise makes of it
    count: int
    spare: float  # Of the engagements, what the fit does not follow: the degrees of freedom of that scatter
    chance: float  # That noise alone makes gains so different
    tau1: float = 0.0  # Standard deviation of ln τ1 from engagement to engagement, beyond noise
    beside: bool = False  # Whether the gains were fitted beside the plant

    @property
    def findings(self) -> list[Finding]:
        """Whether the output differs between engagements, where there are enough to see it."""
        if self.count < FEWEST_ENGAGEMENTS:
            return [finding("engagements-few", "data", count=self.count)]
        if self.chance < GAINS_CHANCE and self.gain > 0:
            pct, tau1_pct = 100 * self.gain, 100 * self.tau1
            told = {"count": self.count, "scatter_pct": pct, "tau1_pct": tau1_pct, "beside": self.beside}
            return [finding("engagements-scatter", "data", (), **told)]
        return []


def gains_of_engagements(solved: Solved, k: int) -> tuple[Array, NDArray[np.intp], Array, Array, NDArray[np.bool_]]:
    """Of a log the model's output (N,); of its engagements the rows at which they begin, Σ T², by what part the model
    lies above the recorded output, and whether they are loaded enough to tell it."""
    r, starts = solved.missed[k], engagement_starts(solved.setup.drives[k])
    T = solved.outputs[k] - idle_found(solved, k) + r
    square = np.add.reduceat(T * T, starts)
    loaded = np.asarray(square > LEAST_LOAD * square.mean())
    gain = np.where(loaded, np.add.reduceat(T * r, starts) / np.maximum(square, 1e-300), 0.0)
    return T, starts, square, gain, loaded


@dataclass(frozen=True, eq=False)
class FreedLog:
    """One log with the gains of all engagements solved for: r moves the unknowns by −(Z'J)⁻¹ Z'r."""

    Z: Array  # (N, p)
    J: Array  # √w ∂f/∂x, (N, p)
    r: Array  # √w (f − y), (N,)
    left: Array  # The same with the gains
    by_gains: Array  # ω G_e of its loaded engagements, (M, p)


def without_gains(solved: Solved, logs: Sequence[RecordedLog]) -> list[RecordedLog]:
    """Logs as if all their engagements had one gain, where these scatter so much that they hide how the plant goes;
    empty where they do not."""
    seen, _ = scatter_of(solved, 1.0)
    if seen.count < FEWEST_ENGAGEMENTS or seen.chance > GAINS_CHANCE or seen.gain < HIDING_GAIN:
        return []
    found, each = [], [gains_of_engagements(solved, k) for k in range(len(logs))]
    mean = float(np.concatenate([1 - gain[loaded] for _, _, _, gain, loaded in each]).mean())
    for k, (log, (T, starts, _, gain, loaded)) in enumerate(zip(logs, each, strict=True)):
        known, idle = np.isfinite(log.output), idle_found(solved, k) + (log.baseline or 0.0)
        if known.sum() != len(T):
            return []
        own, output = np.where(loaded, (1 - gain) / mean, 1.0), log.output.copy()
        output[known] = idle + (output[known] - idle) / of_rows(np.maximum(own, SMALLEST_GAIN), starts, len(T))
        found.append(replace(log, output=output))
    return found


def fit_beside_gains(alike: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """The fit of logs whose engagements have gains of their own, from one to the logs without these, and what the logs
    as they are leave with all gains at their mean."""
    before = alike.fitted

    def of(with_outputs: Sequence[RecordedLog]) -> Setup:
        as_left, extras = before.falls_as_left, before.extras
        return setup_of(before.model, with_outputs, before.idle_free, before.dead_time_s, as_left, extras)

    recorded = of(logs)
    seen, _ = scatter_of(Solved(recorded, alike.x, alike.cost, alike.solver), 1.0)
    weight = gains_weight(alike, seen)
    x, cost = _solve_beside_gains(recorded, alike.x, weight)
    for _ in range(GAIN_SEARCHES):
        plain = of(without_gains(Solved(recorded, x, cost, alike.solver), logs) or logs)
        if before.model.kind != "parallel":
            break
        anew, size = fit_setup(replace(plain, extras=())).x, before.model.size  # as the first gains may lead astray
        anew = np.concatenate([anew[:size], x[size : before.shared], anew[size:]])
        other = _solve_beside_gains(recorded, anew, weight)
        if not other[1] < NOT_LESS * cost:
            break
        x, cost = other
    last = replace(alike, fitted=plain, x=x)
    return Solved(recorded, x, recorded.every.problem().value(x)[0], alike.solver, beside=last)


def gains_weight(alike: Solved, seen: EngagementScatter) -> float:
    """ω of gains that scatter so beside what a fit without them leaves."""
    return max(alike.cost, 1e-300) / sum(map(len, alike.outputs)) / max(seen.gain, LEAST_SCATTER) ** 2


def _solve_beside_gains(setup: Setup, x: Array, weight: float) -> tuple[Array, float]:
    """Where Newton steps with the gains solved for lead to from x, and the squares that are left there."""

    def squares(freed: Sequence[FreedLog]) -> float:
        return sum(float(one.left @ one.left) for one in freed)

    problem, freed = setup.problem(), free_gains(setup, x, weight)
    for _ in range(GAIN_ROUNDS):
        H, g, cost = np.zeros((setup.size, setup.size)), np.zeros(setup.size), squares(freed)
        for place, one in zip(setup.places, freed, strict=True):
            H[np.ix_(place.columns, place.columns)] += one.Z.T @ one.J
            g[place.columns] += one.Z.T @ one.r
        step, before = newton_step(problem, x, g, H).d, x
        for length in GAIN_STEPS:
            x = draw_back_inside(problem, before, before + length * step)
            freed = free_gains(setup, x, weight)
            if squares(freed) <= cost * (1 + GAINS_SETTLED):
                break
        if (np.abs(x - before) <= GAINS_SETTLED * np.abs(x)).all():
            break
    return x, squares(freed)


def free_gains(setup: Setup, x: Array, weight: float) -> list[FreedLog]:
    """The logs of a setup so, gains having the `weight` ω."""
    found = []
    for k, (drive, place) in enumerate(zip(setup.drives, setup.places, strict=True)):
        (J, r), known, idle = setup.jacobian(x, k), drive.w > 0, int(place.own[0])
        T = r + np.sqrt(drive.w[known]) * (drive.y[known] - (x[idle] if idle >= 0 else 0.0))
        starts = engagement_starts(drive)
        square = np.add.reduceat(T * T, starts)
        loaded = square > LEAST_LOAD * square.mean()
        share = T * of_rows(loaded / np.maximum(square, 1e-300), starts, len(T))
        of_gains = np.array([np.add.reduceat(share * column, starts) for column in J.T]).T  # G_e
        T = T * of_rows(loaded, starts, len(T))
        left = r - T * of_rows(np.add.reduceat(share * r, starts), starts, len(T))
        Z = J - (T - weight * share)[:, None] * of_rows(of_gains, starts, len(T))
        found.append(FreedLog(Z, J, r, left, weight * of_gains[loaded]))
    return found


def log_that_differs(solved: Solved, names: Sequence[str]) -> list[Finding]:
    """Said where the output of one log of several lies off the others' by more than engagements scatter within logs."""
    if len(names) < 2:
        return []
    gains = [gain[loaded] for _, _, _, gain, loaded in (gains_of_engagements(solved, k) for k in range(len(names)))]
    spare = sum(len(one) - 1 for one in gains)
    within = sum(float(((one - one.mean()) ** 2).sum()) for one in gains) / max(spare, 1)
    within = max(within, LEAST_SCATTER**2) if spare >= FEWEST_ENGAGEMENTS else USUAL_GAIN_SD**2
    means, counts = np.array([one.mean() for one in gains]), np.array([len(one) for one in gains])
    off = [mean - float(np.delete(means, k).mean()) for k, mean in enumerate(means)]
    errors = [np.sqrt(within * (1 / counts[k] + float((1 / np.delete(counts, k)).sum()) / (len(means) - 1) ** 2))
              for k in range(len(means))]  # fmt: skip
    k = int(np.argmax(np.abs(off)))
    limit = t_quantile(float(max(spare, FEWEST_ENGAGEMENTS)), 1 - LOG_CHANCE / len(means)) * errors[k]
    if abs(off[k]) <= max(limit, LEAST_LOG_PART):
        return []
    return [finding("log-differs", names[k], off_pct=-100 * float(off[k]))]


def scatter_of(solved: Solved, followed: float) -> tuple[EngagementScatter, Sequence[Array]]:
    """Gains of all engagements, and the noise about them, and the residuals of each log, model less recorded, without
    what the gains explain; the fit has `followed` so many of them."""
    gains, squares, fourths, cleaned, outputs, steps = [], [], [], [], [], []
    for k, drive in enumerate(solved.setup.drives):
        T, at, square, gain, loaded = gains_of_engagements(solved, k)
        r = solved.missed[k]
        steps.append(float(drive.dt_s.sum()) / len(r))
        gains.append(gain[loaded])
        squares.append(square[loaded] * steps[-1])
        fourths.append(np.add.reduceat(T**4, at)[loaded] * steps[-1])
        cleaned.append(r - of_rows(gain, at, len(r)) * T)
        outputs.append(T)
    gamma, T2, T4 = np.concatenate(gains), np.concatenate(squares), np.concatenate(fourths)
    if len(gamma) < FEWEST_ENGAGEMENTS:
        few = EngagementScatter(*densities(solved.missed, outputs, steps), 0.0, len(gamma), 1.0, 1.0)
        return few, solved.missed
    s0, s1 = densities(cleaned, outputs, steps)
    own = np.maximum((s0 * T2 + s1 * T4) / T2**2, 1e-300)
    mean = float((gamma / own).sum() / (1 / own).sum())
    spare = max(len(gamma) - max(followed, 1.0), 1.0)
    chance = float(chdtrc(spare, float(((gamma - mean) ** 2 / own).sum())))
    gain = max(float(((gamma - gamma.mean()) ** 2).sum()) / spare - float(own.mean()), 0.0) ** 0.5
    return EngagementScatter(s0, s1, gain, len(gamma), spare, chance), cleaned


def lag_scatter(
    solved: Solved, pull: Array, noise: EngagementScatter, of_gains: float | None = None
) -> tuple[float, Array]:
    """Standard deviation of ln τ1 from engagement to engagement beyond what noise makes of it, and what one of 1 in
    each does to the unknowns, (M, n), with the gains solved for where they have a weight; 0 where too few show it.

    With D = ∂f/∂ln τ1, freed of T, an engagement by itself moves ln τ1 by −D'r/D'D.
    """
    # few rows whose sums are those of all, where inputs are held
    held = all(one.log.stepwise for one in solved.fitted.copies)
    setup, part = solved.fitted if held else solved.setup, solved.setup.model.slices[1]
    S, moved, own, sizes = [], [], [], []
    for k, (drive, place) in enumerate(zip(setup.drives, setup.places, strict=True)):
        known, idle, first, count = drive.w > 0, int(place.own[0]), 0, len(place.columns)
        begins, root, one = engagement_starts(drive), np.sqrt(drive.w[known]), solved.setup.drives[k]
        which = of_rows(np.arange(len(begins)), begins, len(root))
        stands_for = (drive.w[known] / float(one.w.max()))[:, None]
        above = root * (drive.y[known] - (solved.x[idle] if idle >= 0 else 0.0))
        sums = np.zeros((int(which[-1]) + 1, 2 * count + 6))
        for piece in setup.derivatives(solved.x, k):
            here = slice(first, first + len(piece))
            J, r, T, first = piece[:, :-1], piece[:, -1:], (piece[:, -1] + above[here])[:, None], here.stop
            D = J[:, part] @ solved.x[part][:, None]
            starts = np.flatnonzero(np.diff(which[here], prepend=-1))
            noisy = (D * T) ** 2 / stands_for[here]
            products = np.hstack([J * D, J * T, D * D, D * T, T * T, D * r, T * r, noisy])
            sums[which[here][starts]] += np.add.reduceat(products, starts)
        sums = sums[sums[:, -4] > LEAST_LOAD * sums[:, -4].mean()]
        JD, JT, (DD, DT, TT, Dr, Tr, DDTT) = sums[:, :count], sums[:, count : 2 * count], sums[:, -6:].T
        alone = np.maximum(DD - DT**2 / TT, 1e-300)
        moved.append(-(Dr - DT * Tr / TT) / alone)
        dt_s = float(one.dt_s.sum()) / max(int(np.count_nonzero(one.w)), 1)
        own.append((noise.sensor_nm2_s * DD + noise.ripple_s * DDTT) / dt_s / alone**2)
        sizes.append(alone)
        S.append(np.zeros((len(DD), setup.size)))
        S[-1][:, place.columns] = JD
        if of_gains is not None:
            S[-1][:, place.columns] -= JT * (DT / TT * (1 - of_gains / TT))[:, None]
    d, of_noise, each, alone = np.concatenate(moved), np.concatenate(own), np.vstack(S), np.concatenate(sizes)
    if len(d) < FEWEST_ENGAGEMENTS or not np.isfinite(d).all():
        return 0.0, each
    followed = float((((each @ pull) * each).sum(axis=1) / alone).sum())
    spare, about = max(len(d) - max(followed, 1.0), 1.0), np.maximum(of_noise, 1e-300)
    chance = float(chdtrc(spare, float(((d - np.average(d, weights=1 / about)) ** 2 / about).sum())))
    square = float(((d - d.mean()) ** 2).sum()) / spare - float(of_noise.mean())
    return float(np.sqrt(max(square, 0.0))) * (chance <= LAGS_SEEN), each @ pull.T


def densities(residuals: Sequence[Array], outputs: list[Array], steps: list[float]) -> tuple[float, float]:
    """s0 and s1 of S = s0 + s1 T², from squared sums of the residuals over short stretches."""
    squares, powers = [], []
    for r, T, dt_s in zip(residuals, outputs, steps, strict=True):
        width = max(1, min(round(WINDOW_S * pace(dt_s * len(r), LOGS_S) / dt_s), len(r)))
        count = len(r) // width
        squares.append(np.mean(T[: count * width].reshape(count, width) ** 2, axis=1))
        powers.append(r[: count * width].reshape(count, width).sum(axis=1) ** 2 * dt_s / width)
    x, S = np.concatenate(squares), np.concatenate(powers)
    design = np.column_stack([np.ones_like(x), x])
    weight = 1 / np.maximum(S.mean() * (0.1 + x / max(x.mean(), 1e-300)), 1e-300)
    s0, s1 = np.linalg.lstsq(design * weight[:, None], S * weight, rcond=None)[0].tolist()
    if s1 < 0:
        return float(S.mean()), 0.0
    if s0 < 0:
        return 0.0, float((S * weight).sum() / max((x * weight).sum(), 1e-300))
    return s0, s1
