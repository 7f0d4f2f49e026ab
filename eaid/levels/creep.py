"""What steps from rest have besides the clutch's form and its C: another C, and an output that creeps at one rate.

    ȳ_l(t) = T_l φ(t; τ1(u_l), τ2(u_l), C) + r (t + t_l),   t_l from the middle of the rests that its runs are counted
                                                            from to the step

Both bend every curve, another C by a part of its T_s, a creep by as much at each level, so that levels tell them apart;
records of one level do not. The fit goes along by Gauss–Newton steps in r, T_s of each level, τ1(u), τ2(u) and C solved
for anew; how the runs scatter says how sure C and r are, where each level has a single run how the levels do (as
clusters). A creep has to be that of the idle time, too, as far as this shows it: what does not idle so is a slow part
of the response.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array, lowest_places, median
from eaid.estimate.data import Data, data_of
from eaid.estimate.scatter import scatter_about
from eaid.estimate.spread import Influence, free_inverse, t_quantile
from eaid.levels.certainty import Estimate
from eaid.levels.from_steps import fit_levels_first
from eaid.plant.steps import step_slopes
from eaid.results.models import ShareEstimate
from eaid.shapes.shape import is_coloured
from eaid.steps.noise import resolution
from eaid.steps.stepset import Creep, Level, StepSet

SHARE_CHANCE = 1e-3  # That noise alone rejects the C that was held, or makes a creep
SURE_SHARE = 0.05  # Half-width of C up to which it takes the place of that
LEAST_CREEP_PCT = 1.0  # Of the least level that a creep makes by the end of a hold
APART = 4.0  # Standard errors by which it may differ from that of the idle time
FEWEST_IDLE = 4  # Runs whose idle time is known
FEWEST_CREEP_SINGLES = 8  # Levels of a single run that tell a creep beside two curves of three coefficients
GROWTH = (0.002, 0.005, 0.01, 0.02, 0.04)  # Of the highest output in a hold, that a creep may make: where it is begun
BEST = 2  # Places from which it is solved
RATE_ROUNDS, SETTLED = 20, 1e-2  # Steps in r, and the part of its standard error at which they end


@dataclass(frozen=True)
class Told:
    """A number that the runs tell, its standard error, and the degrees of freedom of that."""

    value: float
    error: float
    degrees: float

    def differs(self, held: float) -> bool:
        """Whether noise alone makes it differ so much from another as rarely as `SHARE_CHANCE`."""
        return self.degrees > 0 and abs(self.value - held) > t_quantile(self.degrees, 1 - SHARE_CHANCE) * self.error

    @property
    def half(self) -> float:
        """Half-width of its 95 % interval."""
        return float(t_quantile(self.degrees) * self.error)


def find_share_and_creep(stepset: StepSet, share: ShareEstimate, held: float) -> tuple[bool, Creep | None]:
    """Whether the runs have a C of their own, and the creep of their output; `share` is what they ask for where nothing
    creeps, with `held` in its place."""
    levels = stepset.levels
    single, free = all(len(level.runs) == 1 for level in levels), False
    if len(levels) >= (FEWEST_CREEP_SINGLES if single else 2):
        idle = np.array([run.idle_slope for run in stepset.runs if run.idle_slope is not None and not run.left_out])
        middles = [stepset.middles_s(level) for level in levels]
        t0 = np.array([one.mean() for one in middles])
        at_idle = float(idle.mean()) if len(idle) else 0.0
        if not single:
            C, rate, _ = _share_and_rate(stepset, t0, None, at_idle)
            free = C.differs(held)
        if not free:
            C, rate, cost = _share_and_rate(stepset, t0, held, at_idle)
        if _creeps(rate, levels, idle) and (free or cost < _cost_of_share(levels, held)):
            told = free and share_is_told(C.value - C.half, C.value + C.half)
            of_levels = {level.level: float(one) for level, one in zip(levels, t0, strict=True)}
            return told, Creep(rate.value, rate.error, rate.half, median(np.concatenate(middles)), of_levels)
    told = bool(share.matters and share.ci95 is not None and share_is_told(*share.ci95))
    if told and single and len(levels) < FEWEST_CREEP_SINGLES:  # noise that lasts bends them as another C does
        data = data_of(levels)
        rows = zip(levels, fit_levels_first(data, None).residuals(data), strict=True)
        told = not any(is_coloured(left) and left.std() > resolution(level.mean) / 2 for level, left in rows)
    return told, None


def share_is_told(low: float, high: float) -> bool:
    """Whether an interval of C tells it."""
    return 0 < low < high < 1 and high - low < 2 * SURE_SHARE


def _creeps(rate: Told, levels: Sequence[Level], idle: Array) -> bool:
    """Whether there is a creep that matters, and the idle time does not deny it."""
    least = min(float(np.abs(level.mean).max()) for level in levels)
    longest_s = max(float(level.time_s[-1]) for level in levels)
    if len(idle) < FEWEST_IDLE or not rate.differs(0.0) or abs(rate.value) * longest_s < LEAST_CREEP_PCT / 100 * least:
        return False
    apart = float(np.hypot(rate.error, idle.std(ddof=1) / np.sqrt(len(idle))))
    return abs(rate.value - float(idle.mean())) <= APART * apart


def _cost_of_share(levels: Sequence[Level], held: float) -> float:
    """What another C leaves where nothing creeps: where the runs do not tell both, that of the two which leaves less is
    taken."""
    data = data_of(levels)
    return float(fit_levels_first(data, held).steps.weight @ fit_levels_first(data, None).at.cost)


def _share_and_rate(stepset: StepSet, t0: Array, share: float | None, idle: float) -> tuple[Told, Told, float]:
    """C, free or held, the rate of a creep that all runs share, from the best of some rates, that of the idle time
    among them: the slow parts of low levels imitate one; and what these leave."""
    data = data_of(stepset.levels)
    first = fit_levels_first(data, share)
    weight = first.steps.weight
    per_hold = float(np.abs(data.points.y).max()) / data.longest_s
    tried = sorted({0.0, idle, *(side * part * per_hold for part in GROWTH for side in (-1, 1))})
    ends = [fit_levels_first(data_of(stepset.without_creep(rate, 0.0).levels), share, [first.x]) for rate in tried]
    costs = np.array([float(weight @ one.at.cost) for one in ends])
    found = [_solve_near(stepset, t0, tried[k], ends[k].x, share) for k in lowest_places(costs)[:BEST]]
    rate, near, (errors, degrees) = min(found, key=lambda one: float(weight @ one[1].solved.at.cost))
    of_C, of_rate = zip(errors.tolist(), degrees.tolist(), strict=True)
    C = Told(float(near.solved.x[-1]), *of_C) if share is None else Told(share, 0.0, of_C[1])
    return C, Told(rate, *of_rate), float(weight @ near.solved.at.cost)


def _solve_near(
    stepset: StepSet, t0: Array, rate: float, x: Array, share: float | None
) -> tuple[float, Estimate, tuple[Array, Array]]:
    """The rate next to one, the estimate without it, and how sure C and the rate are."""
    for _ in range(RATE_ROUNDS):
        moved = data_of(stepset.without_creep(rate, 0.0).levels)
        near = Estimate(stepset.levels, fit_levels_first(moved, share, [x]))
        x, columns = near.solved.x, _creep_columns(near, t0)
        score, back = _sum_scores(near, moved, columns)
        step, known = float(back[-1] @ score.sum(axis=0)), _creep_errors(near, back, columns, score)
        if abs(step) <= SETTLED * known[0][-1]:
            break
        rate -= step
    return rate, near, known


def _creep_columns(near: Estimate, t0: Array) -> list[Array]:
    """How the curves go with T_s of each level over its size, with x and with the rate, (n_l, L + p + 1) each."""
    rows = zip(near.levels, near.scatter.curves, near.take, t0.tolist(), strict=True)
    return [
        np.column_stack([step_slopes(curve, level.time_s).T @ take, level.time_s + since])
        for level, curve, take, since in rows
    ]


def _sum_scores(near: Estimate, data: Data, columns: Sequence[Array]) -> tuple[Array, Array]:
    """w J'(f − ȳ) of all unknowns level by level, the rate last, and the inverse of Σ w J'J where no constraint holds
    them."""
    residuals, weight = near.solved.residuals(data), near.solved.steps.weight
    score = np.array([w * (J.T @ r) for J, r, w in zip(columns, residuals, weight, strict=True)])
    curvature = sum(w * (J.T @ J) for J, w in zip(columns, weight, strict=True))
    held = np.pad(near.blocked, ((0, 0), (0, 1)))
    return score, free_inverse(np.asarray(curvature), held)


def _creep_errors(near: Estimate, back: Array, columns: Sequence[Array], score: Array) -> tuple[Array, Array]:
    """Standard errors of C and of the rate, and their degrees of freedom, (2,) each: by how the levels' own estimates
    scatter, a creep of each among them; of levels of a single run by how far each of these pulls them."""
    asked, count = np.eye(len(back))[-2:], len(near.levels)
    if all(len(level.runs) == 1 for level in near.levels):
        shared = max(count - len(near.solved.x) - 1, 1)
        pulled = ((score @ back @ asked.T) ** 2).sum(axis=0) * count / shared
        return np.sqrt(pulled), np.full(2, float(shared))
    along, own = [], []
    rows = zip(near.levels, near.solved.at.theta[0], near.scatter.jacobians, columns, strict=True)
    for k, (level, Ts, by_logs, J) in enumerate(rows):
        own.append(np.hstack([by_logs, J[:, -1:] * Ts / level.time_s[-1]]))
        along.append(near.solved.steps.weight[k] * own[-1].T @ J)
    seen = scatter_about(near.levels, own)
    every = np.broadcast_to(seen.degrees / seen.degrees.sum(), seen.mixed.shape)  # one number of all levels
    seen = replace(seen, mixed=every)
    answers = Influence(np.array(along) @ back, seen, np.zeros((0, len(back))), 0.0)
    variance, degrees = answers.of(asked).variance()
    return np.sqrt(variance), degrees
